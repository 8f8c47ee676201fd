"""Density of states against dense spectra, component by component, and against its own claims."""

import h5py
import numpy as np
import pytest
from changes import stiffer
from packings import random_sample
from refusals import refusal
from scipy.linalg import eigh
from scipy.special import ndtr

from modal.__main__ import main
from modal.formats.whole_file import sha256
from modal.modes.density import DensityOfStates, density_of_states, read_density
from modal.packing import crystal as gallery
from modal.packing.network import write_network
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.linear_system import LinearSystem

pytestmark = pytest.mark.two_ways


def spectrum(network):
    """Return exact frequencies, Hz, ascending, and the share of each mode in components (k, 6)."""
    scale = 1 / np.sqrt(mass_diagonal(network))
    square, vector = eigh(scale[:, None] * stiffness_matrix(network).toarray() * scale)
    share = (vector.reshape(-1, 6, len(square)) ** 2).sum(axis=0).T
    return np.sqrt(np.maximum(square, 0)) / (2 * np.pi), share


@pytest.fixture(scope="module")
def packing():
    """Return a random packing, its exact frequencies, Hz, and the components of its modes."""
    network = random_sample(100, 1e5, seed=3).network()
    return network, *spectrum(network)


def smooth_counts(states, exact, share, frequency):
    """Return the exact count below each frequency, each mode a Gaussian of the kernel's width.

    share (modes, c); returns (nf, c). By symmetry each mode counts half at +f and half at -f.
    """
    width = states.resolution / np.sqrt(8 * np.log(2))
    width = width * np.sqrt(1 - (exact / states.highest) ** 2)
    up = ndtr((frequency[:, None] - exact) / width) - ndtr((-frequency[:, None] - exact) / width)
    return up @ share


def without_scatter(network, states):
    """Return the kernel's density of the dense spectrum without its zero modes, in one row."""
    exact, share = spectrum(network)
    angle = np.arccos(exact / states.highest)[:, None]
    even = np.cos(2 * angle * np.arange(states.moments.shape[2]))
    zero = exact < 1e-5 * exact[-1]
    moments = (share[~zero].T @ even[~zero])[None]
    return DensityOfStates(moments, states.highest, share[zero].sum(axis=0), 0.0, 0)


def test_counts_of_every_component_against_the_dense_spectrum(packing):
    network, exact, by_component = packing
    states = density_of_states(network, resolution=4e3, tolerance=2e-3)
    frequency = np.linspace(1e4, 2.1e5, 12)
    share = np.column_stack([by_component, np.ones(len(exact))])
    exact_count = smooth_counts(states, exact, share, frequency)
    count, error = states.count_below(frequency)
    # Five standard errors over 84 numbers; and the Jackson kernel is a Gaussian only to a few
    # per cent of the modes within a resolution of the cut, here at most 20 of 600.
    assert (abs(count - exact_count) <= 5 * error + 1.0).all()
    assert count[:, :6].sum(axis=1) == pytest.approx(count[:, 6], rel=1e-12)


def test_standard_errors_are_those_seen(packing):
    """Check that deviations from exact counts, in standard errors, have a mean square near one."""
    network, exact, _ = packing
    frequency = np.linspace(2e4, 1.9e5, 9)
    deviations = []
    for seed in range(12):
        states = density_of_states(network, resolution=6e3, tolerance=2e-2, seed=seed)
        count, error = states.count_below(frequency)
        exact_count = smooth_counts(states, exact, np.ones((len(exact), 1)), frequency)[:, 0]
        deviations.append((count[:, 6] - exact_count) / error[:, 6])
    # 12 seeds, neighbouring frequencies correlated: about 50 independent numbers, with 6 vectors
    # each the square of Student's t has mean 5/3.
    assert 0.8 < np.mean(np.square(deviations)) < 3.5


