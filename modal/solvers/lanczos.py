"""Block Lanczos for the modes nearest a shift, from the top or below, with known modes held out.

The eigenvalues of (A - sigma)^-1 that are largest in size belong to the modes nearest sigma. A
direct solver answers a block of right-hand sides for a third of the price of single ones, and a
block sees every mode of a degenerate frequency up to its own width. The basis is kept whole and
orthogonal, so no mode comes twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import LinAlgError, cholesky, eigh, qr, solve_triangular

from modal.solvers.chebyshev import WIDTHS
from modal.solvers.low_end import LowEnd
from modal.tools.arrays import Bools, Floats
from modal.tools.blas import blas_threads
from modal.tools.progress import progress

BLOCK = 12
"""Right-hand sides of one solve. Of twice as many each costs four fifths, but 300 modes take 1.4
times as many solves, and so many more vectors to be kept orthogonal."""
TOLERANCE = 1e-10
"""Residual at which a mode counts as converged, relative to its eigenvalue: of (A - sigma)^-1, or
of A for the highest modes. The error of omega^2 - sigma, or omega^2, is then no larger relative to
it. After solves the residual of A, which a `ModeSet` states, may be |A| / omega^2 times as large;
it was 50 times for the lowest 100 of 35,201 spheres."""
BASIS, BLOCKS = 2.5, 8
"""Vectors of the basis for each mode that is asked for, and blocks besides. Several hundred modes
then converge without a restart, which combines the whole basis anew."""
BASIS_LIFTED = 1.8
"""The same for modes that `modal.solvers.low_end` lifts. Of packings 1.5 are used; the rest is for
worse spectra."""
STEPS = 45
"""Modes for each column of a block of these, of `WIDTHS` from the second on. A product of the whole
basis with a block waits for memory: of 3,000 vectors it runs at 14, 23 and 33 GFlop/s for 12, 24
and 48 columns. Blocks that are wider in proportion take more vectors: of 496 modes 1.48 each for 12
columns, 1.74 for 24."""
LOOKS, LOOKS_LIFTED = (2.0, 1.5), (1.45, 1.0)
"""When the basis is looked at: vectors for each mode before the first look; from then on for each
mode that is missing."""
EPS, LOST = float(np.finfo(float).eps), 1e-10
"""Overlap of a new block with those before, by the recurrence of round-off, up to which it is made
orthogonal to the last two alone. A basis that is orthogonal to the root of round-off gives
eigenvalues to round-off (H. D. Simon, Math. Comp. 42, 115, 1984)."""
WIDTH_ABOVE = 4
"""Columns of a block from the top, where products cost less than the basis."""
ROOM = 4
"""Dimensions from the top that are left for each mode, at least."""
DEPENDENT = 1e-5
"""Ratio of pivots below which columns count as nearly dependent: from 1e-8 on a Gram matrix is lost
in round-off."""
ROWS = 4096
"""Rows of the basis that are combined together."""
SHARED = 1e6
"""Numbers of a block from which on threads share its products: for 8,800 spheres of 48 columns, and
35,201 of 12. Of 6,000 spheres the lowest 100 modes take two thirds of the time with one thread."""
SEED = 20170729
"""The same start every time, so that the same network gives the same digits."""


def start_block(size: int, width: int, round: int = 0) -> Floats:
    """Shape (size, width): random columns from which an iteration starts.

    Of the modes of one frequency an iteration finds only combinations that its start block is not
    orthogonal to, at most `width` of them. Each further `round` therefore starts from others.
    """
    return np.random.default_rng(SEED + round).standard_normal((size, width))


def _orthonormal(
    block: Floats, basis: Floats, held: Held, *, anew: bool = False, overlap: float = np.inf
) -> tuple[Floats, Floats, Floats, float]:
    """Make a block orthogonal to the basis V and to the held-out modes.

    Shapes: block (size, w), basis (size, k). Returns Q (size, w), with orthonormal columns that
    are orthogonal to V, the coefficients V^T block (k, w), and R (w, w), such that
    block = V (V^T block) + Q R once the held-out modes are removed; and what Q still overlaps with
    V. The block is overwritten.

    Two passes of Gram-Schmidt. In exact arithmetic a new Lanczos block overlaps only with the last
    two blocks of V, so the first pass removes those; with a basis that has just been restarted
    (`anew`) it overlaps with every column, and the first pass removes all. The second pass removes
    from all of V what round-off has left, unless that is at most `overlap`, and of what the first
    one leaves a part below `LOST`. Where a column of the block depends on the others, QR puts an
    arbitrary direction in its place, which may show further modes of a degenerate frequency.
    """
    width = block.shape[1]
    within = np.zeros((basis.shape[1], width))
    coupling, lost = np.eye(width), EPS
    first = 0 if anew else max(0, basis.shape[1] - 2 * width)
    for second in (False, True):
        held.take_out_of(block)
        inside = basis[:, first:].T @ block
        block -= basis[:, first:] @ inside
        within[first:] += inside @ coupling
        block, factor = _orthonormal_columns(block)
        coupling = factor @ coupling
        if not second:
            least = abs(factor.diagonal()).min()
            first, lost = (first, overlap / least) if overlap < LOST * least else (0, EPS)
    return block, within, coupling, lost


def orthonormal(block: Floats, held: Held) -> Floats:
    """An orthonormal basis (size, w) of a block (size, w), which is overwritten, but for `held`."""
    return _orthonormal(block, block[:, :0], held)[0]


def _orthonormal_columns(block: Floats) -> tuple[Floats, Floats]:
    """Q (size, w) and R (w, w) of a block (size, w), which is overwritten.

    By the Cholesky factor of its Gram matrix; what that leaves, the second pass removes
    (CholeskyQR2: Y. Yamamoto et al., Electron. Trans. Numer. Anal. 44, 306, 2015). These are
    products of matrices, where Householder's reflections take column by column. Columns that nearly
    depend on each other are left to reflections.
    """
    gram = block.T @ block
    try:
        factor = cholesky(gram, check_finite=False)
    except LinAlgError:
        factor = np.zeros_like(gram)
    size = factor.diagonal()
    if not size.min() > DEPENDENT * size.max():
        q, r = qr(block, overwrite_a=True, mode="economic", check_finite=False)
        return q, r
    inverse = solve_triangular(factor, np.eye(len(factor)), check_finite=False)
    return block @ inverse, factor


@dataclass
class Held:
    """Modes that an iteration must not find: its vectors are kept orthogonal to them.

    `null` (size, z) sparse: an orthonormal basis of the zero modes; `found` (size, f): the unit
    vectors of modes found before.
    """

    null: sp.csc_matrix
    found: Floats

    def take_out_of(self, block: Floats) -> None:
        """Subtract from the block (size, k), in place, its components along the held modes."""
        block -= self.null @ (self.null.T @ block)
        block -= self.found @ (self.found.T @ block)

    @property
    def free(self) -> int:
        """Dimension of the space orthogonal to the held modes."""
        return self.found.shape[0] - self.null.shape[1] - self.found.shape[1]


@dataclass
class Nearest:
    """Modes nearest a shift, or the top: omega^2 (k,) ascending, unit vectors (size, k).

    converged (k,) bool: residual below `TOLERANCE` of the eigenvalue; products: solves, or products
    with A, spent on single vectors.
    """

    square: Floats
    vector: Floats
    converged: Bools
    products: int


def modes_nearest(
    solve: Callable[[Floats], Floats], count: int, sigma: float, held: Held
) -> Nearest:
    """The `count` eigenpairs of A nearest `sigma`, of which those that converged are marked.

    `solve` applies (A - sigma)^-1 to a block (size, k). After 5 `count` and 40 blocks of solves at
    most, what has not converged is returned as it is.
    """
    return _largest(
        solve,
        count,
        held,
        width=min(BLOCK, max(1, held.free // 8)),
        limit=int(BASIS * count) + BLOCKS * BLOCK,
        most=5 * count + 40 * BLOCK,
        rank=np.abs,
        square=lambda inverse: sigma + 1 / inverse,
        looks=LOOKS,
    )


def modes_below(low_end: LowEnd, count: int, held: Held) -> Nearest:
    """The `count` lowest eigenpairs of A, all below the edge of `low_end`.

    After 5 `count` and 40 blocks of vectors at most, what has not converged is returned as it is.
    `products` counts those with A.
    """
    found = _largest(
        low_end.apply,
        count,
        held,
        width=min(max(w for w in WIDTHS if w <= max(16, count // STEPS)), max(1, held.free // 8)),
        limit=int(BASIS_LIFTED * count) + BLOCKS * BLOCK,
        most=5 * count + 40 * BLOCK,
        rank=np.positive,
        square=low_end.square,
        looks=LOOKS_LIFTED,
        lifted=True,
    )
    found.products *= low_end.degree
    return found


def modes_from_top(apply: Callable[[Floats], Floats], count: int, held: Held, most: int) -> Nearest:
    """The `count` largest eigenpairs of A, of which those that converged are marked.

    `apply` multiplies a block (size, k) by A; about `most` columns are multiplied at most. More
    than `ROOM` times `count` dimensions must be free.
    """
    return _largest(
        lambda block: apply(np.ascontiguousarray(block)),
        count,
        held,
        width=min(WIDTH_ABOVE, count),
        limit=3 * count + 40,
        most=most,
        rank=np.positive,
        square=np.positive,
        looks=LOOKS,
    )


def _largest(
    apply: Callable[[Floats], Floats], count: int, held: Held, *, width: int, **how: Any
) -> Nearest:
    """As `_found`, with as many threads as pay."""
    with blas_threads(shared=len(held.found) * width >= SHARED):
        return _found(apply, count, held, width=width, **how)


def _found(
    apply: Callable[[Floats], Floats],
    count: int,
    held: Held,
    *,
    width: int,
    limit: int,
    most: int,
    rank: Callable[[Floats], Floats],
    square: Callable[[Floats], Floats],
    looks: tuple[float, float],
    lifted: bool = False,
) -> Nearest:
    """The `count` eigenpairs of a symmetric operator whose eigenvalues `rank` highest.

    `apply` takes blocks (size, `width`), about `most` columns in all; `square` gives the omega^2 of
    eigenvalues; `looks` as `LOOKS`; `lifted`: whether by a polynomial. When the basis has `limit`
    vectors, the iteration restarts with the best combinations of them (thick restart: K. Wu and H.
    Simon, SIAM J. Matrix Anal. Appl. 22, 602, 2000). A basis of all free directions needs none.
    """
    size, limit = len(held.found), min(limit, held.free)
    kept = (limit + count) // 2
    basis = np.empty((size, limit + width), order="F")
    projected = np.zeros((limit + width, limit + width))
    start = start_block(size, width, held.found.shape[1])
    basis[:, :width] = orthonormal(start, held)
    dimension, anew, look = width, False, looks[0] * count
    largest = between = 0.0
    before = lost = EPS
    for step in progress(most // width + 2, "Lanczos"):
        last = slice(dimension - width, dimension)
        block = apply(basis[:, last])
        overlap = largest * (EPS + lost) + between * before if lifted and not anew else np.inf
        block, within, coupling, new = _orthonormal(
            block, basis[:, :dimension], held, anew=anew, overlap=overlap
        )
        largest = max(largest, abs(within).max())
        between = float(np.linalg.norm(coupling, 2))
        before, lost = lost, new
        projected[last, :dimension] = within.T
        anew, full, spent = False, dimension + width > limit, (step + 1) * width
        ended = spent >= most or (full and limit == held.free)
        # The small eigenproblem is not free: every missing mode will need more than one vector.
        if dimension >= look or full or ended:
            value, vector = eigh(
                projected[:dimension, :dimension], driver="evd", check_finite=False
            )
            best = np.argsort(-rank(value), kind="stable")
            chosen = best[:count]
            residual = np.linalg.norm(coupling @ vector[-width:, chosen], axis=0)
            converged = residual <= TOLERANCE * abs(value[chosen])
            if converged.all() or ended:
                break
            if full:
                best = best[:kept]
                _combine(basis[:, :dimension], vector[:, best])
                projected[:] = 0
                projected[range(kept), range(kept)] = value[best]
                # Combinations are as far from invariant as their blocks overlap.
                dimension, anew, lifted = kept, True, False
            look = dimension + max(width, looks[1] * (count - converged.sum()))
        basis[:, dimension : dimension + width] = block
        dimension += width
    found = square(value[chosen])
    order = np.argsort(found)
    _combine(basis[:, :dimension], vector[:, chosen[order]])
    basis.resize((size, len(chosen)), refcheck=False)  # gives the rest back without a copy
    return Nearest(found[order], basis, converged[order], spent)


def _combine(basis: Floats, mixing: Floats) -> None:
    """Replace the first columns of `basis` (size, k) by basis @ `mixing`, `mixing` (k, c), c <= k.

    The other columns keep no meaning. It is done in place, `ROWS` rows at a time, so that basis
    and product never stand in memory together.
    """
    dimension, count = mixing.shape
    for first in range(0, len(basis), ROWS):
        rows = slice(first, first + ROWS)
        basis[rows, :count] = basis[rows, :dimension] @ mixing
