"""The threshold rule and the wave number of a chain, on fields whose answer is known."""

import numpy as np
import pytest
from exact_crystal import CHAIN, LENGTH, noisy, part_of_chain, record

from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.estimators.low_pass import (
    CRYSTAL_STRETCH,
    STRETCH,
    THRESHOLDS,
    Passband,
    at_stretch,
    columns_of,
    last_crossing,
    spectra,
    threshold_curves,
)
from analysis.estimators.wavenumber import chain_wavenumber
from modal.packing.contact_law import RADIUS
from modal.packing.crystal import fcc
from modal.waves.motions import Pulse
from modal.waves.propagate import propagate

TIME = np.arange(0, 1e-3, 1e-6)
EXACT = record(0.95)


def bells(widths: np.ndarray) -> np.ndarray:
    """Pulses (nt, n) whose spectra are exp(-(pi f tau)^2) of one height: known at any level."""
    return np.exp(-(((TIME[:, None] - 4e-4) / widths) ** 2)) / widths


def edge_of(width, threshold):
    return np.sqrt(-np.log(threshold)) / (np.pi * width)


def test_threshold_is_found_between_the_frequencies():
    """The logarithm of a bell is a parabola: straight over df it is off by (df)^2 / 8 of its bend.

    At the crossing f the bend 2 (pi tau)^2 over the slope 2 (pi tau)^2 f leaves df^2 / (8 f):
    250^2 / (8 * 12,590) Hz = 0.6 Hz for the 2 % of 50 us.
    """
    widths = np.array([5e-5, 3e-5])
    found = threshold_curves(*spectra(TIME, bells(widths), 6e4))
    for row, threshold in zip(found, THRESHOLDS, strict=True):
        assert row == pytest.approx(edge_of(widths, threshold), abs=1.0)
    # No bell, so no crossing that can be seen: a spike has all frequencies.
    spike = np.eye(1, len(TIME), 400).T
    assert np.isnan(threshold_curves(*spectra(TIME, spike, 6e4))).all()
    assert np.isnan(last_crossing(np.arange(5.0), np.zeros((5, 1)), 1.0)).all()


def test_relative_to_the_map_or_to_each():
    """A particle that moves a tenth as much falls to 2 % of the map at 20 % of its own maximum."""
    u = bells(np.array([5e-5, 5e-5])) * [1.0, 0.1]
    spectrum = spectra(TIME, u, 6e4)
    of_map = threshold_curves(*spectrum, "map")[0]
    assert of_map[1] == pytest.approx(edge_of(5e-5, 0.2), abs=1.5)
    assert of_map[0] == pytest.approx(edge_of(5e-5, 0.02), abs=1.0)
    own = threshold_curves(*spectrum, "own")[0]
    assert own == pytest.approx(edge_of(5e-5, 0.02), abs=1.0)


def test_plateau_or_none():
    """One stretch for all thresholds: a constant is a plateau, a steady fall is none."""
    distance, stretch = np.linspace(0.001, 0.999, 300), STRETCH
    for fall, flat in ((0.0, True), (0.5, True), (2.0, False)):
        # f = 20 kHz (1 - fall (z - 0.55)); a stretch of 0.1 further off by fall / 10.
        width = 5e-5 / (1 - fall * (distance - 0.55))
        curves = threshold_curves(*spectra(TIME, bells(width), 8e4))
        for row, threshold in zip(curves, THRESHOLDS, strict=True):
            found = at_stretch(distance, row, 1.0, stretch)
            assert found.value == pytest.approx(edge_of(5e-5, threshold), rel=1e-2)
            assert found.plateau is flat
            if not flat:
                (caveat,) = found.caveats
                assert caveat.code == "no_plateau"
                assert 100 * caveat.values["change"] == pytest.approx(10 * fall, abs=2)
    unknown = at_stretch(distance, np.full(300, np.nan), 1.0, stretch)
    assert np.isnan(unknown.value)
    (caveat,) = unknown.caveats
    assert (caveat.code, *caveat.values.values()) == ("few_particles", 0, 30)


def test_exact_crystal_by_the_papers_words():
    """The rule near the source is within a per cent of the band edge; at half the length it is not.

    The waves at the edge do not travel: the record of a passage does not hold them there.
    """
    u, z = EXACT.chain_displacement, EXACT.chain_position
    highest = 0.5 * CHAIN.velocity / CHAIN.distance
    two = threshold_curves(*spectra(EXACT.time, u, highest))[0]
    near, far = (at_stretch(z, two, LENGTH, part) for part in (CRYSTAL_STRETCH, STRETCH))
    assert near.value == pytest.approx(CHAIN.low_pass_frequency, rel=0.01)
    assert not near.caveats
    assert far.value < 0.95 * CHAIN.low_pass_frequency


