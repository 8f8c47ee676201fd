"""Eliminate bodies with few contacts exactly before multigrid, since their motion is not smooth.

Near isostaticity soft motions change from body to body, and rigid motions of aggregates do not
represent them. A set E of bodies of which no two touch is eliminated by the blocks of single
bodies,

    S = A_RR - A_RE A_EE^-1 A_ER,

and multigrid solves for the remaining bodies R. The elimination of a body couples its neighbours
with each other. Therefore only bodies with few contacts are eliminated, those with the fewest
first.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from modal.solvers import multigrid_loops as loops
from modal.solvers.hierarchy import Hierarchy
from modal.tools.arrays import Floats, Ints, Singles

MAX_CONTACTS = 4
"""Largest number of contacts of an eliminated body. Of 35,201 spheres with z = 4.45 this takes
14,896; with 3 it takes 10,656, and conjugate gradients take 1.4 times as many steps."""
ROWS = 6
"""Rows of a body."""


class Eliminated(NamedTuple):
    """A matrix A in blocks after the elimination of a set E of bodies; R are the other bodies.

    out, remaining: bodies (e,), (r,) of E and R. inverse: blocks (e, 6, 6) of A_EE^-1. coupling:
    A_RE. schur: S.
    """

    out: Ints
    remaining: Ints
    inverse: Floats
    coupling: sp.bsr_matrix
    schur: sp.bsr_matrix


def eliminate(matrix: sp.bsr_matrix, bodies: Ints) -> Eliminated:
    """Eliminate bodies with few contacts.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 n) in blocks (6, 6), symmetric and positive definite
    bodies : ndarray of int (n,)
        Order of the bodies in which those that touch are neighbours; the result keeps it.
    """
    is_out = np.zeros(len(bodies), bool)
    is_out[independent_bodies(matrix)] = True
    out = bodies[is_out[bodies]]
    remaining = bodies[~is_out[bodies]]
    inverse = np.linalg.inv(some_blocks(matrix, out, out).data)
    coupling = some_blocks(matrix, remaining, out)
    weighted_blocks = coupling.data @ inverse[coupling.indices]
    weighted = sp.bsr_matrix((weighted_blocks, coupling.indices, coupling.indptr), coupling.shape)
    added = weighted @ coupling.T.tobsr((ROWS, ROWS))
    schur = (some_blocks(matrix, remaining, remaining) - added).tobsr((ROWS, ROWS))
    return Eliminated(out, remaining, inverse, coupling, schur)


class EliminationHierarchy:
    """The approximate inverse of a matrix by elimination of bodies, and multigrid on the others.

    Parameters
    ----------
    parts : Eliminated
        The matrix, which is scaled in place.
    smooth_motions : ndarray (6 n, 6)
        As in `modal.solvers.hierarchy.Hierarchy`.
    """

    def __init__(self, parts: Eliminated, smooth_motions: Floats) -> None:
        self.scale = float(parts.schur.diagonal().max())
        self.out = parts.out
        self.remaining = parts.remaining
        parts.schur.data /= self.scale
        parts.coupling.data /= -self.scale
        self.inverse = (parts.inverse * self.scale).astype(np.float32)
        self.coupling = parts.coupling.astype(np.float32)
        self.hierarchy = Hierarchy(parts.schur, smooth_motions[rows_of(parts.remaining)])

    def apply(self, load: Floats) -> Floats:
        """Return the approximate solution for loads (6 n, k)."""
        load = np.ascontiguousarray(load)
        size, count = load.shape
        largest = abs(load).max(axis=0, initial=0.0)
        largest[largest == 0] = 1.0
        solution = np.empty((size, count))
        eliminated = _groups(len(self.out), count)
        reduced = _groups(len(self.remaining), count)
        loops.gather(eliminated, load, self.out, 1 / largest)
        loops.gather(reduced, load, self.remaining, 1 / largest)
        pattern = (self.coupling.indptr, self.coupling.indices, self.coupling.data)
        loops.scale_blocks(eliminated, self.out, self.inverse)
        loops.transfer(reduced, eliminated, *pattern, True)
        reduced = self.hierarchy.cycle(reduced)
        back = np.zeros_like(eliminated)
        loops.transfer(reduced, back, *pattern, False)
        loops.scale_blocks(back, self.out, self.inverse)
        eliminated += back
        loops.scatter(eliminated, solution, self.out, largest / self.scale)
        loops.scatter(reduced, solution, self.remaining, largest / self.scale)
        return solution


def _groups(bodies: int, columns: int) -> Singles:
    """Return an array for columns of bodies in groups, (groups, n, 6, 8)."""
    groups = -(-columns // loops.COLUMNS)
    return np.empty((groups, bodies, ROWS, loops.COLUMNS), np.float32)


def independent_bodies(matrix: sp.bsr_matrix) -> Ints:
    """Return bodies, ascending, of which no two touch, each with at most `MAX_CONTACTS` others."""
    pointers = matrix.indptr
    contacts = np.diff(pointers) - 1
    is_free = contacts <= MAX_CONTACTS
    chosen = []
    for body in np.argsort(contacts, kind="stable")[: int(is_free.sum())].tolist():
        if is_free[body]:
            chosen.append(body)
            is_free[matrix.indices[pointers[body] : pointers[body + 1]]] = False
    if len(chosen) == len(contacts):
        chosen.pop()  # something must remain
    return np.sort(np.array(chosen, int))


def some_blocks(matrix: sp.bsr_matrix, rows: Ints, columns: Ints) -> sp.bsr_matrix:
    """Return the blocks of a matrix in the rows of some bodies and the columns of other bodies."""
    n = len(matrix.indptr) - 1
    places = np.arange(1, len(matrix.data) + 1)
    pattern = sp.csr_matrix((places, matrix.indices, matrix.indptr), (n, n))
    part = pattern[rows][:, columns]
    part.sort_indices()
    shape = (ROWS * len(rows), ROWS * len(columns))
    return sp.bsr_matrix((matrix.data[part.data - 1], part.indices, part.indptr), shape)


def rows_of(bodies: Ints) -> Ints:
    """Return the rows (6 k,) of k bodies."""
    return (bodies[:, None] * ROWS + np.arange(ROWS)).ravel()
