"""Find all modes, or any part of them, from dense matrices (Otsubo et al. 2017, Eq. 1).

Small networks are solved at once. If a network consists of equal cells side by side, K separates
into blocks, one for each lateral wave vector q: U^H K U, where U spreads the motion of a cell over
all cells with the phase q. This is exact, and q and -q have equal frequencies.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eig, eigh

from modal.modes.effort import of_blocks, refuse_endless_search
from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.unsymmetric import at_zero, real_spectrum
from modal.packing.repeats import lateral_repeats
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.blas import blas_threads

MIN_ROWS_FOR_THREADS = 1000
"""Least number of rows of a dense matrix for which threads share the work."""


class Cells(NamedTuple):
    """The smallest equal cells side by side, nx along x and ny along y.

    The first row of `particles` (nx ny, n / (nx ny)) holds the particles of one cell; row x + nx y
    holds their images in cell (x, y).
    """

    nx: int
    ny: int
    particles: Ints


class SolvedBlock(NamedTuple):
    """Eigenvalues (b,) and unit eigenvectors (b, b) of a block, and its U (size, b)."""

    square: Floats
    vector: Array
    U: sp.csr_matrix

    @property
    def modes_each(self) -> int:
        """Number of modes per eigenvector: two if it is complex, one for q and one for -q."""
        return 2 if np.iscomplexobj(self.vector) else 1


def dense_modes(system: LinearSystem, choice: Choice) -> ModeSet:
    """Find the modes of a choice by solving dense eigenproblems for all modes.

    Raises InputError if the network is too large.
    """
    cells = _equal_cells(system)
    blocks = []
    for block, U in _blocks(system, cells):
        square_of_block, vector = _solve(system, block)
        blocks.append(SolvedBlock(square_of_block, vector, U))
    square = np.concatenate([np.tile(block.square, block.modes_each) for block in blocks])
    frequency = frequency_of(square)
    order = np.argsort(frequency, kind="stable")
    listed = order[choice.part(frequency[order], system.zero_frequency)]
    place = np.full(len(square), -1)
    place[listed] = np.arange(len(listed))
    modes = found_modes(system, _pieces(blocks, place), len(listed), choice)
    solver = "dense"
    if len(cells.particles) > 1:
        solver = f"symmetry {cells.nx}x{cells.ny}"
    modes.attributes |= {"solver": solver} | certificate(0)
    return modes.with_zero_modes(*at_zero(system, square))


def _pieces(blocks: list[SolvedBlock], place: Ints) -> Iterator[Piece]:
    """Yield the listed modes of each block; `place` (size,) is each mode's place in the list.

    A mode whose place is -1 is not listed.
    """
    first = 0
    for number, block in enumerate(blocks):
        last = first + block.modes_each * len(block.square)
        places = place[first:last].reshape(block.modes_each, -1)
        listed = np.flatnonzero((places >= 0).any(axis=0))
        first = last
        vector = block.vector[:, listed]

        def unit(part: slice, U: sp.csr_matrix = block.U, vector: Array = vector) -> Array:
            return U @ vector[:, part]

        yield Piece(block.square[listed], places[:, listed], unit, planar=number == 0)


def _solve(system: LinearSystem, block: Array) -> tuple[Floats, Array]:
    """Return ascending eigenvalues (b,) and unit vectors (b, b) of a block, and overwrite it."""
    if not system.symmetric:
        return real_spectrum(*eig(block, overwrite_a=True, check_finite=False))
    with blas_threads(shared=len(block) >= MIN_ROWS_FOR_THREADS):
        square, vector = eigh(block, overwrite_a=True, check_finite=False, driver="evd")
    return square, vector


def _equal_cells(system: LinearSystem) -> Cells:
    """Find the smallest equal cells side by side; with pre-stress their forces are equal, too.

    There is one cell if K is not symmetric. Raises InputError if all modes would take too much
    memory or time.
    """
    network = system.network
    cells = Cells(1, 1, np.arange(network.n_particles)[None])
    repeats = lateral_repeats(network, pre_stress=system.pre_stress != "none")
    if system.symmetric and repeats.count > 1:
        counts = [1, 1]
        index = np.zeros((2, network.n_particles), np.int64)
        for axis in (0, 1):
            width = repeats.part.cell_size[axis]
            counts[axis] = round(network.cell_size[axis] / width)
            first_image = network.position[repeats.first, axis][repeats.member]
            step = network.position[:, axis] - first_image
            index[axis] = np.rint(step / width).astype(int) % counts[axis]
        nx, ny = counts
        particles = np.empty((repeats.count, len(repeats.first)), np.int64)
        particles[index[0] + nx * index[1], repeats.member] = np.arange(network.n_particles)
        cells = Cells(nx, ny, particles)
    count = len(cells.particles)
    rows = system.degrees_of_freedom // count
    blocks = "with no lateral symmetry"
    if count > 1:
        blocks = f"in {count} blocks of {rows} rows"
    refuse_endless_search(
        system,
        of_blocks(rows, count),
        f"all {system.degrees_of_freedom} modes {blocks} take",
        "ask for the lowest, the highest or those of an interval",
    )
    return cells


def _blocks(system: LinearSystem, cells: Cells) -> Iterator[tuple[Array, sp.csr_matrix]]:
    """Yield a block (b, b) and U (size, b) for each pair of wave vectors q, -q.

    The columns of U are motions that the bodies can make. The block is real if q is -q. An
    eigenvector w of the block is the Bloch wave U w of the whole network, of equal size in every
    cell. The first block is the laterally uniform one (q = 0).
    """
    nx, ny, particles = cells
    n_cells = len(particles)
    rows = (system.dof * particles[:, :, None] + np.arange(system.dof)).reshape(n_cells, -1)
    is_free = np.zeros(system.size, bool)
    is_free[system.free_rows] = True
    rows = rows[:, is_free[rows[0]]]  # all cells are held alike
    size = rows.shape[1]
    cell_y, cell_x = np.divmod(np.arange(n_cells), nx)
    for y, x in np.ndindex((ny, nx)):
        q = (y, x)
        opposite = (-y % ny, -x % nx)
        if q > opposite:
            continue
        angle = 2 * np.pi * (x * cell_x / nx + y * cell_y / ny)
        phase = np.cos(angle) if q == opposite else np.exp(1j * angle)
        values = np.repeat(phase / np.sqrt(n_cells), size)
        entries = (rows.ravel(), np.tile(np.arange(size), n_cells))
        U = sp.csr_matrix((values, entries), shape=(system.size, size))
        yield (U.conj().T @ system.dynamical_matrix @ U).toarray(), U