@pytest.mark.parametrize("seeds", [1, 30])
@pytest.mark.parametrize("spheres", [5, 50, 100])
def test_tolerance_bounds_the_standard_error_for_every_size(spheres, seeds):
    """Compare the scatter of counts over seeds with the tolerance, for the fewest random vectors.

    With a single seed the tolerance is 1e-3, the default, at which no random vector is needed.
    """
    packed = spheres != 5
    network = random_sample(spheres, 1e6, aspect=1.0).network() if packed else gallery.column(5)
    size = 6 * spheres
    vectors = 0 if seeds == 1 else max(6, spheres // 5)
    tolerance = 1 / np.sqrt(2 * size * (vectors - 0.3)) if vectors else 1e-3
    frequency = np.linspace(1e4, 2e5, 8)
    densities = [
        density_of_states(network, resolution=2e4, tolerance=tolerance, seed=seed)
        for seed in range(seeds)
    ]
    exact_count = without_scatter(network, densities[0]).count_below(frequency)[0][:, 6]
    count = np.array([states.count_below(frequency)[0][:, 6] for states in densities])
    error = np.sqrt(((count - exact_count) ** 2).mean(axis=0)) / size
    # Of 30 seeds the root mean square is itself uncertain by 1 / sqrt(60); thrice that is allowed.
    assert error.max() <= tolerance * (1.4 if vectors else 1)
    assert densities[0].random_vectors == vectors


def test_exact_traces_split_zero_modes_off(packing):
    network, exact, _ = packing
    states = density_of_states(network, resolution=1e3)
    frequency = np.linspace(5e3, 2.3e5, 12)
    count, error = states.count_below(frequency)
    exact_count = without_scatter(network, states).count_below(frequency)[0]
    # Zero modes of the structure and of the dense spectrum: the same, to the round-off of moments.
    assert count == pytest.approx(exact_count, abs=1e-9 * len(exact))
    assert not error.any()


def test_moments_do_not_depend_on_the_unit_of_stiffness(packing):
    network, exact, _ = packing
    states = density_of_states(network, resolution=1e3)
    slow_states = density_of_states(stiffer(network, 1e-20, 1e-20), resolution=1e-7)
    # To the round-off of moments.
    assert slow_states.moments == pytest.approx(states.moments, abs=1e-9 * len(exact))


def test_density_is_the_derivative_of_the_count(packing):
    states = density_of_states(packing[0], resolution=4e3, tolerance=1e-2)
    frequency = states.grid()[1:-8]
    step = 1e-3 * states.resolution
    slope = states.count_below(frequency + step)[0] - states.count_below(frequency - step)[0]
    density = states.density(frequency)[0]
    # Central difference: the relative error is (step / width)^2, some 1e-5 of the largest value.
    assert density == pytest.approx(slope / (2 * step), rel=1e-3, abs=1e-4 * density.max())


@pytest.mark.parametrize("place", [0.0, 0.3, 0.8])
def test_width_and_sign_of_a_single_mode(place):
    """Check the width of the line of a single mode, and that it is nowhere negative.

    Half height is reached half a resolution away, less by sqrt(1 - x^2) towards the highest
    frequency. Jackson's kernel is the narrowest of all that are nowhere negative.
    """
    highest = 2e5
    resolution = 4e3
    count = int(np.ceil(np.pi * np.sqrt(8 * np.log(2)) * highest / resolution / 2))
    moments = np.cos(2 * np.arange(count) * np.arccos(place)) * np.ones((2, 6, 1)) / 6
    states = DensityOfStates(moments, highest, np.zeros(6), resolution, 0)
    half_width = resolution / 2 * np.sqrt(1 - place**2)
    centre = place * highest
    half_height = place * highest + half_width
    peak, value_at_half_height = states.density([centre, half_height])[0][:, 6]
    # The Jackson kernel is a Gaussian up to a few per cent.
    assert value_at_half_height == pytest.approx(peak / 2, rel=0.05)
    assert states.density(states.grid())[0].min() >= -1e-12 * peak


def test_command_and_file(tmp_path, printed):
    network = gallery.fcc(cells=(2, 2, 6))
    path = tmp_path / "a.network.h5"
    output = tmp_path / "a.density.h5"
    write_network(path, network)
    printed("density", path, "--resolution", "5e3", "--at", "3e5", "-o", output)
    with h5py.File(output) as file:
        sum_of_components = file["translation/count_below"][:].sum(axis=1)
        sum_of_components += file["rotation/count_below"][:].sum(axis=1)
        assert file["all/count_below"][:] == pytest.approx(sum_of_components, rel=1e-12)
        names = "frequency", "all/density", "all/count_below"
        for column, name in zip(read_density(output), names, strict=True):
            assert np.array_equal(column, file[name])
        assert file["frequency"].attrs["units"] == "Hz"
        assert file.attrs["network_sha256"] == sha256(path)
        assert file.attrs["resolution"] == 5e3


@pytest.mark.parametrize("resolution", [1e3, 3.3e3, 7e3, 2e4, 9e4])
def test_orders_are_as_few_as_the_resolution_takes(resolution):
    """Compare the width of a line with the standard deviation of the kernel.

    In x = f / f_max it is pi divided by the number of orders, odd orders included.
    """
    states = density_of_states(gallery.fcc(cells=(2, 2, 6)), resolution=resolution)
    orders = 2 * states.moments.shape[2] - np.array([0, 2])
    width = np.sqrt(8 * np.log(2)) * np.pi / orders * states.highest
    assert width[0] <= resolution < width[1]


@pytest.mark.parametrize("tolerance", [1e-4, 0.1])
def test_coarsest_resolution_knows_the_mean_of_omega_squared(tolerance):
    """Check the two moments that are left by a resolution wider than the whole spectrum.

    They are the number of modes and the trace of A.
    """
    network = gallery.fcc(cells=(3, 3, 8))
    states = density_of_states(network, resolution=1e9, tolerance=tolerance)
    moments = states.moments.sum(axis=1)
    size = 6 * network.n_particles
    assert moments.shape[1] == 2
    assert moments[:, 0] == pytest.approx(size, rel=1e-12)
    A = LinearSystem.of(network).dynamical_matrix.toarray() / (2 * np.pi * states.highest) ** 2
    expected = 2 * A.trace() - size
    np.fill_diagonal(A, 0)
    # The standard deviation of r^T 2 A r for a vector r of signs; the mean of six has less.
    error = 2 * np.sqrt(2) * np.linalg.norm(A) if states.random_vectors else 1e-12 * size
    assert moments[:, 1].mean() == pytest.approx(expected, abs=2 * error)


@pytest.mark.parametrize("tolerance", [1e-4, 0.1])
def test_nothing_lies_above_the_top(packing, tolerance):
    """Check that the density ends at the highest frequency, and integrates to the number of modes.

    Modes of zero frequency are not in the integral.
    """
    network = packing[0]
    states = density_of_states(network, resolution=5e3, tolerance=tolerance)
    # At the end itself the formula divides by zero.
    above = states.density(states.highest * np.linspace(1, 1e3, 50))
    assert not above[0].any()
    assert not above[1].any()
    count, error = states.count_below([states.highest, 1.5 * states.highest, 1e9])
    all_modes = np.full(3, 6.0 * network.n_particles)
    assert count[:, 6] == pytest.approx(all_modes, abs=5 * error[0, 6] + 1e-6)
    # Over the angle of the Chebyshev series, in which it is a finite sum of cosines.
    angle = (np.arange(4000) + 0.5) * np.pi / 8000
    value = states.density(frequency := states.highest * np.sin(angle))[0]
    integral = (value[:, 6] * states.highest * np.cos(angle)).sum() * np.pi / 8000
    # The count is read at 1e-12 below the top, sqrt(2e-12) in the angle.
    assert integral + states.zero_modes.sum() == pytest.approx(count[0, 6], rel=1e-6)
    assert states.density(frequency[7])[0] == pytest.approx(value[7], rel=1e-9)


WRONG_FREQUENCIES = [-5.0, np.nan, np.inf, "low"]


@pytest.mark.parametrize("method", ["density", "count_below", "reduced"])
@pytest.mark.parametrize("wrong", WRONG_FREQUENCIES)
def test_what_is_no_frequency_is_refused(packing, wrong, method):
    states = density_of_states(packing[0], resolution=5e4, tolerance=0.1)
    with refusal("frequency"):
        getattr(states, method)([wrong])


@pytest.mark.parametrize("wrong", WRONG_FREQUENCIES)
def test_what_is_no_frequency_is_refused_by_the_command(packing, wrong, tmp_path, one_line):
    path = tmp_path / "a.network.h5"
    write_network(path, packing[0])
    one_line(main, ["density", path, "--at", wrong], "frequency")


@pytest.mark.parametrize(
    ("command", "options", "frequency", "is_beyond"),
    [
        ("count", ["--at", "50"], "50 Hz", True),
        ("count", ["--at", "5e6"], "5 MHz", True),
        ("density", ["--at", "5e6", "--resolution", "5e4"], "5 MHz", True),
        ("count", ["--at", "5e4"], "50 kHz", False),
    ],
    ids=["count below", "count above", "density above", "count inside"],
)
def test_a_frequency_beyond_the_modes_is_remarked_on(
    command, options, frequency, is_beyond, packing, tmp_path, capsys
):
    """Find a remark for a frequency beyond all modes, as if it were given in kHz.

    The count is right all the same.
    """
    path = tmp_path / "a.network.h5"
    write_network(path, packing[0])
    assert main([command, str(path), *options]) == 0
    assert (frequency in capsys.readouterr().err) == is_beyond


@pytest.mark.parametrize(
    ("argument", "value", "code"),
    [
        ("resolution", 0, "resolution"),
        ("resolution", np.nan, "frequency"),
        ("resolution", np.inf, "frequency"),
        ("resolution", 1e-9, "too_large"),
        ("tolerance", 2, "tolerance"),
        ("tolerance", 1.0, "tolerance"),
        ("tolerance", 0.0, "tolerance"),
        ("seed", -1, "seed"),
        ("seed", 1.5, "argument"),
    ],
)
def test_arguments_out_of_range_are_refused(argument, value, code):
    network = gallery.column(3)
    with refusal(code):
        density_of_states(network, **{argument: value})


def test_density_without_stiffness_is_refused():
    with refusal("no_stiffness"):
        density_of_states(stiffer(gallery.column(3), 0, 0))
