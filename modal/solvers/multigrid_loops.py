"""Loops of a multigrid cycle: Gauss-Seidel by blocks of six rows, eight columns at a time.

Vectors have the shape (groups, n, 6, 8): groups of eight columns, n bodies with six entries each. A
block of the matrix is read once for the eight columns of a group, which takes hardly longer than
for one column. The groups are distributed over the threads. Rows of the matrix have ascending
columns, and `diagonal` (n,) is the place of each row's own block.

All is in single precision, which halves memory and time: a cycle only approximates the inverse, and
the iterations around it are in double precision.
"""

import numpy as np

from modal.tools.loops import compiled, compiled_part, fingerprint, numba, prange

ROWS = 6
"""Rows of a block, which the compiler must know."""
COLUMNS = 8
"""Columns of a group."""
SIZE = ROWS * COLUMNS


def _multiply(block, x, out):
    """Set `out` (48,) to a block (36,) times x (48,).

    The compiler turns the inner loop into vector operations because `out` is only written.
    """
    for r in range(ROWS):
        a = block[ROWS * r]
        b = block[ROWS * r + 1]
        c = block[ROWS * r + 2]
        d = block[ROWS * r + 3]
        e = block[ROWS * r + 4]
        f = block[ROWS * r + 5]
        for v in range(COLUMNS):
            translation = a * x[v] + b * x[COLUMNS + v] + c * x[2 * COLUMNS + v]
            rotation = d * x[3 * COLUMNS + v] + e * x[4 * COLUMNS + v] + f * x[5 * COLUMNS + v]
            out[COLUMNS * r + v] = translation + rotation


def _multiply_transposed(block, x, out):
    """Set `out` (48,) to the transpose of a block (36,) times x (48,)."""
    for r in range(ROWS):
        a = block[r]
        b = block[ROWS + r]
        c = block[2 * ROWS + r]
        d = block[3 * ROWS + r]
        e = block[4 * ROWS + r]
        f = block[5 * ROWS + r]
        for v in range(COLUMNS):
            translation = a * x[v] + b * x[COLUMNS + v] + c * x[2 * COLUMNS + v]
            rotation = d * x[3 * COLUMNS + v] + e * x[4 * COLUMNS + v] + f * x[5 * COLUMNS + v]
            out[COLUMNS * r + v] = translation + rotation


def _subtract_row(rest, blocks, columns, first, last, x, out):
    """Subtract from `rest` (48,) the blocks of a row, from `first` to before `last`, times x."""
    for entry in range(first, last):
        start = SIZE * columns[entry]
        block = blocks[ROWS * ROWS * entry : ROWS * ROWS * (entry + 1)]
        _multiply(block, x[start : start + SIZE], out)
        for k in range(SIZE):
            rest[k] -= out[k]


def _solve_lower(x, rhs, pointers, columns, diagonal, blocks, inverses):
    """Set x to the solution of (L + D) x = rhs: a forward sweep that starts from zero."""
    for group in prange(len(x)):
        rest = np.empty(SIZE, np.float32)
        out = np.empty(SIZE, np.float32)
        solution = x[group].reshape(-1)
        load = rhs[group].reshape(-1)
        entries = blocks.reshape(-1)
        inverse = inverses.reshape(-1)
        for i in range(len(diagonal)):
            rest[:] = load[SIZE * i : SIZE * (i + 1)]
            _subtract_row(rest, entries, columns, pointers[i], diagonal[i], solution, out)
            own = inverse[ROWS * ROWS * i : ROWS * ROWS * (i + 1)]
            _multiply(own, rest, solution[SIZE * i : SIZE * (i + 1)])


def _subtract_upper(x, residual, pointers, columns, diagonal, blocks):
    """Set the residual to -U x, which is rhs - A x after the solution of (L + D) x = rhs."""
    for group in prange(len(x)):
        out = np.empty(SIZE, np.float32)
        solution = x[group].reshape(-1)
        rest = residual[group].reshape(-1)
        rest[:] = 0.0
        entries = blocks.reshape(-1)
        for i in range(len(diagonal)):
            own = rest[SIZE * i : SIZE * (i + 1)]
            _subtract_row(own, entries, columns, diagonal[i] + 1, pointers[i + 1], solution, out)


