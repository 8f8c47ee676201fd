"""Exact waves of a known crystal, damaged, or recorded as they should not be.

Every deviation is the damage's: the right number within a stated bound, or none. The paper's rules
have no such guard: their limits are in docs/stability.md.
"""

from dataclasses import replace

import numpy as np
import pytest
from exact_crystal import CHAIN, LENGTH, moved, noisy, part_of_chain, record

from analysis.case import Case
from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.fits import power_law
from analysis.estimators.layer_lattice import LayerLattice, exact_twin, lattice_signals
from analysis.estimators.low_pass import Passband, at_stretch
from analysis.estimators.ridge import ridge
from analysis.estimators.travel_time import arrival_times, first_peak_times, travelled
from analysis.estimators.wavenumber import chain_wavenumber
from analysis.packing_data import PackingData
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.tools.errors import InputError
from modal.waves.motions import step
from modal.waves.signals import Signals, write_signals

FULL = record()
U = FULL.chain_displacement
RANDOM = np.random.default_rng(0)
LAYERS = np.arange(CHAIN.layers)


def off(signals: Signals) -> float:
    """The larger relative error of V_P and of the band edge by the damped transform."""
    found = chain_dispersion(signals)
    velocity = abs(found.velocity / CHAIN.velocity - 1)
    return max(velocity, abs(found.low_pass_frequency / CHAIN.low_pass_frequency - 1))


@pytest.mark.parametrize(
    ("damaged", "bound"),
    [
        # A place of rest that was misread: a static part, which the transform hardly sees.
        (moved(FULL, U + 1e-3 * U.max()), 3e-5),
        (moved(FULL, U + 1e-1 * U.max()), 3e-3),
        # One silent channel among two hundred weighs little.
        (moved(FULL, U * (LAYERS != 80)), 1e-3),
        # Half the record still has waves over a hundred layers.
        (record(0.5), 2e-3),
        (record(0.7), 2e-3),
    ],
)
def test_harmless_damage(damaged, bound):
    assert off(damaged) < bound


def missing(count: int) -> np.ndarray:
    inner = np.random.default_rng(count).permutation(LAYERS[1:-1])[:count]
    return np.delete(LAYERS, inner)


@pytest.mark.parametrize(
    ("damaged", "code"),
    [
        # Unnoticed they would shift V_P by 0.5 to 2 % and the band edge by up to 6 %.
        *((part_of_chain(FULL, missing(count)), "uneven_chain") for count in (1, 5, 20)),
        (part_of_chain(FULL, RANDOM.permutation(LAYERS)), "uneven_chain"),
        (part_of_chain(FULL, LAYERS[::-1]), "uneven_chain"),
        *(
            (moved(FULL, np.clip(U, -a * U.max(), a * U.max())), "clipped_record")
            for a in (0.3, 0.6, 0.9)
        ),
        (moved(FULL, 0 * U), "no_wave"),
        (part_of_chain(FULL, LAYERS[:8]), "short_chain"),
        (moved(FULL, U + 1e-9), "not_from_rest"),
    ],
)
def test_what_the_damped_transform_cannot_bear_it_refuses(damaged, code):
    with pytest.raises(InputError) as refused:
        chain_dispersion(damaged)
    assert refused.value.code == code


def test_first_peaks_bear_less_noise_than_the_damped_transform():
    """The paper's rules: 0.1 % of noise is harmless; at 2 % the 5 % arrival is lost altogether."""
    for share, bearable in ((1e-3, True), (2e-2, False)):
        damaged = noisy(FULL, share, np.random.default_rng(0))
        peak = travelled(damaged, (0.0, LENGTH))[0] / CHAIN.velocity - 1
        arrival = travelled(damaged, (0.0, LENGTH), arrival_times)[0] / CHAIN.velocity - 1
        assert abs(peak) < 0.015
        assert (abs(arrival) < 0.02) == bearable


def sent_by(motion) -> Signals:
    """The wave of any motion of the wall, whose amplitude has no sign."""
    wall = motion.displacement(FULL.time)
    return exact_twin(replace(FULL, source_displacement=wall, amplitude=motion.amplitude), CHAIN)