@pytest.mark.parametrize(("noise", "rel"), [(1e-4, 2e-3), (2e-3, 2e-2)])
def test_noise_below_the_threshold_does_not_move_it(noise, rel):
    """White noise of `noise` of the largest displacement: its spectrum is sqrt(nt) noise dt u.

    Of 0.42 ms at 0.4 us, against the map's maximum of about a period of the wall's motion: 0.8
    times `noise` at sqrt(1060) samples over 25 of the pulse, 1.3 `noise`, a twentieth of the 2 %
    threshold at noise 1e-3; the median over twenty layers shifts by less.
    """
    highest, found = 0.5 * CHAIN.velocity / CHAIN.distance, []
    for one in (EXACT, noisy(EXACT, noise, np.random.default_rng(5))):
        curve = threshold_curves(*spectra(one.time, one.chain_displacement, highest))[0]
        found.append(at_stretch(one.chain_position, curve, LENGTH, CRYSTAL_STRETCH).value)
    assert found[1] == pytest.approx(found[0], rel=rel)


@pytest.mark.parametrize("share", [0.1, 0.3, 0.6, 0.8])
@pytest.mark.parametrize("some", [False, True])
def test_wave_number_of_the_exact_chain(share, some):
    """Eq. 9 within 0.5 %, from all layers or from an uneven two thirds of them.

    A record cut at the end smears the slow waves; up to 0.8 of the edge all have passed 0.5 L.
    """
    kept = np.sort(np.random.default_rng(1).choice(CHAIN.layers, 133, replace=False))
    seen = part_of_chain(EXACT, kept) if some else EXACT
    frequency = share * CHAIN.low_pass_frequency
    found = chain_wavenumber(seen, frequency, LENGTH, velocity=CHAIN.velocity)
    exact = 2 * np.arcsin(share) / CHAIN.distance
    assert found == pytest.approx(exact, rel=5e-3)


def test_no_wave_number_of_noise_or_of_nothing():
    assert np.isnan(chain_wavenumber(EXACT, np.nan, LENGTH, velocity=CHAIN.velocity))
    short = part_of_chain(EXACT, slice(10))
    assert np.isnan(chain_wavenumber(short, 1e4, 10 * LENGTH, velocity=CHAIN.velocity))


def test_columns_of_a_crystal_agree():
    """All columns of a crystal carry one wave: the choice of the chain is worth nothing."""
    network = fcc(cells=(2, 2, 80))
    lattice = LayerLattice.of_network(network)
    passage = network.length / lattice.velocity
    wave = propagate(network, passage, interval=1e-6, particles=True).signals
    band = Passband(network, wave, None, lattice.velocity, True)
    assert len(columns_of(network, np.arange(network.n_particles))) == 4
    assert len(band.of_columns) == 4
    assert band.chain_scatter == pytest.approx(np.zeros(4), abs=1e-2 * lattice.low_pass_frequency)
    assert band.passages(wave) == pytest.approx(0.95)


def test_the_end_of_the_source_is_not_taken_for_the_packings():
    """A pulse of 100 kHz in a crystal whose band ends at 688 kHz: no answer, and why."""
    network = fcc(cells=(1, 1, 120), radius=0.2 * RADIUS)
    lattice = LayerLattice.of_network(network)
    passage = network.length / lattice.velocity
    seen = lattice_signals(lattice, np.arange(0, passage, 5e-8))
    band = Passband(network, seen, None, lattice.velocity, True)
    for edge in band.edges(seen):
        assert np.isnan(edge.value)
        assert edge.codes == ["source_too_weak"]
    heard = lattice_signals(lattice, seen.time, Pulse(frequency=5e5))
    assert band.edges(heard)[0].value == pytest.approx(lattice.low_pass_frequency, rel=0.1)


@pytest.mark.parametrize("count", [0, 1])
def test_a_record_too_short_for_two_frequencies_has_no_crossing(count):
    frequency, amplitude = np.arange(float(count)), np.ones((count, 3))
    assert np.isnan(last_crossing(frequency, amplitude, 0.5)).all()