def _sweep_back(x, rhs, pointers, columns, diagonal, blocks, inverses):
    """Set x, body by body from the last to the first, to balance rhs (Gauss-Seidel)."""
    for group in prange(len(x)):
        rest = np.empty(SIZE, np.float32)
        out = np.empty(SIZE, np.float32)
        solution = x[group].reshape(-1)
        load = rhs[group].reshape(-1)
        entries = blocks.reshape(-1)
        inverse = inverses.reshape(-1)
        for i in range(len(diagonal) - 1, -1, -1):
            rest[:] = load[SIZE * i : SIZE * (i + 1)]
            _subtract_row(rest, entries, columns, pointers[i], diagonal[i], solution, out)
            last = pointers[i + 1]
            _subtract_row(rest, entries, columns, diagonal[i] + 1, last, solution, out)
            own = inverse[ROWS * ROWS * i : ROWS * ROWS * (i + 1)]
            _multiply(own, rest, solution[SIZE * i : SIZE * (i + 1)])


def _transfer(x, coarse, pointers, columns, blocks, prolongs):
    """Add P coarse to x if `prolongs`, otherwise P^T x to `coarse`; P has `blocks` (q, 6, 6)."""
    for group in prange(len(x)):
        out = np.empty(SIZE, np.float32)
        fine = x[group].reshape(-1)
        flat = coarse[group].reshape(-1)
        entries = blocks.reshape(-1)
        for i in range(len(pointers) - 1):
            own = fine[SIZE * i : SIZE * (i + 1)]
            for entry in range(pointers[i], pointers[i + 1]):
                start = SIZE * columns[entry]
                partner = flat[start : start + SIZE]
                block = entries[ROWS * ROWS * entry : ROWS * ROWS * (entry + 1)]
                if prolongs:
                    _multiply(block, partner, out)
                    for k in range(SIZE):
                        own[k] += out[k]
                else:
                    _multiply_transposed(block, own, out)
                    for k in range(SIZE):
                        partner[k] += out[k]


def _scale_blocks(x, pointers, inverses):
    """Multiply each body's part of x by its own block of `inverses` (n, 6, 6), in place.

    `pointers` (n,) has an entry for each body.
    """
    for group in prange(len(x)):
        out = np.empty(SIZE, np.float32)
        solution = x[group].reshape(-1)
        inverse = inverses.reshape(-1)
        for i in range(len(pointers)):
            own = solution[SIZE * i : SIZE * (i + 1)]
            _multiply(inverse[ROWS * ROWS * i : ROWS * ROWS * (i + 1)], own, out)
            own[:] = out


def _gather(x, columns, bodies, scale):
    """Set x to columns (6 m, k) of loads, each times its `scale` (k,).

    `bodies` (n,) are their rows' bodies in the order of x.
    """
    count = columns.shape[1]
    for group in prange(len(x)):
        first = COLUMNS * group
        width = min(COLUMNS, count - first)
        for i in range(len(bodies)):
            for r in range(ROWS):
                row = columns[ROWS * bodies[i] + r]
                for v in range(COLUMNS):
                    x[group, i, r, v] = 0.0
                for v in range(width):
                    x[group, i, r, v] = row[first + v] * scale[first + v]


def _scatter(x, columns, bodies, scale):
    """Set columns (6 m, k) of solutions to x, each times its `scale` (k,), as `gather` reads."""
    count = columns.shape[1]
    for group in prange(len(x)):
        first = COLUMNS * group
        width = min(COLUMNS, count - first)
        for i in range(len(bodies)):
            for r in range(ROWS):
                row = columns[ROWS * bodies[i] + r]
                for v in range(width):
                    row[first + v] = x[group, i, r, v] * scale[first + v]


if numba is not None:
    _FINGERPRINT = fingerprint()
    _multiply = compiled_part(_multiply, _FINGERPRINT, fastmath=True)
    _multiply_transposed = compiled_part(_multiply_transposed, _FINGERPRINT, fastmath=True)
    _subtract_row = compiled_part(_subtract_row, _FINGERPRINT, fastmath=True)
    solve_lower = compiled(_solve_lower, 2, _FINGERPRINT, fastmath=True)
    subtract_upper = compiled(_subtract_upper, 2, _FINGERPRINT, fastmath=True)
    sweep_back = compiled(_sweep_back, 2, _FINGERPRINT, fastmath=True)
    transfer = compiled(_transfer, 2, _FINGERPRINT, fastmath=True)
    scale_blocks = compiled(_scale_blocks, 1, _FINGERPRINT, fastmath=True)
    gather = compiled(_gather, 2, _FINGERPRINT, fastmath=True)
    scatter = compiled(_scatter, 2, _FINGERPRINT, fastmath=True)
