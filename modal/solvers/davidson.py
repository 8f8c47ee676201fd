"""Find the lowest modes by products with A and a cheap approximation of its inverse.

The method is that of Davidson in blocks (E. R. Davidson, J. Comput. Phys. 17, 87, 1975). Ritz
vectors approximate the modes in a basis. The approximate inverse, applied to the residuals of some
of them, extends the basis, which is orthonormal. A full basis restarts from its lowest Ritz vectors
and from the previous ones of the modes that are being improved. With the latter the restarts cost
hardly any convergence (A. Stathopoulos, SIAM J. Sci. Comput. 29, 481, 2007). A solution by
conjugate gradients for every vector of a Krylov space takes an approximate inverse some 25 times;
here it is taken once for every vector.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from modal.solvers.lanczos import SEED, Held, Nearest, combine, orthonormal
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.blas import blas_threads
from modal.tools.progress import Minute

TOLERANCE = 1e-7
"""Residual |A v - omega^2 v| of a converged mode, divided by omega^2 - sigma. The relative error of
omega^2 is about the square of this, divided by the relative distance of the next modes."""
WIDTH = 16
"""Number of modes that are improved at a time: two groups of columns of the multigrid cycle."""
GROUP = 8
"""Columns that the approximate inverse takes together: fewer cost as much."""
GUARDS = 24
"""Number of Ritz vectors beyond the wanted ones that a restart keeps. Where a list ends among modes
of nearly equal frequency, as in cubes, it takes 0.72 times as many cycles with 24 as with 8."""
BLOCKS = 3
"""Blocks of new vectors between restarts. With 8, a list takes 0.95 times as many cycles, and more
time and memory for its basis."""
MAX_STEPS_PER_BLOCK = 400
"""Largest number of steps for every `WIDTH` wanted modes."""
MAX_CHANGE = 10.0
"""Largest change of omega^2 of a converged pair, in units of the tolerance times omega^2 - sigma; a
larger one means that another mode has taken its place."""
DEPENDENT = 1e-8
"""Norm below which a previous Ritz vector counts as a combination of the present ones."""


class Operators(NamedTuple):
    """The products of a search about `sigma`, 1/s^2, below the spectrum.

    apply: function that multiplies a block (size, k) by A. precondition: function that applies a
    symmetric, positive definite approximation of (A - sigma)^-1.
    """

    apply: Callable[[Floats], Floats]
    precondition: Callable[[Floats], Floats]
    sigma: float


class Ritz(NamedTuple):
    """Ritz pairs of a basis: omega^2 (m,), ascending, and their coefficients (m, m)."""

    square: Floats
    vector: Floats


class Basis:
    """An orthonormal basis V (size, m), the projected matrix V^T A V, and its Ritz pairs."""

    def __init__(self, operators: Operators, held: Held, max_dimension: int) -> None:
        self.operators = operators
        self.held = held
        self.max_dimension = max_dimension
        self.dimension = 0
        self.vectors = np.empty((len(held.found), max_dimension), order="F")
        self.projected = np.zeros((max_dimension, max_dimension))

    def room_for(self, columns: int) -> bool:
        """Tell whether a block of columns still fits."""
        return self.dimension + columns <= self.max_dimension

    def extend(self, block: Floats) -> Ritz:
        """Add the directions of a block (size, k), which is overwritten; return the Ritz pairs."""
        first = self.dimension
        last = first + block.shape[1]
        new = orthonormal(block, self.held, self.vectors[:, :first])
        self.vectors[:, first:last] = new
        product = self.operators.apply(np.ascontiguousarray(new))
        self.dimension = last
        self.projected[:last, first:last] = self.current.T @ product
        self.projected[first:last, :first] = self.projected[:first, first:last].T
        # Only one triangle is read, so that round-off cannot make the matrix unsymmetric.
        square, vector = eigh(self.projected[:last, :last], driver="evd", check_finite=False)
        return Ritz(square, vector)

    @property
    def current(self) -> Floats:
        """The vectors (size, m) of the basis."""
        return self.vectors[:, : self.dimension]

    def residual(self, ritz: Ritz, places: Ints) -> Floats:
        """Return the residuals A v - omega^2 v (size, k) of Ritz pairs."""
        shape = self.current @ ritz.vector[:, places]
        shape = np.ascontiguousarray(shape)
        residual = self.operators.apply(shape)
        shape *= ritz.square[places]
        residual -= shape
        if self.held.found.shape[1]:
            # Known modes are exact to the tolerance only; their part would hide convergence.
            self.held.take_out_of(residual)
        return residual

    def take(self, mixing: Floats) -> Floats:
        """Return combinations (size, k) of the vectors, whose memory they take over."""
        combine(self.current, mixing)
        self.vectors.resize((len(self.vectors), mixing.shape[1]), refcheck=False)
        return self.vectors

    def restart(self, ritz: Ritz, kept: int, previous: Floats) -> None:
        """Reduce the basis to its `kept` lowest Ritz vectors and to `previous` ones.

        `previous` (m', k) are the coefficients of Ritz vectors in the first m' vectors of V.
        """
        lowest = ritz.vector[:, :kept]
        before = np.zeros((self.dimension, previous.shape[1]))
        before[: len(previous)] = previous
        for _ in range(2):
            before -= lowest @ (lowest.T @ before)
        factor_q, factor_r = np.linalg.qr(before)
        is_new = abs(factor_r.diagonal()) > DEPENDENT
        mixing = np.concatenate([lowest, factor_q[:, is_new]], axis=1)
        projected = mixing.T @ self.projected[: self.dimension, : self.dimension] @ mixing
        combine(self.current, mixing)
        self.dimension = mixing.shape[1]
        self.projected[:] = 0
        self.projected[: self.dimension, : self.dimension] = (projected + projected.T) / 2


def lowest_modes(
    operators: Operators, count: int, held: Held, tolerance: float = TOLERANCE
) -> Nearest:
    """Find the `count` lowest eigenpairs of A, all above `sigma`, and mark those that converged.

    `tolerance` is the residual relative to omega^2 - sigma. `products` of the result is the number
    of approximate inverses, counted by single vectors.
    """
    # The loops of a cycle have threads of their own, which wait for work while BLAS computes: with
    # threads of BLAS beside them 20 modes of 20,000 spheres take 1.7 times as long on two cores.
    with blas_threads(shared=False):
        return _iterate(operators, count, held, tolerance)


def _iterate(operators: Operators, count: int, held: Held, tolerance: float) -> Nearest:
    """Find modes as `lowest_modes` does."""
    kept = min(count + GUARDS, held.free)
    basis = Basis(operators, held, min(kept + (BLOCKS + 1) * WIDTH, held.free))
    ritz = _start(basis, kept)
    cycles = kept
    progress = Progress(kept, operators.sigma, tolerance)
    previous = np.empty((0, 0))
    for _ in range(MAX_STEPS_PER_BLOCK * (1 + count // WIDTH)):
        progress.forget_changed(ritz.square)
        if progress.converged[:count].all():
            # Pairs that converged first may have been improved, or displaced, since.
            _note_all(progress, basis, ritz, count)
        if progress.converged[:count].all() or basis.dimension == held.free:
            break
        targets = progress.targets(count)
        residual = basis.residual(ritz, targets)
        progress.note(targets, ritz.square, residual)
        progress.tell(count)
        block = operators.precondition(residual)
        cycles += len(targets)
        if basis.max_dimension == held.free:
            block = block[:, : held.free - basis.dimension]
        if basis.room_for(block.shape[1]):
            previous = ritz.vector[:, targets]
        else:
            basis.restart(ritz, kept, previous)
            # The Ritz vectors of this step are now the first vectors of the basis.
            previous = np.eye(kept)[:, targets]
        ritz = basis.extend(block)
    _note_all(progress, basis, ritz, count)
    square = ritz.square[:count].copy()
    vector = basis.take(ritz.vector[:, :count])
    return Nearest(square, vector, progress.converged[:count].copy(), cycles)


def _start(basis: Basis, kept: int) -> Ritz:
    """Fill an empty basis with `kept` random vectors, each after an approximate inverse.

    Vectors of each search, and of each block, are different.
    """
    size, n_found = basis.held.found.shape
    for first in range(0, kept, WIDTH):
        random = np.random.default_rng([SEED, n_found, first])
        block = random.standard_normal((size, min(WIDTH, kept - first)))
        ritz = basis.extend(basis.operators.precondition(block))
    return ritz


def _note_all(progress: Progress, basis: Basis, ritz: Ritz, count: int) -> None:
    """Compute the residuals of all `count` wanted pairs, a block at a time, and store them."""
    for first in range(0, count, WIDTH):
        places = np.arange(first, min(first + WIDTH, count))
        progress.note(places, ritz.square, basis.residual(ritz, places))


class Progress:
    """Which Ritz pairs have converged: the k lowest, by their places.

    Attributes
    ----------
    converged : ndarray (k,) of bool
    square : ndarray (k,)
        omega^2, 1/s^2, at which a pair converged.
    """

    def __init__(self, kept: int, sigma: float, tolerance: float) -> None:
        self.sigma = sigma
        self.tolerance = tolerance
        self.converged: Bools = np.zeros(kept, bool)
        self.square = np.zeros(kept)
        self.minute = Minute()

    def forget_changed(self, square: Floats) -> None:
        """Take pairs whose omega^2 has changed as not converged: another mode has their place."""
        square = square[: len(self.square)]
        change = abs(square - self.square)
        self.converged &= change <= MAX_CHANGE * self.tolerance * (square - self.sigma)

    def note(self, places: Ints, square: Floats, residual: Floats) -> None:
        """Store whether pairs have converged, from their residuals (size, k)."""
        norm = np.linalg.norm(residual, axis=0)
        self.square[places] = square[places]
        self.converged[places] = norm <= self.tolerance * (square[places] - self.sigma)

    def targets(self, count: int) -> Ints:
        """Return the places of the pairs to improve: those that are wanted first.

        Other pairs fill the last group of columns.
        """
        improvable = np.flatnonzero(~self.converged)
        wanted = min(int((improvable < count).sum()), WIDTH)
        columns = -(-wanted // GROUP) * GROUP
        return improvable[:columns]

    def tell(self, count: int) -> None:
        """Print once a minute how many modes have converged."""
        if self.minute.passed():
            converged = int(self.converged[:count].sum())
            self.minute.tell(f"lowest modes: {converged} of {count} have converged")
