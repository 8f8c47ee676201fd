"""Block Lanczos and the polynomial that lifts a low end, on matrices of known eigenpairs."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.polynomial.chebyshev import Chebyshev
from operators import Known, rotation

from modal.solvers import lanczos as krylov
from modal.solvers.lanczos import (
    BASIS_VECTORS_PER_MODE,
    BLOCK,
    EXTRA_BLOCKS,
    TOLERANCE,
    Held,
    modes_below,
    modes_from_top,
    modes_nearest,
)
from modal.solvers.low_end import LOG_TWICE_LIFT_AT_ZERO, LowEnd

EPS = np.finfo(float).eps


def solver(square: np.ndarray, vector: np.ndarray, sigma: float):
    """Return (A - sigma)^-1 of the matrix A with these eigenpairs."""
    return lambda block: vector @ ((vector.T @ block) / (square - sigma)[:, None])


def held_out(null: np.ndarray, found: np.ndarray) -> Held:
    """Return both kinds of modes that are held out: null vectors, and modes found before."""
    return Held(sp.csc_matrix(null), found)


def nothing(size: int) -> Held:
    """Return no held modes at all."""
    return held_out(np.empty((size, 0)), np.empty((size, 0)))


@pytest.mark.parametrize("sigma", [-0.3, 37.2])
@pytest.mark.parametrize("count", [1, 30])
def test_nearest_of_a_known_spectrum(sigma, count, monkeypatch):
    """Find the eigenpairs nearest to the shift on both sides, without the held ones."""
    monkeypatch.setattr(
        krylov, "ROWS_COMBINED_TOGETHER", 64
    )  # several pieces, the last one shorter
    square = np.concatenate([np.zeros(5), np.linspace(1, 100, 295)])
    vector = rotation(300, 1)
    by_distance = np.argsort(abs(square - sigma))
    found_before = by_distance[~np.isin(by_distance, np.arange(5))][:4]
    held_modes = held_out(vector[:, :5], vector[:, found_before])
    assert held_modes.free == 291
    near = modes_nearest(solver(square, vector, sigma), count, sigma, held_modes)
    others = np.setdiff1d(by_distance, [*range(5), *found_before])
    expected = np.sort(others[np.argsort(abs(square[others] - sigma))][:count])
    assert near.converged.all()
    assert len(near.converged) == count
    # theta is wrong by the square of its residual over a gap, and by round-off of the largest one.
    assert near.square == pytest.approx(square[expected], rel=1e-12)
    # The residual of (A - sigma)^-1 over the gap to the next theta, at least a hundredth of it.
    assert abs(abs(near.vector.T @ vector[:, expected]) - np.eye(count)).max() < 200 * TOLERANCE
    assert near.vector.T @ near.vector == pytest.approx(np.eye(count), abs=300 * EPS)
    assert abs(held_modes.found.T @ near.vector).max() < 300 * EPS
    assert abs(held_modes.null.T @ near.vector).max() < 300 * EPS


def test_what_is_marked_as_converged_has_converged_and_no_other():
    """Compare the marks with the residuals.

    Fifteen modes are isolated; the others are so dense that the basis ends before they converge.
    """
    size = 1500
    count = 40
    theta = np.concatenate([np.linspace(9, 3, 15), np.linspace(2, 1, size - 15)])
    near = modes_nearest(lambda block: theta[:, None] * block, count, 0.0, nothing(size))
    assert near.products + BLOCK > 5 * count + 40 * BLOCK
    inverse = 1 / near.square
    residual = np.linalg.norm(theta[:, None] * near.vector - inverse * near.vector, axis=0)
    # Round-off of the basis, size times eps, is a thousandth of the tolerance.
    decided = abs(residual - TOLERANCE * inverse) > 0.01 * TOLERANCE * inverse
    assert decided.all()
    assert ((residual < TOLERANCE * inverse) == near.converged).all()
    assert 15 <= near.converged.sum() < count


def test_many_modes_without_a_restart():
    """Find 300 modes inside a spectrum, with no more solves than `SLICE` assumes."""
    square = np.linspace(1, 9, 2000)
    vector = rotation(2000, 4)
    count = 300
    near = modes_nearest(solver(square, vector, 5.001), count, 5.001, nothing(2000))
    expected = np.sort(square[np.argsort(abs(square - 5.001))[:count]])
    assert near.converged.all()
    # Ritz values err by the square of the residual; sums of 2,000 terms by 2,000 eps at most.
    assert near.square == pytest.approx(expected, rel=1e-12)
    # The basis has room for so many: it has never been combined anew on the way.
    assert near.products < BASIS_VECTORS_PER_MODE * count + EXTRA_BLOCKS * BLOCK


def test_few_directions_are_searched_whole():
    """Search seven free directions of twenty: the basis ends where they end."""
    operator = Known(np.arange(1.0, 21), rotation(20, 3))
    held_modes = held_out(operator.vector[:, :13], np.empty((20, 0)))
    low_end = LowEnd(operator, 21.0, 30.0)
    for near in (
        modes_nearest(solver(operator.square, operator.vector, 0.0), 7, 0.0, held_modes),
        modes_below(low_end, 7, held_modes),
    ):
        assert near.converged.all()
        # Round-off of what a mode at zero is lifted to.
        assert near.square == pytest.approx(operator.square[13:], rel=1e-11)
        assert near.products in (7, 7 * low_end.degree)


@pytest.mark.parametrize("count", [1, 6, 25])
@pytest.mark.parametrize("spectrum", ["even", "negative", "edge"])
def test_highest_of_a_known_spectrum(spectrum, count, monkeypatch):
    """Find the largest eigenpairs without the held ones, with many restarts of a small basis."""
    monkeypatch.setattr(krylov, "ROWS_COMBINED_TOGETHER", 64)
    square = {
        "even": np.linspace(0, 100, 300),
        "negative": np.linspace(-300, -1, 300),
        "edge": 1 - np.linspace(0, 1, 300)[::-1] ** 2,
    }[spectrum]
    vector = rotation(300, 7)
    held_modes = held_out(vector[:, :5], vector[:, -4:-2])
    operator = Known(square, vector)
    near = modes_from_top(operator.apply, count, held_modes, 20_000)
    expected = np.r_[5:296, 298:300][-count:]
    assert near.converged.all()
    assert len(near.converged) == count
    assert near.products == operator.products
    # eps of the norm, at most 300, beside the smallest value, 1; sums add a factor of ten.
    assert near.square == pytest.approx(square[expected], rel=1e-12)
    # Each of up to some twenty restarts rounds once more.
    round_off = 20 * 300 * EPS
    assert near.vector.T @ near.vector == pytest.approx(np.eye(count), abs=round_off)
    assert abs(held_modes.found.T @ near.vector).max() < round_off
    assert abs(held_modes.null.T @ near.vector).max() < round_off
    # The residual, relative to the eigenvalue, once more from the vectors themselves.
    misfit = operator.apply(near.vector) - near.vector * near.square
    limit = TOLERANCE * abs(near.square) + round_off * abs(square).max()
    assert (np.linalg.norm(misfit, axis=0) <= 1.01 * limit).all()


def test_products_from_the_top_end_where_they_shall():
    """Allow too few products: some modes are marked, and the number of products is kept.

    It exceeds the limit by less than a block.
    """
    theta = np.concatenate([np.linspace(1, 2, 1485), np.linspace(3, 9, 15)])
    near = modes_from_top(lambda block: theta[:, None] * block, 30, nothing(1500), 400)
    assert 400 <= near.products < 400 + krylov.MAX_TOP_WIDTH
    residual = np.linalg.norm((theta[:, None] - near.square) * near.vector, axis=0)
    assert ((residual < TOLERANCE * near.square) == near.converged).all()
    assert 10 <= near.converged.sum() < 30
    assert near.square[near.converged] == pytest.approx(theta[-30:][near.converged], rel=1e-12)


@pytest.mark.parametrize("edge", [0.02, 1.0, 20.0])
def test_the_polynomial_is_that_of_chebyshev(edge):
    """Compare with numpy's polynomial in the eigenvectors; a mode at zero is lifted by e^10 / 2."""
    operator = Known(np.linspace(0, 90, 40), rotation(40, 1))
    low_end = LowEnd(operator, edge, 100.0)
    x = (100 + edge - 2 * operator.square) / (100 - edge)
    lifted = Chebyshev.basis(low_end.degree)(x)
    applied = operator.vector.T @ low_end.apply(operator.vector)
    # Round-off of each of `degree` steps grows by the degree at most.
    error = low_end.degree**2 * np.finfo(float).eps * abs(lifted).max()
    assert applied == pytest.approx(np.diag(lifted), abs=10 * error)
    # The degree is whole and odd: off by one at most.
    off = np.arccosh((100 + edge) / (100 - edge))
    assert abs(np.log(2 * lifted[0]) - LOG_TWICE_LIFT_AT_ZERO) < off + 2 * np.exp(
        -2 * LOG_TWICE_LIFT_AT_ZERO
    )
    assert operator.products == 40 * low_end.degree


