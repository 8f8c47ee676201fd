"""The estimators against the paper's rules written a second time (`examples/_paper_rules.py`).

That module was written from the paper alone. Here it reads the same records with the same choices,
so that the code alone differs.
"""

import runpy

import numpy as np
import pytest
from exact_crystal import CHAIN, LENGTH, record
from long_packing import thin_packing
from places import ROOT

import modal
from analysis.estimators.low_pass import CRYSTAL_STRETCH, STRETCH
from analysis.estimators.threshold_rule import THRESHOLDS, at_stretch, spectra, threshold_curves
from analysis.estimators.travel_time import travelled
from modal.motions import Pulse

RULES = runpy.run_path(str(ROOT / "examples/_paper_rules.py"))
HIGHEST_FREQUENCY = 0.5 * CHAIN.velocity / CHAIN.distance
"""Hz; above the band edge of the crystal, velocity / (pi distance)."""


def random_record():
    """Return the record of a linear wave in a thin random packing, and the packing's length."""
    packing = thin_packing(1)
    duration = 1.2 * packing.length / modal.elastic_moduli(packing).v_p
    motion = Pulse(amplitude=2.5e-9, frequency=1e5)
    return modal.propagate(packing, duration, motion=motion).signals, packing.length


@pytest.fixture(scope="module", params=["crystal", "random"])
def signals_of_kind(request):
    """Return a record, the length of its packing, and whether it is a crystal."""
    if request.param == "crystal":
        return record(1.2), LENGTH, True
    return (*random_record(), False)


def test_first_peaks_give_the_same_velocity(signals_of_kind):
    """Fit the same straight line to peaks of the same parabolas.

    Only which of two peaks counts as the first may differ, and does so at few spheres of a random
    packing.
    """
    signals, length, crystal = signals_of_kind
    ours, error = travelled(signals, np.array([0.0, length]))
    again = RULES["first_peaks_velocity"](
        signals.time, signals.chain_position, signals.chain_displacement, length
    )
    tolerance = 1e-6 * ours if crystal else error
    assert again == pytest.approx(ours, abs=tolerance)


def test_two_percent_rule_gives_the_same_frequency(signals_of_kind):
    """Read the threshold between the same two frequencies of the transform, a record's inverse."""
    signals, length, crystal = signals_of_kind
    stretch = CRYSTAL_STRETCH if crystal else STRETCH
    spectrum = spectra(signals.time, signals.chain_displacement, HIGHEST_FREQUENCY)
    curve = threshold_curves(*spectrum)[THRESHOLDS.index(0.02)]
    ours = at_stretch(signals.chain_position, curve, length, stretch).value
    again, _ = RULES["low_pass_frequency"](
        signals.time,
        signals.chain_position,
        signals.chain_displacement,
        length,
        np.multiply(stretch, length),
        passages=2.0,
    )
    assert again == pytest.approx(ours, abs=1 / signals.time[-1])


def test_frequency_of_known_spectra():
    """Find where spectra exp(-(pi f tau)^2) of Gaussian pulses fall to 2 %."""
    time = np.arange(0, 1e-3, 1e-6)
    width = 5e-5
    pulse = np.exp(-(((time - 4e-4) / width) ** 2))
    (frequency,) = RULES["low_pass_by_distance"](time, pulse[:, None], 0.02)
    expected = np.sqrt(-np.log(0.02)) / (np.pi * width)
    # Between two frequencies 1 kHz apart.
    assert frequency == pytest.approx(expected, abs=1e3)
