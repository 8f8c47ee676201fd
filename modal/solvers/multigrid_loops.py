"""Loops of a multigrid cycle: Gauss-Seidel by blocks of six rows, eight columns at a time.

Vectors have the shape (n, 6, 8): n bodies with six entries each, eight columns. A block of the
matrix is read once for all columns, which takes hardly longer than for one column. The own blocks
of all matrices are 1. Slabs of bodies are distributed over the threads
(`modal.solvers.hierarchy.in_slabs`).

All is in single precision, which halves memory and time: a cycle only approximates the inverse, and
the iterations around it are in double precision.
"""

from modal.solvers import block_products
from modal.solvers.block_products import COLUMNS, ROWS, add_product, subtract_product
from modal.tools.loops import compiled, fingerprint, prange
from modal.tools.slabs import SLABS

SIZE = ROWS * COLUMNS


def _solve_lower(x, bounds, halves, pointers, columns, diagonal, blocks):
    """Set x, which is a load before, to the solution of (L + 1) x = load: a sweep from zero.

    The bounds (s + 1,) of the slabs, their two `halves` (3,), and the order of the rows are those
    of `modal.solvers.hierarchy.in_slabs`: slabs of the same half do not touch.
    """
    for half in range(2):
        for slab in prange(halves[half], halves[half + 1]):
            solution = x.reshape(-1)
            entries = blocks.reshape(-1)
            for i in range(bounds[slab], bounds[slab + 1]):
                for entry in range(pointers[i], diagonal[i]):
                    subtract_product(solution, i, entries, entry, solution, columns[entry])


def _subtract_upper(residual, x, pointers, columns, diagonal, blocks):
    """Subtract U x from the residual, which is 0 before: load - A x after (L + 1) x = load."""
    n = len(diagonal)
    for part in prange(SLABS):
        result = residual.reshape(-1)
        solution = x.reshape(-1)
        entries = blocks.reshape(-1)
        for i in range(part * n // SLABS, (part + 1) * n // SLABS):
            for entry in range(diagonal[i] + 1, pointers[i + 1]):
                subtract_product(result, i, entries, entry, solution, columns[entry])


def _sweep_back(x, rhs, bounds, halves, pointers, columns, diagonal, blocks):
    """Set x, body by body from the last to the first, to balance rhs (Gauss-Seidel).

    The slabs are those of `solve_lower`.
    """
    for half in range(1, -1, -1):
        for slab in prange(halves[half], halves[half + 1]):
            solution = x.reshape(-1)
            load = rhs.reshape(-1)
            entries = blocks.reshape(-1)
            for i in range(bounds[slab + 1] - 1, bounds[slab] - 1, -1):
                solution[SIZE * i : SIZE * (i + 1)] = load[SIZE * i : SIZE * (i + 1)]
                for entry in range(pointers[i], pointers[i + 1]):
                    if entry != diagonal[i]:
                        subtract_product(solution, i, entries, entry, solution, columns[entry])


def _add_transfer(y, x, pointers, columns, blocks):
    """Add P x to y, for P with `blocks` (q, 6, 6) in scipy's BSR format."""
    n = len(y)
    for part in prange(SLABS):
        result = y.reshape(-1)
        source = x.reshape(-1)
        entries = blocks.reshape(-1)
        for i in range(part * n // SLABS, (part + 1) * n // SLABS):
            for entry in range(pointers[i], pointers[i + 1]):
                add_product(result, i, entries, entry, source, columns[entry])


def _gather(x, columns, bodies, factor):
    """Set x to columns (6 n, k), k <= 8, of a load times a factor; other columns to zero.

    Row i of x belongs to body number `bodies[i]` of the load.
    """
    n = len(x)
    width = columns.shape[1]
    for part in prange(SLABS):
        for i in range(part * n // SLABS, (part + 1) * n // SLABS):
            for r in range(ROWS):
                row = columns[ROWS * bodies[i] + r]
                for v in range(COLUMNS):
                    x[i, r, v] = 0.0
                for v in range(width):
                    x[i, r, v] = row[v] * factor


def _scatter(x, columns, bodies, factor):
    """Set columns (6 n, k) of a solution to x times a factor, as `gather` reads."""
    n = len(x)
    width = columns.shape[1]
    for part in prange(SLABS):
        for i in range(part * n // SLABS, (part + 1) * n // SLABS):
            for r in range(ROWS):
                row = columns[ROWS * bodies[i] + r]
                for v in range(width):
                    row[v] = x[i, r, v] * factor


_FINGERPRINT = fingerprint(block_products)
solve_lower = compiled(_solve_lower, 0, _FINGERPRINT, fastmath=True)
subtract_upper = compiled(_subtract_upper, 0, _FINGERPRINT, fastmath=True)
sweep_back = compiled(_sweep_back, 0, _FINGERPRINT, fastmath=True)
add_transfer = compiled(_add_transfer, 0, _FINGERPRINT, fastmath=True)
gather = compiled(_gather, 0, _FINGERPRINT, fastmath=True)
scatter = compiled(_scatter, 0, _FINGERPRINT, fastmath=True)
