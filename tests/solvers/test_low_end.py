"""The polynomial that lifts the low end of a spectrum, on matrices whose eigenpairs are known."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.polynomial.chebyshev import Chebyshev
from operators import Known, rotation

from modal.solvers.lanczos import TOLERANCE, Held, modes_below
from modal.solvers.low_end import REACH, LowEnd

pytestmark = pytest.mark.two_ways


@pytest.mark.parametrize("edge", [0.02, 1.0, 20.0])
def test_the_polynomial_is_that_of_chebyshev(edge):
    """Against numpy's, in the eigenvectors; a mode at zero is lifted to e^REACH / 2."""
    known = Known(np.linspace(0, 90, 40), rotation(40, 1))
    low_end = LowEnd(known, edge, 100.0)
    x = (100 + edge - 2 * known.square) / (100 - edge)
    lifted = Chebyshev.basis(low_end.degree)(x)
    found = known.vector.T @ low_end.apply(known.vector)
    # Round-off of each of `degree` steps grows by the degree at most.
    error = low_end.degree**2 * np.finfo(float).eps * abs(lifted).max()
    assert found == pytest.approx(np.diag(lifted), abs=10 * error)
    # The degree is whole and odd: off by one at most.
    off = np.arccosh((100 + edge) / (100 - edge))
    assert abs(np.log(2 * lifted[0]) - REACH) < off + 2 * np.exp(-2 * REACH)
    assert known.products == 40 * low_end.degree


def test_frequencies_come_back():
    """The inverse below the edge; at most the edge for what is not lifted."""
    low_end = LowEnd(Known(np.ones(1)), 3.0, 100.0)
    square = np.linspace(-1, 3, 9)
    lifted = Chebyshev.basis(low_end.degree)((103 - 2 * square) / 97)
    assert low_end.square(lifted) == pytest.approx(square, abs=1e-13 * 3)
    assert low_end.square(np.array([-5.0, 0.3])) == pytest.approx(3.0)


def test_a_mode_above_the_top_is_not_lifted():
    """T_d of an odd degree is negative there."""
    for edge in (0.03, 0.5, 7.0):
        # Along the axes: what grows out of range would reach the others by round-off.
        low_end = LowEnd(Known(np.array([0.0, 101.0, 150.0])), edge, 100.0)
        value = np.diag(low_end.apply(np.eye(3)))
        assert low_end.degree % 2 == 1
        assert value[0] > 100 and (value[1:] < -1).all()


@pytest.mark.parametrize("count", [1, 40])
def test_lowest_of_a_known_spectrum(count):
    """The lowest but the held ones, as true eigenpairs."""
    square = np.concatenate([np.zeros(5), np.linspace(1, 100, 395)])
    known = Known(square, rotation(400, 1))
    edge = 1.08 * square[5 + 3 + count - 1]
    held = Held(sp.csc_matrix(known.vector[:, :5]), known.vector[:, [6, 8, 9]])
    wanted = np.setdiff1d(np.arange(5, 400), [6, 8, 9])[:count]
    # Vectors from outside are turned round by `outward`.
    found = modes_below(LowEnd(known, edge, 101.0), count, held)
    assert found.converged.all()
    # Wrong by the square of the residual, and by round-off of what a mode at zero is lifted to.
    assert found.square == pytest.approx(square[wanted], rel=1e-11)
    # A residual over the least distance of a lifted mode from one that is not: 1 and more.
    lifted = np.cosh(REACH)
    assert abs(abs(found.vector.T @ known.vector[:, wanted]) - np.eye(count)).max() < (
        400 * TOLERANCE * lifted
    )
    assert found.products == known.products
    assert abs(held.found.T @ found.vector).max() < 1e-13
