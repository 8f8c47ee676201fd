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
    wanted = smooth_counts(states, exact, share, frequency)
    value, error = states.count_below(frequency)
    # Five standard errors over 84 numbers; and the Jackson kernel is a Gaussian only to a few
    # per cent of the modes within a resolution of the cut, here at most 20 of 600.
    assert (abs(value - wanted) <= 5 * error + 1.0).all()
    assert value[:, :6].sum(axis=1) == pytest.approx(value[:, 6], rel=1e-12)


def test_standard_errors_are_those_seen(packing):
    """Deviations from the exact counts, in standard errors, have a mean square near one."""
    network, exact, _ = packing
    frequency = np.linspace(2e4, 1.9e5, 9)
    deviations = []
    for seed in range(12):
        states = density_of_states(network, resolution=6e3, tolerance=2e-2, seed=seed)
        value, error = states.count_below(frequency)
        wanted = smooth_counts(states, exact, np.ones((len(exact), 1)), frequency)[:, 0]
        deviations.append((value[:, 6] - wanted) / error[:, 6])
    # 12 seeds, neighbouring frequencies correlated: about 50 independent numbers, with 6 vectors
    # each the square of Student's t has mean 5/3.
    assert 0.8 < np.mean(np.square(deviations)) < 3.5


@pytest.mark.parametrize("seeds", [1, 30])
@pytest.mark.parametrize("spheres", [5, 50, 100])
def test_tolerance_bounds_the_standard_error_for_every_size(spheres, seeds):
    """Root mean square over seeds of the errors of counts, with as few random vectors as may be.

    A single seed at the usual tolerance of 1e-3, where no random vector is needed.
    """
    packed = spheres != 5
    network = random_sample(spheres, 1e6, aspect=1.0).network() if packed else gallery.column(5)
    size, vectors = 6 * spheres, 0 if seeds == 1 else max(6, spheres // 5)
    tolerance = 1 / np.sqrt(2 * size * (vectors - 0.3)) if vectors else 1e-3
    frequency = np.linspace(1e4, 2e5, 8)
    found = [
        density_of_states(network, resolution=2e4, tolerance=tolerance, seed=seed)
        for seed in range(seeds)
    ]
    wanted = without_scatter(network, found[0]).count_below(frequency)[0][:, 6]
    count = np.array([states.count_below(frequency)[0][:, 6] for states in found])
    error = np.sqrt(((count - wanted) ** 2).mean(axis=0)) / size
    # Of 30 seeds the root mean square is itself uncertain by 1 / sqrt(60); thrice that is allowed.
    assert error.max() <= tolerance * (1.4 if vectors else 1)
    assert found[0].random_vectors == vectors


def test_exact_traces_split_zero_modes_off(packing):
    network, exact, _ = packing
    states = density_of_states(network, resolution=1e3)
    frequency = np.linspace(5e3, 2.3e5, 12)
    value, error = states.count_below(frequency)
    wanted = without_scatter(network, states).count_below(frequency)[0]
    # Zero modes of the structure and of the dense spectrum: the same, to the round-off of moments.
    assert value == pytest.approx(wanted, abs=1e-9 * len(exact))
    assert not error.any()
    slow = density_of_states(stiffer(network, 1e-20, 1e-20), resolution=1e-7)
    assert slow.moments == pytest.approx(states.moments, abs=1e-9 * len(exact))


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
    """Half height is reached half a resolution away, less by sqrt(1 - x^2) towards the top.

    Nowhere is it negative: of all kernels that are not, Jackson's is the narrowest.
    """
    highest, resolution = 2e5, 4e3
    count = int(np.ceil(np.pi * np.sqrt(8 * np.log(2)) * highest / resolution / 2))
    moments = np.cos(2 * np.arange(count) * np.arccos(place)) * np.ones((2, 6, 1)) / 6
    states = DensityOfStates(moments, highest, np.zeros(6), resolution, 0)
    half = resolution / 2 * np.sqrt(1 - place**2)
    centre, side = place * highest, place * highest + half
    peak, at_half = states.density([centre, side])[0][:, 6]
    # The Jackson kernel is a Gaussian up to a few per cent.
    assert at_half == pytest.approx(peak / 2, rel=0.05)
    assert states.density(states.grid())[0].min() >= -1e-12 * peak


def test_command_and_file(tmp_path, printed):
    network = gallery.fcc(cells=(2, 2, 6))
    path, output = tmp_path / "a.network.h5", tmp_path / "a.density.h5"
    write_network(path, network)
    printed("density", path, "--resolution", "5e3", "--at", "3e5", "-o", output)
    with h5py.File(output) as file:
        parts = file["translation/count_below"][:].sum(axis=1)
        parts += file["rotation/count_below"][:].sum(axis=1)
        assert file["all/count_below"][:] == pytest.approx(parts, rel=1e-12)
        names = "frequency", "all/density", "all/count_below"
        for found, name in zip(read_density(output), names, strict=True):
            assert np.array_equal(found, file[name])
        assert file["frequency"].attrs["units"] == "Hz"
        assert file.attrs["network_sha256"] == sha256(path)
        assert file.attrs["resolution"] == 5e3


@pytest.mark.parametrize("resolution", [1e3, 3.3e3, 7e3, 2e4, 9e4])
def test_orders_are_as_few_as_the_resolution_takes(resolution):
    """The kernel's standard deviation in x = f / f_max is pi over the orders, odd ones too."""
    states = density_of_states(gallery.fcc(cells=(2, 2, 6)), resolution=resolution)
    orders = 2 * states.moments.shape[2] - np.array([0, 2])
    width = np.sqrt(8 * np.log(2)) * np.pi / orders * states.highest
    assert width[0] <= resolution < width[1]


@pytest.mark.parametrize("tolerance", [1e-4, 0.1])
def test_coarsest_resolution_knows_the_mean_of_omega_squared(tolerance):
    """A width beyond the whole spectrum leaves two moments: all modes, and the trace of A."""
    network = gallery.fcc(cells=(3, 3, 8))
    states = density_of_states(network, resolution=1e9, tolerance=tolerance)
    moments, size = states.moments.sum(axis=1), 6 * network.n_particles
    assert moments.shape[1] == 2
    assert moments[:, 0] == pytest.approx(size, rel=1e-12)
    A = LinearSystem.of(network).dynamical_matrix.toarray() / (2 * np.pi * states.highest) ** 2
    wanted = 2 * A.trace() - size
    np.fill_diagonal(A, 0)
    # The standard deviation of r^T 2 A r for a vector r of signs; the mean of six has less.
    error = 2 * np.sqrt(2) * np.linalg.norm(A) if states.random_vectors else 1e-12 * size
    assert moments[:, 1].mean() == pytest.approx(wanted, abs=2 * error)


@pytest.mark.parametrize("tolerance", [1e-4, 0.1])
def test_nothing_lies_above_the_top(packing, tolerance):
    """The density ends there, its integral is the number of modes but for those at zero."""
    network = packing[0]
    states = density_of_states(network, resolution=5e3, tolerance=tolerance)
    # At the end itself the formula divides by zero.
    above = states.density(states.highest * np.linspace(1, 1e3, 50))
    assert not above[0].any() and not above[1].any()
    below, spread = states.count_below([states.highest, 1.5 * states.highest, 1e9])
    wanted = np.full(3, 6.0 * network.n_particles)
    assert below[:, 6] == pytest.approx(wanted, abs=5 * spread[0, 6] + 1e-6)
    # Over the angle of the Chebyshev series, in which it is a finite sum of cosines.
    angle = (np.arange(4000) + 0.5) * np.pi / 8000
    value = states.density(at := states.highest * np.sin(angle))[0]
    integral = (value[:, 6] * states.highest * np.cos(angle)).sum() * np.pi / 8000
    # The count is read at 1e-12 below the top, sqrt(2e-12) in the angle.
    assert integral + states.zero_modes.sum() == pytest.approx(below[0, 6], rel=1e-6)
    assert states.density(at[7])[0] == pytest.approx(value[7], rel=1e-9)


@pytest.mark.parametrize("wrong", [-5.0, np.nan, np.inf, "low"])
def test_what_is_no_frequency_is_refused(packing, wrong, tmp_path, one_line):
    states = density_of_states(packing[0], resolution=5e4, tolerance=0.1)
    for evaluate in (states.density, states.count_below, states.reduced):
        with refusal("frequency"):
            evaluate([wrong])
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
    """A frequency given in kHz lies there; its count is right all the same."""
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
