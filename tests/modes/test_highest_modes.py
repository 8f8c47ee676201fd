"""The highest modes: complete where they are degenerate or nearly so, and counted exactly."""

import json

import numpy as np
import pytest
from changes import stiffer
from oracles import dense_squares
from packings import columns_side_by_side, disordered
from refusals import refusal

from modal.__main__ import main
from modal.modes import search
from modal.modes.eigenmodes import eigenmodes, modes_of
from modal.modes.mode_set import read_modes
from modal.packing import crystal as gallery
from modal.packing.network import Network, write_network
from modal.solvers.factor import available
from modal.system.linear_system import LinearSystem, frequency_of

pytestmark = pytest.mark.two_ways


def columns(copies: int, step: float = 0.0) -> tuple[Network, np.ndarray]:
    """Return uncoupled columns of two spheres and all their frequencies, Hz, ascending.

    Each column is stiffer by `step` than the one before.
    """
    network = columns_side_by_side(copies)
    factor = 1 + step * np.arange(copies)
    factor_of_contact = np.repeat(factor, network.n_contacts // copies)
    single = dense_squares(LinearSystem.of(gallery.column(2)))
    return stiffer(network, factor_of_contact, factor_of_contact), frequency_of(
        np.sort(np.outer(single, factor).ravel())
    )


@pytest.mark.parametrize(
    ("copies", "step", "count"),
    [(100, 0.0, 30), (1000, 0.0, 30), (100, 1e-6, 30), (1000, 1e-6, 20), (100, 1e-8, 30)],
)
def test_degenerate_and_nearly_degenerate_tops(copies, step, count):
    """Compare with the spectrum of one column, scaled.

    The relative error of a frequency is half of that of omega^2, which is known to round-off of the
    matrix and to the square of a residual of 1e-10 divided by the gap.
    """
    if copies == 1000 and not available("pardiso"):
        pytest.skip("pypardiso is not installed")  # the count by layers takes minutes for them
    network, exact = columns(copies, step)
    system = LinearSystem.of(network)
    assert system.size > system.limits.small
    assert count <= system.size // 4
    modes = modes_of(system, highest=count)
    assert modes.frequency == pytest.approx(exact[-count:], rel=1e-9)
    assert modes.attributes["certified"]
    assert modes.attributes["missing"] == 0


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: gallery.fcc(cells=(3, 3, 14)), id="crystal"),
        pytest.param(disordered, id="disordered crystal"),
    ],
)
def test_highest_modes_are_those_of_the_dense_spectrum(make):
    system = LinearSystem.of(make())
    exact = frequency_of(dense_squares(system))
    for count in (1, 7, system.size // 4):
        modes = modes_of(system, highest=count)
        # Converged to 1e-10 of omega^2, which is what a residual may be, and f errs by half of it.
        assert modes.frequency == pytest.approx(exact[-count:], rel=1e-9)
        assert modes.attributes["certified"]
        assert modes.residual.max() < 1e-9


def test_a_mode_that_the_search_misses_is_found_by_the_count(monkeypatch):
    """Hide the highest mode from the first round; the count requests a second round."""
    network, exact = columns(300, 1e-3)
    system = LinearSystem.of(network)
    requested_counts = []
    modes_from_top = search.modes_from_top

    def hide_highest_at_first(apply, count, held, most):
        requested_counts.append(count)
        is_first = len(requested_counts) == 1
        pairs = modes_from_top(apply, count + is_first, held, 50 * most)
        if is_first:
            for name in ("square", "vector", "converged"):
                setattr(pairs, name, getattr(pairs, name)[..., :-1])
        return pairs

    monkeypatch.setattr(search, "modes_from_top", hide_highest_at_first)
    modes = modes_of(system, highest=5)
    assert modes.frequency == pytest.approx(exact[-5:], rel=1e-9)
    assert modes.attributes["certified"]
    assert requested_counts == [5, 1]


def test_uncertified_is_cheap_and_says_so(tmp_path, capsys, monkeypatch):
    """Find one mode of columns of different stiffness without a factor and without a count."""
    source = tmp_path / "x.network.h5"
    product = tmp_path / "x.modes.h5"
    network, exact = columns(100, 1e-2)
    write_network(source, network)
    monkeypatch.delattr(LinearSystem, "factor")
    monkeypatch.delattr("modal.modes.eigenmodes.count_below")
    command = [
        "modes",
        str(source),
        "--highest",
        "1",
        "--uncertified",
        "--json",
        "-o",
        str(product),
    ]
    assert main(command) == 0
    printed = capsys.readouterr()
    output = json.loads(printed.out)
    # Converged to 1e-10 of omega^2.
    assert output["frequency_hz"] == pytest.approx(exact[-1:], rel=1e-9)
    assert output["certified"] is False
    assert output["missing"] == 0
    assert "as was asked for" in read_modes(product).attributes["uncertified_because"]
    assert printed.err.count("not certified") == 1
    assert main(["modes", str(source), "--below", "1", "--uncertified"]) == 2
    assert "--highest" in capsys.readouterr().err


@pytest.mark.parametrize(("layers", "count", "certify"), [(300, 12, True), (200, 1, False)])
def test_a_long_column_goes_on_about_a_shift(layers, count, certify):
    """Find modes that lie 1e-5 apart in omega^2, which products alone hardly resolve.

    A shift below the highest mode is noticed and raised: there sigma - A is not definite, which
    some Cholesky factorisations show only by NaN.
    """
    system = LinearSystem.of(gallery.fcc(cells=(1, 1, layers)))
    modes = modes_of(system, highest=count, certify=certify)
    assert "solves" in modes.attributes["solver"]
    assert modes.certified == certify
    # omega^2 of products that have converged to 1e-10, and of a dense solution to round-off.
    assert modes.frequency == pytest.approx(frequency_of(dense_squares(system))[-count:], rel=1e-9)


def test_the_top_of_a_crystal_is_found_by_products_where_no_factor_fits(monkeypatch):
    """Find modes that lie a millionth apart by hundreds of products, without a factor."""
    exact = eigenmodes(gallery.fcc(cells=(1, 1, 210)), all=True).frequency

    def refuse(*_):
        raise AssertionError("a shift was taken")

    monkeypatch.setattr(search, "AboutShift", refuse)
    monkeypatch.setattr(search, "memory_at_hand", lambda: 1e3)
    crystal = gallery.fcc(cells=(1, 1, 210))
    for count in (1, 2):
        modes = eigenmodes(crystal, highest=count, certify=False)
        # Converged to 1e-10 of omega^2.
        assert modes.frequency == pytest.approx(exact[-count:], rel=1e-9)
        assert modes.attributes["solver"] == "lanczos, products"


def test_a_top_too_dense_for_products_is_refused_before_a_matrix_is_made(monkeypatch):
    """Refuse a factor that does not fit by its estimate: the matrix alone may fill the memory."""

    def refuse(*_):
        raise AssertionError("a matrix was assembled")

    monkeypatch.setattr(LinearSystem, "assemble_dynamical_matrix", refuse)
    monkeypatch.setattr(search, "MAX_PRODUCTS", 20)
    monkeypatch.setattr(search, "MIN_PRODUCTS", 5)
    monkeypatch.setattr(search, "MIN_PRODUCTS_PER_MODE", 5)
    monkeypatch.setattr("modal.tools.workload.memory_at_hand", lambda: 1e6)
    with refusal("too_large"):
        eigenmodes(gallery.fcc(cells=(1, 1, 210)), highest=1)