@pytest.mark.parametrize(
    "found",
    [
        record(0.5),
        record(0.3),
        noisy(record(0.5), 1e-6, RANDOM),
        replace(record(amplitude=-2.5e-9), amplitude=2.5e-9),
        sent_by(step(-1e-9, 1e-5)),
        noisy(FULL, 0.3, RANDOM),
        moved(FULL, U[:, ::-1]),
        moved(FULL, U + U[:, ::-1]),
    ],
    ids=["half", "third", "half noise", "reversed", "step down", "noise", "backward", "both ends"],
)
@pytest.mark.parametrize("rule", [first_peak_times, arrival_times])
def test_times_of_arrival_give_the_velocity_or_none(rule, found):
    """The known bias of both rules on this wave is 2 % at most."""
    value, error = travelled(found, (0.0, LENGTH), rule)
    assert np.isnan([value, error]).all() or value == pytest.approx(CHAIN.velocity, rel=0.025)


@pytest.mark.parametrize("order", [slice(None, None, -1), RANDOM.permutation(LAYERS)])
def test_the_order_of_the_chain_does_not_matter(order):
    turned = part_of_chain(FULL, order)
    slow, wanted = (longest_waves(coherent_wave(of, LENGTH)) for of in (turned, FULL))
    assert slow == pytest.approx(wanted, rel=1e-6)
    assert ridge(turned).edge_wavelength == pytest.approx(2 * CHAIN.distance, rel=1e-3)
    kappa = [chain_wavenumber(r, 2e4, LENGTH, velocity=CHAIN.velocity) for r in (turned, FULL)]
    assert kappa[0] == pytest.approx(kappa[1], rel=1e-6)


def test_nothing_has_no_ridge():
    assert np.isnan(ridge(moved(FULL, 0 * U)).edge_frequency)


def test_a_source_that_waits_leaves_the_low_pass_as_it_is():
    """The record is cut so many passages after the wave has set out, not after its first time."""
    network = fcc(cells=(1, 1, 200))
    lattice, quiet = LayerLattice.of_network(network), 250
    time = np.arange(0, 1.3 * network.length / lattice.velocity, 4e-7)
    plain = lattice_signals(lattice, time)
    rest = np.zeros((quiet, lattice.layers))
    waiting = replace(
        plain,
        time=4e-7 * np.arange(len(time) + quiet),
        chain_displacement=np.vstack([rest, plain.chain_displacement]),
        source_displacement=np.append(rest[:, 0], plain.source_displacement),
    )
    edges = [
        Passband(network, r, None, lattice.velocity, True).edges(r)[0].value
        for r in (plain, waiting)
    ]
    # The longer record's frequencies stand closer: 1 / 4 T between which the value is interpolated.
    assert edges[1] == pytest.approx(edges[0], rel=2e-3)


def test_few_particles_with_a_value_do_not_speak_for_a_stretch():
    distance, values = np.linspace(0, 1, 200), np.full(200, np.nan)
    values[[102, 107, 112, 117]] = 1.0
    found = at_stretch(distance, values, 1.0, (0.5, 0.6))
    (caveat,) = found.caveats
    assert np.isnan(found.value) and caveat.values == {"seen": 4, "particles": 20}


@pytest.mark.parametrize("y", [[0.0, 1.0, 2.0], [-1.0, 1.0, 2.0]])
def test_what_has_no_logarithm_has_no_power(y):
    assert np.isnan(power_law(np.array([1.0, 2.0, 3.0]), np.array(y)).exponent)


def test_a_chain_that_leaves_out_layers_is_refused(tmp_path):
    """It would end the crystal's band at 0.707 of its frequency, without a word."""
    network = fcc(cells=(1, 1, 120))
    whole = lattice_signals(LayerLattice.of_network(network), np.arange(0, 3e-4, 4e-7))
    write_network(tmp_path / "a.network.h5", network)
    write_signals(tmp_path / "a.signals.h5", part_of_chain(whole, slice(None, None, 2)))
    with pytest.raises(InputError) as refused:
        _ = PackingData.of(Case("a", tmp_path)).yade
    assert refused.value.code == "layers_skipped"
