"""Measure packings in other units of length, mass and time: all quantities scale with the units.

Each number is that of the first packing times its unit. Round-off, and iterations that end at a
tolerance, leave 1e-8 of it.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from changes import in_units
from packings import slender

import analysis
import modal
from analysis.estimators.coherent import Coherent, longest_waves
from analysis.packing_data import PackingData
from analysis.quantities import QUANTITIES
from analysis.quantities.amplitude import AMPLITUDE
from modal.packing import crystal as gallery
from modal.packing.sample import sample_of_network
from modal.waves.motions import Pulse

DIMENSIONS = {"m/s": (1, 0, -1), "Hz": (0, 0, -1), "1/m": (-1, 0, 0), "Pa": (-1, 1, -2)}
"""Powers of length, mass and time."""
PACKINGS = {
    "random": slender,
    "crystal": lambda: modal.fcc(cells=(1, 1, 40)),
    "periodic": lambda: modal.random_packing(110, seed=2, friction=0.6, aspect=1, periodic=True),
}
UNITS = [
    pytest.param((1e-6, 1e-9, 1e-3), id="2.5 nm under another stress"),
    pytest.param((1e-6, 1e-18, 1e-6), id="2.5 nm", marks=pytest.mark.slow),
    pytest.param((1e5, 1e15, 1e5), id="250 m", marks=pytest.mark.slow),
    pytest.param((1e-3, 1e6, 1.0), id="another stress", marks=pytest.mark.slow),
]
"""Units of length, mass and time. In the first none of m/s, Hz, 1/m, Pa, N and N/m stays what it
is; the slow ones show which of them a fault depends on: two keep the stress of glass spheres, with
the last stiffnesses grow by 1e6 and stresses by 1e9."""
ROUND_OFF = 1e-7
OF_POINTS = {"lambda_edge_linear_over_d": 1e-3}
"""At a crystal's band edge a wave turns forward and backward alike: round-off chooses which points
the edge is fitted to, where these lie off the curve by up to 3e-3 (`ROUGH` of the ridge)."""
NO_SCALE = ("residual", "stress_error")
"""Round-off of a crystal's balance, and the stress that a note names."""


def measured(network):
    """Return all quantities except those that depend on the amplitude."""
    packing = PackingData(replace(network, study={}))
    names = [name for name in QUANTITIES if name not in (*AMPLITUDE, *NO_SCALE)]
    return {name: QUANTITIES[name].measured(packing) for name in names}


@cache
def measured_in_si(kind):
    """Return the quantities of a packing in SI units."""
    return measured(PACKINGS[kind]())


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize(
    "kind", ["random", "crystal", pytest.param("periodic", marks=pytest.mark.slow)]
)
def test_every_quantity_scales_with_the_units_of_length_mass_and_time(kind, units):
    """Compare which are known, and values and errors to round-off."""
    in_si = measured_in_si(kind)
    converted = measured(in_units(PACKINGS[kind](), *units))
    assert sum(value.known for value in in_si.values()) > 25
    for name, value in in_si.items():
        unit = np.prod(np.power(units, DIMENSIONS.get(value.unit, (0, 0, 0))))
        largest = np.max(np.abs(np.nan_to_num(value.value)), initial=0.0) * unit
        allowed = OF_POINTS.get(name, ROUND_OFF) * largest
        for field in ("value", "error"):
            expected = np.asarray(getattr(value, field)) * unit
            number = getattr(converted[name], field)
            np.testing.assert_allclose(number, expected, rtol=0, atol=allowed, err_msg=name)


def test_waves_of_finite_amplitude_scale_with_the_spheres():
    """Push spheres of 2.5 nm by the same share of their overlap as spheres of 2.5 mm."""
    column = gallery.column(12)
    push = 0.01 * column.overlap[1]

    def quantities(network, amplitude):
        sample = sample_of_network(network, 0.3)
        packing = PackingData(network, sample=sample, amplitudes=[amplitude])
        return [float(QUANTITIES[name].measured(packing).value[0]) for name in AMPLITUDE]

    expected = quantities(column, push)
    small = quantities(in_units(column, 1e-6, 1e-18, 1e-6), 1e-6 * push)
    assert small == pytest.approx(expected, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("amplitude", [1e-60, 1e60])
def test_a_linear_wave_does_not_depend_on_the_size_of_its_pulse(amplitude):
    crystal = modal.fcc(cells=(1, 1, 40))
    names = ["v_p", "low_pass", "attenuation", "v_p_first_peaks"]
    frequency = PackingData(crystal).pulse.frequency
    expected = analysis.measure(crystal, source=Pulse(1e-9, frequency), quantities=names)
    values = analysis.measure(crystal, source=Pulse(amplitude, frequency), quantities=names)
    for name in names:
        np.testing.assert_allclose(
            values[name].value, expected[name].value, rtol=1e-6, err_msg=name
        )


@pytest.mark.parametrize("highest", [1e-3, 1e5, 1e11])
def test_the_limit_of_long_waves_is_that_of_the_dispersion(highest):
    """Extrapolate the slowness of kappa = omega / V (1 + b f^2) to 1 / V at zero."""
    frequency = np.linspace(highest / 120, highest, 120)
    velocity = 500.0
    slowness = (1 + 0.2 * (frequency / highest) ** 2) / velocity
    wave = Coherent(frequency, 2 * np.pi * frequency * slowness, 0 * frequency, highest / 10)
    measured_velocity, error = longest_waves(wave)
    assert measured_velocity == pytest.approx(velocity, rel=1e-12)
    assert error < 1e-9 * velocity
