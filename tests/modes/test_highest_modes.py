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
    """Uncoupled columns of two spheres, each stiffer by `step`, and all frequencies, ascending."""
    network, factor = columns_side_by_side(copies), 1 + step * np.arange(copies)
    each = np.repeat(factor, network.n_contacts // copies)
    single = dense_squares(LinearSystem.of(gallery.column(2)))
    return stiffer(network, each, each), frequency_of(np.sort(np.outer(single, factor).ravel()))


@pytest.mark.parametrize(
    ("copies", "step", "count"),
    [(100, 0.0, 30), (1000, 0.0, 30), (100, 1e-6, 30), (1000, 1e-6, 20), (100, 1e-8, 30)],
)
def test_degenerate_and_nearly_degenerate_tops(copies, step, count):
    """Against the spectrum of one column, scaled. Frequencies are half as wrong as omega^2, which
    is known to round-off of the matrix and to the square of a residual of 1e-10 over the gap."""
    if copies == 1000 and not available("pardiso"):
        pytest.skip("pypardiso is not installed")  # the count by layers takes minutes for them
    network, exact = columns(copies, step)
    system = LinearSystem.of(network)
    assert system.size > system.limits.small and count <= system.size // 4
    found = modes_of(system, highest=count)
    assert found.frequency == pytest.approx(exact[-count:], rel=1e-9)
    assert found.attributes["certified"] and found.attributes["missing"] == 0


def test_a_crystal_and_a_disordered_one_against_dense_spectra():
    for network in (gallery.fcc(cells=(3, 3, 14)), disordered()):
        system = LinearSystem.of(network)
        exact = frequency_of(dense_squares(system))
        for count in (1, 7, system.size // 4):
            found = modes_of(system, highest=count)
            assert found.frequency == pytest.approx(exact[-count:], rel=1e-9)
            assert found.attributes["certified"]
            assert found.residual.max() < 1e-9


def test_a_mode_that_the_search_misses_is_found_by_the_count(monkeypatch):
    """The first round is blind to the highest mode of all; the count sends a second one."""
    network, exact = columns(300, 1e-3)
    system = LinearSystem.of(network)
    seen, plain = [], search.modes_from_top

    def blind(apply, count, held, most):
        seen.append(count)
        first = len(seen) == 1
        found = plain(apply, count + first, held, 50 * most)
        if first:
            for name in ("square", "vector", "converged"):
                setattr(found, name, getattr(found, name)[..., :-1])
        return found

    monkeypatch.setattr(search, "modes_from_top", blind)
    found = modes_of(system, highest=5)
    assert found.frequency == pytest.approx(exact[-5:], rel=1e-9)
    assert found.attributes["certified"]
    assert seen == [5, 1]


def test_uncertified_is_cheap_and_says_so(tmp_path, capsys, monkeypatch):
    """No factor for solves and no count, for one mode of a random chain of stiffnesses."""
    source, out = tmp_path / "x.network.h5", tmp_path / "x.modes.h5"
    network, exact = columns(100, 1e-2)
    write_network(source, network)
    monkeypatch.delattr(LinearSystem, "factor")
    monkeypatch.delattr("modal.modes.eigenmodes.count_below")
    command = ["modes", str(source), "--highest", "1", "--uncertified", "--json", "-o", str(out)]
    assert main(command) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert found["frequency_hz"] == pytest.approx(exact[-1:], rel=1e-9)
    assert found["certified"] is False and found["missing"] == 0
    assert "as was asked for" in read_modes(out).attributes["uncertified_because"]
    assert printed.err.count("not certified") == 1
    assert main(["modes", str(source), "--below", "1", "--uncertified"]) == 2
    assert "--highest" in capsys.readouterr().err


@pytest.mark.parametrize(("layers", "count", "certify"), [(300, 12, True), (200, 1, False)])
def test_a_long_column_goes_on_about_a_shift(layers, count, certify):
    """Its top modes are 1e-5 apart in omega^2, which products alone hardly resolve: a shift that is
    taken below the highest is noticed and raised.

    The matrix sigma - A is not definite there, which a Cholesky factorisation may only say by NaN.
    """
    system = LinearSystem.of(gallery.fcc(cells=(1, 1, layers)))
    found = modes_of(system, highest=count, certify=certify)
    assert "solves" in found.attributes["solver"] and found.certified == certify
    # omega^2 of products that have converged to 1e-10, and of a dense solution to round-off.
    assert found.frequency == pytest.approx(frequency_of(dense_squares(system))[-count:], rel=1e-9)


def test_the_top_of_a_crystal_is_found_by_products_where_no_factor_fits(monkeypatch):
    """Its modes lie a millionth apart: hundreds of products, and no factor; exact: all modes."""
    exact = eigenmodes(gallery.fcc(cells=(1, 1, 210)), all=True).frequency

    def refuse(*_):
        raise AssertionError("a shift was taken")

    monkeypatch.setattr(search, "AboutShift", refuse)
    monkeypatch.setattr(search, "memory_at_hand", lambda: 1e3)
    crystal = gallery.fcc(cells=(1, 1, 210))
    for count in (1, 2):
        modes = eigenmodes(crystal, highest=count, certify=False)
        assert modes.frequency == pytest.approx(exact[-count:], rel=1e-9)
        assert modes.attributes["solver"] == "lanczos, products"


def test_a_top_too_dense_for_products_is_refused_before_a_matrix_is_made(monkeypatch):
    """What would not fit is known from its estimate; the matrix alone may fill the memory."""

    def refuse(*_):
        raise AssertionError("a matrix was assembled")

    monkeypatch.setattr(LinearSystem, "assemble_dynamical_matrix", refuse)
    monkeypatch.setattr(search, "MAX_PRODUCTS", 20)
    monkeypatch.setattr(search, "MIN_PRODUCTS", 5)
    monkeypatch.setattr(search, "MIN_PRODUCTS_PER_MODE", 5)
    monkeypatch.setattr("modal.tools.workload.memory_at_hand", lambda: 1e6)
    with refusal("too_large"):
        eigenmodes(gallery.fcc(cells=(1, 1, 210)), highest=1)
