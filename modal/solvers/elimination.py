"""Eliminate bodies exactly before multigrid, where motions change from body to body.

Near isostaticity soft motions are not smooth, and rigid motions of aggregates do not represent
them. A set E of bodies of which no two touch is eliminated by the blocks of single bodies,

    S = A_RR - A_RE A_EE^-1 A_ER,

and multigrid solves for the remaining bodies R. The elimination of a body couples its neighbours
with each other. Therefore bodies with few contacts are eliminated, those with the fewest first.
Some of the others have lost most of their stiffness then, alone or together with one that they
touch: the soft motions of loosely held groups. Of these bodies, too, those are eliminated that do
not touch, and so on, until all bodies and pairs are stiff or coupled with too many others.

All bodies are scaled, before the elimination and after each round, so that their own blocks of the
matrix are 1: A_EE^-1 is then 1, and no motion is too soft for single precision.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from modal.solvers import multigrid_loops as loops
from modal.solvers.block_matrices import (
    multiply_rows,
    own_blocks,
    rows_of_blocks,
    scale_to_unit_blocks,
    some_blocks,
)
from modal.solvers.block_products import COLUMNS, ROWS
from modal.solvers.hierarchy import Hierarchy, Transfer
from modal.tools.arrays import Array, Floats, Ints, Singles

MAX_CONTACTS = 4
"""Largest number of contacts of a body that is eliminated first. Of 35,201 spheres with z = 4.45
this takes 14,896; with 3 it takes 10,656, and conjugate gradients take 1.4 times as many steps."""
MIN_STIFFNESS = 0.2
"""Least stiffness of a body that is left, in its softest direction, divided by its stiffness before
the round. With 0.1, 0.2 and 0.3, if pairs are not looked at, case 30 of the study (35,201
spheres with 4.1 contacts) takes 88, 90 and 79 steps for each load, and the set-up of case 29 (3.8
contacts) takes 1.9, 2.3 and 3.9 s."""
MIN_PAIR_STIFFNESS = 0.15
"""Least stiffness of a touching pair, in its softest motion, divided by that of one body while the
other is held. With 0.05, 0.1 and 0.15 the moduli of 125,000 spheres with 4.2 contacts take 43, 39
and 28 steps, and 114 if pairs are not looked at; with 0.25 case 30 of the study takes 55 in place
of 63, but 1.2 times as long."""
MAX_LATER_CONTACTS = 20
"""Largest number of bodies that a body touches, or is coupled with, which is eliminated later. With
20, 30 and 60 the moduli of 4,000 spheres whose stiffnesses spread over 1,000 take 1.4, 1.6 and 2.6
s and 36 to 39 steps; without a limit one body would be coupled with a thousand, and they would take
25 s and 3 GB."""


class Round(NamedTuple):
    """Bodies that are eliminated together, and their coupling to those that are left.

    bodies: their numbers (e,). coupling: sparse matrix (6 n, 6 e), scaled as all bodies are after
    the last round, zero in the rows of bodies that are eliminated in this round or an earlier one.
    """

    bodies: Ints
    coupling: sp.bsr_matrix


class Eliminated(NamedTuple):
    """A matrix A in blocks of n bodies after the elimination of some.

    rounds: the eliminated bodies, the first ones first. remaining: the others (r,). scale: blocks C
    (n, 6, 6), by which all bodies are scaled. schur: C^T S C of the remaining ones.
    """

    rounds: list[Round]
    remaining: Ints
    scale: Floats
    schur: sp.bsr_matrix


def eliminate(matrix: sp.bsr_matrix) -> Eliminated:
    """Eliminate bodies with few contacts, and then those that this leaves with little stiffness.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 n) in blocks (6, 6), symmetric and positive definite
        It is changed.
    """
    n = len(matrix.indptr) - 1
    scale = scale_to_unit_blocks(matrix)
    remaining = np.arange(n)
    rounds: list[Round] = []
    contacts = np.diff(matrix.indptr) - 1
    chosen = independent_bodies(matrix, contacts, MAX_CONTACTS)
    while len(chosen):
        left = np.delete(np.arange(len(remaining)), chosen)
        coupling = some_blocks(matrix, left, chosen)
        added = coupling @ coupling.T.tobsr((ROWS, ROWS))
        # scipy subtracts matrices with sorted blocks in a fraction of the time.
        added.sort_indices()
        matrix = (some_blocks(matrix, left, left) - added).tobsr((ROWS, ROWS))
        rounds.append(Round(remaining[chosen], _among_all(coupling, remaining[left], n)))
        remaining = remaining[left]
        stiffness = np.linalg.eigvalsh(own_blocks(matrix))[:, 0]
        factors = np.tile(np.eye(ROWS), (n, 1, 1))
        factors[remaining] = scale_to_unit_blocks(matrix)
        scale = scale @ factors
        for each in rounds:
            multiply_rows(each.coupling, factors.transpose(0, 2, 1))
        relative_stiffness = np.minimum(
            stiffness / MIN_STIFFNESS,
            pair_stiffness(matrix, MIN_PAIR_STIFFNESS) / MIN_PAIR_STIFFNESS,
        )
        relative_stiffness[np.diff(matrix.indptr) > 1 + MAX_LATER_CONTACTS] = np.inf
        chosen = independent_bodies(matrix, relative_stiffness, 1.0)
    return Eliminated(rounds, remaining, scale, matrix)


def pair_stiffness(matrix: sp.bsr_matrix, limit: float) -> Floats:
    """Return, for each of n bodies, the stiffness (n,) of the softest pair that it belongs to.

    The own blocks of the matrix are 1. If B is the coupling of two bodies, the softest motion of
    both has the stiffness 1 - |B|. Only values below `limit` are computed; others are infinite.
    """
    stiffness = np.full(len(matrix.indptr) - 1, np.inf)
    rows = rows_of_blocks(matrix)
    # The sum of the squares of all entries bounds the norm.
    bound = np.einsum("mij,mij->m", matrix.data, matrix.data)
    (places,) = np.nonzero((bound > (1 - limit) ** 2) & (rows < matrix.indices))
    blocks = matrix.data[places]
    squared_norm = np.linalg.eigvalsh(blocks @ blocks.transpose(0, 2, 1))[:, -1]
    softest = 1 - np.sqrt(squared_norm)
    np.minimum.at(stiffness, rows[places], softest)
    np.minimum.at(stiffness, matrix.indices[places], softest)
    return stiffness


def _among_all(coupling: sp.bsr_matrix, bodies: Ints, n: int) -> sp.bsr_matrix:
    """Return the matrix (6 n, 6 e) that has a coupling in the rows of some bodies, ascending."""
    counts = np.zeros(n + 1, coupling.indptr.dtype)
    counts[bodies + 1] = np.diff(coupling.indptr)
    pointers = np.cumsum(counts, dtype=counts.dtype)
    shape = (ROWS * n, coupling.shape[1])
    return sp.bsr_matrix((coupling.data, coupling.indices, pointers), shape)


class EliminationHierarchy:
    """The approximate inverse of a matrix by elimination of bodies, and multigrid on the others.

    Parameters
    ----------
    matrix : sparse matrix (6 n, 6 n) in blocks (6, 6)
        It is used up, to save memory.
    smooth_motions : ndarray (6 n, 6)
        As in `modal.solvers.hierarchy.Hierarchy`.
    bodies : ndarray of int (n,)
        Order of the bodies in which those that touch are neighbours, as suits the aggregation.
    """

    def __init__(self, matrix: sp.bsr_matrix, smooth_motions: Floats, bodies: Ints) -> None:
        ordered = some_blocks(matrix, bodies, bodies)
        matrix.data = np.empty((0, ROWS, ROWS))
        rounds, remaining, scale, schur = eliminate(ordered)
        del ordered
        motions = smooth_motions.reshape(len(bodies), ROWS, -1)[bodies[remaining]]
        scaled = np.asarray(np.linalg.solve(scale[remaining], motions), float)
        self.hierarchy = Hierarchy(schur, scaled.reshape(ROWS * len(remaining), -1))
        del schur
        # After the remaining bodies follow the eliminated ones, those of the last round first.
        order = remaining[self.hierarchy.order]
        self.couplings = []
        for eliminated, coupling in reversed(rounds):
            every = np.arange(len(eliminated))
            self.couplings.append(Transfer(some_blocks(-coupling, order, every)))
            order = np.append(order, eliminated)
        self.order = bodies[order]
        self.scale_size = float(abs(scale).max())
        places = np.arange(len(bodies) + 1)
        blocks = scale[order] / self.scale_size
        self.scale = Transfer(sp.bsr_matrix((blocks, places[:-1], places)))

    def apply(self, load: Floats) -> Floats:
        """Return the approximate solution for loads (6 n, k)."""
        load = np.ascontiguousarray(load)
        solution = np.empty_like(load)
        load_size = max(load.max(), -load.min()) or 1.0
        for first in range(0, load.shape[1], COLUMNS):
            columns = slice(first, first + COLUMNS)
            x = np.empty((len(self.order), ROWS, COLUMNS), np.float32)
            loops.gather(x, load[:, columns], self.order, 1 / load_size)
            x = self._solve(x)
            loops.scatter(x, solution[:, columns], self.order, load_size * self.scale_size**2)
        return solution

    def _solve(self, load: Singles) -> Singles:
        """Return the approximate solution for a load (n, 6, 8) of bodies in `order`."""
        x = np.zeros_like(load)
        self.scale.add_back(x, load)
        for coupling in reversed(self.couplings):
            rows, columns = coupling.bodies
            coupling.add(x[:rows], x[rows : rows + columns])
        remaining = len(self.hierarchy.order)
        x[:remaining] = self.hierarchy.cycle(x[:remaining])
        for coupling in self.couplings:
            rows, columns = coupling.bodies
            coupling.add_back(x[rows : rows + columns], x[:rows])
        solution = np.zeros_like(x)
        self.scale.add(solution, x)
        return solution


def independent_bodies(matrix: sp.bsr_matrix, values: Array, limit: float) -> Ints:
    """Return bodies, ascending, of which no two touch, each with a value of at most `limit`.

    Those with the least of the `values` (n,) are taken first. At least one body is left.
    """
    pointers = matrix.indptr
    is_free = values <= limit
    chosen = []
    for body in np.argsort(values, kind="stable")[: int(is_free.sum())].tolist():
        if is_free[body]:
            chosen.append(body)
            is_free[matrix.indices[pointers[body] : pointers[body + 1]]] = False
    if chosen and len(chosen) == len(values):
        chosen.pop()
    return np.sort(np.array(chosen, int))
