"""All modes of a packing, or any part of them, from dense matrices (Otsubo et al. 2017, Eq. 1).

Small networks are solved whole. Of one that consists of equal cells side by side K falls into
blocks, one for each lateral wave vector q: U^H K U, where U spreads a cell's motion over all cells
with the phase q. That is exact, and q and -q share their frequencies.
"""

from collections.abc import Iterator

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

SHARED = 1000
"""Rows of a dense matrix from which on threads share its work."""


def dense_modes(system: LinearSystem, choice: Choice) -> ModeSet:
    """The modes that are asked for, from dense eigenproblems of all.

    InputError where the network is too large.
    """
    along, orbit = _equal_cells(system)
    solved = [(*_solved(system, block), U) for block, U in _blocks(system, along, orbit)]
    # A complex wave, of q and of -q, is two modes.
    each = [1 + np.iscomplexobj(inner) for _, inner, _ in solved]
    square = np.concatenate([np.tile(s[0], modes) for s, modes in zip(solved, each, strict=True)])
    frequency = frequency_of(square)
    order = np.argsort(frequency, kind="stable")
    listed = order[choice.part(frequency[order], system.zero_frequency)]
    place = np.full(len(square), -1)
    place[listed] = np.arange(len(listed))

    def waves() -> Iterator[Piece]:
        first = 0
        for number, ((own, inner, U), modes) in enumerate(zip(solved, each, strict=True)):
            last = first + modes * len(own)
            there = place[first:last].reshape(modes, -1)
            some, first = np.flatnonzero((there >= 0).any(axis=0)), last
            vector = inner[:, some]

            def unit(part: slice, U: sp.csr_matrix = U, vector: Array = vector) -> Array:
                return U @ vector[:, part]

            yield Piece(own[some], there[:, some], unit, planar=number == 0)

    modes = found_modes(system, waves(), len(listed), choice)
    solver = "dense" if len(orbit) == 1 else f"symmetry {along[0]}x{along[1]}"
    modes.attributes |= {"solver": solver} | certificate(0)
    return modes.with_zero_modes(*at_zero(system, square))


def _solved(system: LinearSystem, block: Array) -> tuple[Floats, Array]:
    """Eigenvalues (b,), ascending, and unit vectors (b, b) of a block, which is overwritten."""
    if not system.symmetric:
        return real_spectrum(*eig(block, overwrite_a=True, check_finite=False))
    with blas_threads(shared=len(block) >= SHARED):
        square, inner = eigh(block, overwrite_a=True, check_finite=False, driver="evd")
    return square, inner


def _equal_cells(system: LinearSystem) -> tuple[tuple[int, int], Ints]:
    """The smallest equal cells side by side: how many along x and y, and who moves alike in each.

    Shape (nx ny, n / (nx ny)): the first row holds the particles of one cell, row c their images in
    cell c = x + nx y. With pre-stress their forces are alike, too. One cell where K is not
    symmetric. InputError where all modes would take too much memory or time.
    """
    network, along = system.network, [1, 1]
    orbit = np.arange(network.n_particles)[None]
    found = lateral_repeats(network, pre_stress=system.pre_stress != "none")
    if system.symmetric and found.count > 1:
        place = np.zeros((2, network.n_particles), np.int64)
        for axis in (0, 1):
            width = found.part.cell_size[axis]
            along[axis] = round(network.cell_size[axis] / width)
            step = network.position[:, axis] - network.position[found.first, axis][found.member]
            place[axis] = np.rint(step / width).astype(int) % along[axis]
        orbit = np.empty((found.count, len(found.first)), np.int64)
        orbit[place[0] + along[0] * place[1], found.member] = np.arange(network.n_particles)
    count = len(orbit)
    rows = system.size // count
    cut = f"in {count} blocks of {rows} rows" if count > 1 else "with no lateral symmetry"
    task = f"all {system.size} modes {cut} take"
    remedy = "ask for the lowest, the highest or those of an interval"
    refuse_endless_search(system, of_blocks(rows, count), task, remedy)
    return (along[0], along[1]), orbit


def _blocks(
    system: LinearSystem, along: tuple[int, int], orbit: Ints
) -> Iterator[tuple[Array, sp.csr_matrix]]:
    """Yield (block (b, b), U (size, b)) for each pair of wave vectors q, -q; real where q is -q.

    An eigenvector w of the block is the Bloch wave U w of the whole network, of the same size in
    every cell. The first block is the laterally uniform one (q = 0).
    """
    size = system.size // len(orbit)
    rows = (system.dof * orbit[:, :, None] + np.arange(system.dof)).reshape(-1, size)
    cell = np.divmod(np.arange(len(orbit)), along[0])[::-1]
    for y, x in np.ndindex(along[::-1]):
        q, opposite = (y, x), (-y % along[1], -x % along[0])
        if q > opposite:
            continue
        angle = 2 * np.pi * (x * cell[0] / along[0] + y * cell[1] / along[1])
        phase = np.cos(angle) if q == opposite else np.exp(1j * angle)
        values = np.repeat(phase / np.sqrt(len(orbit)), size)
        places = rows.ravel(), np.tile(np.arange(size), len(orbit))
        U = sp.csr_matrix((values, places), shape=(system.size, size))
        yield (U.conj().T @ system.dynamical_matrix @ U).toarray(), U
