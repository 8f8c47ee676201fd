"""Pictures of results: drawn where they are asked for, with the numbers of the result."""

import numpy as np
import pytest

import modal

pyplot = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(scope="module")
def network():
    return modal.random_packing(spheres=100, seed=3, aspect=2.5)


@pytest.fixture(scope="module")
def results(network):
    """Return a result of each kind that has a picture."""
    wave = modal.propagate(network, duration=3e-5)
    return {
        "modes": modal.eigenmodes(network),
        "states": modal.density_of_states(network, resolution=1e4, tolerance=0.1),
        "wave": wave,
        "signals": wave.signals,
        "response": modal.frequency_response(network, highest=3e4),
        "lattice": modal.FccLattice(),
    }


@pytest.fixture(autouse=True)
def without_screen():
    """Draw into memory, and forget all figures at the end."""
    pyplot.switch_backend("agg")
    yield
    pyplot.close("all")


KINDS = ["modes", "states", "wave", "signals", "response", "lattice"]


@pytest.mark.parametrize("kind", KINDS)
def test_picture_is_drawn_on_given_axes(kind, results):
    _, axes = pyplot.subplots()
    assert results[kind].plot(axes) is axes
    assert axes.get_xlabel()
    assert axes.get_ylabel()


@pytest.mark.parametrize("kind", KINDS)
def test_picture_has_a_figure_of_its_own_without_axes(kind, results):
    _, axes = pyplot.subplots()
    assert results[kind].plot().figure is not axes.figure


def test_picture_of_modes_has_frequency_and_chi_z(results):
    modes = results["modes"]
    drawn = modes.plot().lines[0].get_xydata() * [1e3, 1]
    assert drawn == pytest.approx(np.column_stack([modes.frequency, modes.chi_z]))


@pytest.mark.parametrize(
    ("line", "columns"),
    [(0, slice(6, 7)), (1, slice(0, 3)), (2, slice(3, 6))],
    ids=["all", "translations", "rotations"],
)
def test_picture_of_states_has_densities_per_khz(line, columns, results):
    states = results["states"]
    density, _ = states.density(states.grid())
    expected = np.column_stack([states.grid() / 1e3, 1e3 * density[:, columns].sum(axis=1)])
    assert states.plot().lines[line].get_xydata() == pytest.approx(expected, rel=1e-12)


def test_picture_of_states_has_a_band_as_wide_as_the_error(results):
    states = results["states"]
    density, error = states.density(states.grid())
    assert error[:, 6].max() > 0
    band = states.plot().collections[0].get_paths()[0].vertices[:, 1]
    edges = 1e3 * (density[:, 6] + np.outer([-1, 1], error[:, 6]))
    assert np.unique(band) == pytest.approx(np.unique(edges), rel=1e-12)


def test_picture_of_a_response_has_the_gain(results):
    response = results["response"]
    assert np.array_equal(response.plot().lines[0].get_ydata(), response.gain)


def test_picture_of_the_lattice_ends_at_the_low_pass_frequency(results):
    """Find Eq. 9 as the last line, whose end at the zone's edge is f_low-pass, Eq. 10."""
    lattice = results["lattice"]
    end = lattice.plot().lines[-1].get_ydata()[-1]
    assert end * 1e3 == pytest.approx(lattice.low_pass_frequency, rel=1e-12)


def test_picture_of_a_wave_has_displacements_in_nm(results):
    wave = results["wave"]
    drawn = np.asarray(wave.plot().collections[0].get_array())
    expected = 1e9 * abs(wave.signals.layer_displacement).max()
    assert abs(drawn).max() == pytest.approx(expected)