def test_frequencies_come_back():
    """Invert the polynomial below the edge; vectors that are not lifted are at most at the edge."""
    low_end = LowEnd(Known(np.ones(1)), 3.0, 100.0)
    square = np.linspace(-1, 3, 9)
    lifted = Chebyshev.basis(low_end.degree)((103 - 2 * square) / 97)
    assert low_end.square(lifted) == pytest.approx(square, abs=1e-13 * 3)
    assert low_end.square(np.array([-5.0, 0.3])) == pytest.approx(3.0)


def test_a_mode_above_the_top_is_not_lifted():
    """Apply the polynomial above its interval, where an odd degree makes it negative."""
    for edge in (0.03, 0.5, 7.0):
        # Along the axes: what grows out of range would reach the others by round-off.
        low_end = LowEnd(Known(np.array([0.0, 101.0, 150.0])), edge, 100.0)
        value = np.diag(low_end.apply(np.eye(3)))
        assert low_end.degree % 2 == 1
        assert value[0] > 100
        assert (value[1:] < -1).all()


@pytest.mark.parametrize("count", [1, 40])
def test_lowest_of_a_known_spectrum(count):
    """Find the lowest eigenpairs without the held ones."""
    square = np.concatenate([np.zeros(5), np.linspace(1, 100, 395)])
    operator = Known(square, rotation(400, 1))
    edge = 1.08 * square[5 + 3 + count - 1]
    held_modes = Held(sp.csc_matrix(operator.vector[:, :5]), operator.vector[:, [6, 8, 9]])
    expected = np.setdiff1d(np.arange(5, 400), [6, 8, 9])[:count]
    # Vectors from outside are turned round by `outward`.
    lowest = modes_below(LowEnd(operator, edge, 101.0), count, held_modes)
    assert lowest.converged.all()
    # Wrong by the square of the residual, and by round-off of what a mode at zero is lifted to.
    assert lowest.square == pytest.approx(square[expected], rel=1e-11)
    # A residual over the least distance of a lifted mode from one that is not: 1 and more.
    lifted = np.cosh(LOG_TWICE_LIFT_AT_ZERO)
    assert abs(abs(lowest.vector.T @ operator.vector[:, expected]) - np.eye(count)).max() < (
        400 * TOLERANCE * lifted
    )
    assert lowest.products == operator.products
    # Round-off of a product of 400 terms that are held out last of all.
    assert abs(held_modes.found.T @ lowest.vector).max() < 400 * EPS
