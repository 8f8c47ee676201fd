"""Davidson's method on matrices of known eigenpairs, with an inverse that is far from exact."""

import numpy as np
import pytest
import scipy.sparse as sp
from operators import rotation

from modal.solvers import davidson
from modal.solvers.davidson import TOLERANCE, Operators, lowest_modes
from modal.solvers.lanczos import Held

EPS = np.finfo(float).eps
SIGMA = -0.01


def operators(square, vector, seed=1, spread=3.0):
    """Return A with these eigenpairs, and an inverse of A - sigma that is wrong by up to `spread`.

    The factors of the eigenvalues vary at random, in a basis that is turned a little against that
    of A.
    """
    size = len(square)
    random = np.random.default_rng(seed)
    wrong = spread ** random.uniform(-1, 1, size)
    root = vector / np.sqrt(square - SIGMA)
    mixing = rotation(size, 7)
    middle = mixing @ (wrong[:, None] * mixing.T)
    return Operators(
        lambda block: vector @ (square[:, None] * (vector.T @ block)),
        lambda block: root @ (middle @ (root.T @ block)),
        SIGMA,
    )


def held_out(null, found):
    """Return both kinds of modes that are held out: null vectors, and modes found before."""
    return Held(sp.csc_matrix(null), found)


def check(near, square, vector, held):
    """Compare modes with the exact ones: values, residuals, directions."""
    count = len(near.square)
    assert near.converged.all()
    # Round-off of the largest eigenvalue, and the square of the residual over a gap.
    round_off = 100 * EPS * square.max()
    assert near.square == pytest.approx(square[:count], rel=1e-9, abs=round_off)
    product = vector @ (square[:, None] * (vector.T @ near.vector))
    residual = np.linalg.norm(product - near.square * near.vector, axis=0)
    assert (residual <= 1.1 * TOLERANCE * (near.square - SIGMA) + round_off).all()
    assert near.vector.T @ near.vector == pytest.approx(np.eye(count), abs=500 * EPS)
    assert abs(held.null.T @ near.vector).max(initial=0) < 500 * EPS
    assert abs(held.found.T @ near.vector).max(initial=0) < 500 * EPS


@pytest.mark.parametrize("count", [1, 20, 50])
def test_lowest_of_a_known_spectrum(count):
    """Find modes through several restarts, and without those that are held out."""
    square = np.concatenate([np.zeros(3), np.linspace(1, 60, 597)])
    vector = rotation(600, 1)
    held = held_out(vector[:, :3], vector[:, 3:7])
    near = lowest_modes(operators(square, vector), count, held)
    check(near, square[7:], vector[:, 7:], held)


def test_all_modes_of_equal_frequency_are_found():
    """Find 24 modes of each of two frequencies, as in crystals, and the end of a third group."""
    square = np.concatenate([np.full(24, 1.0), np.full(24, 1.7), np.linspace(2, 50, 452)])
    vector = rotation(500, 2)
    held = held_out(np.empty((500, 0)), np.empty((500, 0)))
    near = lowest_modes(operators(square, vector), 50, held)
    check(near, square, vector, held)


def test_few_directions_are_searched_whole():
    """Search nine free directions of forty: the basis ends where they end."""
    square = np.arange(1.0, 41)
    vector = rotation(40, 3)
    held = held_out(vector[:, 9:], np.empty((40, 0)))
    for count in (1, 7, 9):
        near = lowest_modes(operators(square, vector), count, held)
        check(near, square[:9], vector[:, :9], held)


def test_what_has_not_converged_is_marked(monkeypatch):
    """Stop early: the marks are those of the residuals."""
    monkeypatch.setattr(davidson, "MAX_STEPS_PER_BLOCK", 12)
    square = np.concatenate([[0.01, 0.02], np.linspace(1, 1.2, 398)])
    vector = rotation(400, 4)
    held = held_out(np.empty((400, 0)), np.empty((400, 0)))
    near = lowest_modes(operators(square, vector, spread=1.5), 12, held)
    product = vector @ (square[:, None] * (vector.T @ near.vector))
    residual = np.linalg.norm(product - near.square * near.vector, axis=0)
    allowed = TOLERANCE * (near.square - SIGMA)
    assert near.converged[:2].all()
    assert not near.converged.all()
    assert (residual[near.converged] <= 1.01 * allowed[near.converged]).all()


def test_a_loose_tolerance_takes_fewer_cycles():
    """Find omega^2 to the square of the tolerance, for less than half of the cycles."""
    square = np.linspace(1, 60, 600)
    vector = rotation(600, 1)
    held = held_out(np.empty((600, 0)), np.empty((600, 0)))
    fine = lowest_modes(operators(square, vector), 6, held)
    coarse = lowest_modes(operators(square, vector), 6, held, 1e-2)
    assert coarse.converged.all()
    assert coarse.products < 0.6 * fine.products
    assert coarse.square == pytest.approx(fine.square, rel=1e-2)
