"""Find modes nearest a shift, from the top or below an edge, by block Lanczos.

The eigenvalues of (A - sigma)^-1 that are largest in size belong to the modes nearest sigma. A
direct solver solves for a block of right-hand sides at a third of the cost of single ones, and a
block finds as many modes of a degenerate frequency as it has columns. The whole basis is kept
orthogonal, so that no mode is found twice. Modes that are known already are deflated: all vectors
stay orthogonal to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, cholesky, eigh, qr, solve_triangular

from modal.solvers.chebyshev import WIDTHS
from modal.solvers.low_end import LowEnd
from modal.tools.arrays import Bools, Floats
from modal.tools.blas import blas_threads
from modal.tools.progress import progress

BLOCK = 12
"""Number of right-hand sides of one solve. With twice as many, each costs four fifths; but 300
modes then take 1.4 times as many solves, and as many more vectors to be kept orthogonal."""
TOLERANCE = 1e-10
"""Residual of a converged mode, relative to its eigenvalue of (A - sigma)^-1, or of A for the
highest modes. The relative error of omega^2 - sigma, or of omega^2, is then no larger. The residual
of A after solves, which a `ModeSet` states, may be |A| / omega^2 times as large; it was 50 times as
large for the lowest 100 modes of 35,201 spheres."""
BASIS_VECTORS_PER_MODE = 2.5
"""Vectors of the basis for each wanted mode, besides `EXTRA_BLOCKS`. Several hundred modes then
converge without a restart, which combines the whole basis anew."""
EXTRA_BLOCKS = 8
"""Blocks of the basis besides those for the wanted modes."""
BASIS_VECTORS_PER_LIFTED_MODE = 1.8
"""Vectors of the basis for each mode that the polynomial of `modal.solvers.low_end` enlarges.
Packings use 1.5; the rest is for spectra that are harder."""
LIFTED_MODES_PER_COLUMN = 45
"""Wanted modes for each column of a block, where a polynomial enlarges the lowest modes; the width
of the block is one of `WIDTHS`. A product of the whole basis with a block waits
for memory: with 3,000 vectors it runs at 14, 23 and 33 GFlop/s for 12, 24 and 48 columns. Blocks
that are wider in proportion take more vectors: 496 modes took 1.48 each with 12 columns, 1.74 with
24; 20 modes took 5.6 and 8.8 with 8 and 16."""
EPS = float(np.finfo(float).eps)
MAX_LOST_ORTHOGONALITY = 1e-10
"""Largest overlap of a new block with the blocks before, as estimated from the growth of round-off,
with which the block is made orthogonal to the last two blocks alone. A basis that is orthogonal to
the root of round-off gives eigenvalues to round-off (H. D. Simon, Math. Comp. 42, 115, 1984)."""
MAX_TOP_WIDTH = 4
"""Columns of a block from the top of the spectrum, where products cost less than the basis."""
ROOM = 4
"""Least ratio of the free dimensions to the number of modes that are wanted from the top."""
MIN_PIVOT_RATIO = 1e-5
"""Least ratio of pivots of columns that count as independent. From 1e-8 on the Gram matrix is lost
in round-off."""
MIN_REMAINDER = 1e-3
"""Least part of a column that must be new for one pass of Gram-Schmidt to suffice."""
ROWS_COMBINED_TOGETHER = 4096
"""Rows of the basis that are combined in one product."""
MIN_NUMBERS_FOR_THREADS = 1e6
"""Least size of a block, in numbers, for which threads share its products: 48 columns of 8,800
spheres, or 12 of 35,201. The lowest 100 modes of 6,000 spheres take two thirds of the time with one
thread."""
SEED = 20170729
"""Seed of the start block: the same network gives the same digits every time."""


class CheckSchedule(NamedTuple):
    """When to solve the projected eigenproblem, as numbers of vectors for each mode.

    first: vectors for each wanted mode before the first check; next: further vectors for each mode
    that is still missing.
    """

    first: float
    next: float


CHECKS = CheckSchedule(2.0, 1.5)
CHECKS_LIFTED = CheckSchedule(1.45, 1.0)
"""Schedule for modes that the polynomial of `modal.solvers.low_end` enlarges: they need fewer
vectors."""


def start_block(size: int, width: int, round: int = 0) -> Floats:
    """Return random columns (size, width) from which an iteration starts.

    An iteration finds at most `width` modes of one frequency: the combinations that its start block
    is not orthogonal to. Each further `round` therefore starts from other columns.
    """
    return np.random.default_rng(SEED + round).standard_normal((size, width))


@dataclass
class Held:
    """Known modes that an iteration excludes: its vectors are kept orthogonal to them.

    Attributes
    ----------
    null : sparse matrix (size, z)
        An orthonormal basis of the zero modes.
    found : ndarray (size, f)
        Unit vectors of the modes that were found before.
    """

    null: sp.csc_matrix
    found: Floats

    def take_out_of(self, block: Floats) -> None:
        """Subtract from a block (size, k), in place, its components along the known modes."""
        block -= self.null @ (self.null.T @ block)
        block -= self.found @ (self.found.T @ block)

    @property
    def free(self) -> int:
        """Return the dimension of the space orthogonal to the known modes."""
        return self.found.shape[0] - self.null.shape[1] - self.found.shape[1]


@dataclass
class Nearest:
    """The modes that an iteration has found, in ascending order.

    Attributes
    ----------
    square : ndarray (k,)
        omega^2, 1/s^2.
    vector : ndarray (size, k)
        Unit vectors.
    converged : ndarray (k,) of bool
        Whether the residual is below `TOLERANCE` of the eigenvalue.
    products : int
        Solves, or products with A, counted by single vectors.
    """

    square: Floats
    vector: Floats
    converged: Bools
    products: int


class Spectrum(NamedTuple):
    """The operator whose largest eigenvalues are computed, and the meaning of these.

    apply: function that multiplies a block (size, width) by the operator. rank: function that
    returns numbers (k,), largest for the wanted eigenvalues (k,). square: function that returns the
    omega^2 (k,), 1/s^2, of eigenvalues (k,).
    """

    apply: Callable[[Floats], Floats]
    rank: Callable[[Floats], Floats]
    square: Callable[[Floats], Floats]


class Limits(NamedTuple):
    """The size of an iteration.

    width: columns of a block. basis: number of vectors after which the iteration restarts. vectors:
    approximate number of vectors that are multiplied in all. checks: when the projected
    eigenproblem is solved. tolerance: residual of a converged mode, relative to its eigenvalue.
    """

    width: int
    basis: int
    vectors: int
    checks: CheckSchedule
    tolerance: float = TOLERANCE


def modes_nearest(
    solve: Callable[[Floats], Floats], count: int, sigma: float, held: Held
) -> Nearest:
    """Find the `count` eigenpairs of A nearest `sigma`, 1/s^2, and mark those that converged.

    `solve` applies (A - sigma)^-1 to a block (size, k). The search ends after solves for 5 `count`
    vectors and 40 blocks, and also returns pairs that have not converged.
    """
    spectrum = Spectrum(solve, np.abs, lambda inverse: sigma + 1 / inverse)
    limits = Limits(
        width=min(BLOCK, max(1, held.free // 8)),
        basis=int(BASIS_VECTORS_PER_MODE * count) + EXTRA_BLOCKS * BLOCK,
        vectors=5 * count + 40 * BLOCK,
        checks=CHECKS,
    )
    return _find_largest(spectrum, count, held, limits)


def modes_below(low_end: LowEnd, count: int, held: Held, tolerance: float = TOLERANCE) -> Nearest:
    """Find the `count` lowest eigenpairs of A, all below the edge of `low_end`.

    `tolerance` is the residual relative to an eigenvalue of the polynomial. The search ends after 5
    `count` vectors and 40 blocks, and also returns pairs that have not converged. `products` of the
    result is the number of products with A.
    """
    max_width = max(WIDTHS[0], count // LIFTED_MODES_PER_COLUMN)
    width = max(width for width in WIDTHS if width <= max_width)
    limits = Limits(
        width=min(width, max(1, held.free // 8)),
        basis=int(BASIS_VECTORS_PER_LIFTED_MODE * count) + EXTRA_BLOCKS * BLOCK,
        vectors=5 * count + 40 * BLOCK,
        checks=CHECKS_LIFTED,
        tolerance=tolerance,
    )
    spectrum = Spectrum(low_end.apply, np.positive, low_end.square)
    modes = _find_largest(spectrum, count, held, limits, lifted=True)
    modes.products *= low_end.degree
    return modes


def modes_from_top(apply: Callable[[Floats], Floats], count: int, held: Held, most: int) -> Nearest:
    """Find the `count` largest eigenpairs of A, and mark those that converged.

    `apply` multiplies a block (size, k) by A; about `most` columns are multiplied in all. The free
    space must have more than `ROOM` times `count` dimensions.
    """
    spectrum = Spectrum(lambda block: apply(np.ascontiguousarray(block)), np.positive, np.positive)
    limits = Limits(min(MAX_TOP_WIDTH, count), 3 * count + 40, most, CHECKS)
    return _find_largest(spectrum, count, held, limits)


def orthonormal(block: Floats, held: Held, basis: Floats | None = None) -> Floats:
    """Return an orthonormal basis (size, w) of a block (size, w), orthogonal to the known modes.

    It is also orthogonal to an orthonormal `basis` (size, k), if one is given. The block is
    overwritten. The second pass of Gram-Schmidt is left out if the first one left at least
    `MIN_REMAINDER` of each column, so that round-off cannot have grown by more than its inverse.
    """
    if basis is None:
        return _orthogonalise(block, block[:, :0], held).block
    for _ in range(2):
        norm = np.linalg.norm(block, axis=0)
        held.take_out_of(block)
        block -= basis @ (basis.T @ block)
        block, factor = _orthonormal_columns(block)
        if (abs(factor.diagonal()) >= MIN_REMAINDER * norm).all():
            break
    block, _ = _orthonormal_columns(block)
    return block


def _find_largest(
    spectrum: Spectrum, count: int, held: Held, limits: Limits, *, lifted: bool = False
) -> Nearest:
    """Find eigenpairs as `_iterate` does, with as many BLAS threads as are fastest for the size."""
    many_numbers = len(held.found) * limits.width >= MIN_NUMBERS_FOR_THREADS
    with blas_threads(shared=many_numbers):
        return _iterate(spectrum, count, held, limits, lifted)


def _iterate(spectrum: Spectrum, count: int, held: Held, limits: Limits, lifted: bool) -> Nearest:
    """Find the `count` eigenpairs of a symmetric operator whose eigenvalues rank highest.

    `lifted` tells whether the operator is a polynomial, which allows a cheaper orthogonalisation. A
    full basis restarts with the best combinations of its vectors (thick restart: K. Wu and H.
    Simon, SIAM J. Matrix Anal. Appl. 22, 602, 2000); a basis that spans the whole free space needs
    no restart.
    """
    width = limits.width
    size = len(held.found)
    max_dimension = min(limits.basis, held.free)
    restart_dimension = (max_dimension + count) // 2
    basis = np.empty((size, max_dimension + width), order="F")
    projected = np.zeros((max_dimension + width, max_dimension + width))
    basis[:, :width] = orthonormal(start_block(size, width, held.found.shape[1]), held)
    dimension = width
    next_check = limits.checks.first * count
    just_restarted = False
    round_off = _RoundOff()
    for step in progress(limits.vectors // width + 2, "Lanczos"):
        last = slice(dimension - width, dimension)
        block = spectrum.apply(basis[:, last])
        expected_overlap = np.inf
        if lifted and not just_restarted:
            expected_overlap = round_off.expected_overlap
        new = _orthogonalise(
            block,
            basis[:, :dimension],
            held,
            just_restarted=just_restarted,
            expected_overlap=expected_overlap,
        )
        round_off.advance(new)
        projected[last, :dimension] = new.components.T
        just_restarted = False
        full = dimension + width > max_dimension
        vectors_used = (step + 1) * width
        ended = vectors_used >= limits.vectors or (full and max_dimension == held.free)
        # The small eigenproblem is not free: each missing mode needs more than one vector.
        if dimension >= next_check or full or ended:
            value, vector = eigh(
                projected[:dimension, :dimension], driver="evd", check_finite=False
            )
            best = np.argsort(-spectrum.rank(value), kind="stable")
            chosen = best[:count]
            residual = np.linalg.norm(new.coupling @ vector[-width:, chosen], axis=0)
            converged = residual <= limits.tolerance * abs(value[chosen])
            if converged.all() or ended:
                break
            if full:
                best = best[:restart_dimension]
                combine(basis[:, :dimension], vector[:, best])
                projected[:] = 0
                projected[range(restart_dimension), range(restart_dimension)] = value[best]
                dimension = restart_dimension
                just_restarted = True
                # Combinations are as far from invariant as their blocks overlap.
                lifted = False
            missing = count - converged.sum()
            next_check = dimension + max(width, limits.checks.next * missing)
        basis[:, dimension : dimension + width] = new.block
        dimension += width
    square = spectrum.square(value[chosen])
    order = np.argsort(square)
    combine(basis[:, :dimension], vector[:, chosen[order]])
    basis.resize((size, len(chosen)), refcheck=False)  # gives the rest back without a copy
    return Nearest(square[order], basis, converged[order], vectors_used)


class _NewBlock(NamedTuple):
    """A block that was made orthogonal to a basis V.

    block (size, w): Q, orthonormal and orthogonal to V. components (k, w): V^T times the original
    block. coupling (w, w): R, such that the original block, without the known modes, is V
    components + Q R. overlap: remaining overlap of Q with V.
    """

    block: Floats
    components: Floats
    coupling: Floats
    overlap: float


class _RoundOff:
    """Estimate how far a new block overlaps with the basis before its second orthogonalisation."""

    def __init__(self) -> None:
        self.largest_component = 0.0
        self.last_coupling = 0.0
        self.overlap_before = EPS
        self.overlap = EPS

    @property
    def expected_overlap(self) -> float:
        """Return the overlap of the next block, by the recurrence of Lanczos."""
        return (
            self.largest_component * (EPS + self.overlap) + self.last_coupling * self.overlap_before
        )

    def advance(self, new: _NewBlock) -> None:
        """Update the estimate by a new block."""
        self.largest_component = max(self.largest_component, abs(new.components).max())
        self.last_coupling = float(np.linalg.norm(new.coupling, 2))
        self.overlap_before = self.overlap
        self.overlap = new.overlap


def _orthogonalise(
    block: Floats,
    basis: Floats,
    held: Held,
    *,
    just_restarted: bool = False,
    expected_overlap: float = np.inf,
) -> _NewBlock:
    """Make a block (size, w), which is overwritten, orthogonal to a basis V (size, k).

    This takes two passes of Gram-Schmidt. In exact arithmetic a new block overlaps with the last
    two blocks of V alone, so the first pass removes these; a basis that has just been restarted
    overlaps with every column, and the first pass removes all. The second pass removes the
    remainder due to round-off: along all of V, or along the last two blocks if `expected_overlap`
    is at most `MAX_LOST_ORTHOGONALITY` of what the first pass leaves. If a column of the block
    depends on the others, QR puts an arbitrary direction in its place, which may show further modes
    of a degenerate frequency.
    """
    width = block.shape[1]
    components = np.zeros((basis.shape[1], width))
    first = 0
    if not just_restarted:
        first = max(0, basis.shape[1] - 2 * width)
    block, factor = _remove_components(block, basis, first, held, components, np.eye(width))
    coupling = factor
    overlap = EPS
    smallest_left = abs(factor.diagonal()).min()
    if expected_overlap < MAX_LOST_ORTHOGONALITY * smallest_left:
        overlap = expected_overlap / smallest_left
    else:
        first = 0
    block, factor = _remove_components(block, basis, first, held, components, coupling)
    return _NewBlock(block, components, factor @ coupling, overlap)


def _remove_components(
    block: Floats, basis: Floats, first: int, held: Held, components: Floats, coupling: Floats
) -> tuple[Floats, Floats]:
    """Remove from a block its parts along the basis, from column `first` on, and orthonormalise it.

    The parts are added to `components` (k, w); Returns Q and R; `coupling` (w, w) times the present
    block is the original block.
    """
    held.take_out_of(block)
    inside = basis[:, first:].T @ block
    block -= basis[:, first:] @ inside
    components[first:] += inside @ coupling
    return _orthonormal_columns(block)


def _orthonormal_columns(block: Floats) -> tuple[Floats, Floats]:
    """Return Q (size, w) and R (w, w) of a block (size, w), which is overwritten.

    R is the Cholesky factor of the Gram matrix, and a second pass removes the round-off
    (CholeskyQR2: Y. Yamamoto et al., Electron. Trans. Numer. Anal. 44, 306, 2015). This uses matrix
    products and is faster than Householder's reflections, which work column by column. Reflections
    are used only if columns are nearly linearly dependent.
    """
    gram = block.T @ block
    try:
        factor = cholesky(gram, check_finite=False)
    except LinAlgError:
        factor = np.zeros_like(gram)
    pivots = factor.diagonal()
    if not pivots.min() > MIN_PIVOT_RATIO * pivots.max():
        q, r = qr(block, overwrite_a=True, mode="economic", check_finite=False)
        return q, r
    inverse = solve_triangular(factor, np.eye(len(factor)), check_finite=False)
    return block @ inverse, factor


def combine(basis: Floats, mixing: Floats) -> None:
    """Replace the first columns of `basis` (size, k) by basis @ `mixing`, `mixing` (k, c), c <= k.

    The other columns become meaningless. Rows are combined in place, a part of them at a time, so
    that basis and product are never in memory at once.
    """
    dimension, count = mixing.shape
    for first in range(0, len(basis), ROWS_COMBINED_TOGETHER):
        rows = slice(first, first + ROWS_COMBINED_TOGETHER)
        basis[rows, :count] = basis[rows, :dimension] @ mixing
