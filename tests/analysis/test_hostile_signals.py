"""Exact waves of a known crystal, recorded as they should not be: the right number, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.case import Case
from analysis.estimators.chain_wavenumber import chain_wavenumber
from analysis.estimators.coherent import coherent_wave, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.layer_lattice import LayerLattice, exact_twin, lattice_signals
from analysis.estimators.low_pass import Passband, at_stretch
from analysis.estimators.power_law import power_law
from analysis.estimators.ridge import ridge
from analysis.estimators.transfer import wall_velocity
from analysis.estimators.travel_time import arrival_velocity, first_peak_velocity
from analysis.measuring import Measuring
from modal.packing.crystal import fcc
from modal.packing.network import write_network
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError
from modal.waves.signals import Signals, write_signals
from modal.waves.source import step

CHAIN = LayerLattice.of_crystal(FccLattice(1e5))
LENGTH = (CHAIN.layers - 1) * CHAIN.distance + 2 * CHAIN.wall_gap
PASSAGE = LENGTH / CHAIN.velocity
RANDOM = np.random.default_rng(0)


def record(passages: float = 1.0, **settings) -> Signals:
    return lattice_signals(CHAIN, np.arange(0, passages * PASSAGE, 4e-7), **settings)


def chain(found: Signals, at: np.ndarray | slice) -> Signals:
    return replace(
        found,
        chain_position=found.chain_position[at],
        chain_displacement=found.chain_displacement[:, at],
        chain_particle=found.chain_particle[at],
    )


def noisy(found: Signals, share: float) -> Signals:
    u = found.chain_displacement
    noise = share * abs(u).max() * RANDOM.standard_normal(u.shape)
    return replace(found, chain_displacement=u + noise)


def moved(motion) -> Signals:
    """The wave of any motion of the wall, whose amplitude has no sign."""
    found = record()
    wall = motion.displacement(found.time)
    found = replace(found, source_displacement=wall, amplitude=motion.amplitude)
    return exact_twin(found, CHAIN)


FULL = record()
BOTH = replace(FULL, chain_displacement=FULL.chain_displacement + FULL.chain_displacement[:, ::-1])


@pytest.mark.parametrize(
    "found",
    [
        record(0.5),
        record(0.3),
        noisy(record(0.5), 1e-6),
        replace(record(amplitude=-2.5e-9), amplitude=2.5e-9),
        moved(step(-1e-9, 1e-5)),
        noisy(FULL, 0.3),
        replace(FULL, chain_displacement=FULL.chain_displacement[:, ::-1]),
        BOTH,
    ],
    ids=["half", "third", "half noise", "reversed", "step down", "noise", "backward", "both ends"],
)
@pytest.mark.parametrize("rule", [first_peak_velocity, arrival_velocity])
def test_times_of_arrival_give_the_velocity_or_none(rule, found):
    """The known bias of both rules on this wave is 2 % at most."""
    value, error = rule(found, 0.0, LENGTH)
    assert np.isnan([value, error]).all() or value == pytest.approx(CHAIN.velocity, rel=0.025)


@pytest.mark.parametrize("order", [slice(None, None, -1), RANDOM.permutation(CHAIN.layers)])
def test_the_order_of_the_chain_does_not_matter(order):
    turned = chain(FULL, order)
    assert longest_waves(coherent_wave(turned, LENGTH)) == pytest.approx(
        longest_waves(coherent_wave(FULL, LENGTH)), rel=1e-6
    )
    assert ridge(turned).edge_wavelength == pytest.approx(2 * CHAIN.distance, rel=1e-3)
    kappa = [chain_wavenumber(r, 2e4, LENGTH, velocity=CHAIN.velocity) for r in (turned, FULL)]
    assert kappa[0] == pytest.approx(kappa[1], rel=1e-6)


def test_a_record_that_begins_in_the_wave_has_no_dispersion():
    with pytest.raises(InputError, match="not at rest where the record begins"):
        chain_dispersion(replace(FULL, chain_displacement=FULL.chain_displacement + 1e-9))


def test_walls_that_hear_no_wave_have_no_velocity():
    long = record(1.3)
    assert wall_velocity(long, LENGTH) is not None
    noise = RANDOM.standard_normal(len(long.time))
    assert wall_velocity(replace(long, receiver_stress=noise), LENGTH) is None
    still = replace(long, source_displacement=0 * long.time)  # its source has moved before
    assert wall_velocity(still, LENGTH) is None


def test_nothing_has_no_ridge():
    found = ridge(replace(FULL, chain_displacement=0 * FULL.chain_displacement))
    assert np.isnan(found.edge_frequency)


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
        Passband(network, r, None, velocity=lattice.velocity, crystal=True).edges(r)[0].value
        for r in (plain, waiting)
    ]
    # The longer record's frequencies stand closer: 1 / 4 T between which the value is interpolated.
    assert edges[1] == pytest.approx(edges[0], rel=2e-3)


def test_few_particles_with_a_value_do_not_speak_for_a_stretch():
    distance, values = np.linspace(0, 1, 200), np.full(200, np.nan)
    values[[102, 107, 112, 117]] = 1.0
    found = at_stretch(distance, values, 1.0, (0.5, 0.6))
    assert np.isnan(found.value) and "4 of 20" in found.why


@pytest.mark.parametrize("y", [[0.0, 1.0, 2.0], [-1.0, 1.0, 2.0]])
def test_what_has_no_logarithm_has_no_power(y):
    assert np.isnan(power_law(np.array([1.0, 2.0, 3.0]), np.array(y)).exponent)


def test_a_chain_that_leaves_out_layers_is_refused(tmp_path):
    """It would end the crystal's band at 0.707 of its frequency, without a word."""
    network = fcc(cells=(1, 1, 120))
    lattice = LayerLattice.of_network(network)
    whole = lattice_signals(lattice, np.arange(0, 3e-4, 4e-7))
    write_network(tmp_path / "a.network.h5", network)
    write_signals(tmp_path / "a.signals.h5", chain(whole, slice(None, None, 2)))
    with pytest.raises(InputError, match="in every 2 layers"):
        _ = Measuring.of(Case("a", tmp_path)).yade
