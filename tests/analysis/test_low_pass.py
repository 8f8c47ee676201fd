"""The threshold rule and the wave number of a chain, on fields whose answer is known."""

import numpy as np
import pytest
from exact_crystal import CHAIN, LENGTH, noisy, part_of_chain, record

from analysis.estimators.layer_lattice import LayerLattice, lattice_signals
from analysis.estimators.low_pass import CRYSTAL_STRETCH, STRETCH, Passband, columns_of
from analysis.estimators.threshold_rule import (
    THRESHOLDS,
    at_stretch,
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
"""The exact wave of the crystal, recorded for 0.95 of its passage."""
HIGHEST_FREQUENCY = 0.5 * CHAIN.velocity / CHAIN.distance
"""Hz; above the band edge of the crystal, velocity / (pi distance)."""
TWO_PERCENT = THRESHOLDS.index(0.02)


def gaussian_pulses(widths: np.ndarray) -> np.ndarray:
    """Return pulses (nt, n) of the given widths tau, s, with spectra exp(-(pi f tau)^2).

    All spectra have the same height at f = 0, so their crossing of any level is known.
    """
    return np.exp(-(((TIME[:, None] - 4e-4) / widths) ** 2)) / widths


def exact_edge(width, threshold):
    """Return the frequency, Hz, at which such a spectrum falls to a share of its height."""
    return np.sqrt(-np.log(threshold)) / (np.pi * width)


def test_threshold_is_interpolated_between_the_frequencies():
    """Interpolate the logarithm of the spectrum, a parabola, linearly between frequencies.

    A straight line over df deviates from it by df^2 / 8 times its second derivative 2 (pi tau)^2.
    Divided by the slope 2 (pi tau)^2 f at the crossing f this is df^2 / (8 f):
    250^2 / (8 * 12,590) Hz = 0.6 Hz at 2 % for tau = 50 us.
    """
    widths = np.array([5e-5, 3e-5])
    curves = threshold_curves(*spectra(TIME, gaussian_pulses(widths), 6e4))
    for curve, threshold in zip(curves, THRESHOLDS, strict=True):
        assert curve == pytest.approx(exact_edge(widths, threshold), abs=1.0)


def test_spike_has_no_crossing():
    """Find no threshold in the spectrum of a single sample, which is flat."""
    spike = np.eye(1, len(TIME), 400).T
    assert np.isnan(threshold_curves(*spectra(TIME, spike, 6e4))).all()


def test_silent_particle_has_no_crossing():
    assert np.isnan(last_crossing(np.arange(5.0), np.zeros((5, 1)), 1.0)).all()


@pytest.mark.parametrize(
    ("reference", "thresholds", "tolerance"),
    # The error df^2 / (8 f) of the linear interpolation is 0.6 Hz at 2 % and 1.0 Hz at 20 %.
    [
        pytest.param("map", [0.02, 0.2], [1.0, 1.5], id="maximum of all particles"),
        pytest.param("own", [0.02, 0.02], [1.0, 1.0], id="maximum of each particle"),
    ],
)
def test_reference_of_the_threshold(reference, thresholds, tolerance):
    """Compare two equal pulses, the second a tenth as high.

    The second falls to 2 % of the maximum of both at 20 % of its own maximum.
    """
    displacement = gaussian_pulses(np.array([5e-5, 5e-5])) * [1.0, 0.1]
    spectrum = spectra(TIME, displacement, 6e4)
    edges = threshold_curves(*spectrum, reference)[TWO_PERCENT]
    assert (abs(edges - exact_edge(5e-5, np.array(thresholds))) < tolerance).all()


DISTANCE = np.linspace(0.001, 0.999, 300)
"""Distances of 300 particles from the source, as a share of the length."""


def edges_that_fall(slope: float) -> np.ndarray:
    """Return the threshold curves of pulses with f = f_0 (1 - slope (z - 0.55)).

    At the middle of the stretch, z = 0.55, the width of the pulses is 50 us.
    """
    widths = 5e-5 / (1 - slope * (DISTANCE - 0.55))
    return threshold_curves(*spectra(TIME, gaussian_pulses(widths), 8e4))


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_constant_or_slowly_falling_edge_is_a_plateau(slope):
    for curve, threshold in zip(edges_that_fall(slope), THRESHOLDS, strict=True):
        edge = at_stretch(DISTANCE, curve, 1.0, STRETCH)
        # The median of evenly spaced particles is that of the middle, within slope / 300 < 0.2 %.
        assert edge.value == pytest.approx(exact_edge(5e-5, threshold), rel=1e-2)
        assert edge.plateau is True


def test_steadily_falling_edge_is_no_plateau():
    """Report how much the edge changes: next to the stretch, 0.1 further, by slope / 10."""
    for curve, threshold in zip(edges_that_fall(2.0), THRESHOLDS, strict=True):
        edge = at_stretch(DISTANCE, curve, 1.0, STRETCH)
        # The median is that of the middle, within slope / 300 = 0.7 %.
        assert edge.value == pytest.approx(exact_edge(5e-5, threshold), rel=1e-2)
        assert edge.plateau is False
        (caveat,) = edge.caveats
        assert caveat.code == "no_plateau"
        # Each of two medians is off by at most slope / 300, 0.7 %.
        assert 100 * caveat.values["change"] == pytest.approx(20, abs=2)


def test_stretch_without_any_edge_has_no_value():
    edge = at_stretch(DISTANCE, np.full(300, np.nan), 1.0, STRETCH)
    assert np.isnan(edge.value)
    (caveat,) = edge.caveats
    assert caveat.code == "few_particles"
    assert list(caveat.values.values()) == [0, 30]


def two_percent_edge(signals, stretch):
    """Return the frequency at which spectra in a stretch of the chain fall to 2 %."""
    spectrum = spectra(signals.time, signals.chain_displacement, HIGHEST_FREQUENCY)
    curve = threshold_curves(*spectrum)[TWO_PERCENT]
    return at_stretch(signals.chain_position, curve, LENGTH, stretch)


def test_papers_rule_finds_the_band_edge_near_the_source():
    """Find the edge of the crystal within one per cent."""
    edge = two_percent_edge(EXACT, CRYSTAL_STRETCH)
    assert edge.value == pytest.approx(CHAIN.low_pass_frequency, rel=0.01)
    assert not edge.caveats


def test_papers_rule_underestimates_the_band_edge_at_half_the_length():
    """Miss the waves at the edge: their group velocity is zero, so the record ends before them."""
    assert two_percent_edge(EXACT, STRETCH).value < 0.95 * CHAIN.low_pass_frequency


@pytest.mark.parametrize(("noise", "tolerance"), [(1e-4, 2e-3), (2e-3, 2e-2)])
def test_noise_below_the_threshold_does_not_move_it(noise, tolerance):
    """Add white noise whose amplitude is a share `noise` of the largest displacement u.

    Its spectrum is sqrt(nt) noise dt u, with nt = 1060 samples of 0.4 us. The maximum of the map is
    that of the wall's motion, one period of 25 samples: the noise is 1.3 `noise` of it, a twentieth
    of the 2 % threshold at noise 1e-3. The median of twenty layers shifts by less.
    """
    noisy_record = noisy(EXACT, noise, np.random.default_rng(5))
    expected = two_percent_edge(EXACT, CRYSTAL_STRETCH).value
    assert two_percent_edge(noisy_record, CRYSTAL_STRETCH).value == pytest.approx(
        expected, rel=tolerance
    )


TWO_THIRDS = np.sort(np.random.default_rng(1).choice(CHAIN.layers, 133, replace=False))
"""Layers of the crystal at uneven distances."""


@pytest.mark.parametrize("share_of_edge", [0.1, 0.3, 0.6, 0.8])
@pytest.mark.parametrize(
    "signals",
    [
        pytest.param(EXACT, id="all layers"),
        pytest.param(part_of_chain(EXACT, TWO_THIRDS), id="two thirds of the layers"),
    ],
)
def test_wave_number_of_the_exact_chain(share_of_edge, signals):
    """Give Eq. 9 within 0.5 %.

    The end of the record smears slow waves; up to 0.8 of the edge all have passed half the length.
    """
    frequency = share_of_edge * CHAIN.low_pass_frequency
    measured = chain_wavenumber(signals, frequency, LENGTH, velocity=CHAIN.velocity)
    exact = 2 * np.arcsin(share_of_edge) / CHAIN.distance
    assert measured == pytest.approx(exact, rel=5e-3)


def test_unknown_frequency_has_no_wave_number():
    assert np.isnan(chain_wavenumber(EXACT, np.nan, LENGTH, velocity=CHAIN.velocity))


def test_ten_layers_have_no_wave_number():
    short = part_of_chain(EXACT, slice(10))
    assert np.isnan(chain_wavenumber(short, 1e4, 10 * LENGTH, velocity=CHAIN.velocity))


def test_columns_of_a_crystal_agree():
    """Find no scatter between the columns of a crystal, which all carry the same wave."""
    network = fcc(cells=(2, 2, 80))
    lattice = LayerLattice.of_network(network)
    passage = network.length / lattice.velocity
    wave = propagate(network, passage, interval=1e-6, particles=True).signals
    band = Passband(network, wave, None, lattice.velocity, True)
    assert len(columns_of(network, np.arange(network.n_particles))) == 4
    assert len(band.of_columns) == 4
    assert band.chain_scatter == pytest.approx(np.zeros(4), abs=1e-2 * lattice.low_pass_frequency)
    assert band.passages(wave) == pytest.approx(0.95)


@pytest.fixture(scope="module")
def small_spheres():
    """Return a crystal of small spheres, whose band ends at 688 kHz, and its chain of layers."""
    network = fcc(cells=(1, 1, 120), radius=0.2 * RADIUS)
    return network, LayerLattice.of_network(network)


def edges_with_pulse(network, lattice, pulse):
    """Return the low-pass frequencies from one passage of a pulse."""
    time = np.arange(0, network.length / lattice.velocity, 5e-8)
    signals = lattice_signals(lattice, time, pulse)
    return Passband(network, signals, None, lattice.velocity, True).edges(signals)


def test_upper_end_of_the_pulse_is_not_the_band_edge(small_spheres):
    """Give no number, but the reason, for a pulse of 100 kHz, far below the edge."""
    for edge in edges_with_pulse(*small_spheres, Pulse()):
        assert np.isnan(edge.value)
        assert edge.codes == ["source_too_weak"]


def test_pulse_that_reaches_the_band_edge_shows_it(small_spheres):
    """Find the edge by the 2 % rule, whose error in a chain of 120 layers is below 10 %."""
    network, lattice = small_spheres
    edges = edges_with_pulse(network, lattice, Pulse(frequency=5e5))
    assert edges[TWO_PERCENT].value == pytest.approx(lattice.low_pass_frequency, rel=0.1)


@pytest.mark.parametrize("n_frequencies", [0, 1])
def test_fewer_than_two_frequencies_have_no_crossing(n_frequencies):
    frequency = np.arange(float(n_frequencies))
    amplitude = np.ones((n_frequencies, 3))
    assert np.isnan(last_crossing(frequency, amplitude, 0.5)).all()
