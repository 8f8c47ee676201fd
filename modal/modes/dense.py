"""All modes of a packing, or any part of them, from dense matrices (Otsubo et al. 2017, Eq. 1).

Small networks are solved whole. Of one that consists of equal cells side by side K falls into
blocks, one for each lateral wave vector q: U^H K U, where U spreads a cell's motion over all cells
with the phase q. That is exact, and q and -q share their frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from modal.modes.effort import of_blocks, refuse_endless_search
from modal.modes.mode_set import Choice, ModeSet, certificate, subset
from modal.modes.observables import (
    chain_of,
    found_modes,
    observables,
    particle_motion,
    pure_waves,
    resonances,
    shapes_left_out,
)
from modal.modes.unsymmetric import at_zero, whole_spectrum
from modal.packing.repeats import lateral_repeats
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats, Ints

ROUND_OFF = 1e-14
"""Times the largest entry of A: what round-off leaves of entries that a symmetry makes equal."""


def all_modes(system: LinearSystem) -> ModeSet:
    """Every mode; dense, or by symmetry. InputError where neither fits."""
    return dense_modes(system, Choice("all"))


def whole_pays(system: LinearSystem, count: int, listed: int) -> bool:
    """Whether `count` modes at an end, of all that are `listed`, are best had from all."""
    small, part = system.size <= system.limits.small, count > listed // system.limits.part
    return small or part or not system.symmetric


def dense_modes(system: LinearSystem, choice: Choice) -> ModeSet:
    """The modes that are asked for, from dense eigenproblems of all.

    InputError where the network is too large.
    """
    cells = _cells_of(system)
    if len(cells.orbit) > 1:
        return _dense_by_symmetry(system, cells, choice)
    if system.symmetric:
        square, vector = eigh(system.scaled.toarray(), overwrite_a=True)
    else:
        square, vector = whole_spectrum(system)
    part = choice.part(frequency_of(square), system.zero_frequency)
    modes = found_modes(system, square[part], vector[:, part], choice, "dense")
    modes.attributes |= certificate(0) | at_zero(system, square)
    return modes


@dataclass(frozen=True)
class Cells:
    """Equal cells side by side, and which particles move alike in each.

    `along` x and y: how many there are. `orbit` (nx ny, n / (nx ny)): its first row holds the
    particles of one cell, row c their images in cell c = x + nx y.
    """

    along: tuple[int, int]
    orbit: Ints


def _cells_of(system: LinearSystem) -> Cells:
    """The smallest cells of which a network consists; with pre-stress their forces are alike, too.

    One where K is not symmetric. InputError where all modes would take too much memory or time.
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
    refuse_endless_search(
        system,
        of_blocks(rows, count),
        f"all {system.size} modes {cut} take",
        "ask for the lowest, the highest or those of an interval",
    )
    return Cells((along[0], along[1]), orbit)


def _blocks(system: LinearSystem, cells: Cells) -> Iterator[tuple[Array, sp.csr_matrix, int]]:
    """Yield (block (b, b), U (size, b), multiplicity) for each pair of wave vectors q, -q.

    An eigenvector w of the block is the Bloch wave U w of the whole network, of the same size in
    every cell. The first block is the laterally uniform one (q = 0).
    """
    (nx, ny), dof = cells.along, system.dof
    size = dof * cells.orbit.shape[1]
    rows = (dof * cells.orbit[:, :, None] + np.arange(dof)).reshape(nx * ny, size)
    cell = np.arange(nx * ny)
    done: set[tuple[int, int]] = set()
    for q in [(x, y) for y in range(ny) for x in range(nx)]:
        opposite = (-q[0] % nx, -q[1] % ny)
        if q in done:
            continue
        done |= {q, opposite}
        angle = 2 * np.pi * (q[0] * (cell % nx) / nx + q[1] * (cell // nx) / ny)
        real = opposite == q
        phase = np.cos(angle) if real else np.exp(1j * angle)
        values = np.repeat(phase / np.sqrt(nx * ny), size)
        places = rows.ravel(), np.tile(np.arange(size), nx * ny)
        U = sp.csr_matrix((values, places), shape=(system.size, size))
        yield (U.conj().T @ system.scaled @ U).toarray(), U, 1 if real else 2


def _dense_by_symmetry(system: LinearSystem, cells: Cells, choice: Choice) -> ModeSet:
    """Modes of one symmetry block after the other, each block a dense eigenproblem.

    A block belongs to one lateral wave vector q. Its modes are Bloch waves, of the same size in
    every lateral cell, so their observables are computed on one column of cells. Only the block of
    q = 0, laterally uniform motion, has planar resonances.
    """
    column, network = cells.orbit[0], system.network
    root = system.root.some(column, system.dof)
    chain = chain_of(network)
    if chain is not None:
        in_column = np.empty(network.n_particles, np.int64)
        in_column[cells.orbit] = np.arange(len(column))
        chain = in_column[chain]
    tables, waves = [], []
    uniform: Floats | None = None
    for block, U, multiplicity in _blocks(system, cells):
        square, inner = eigh(block, check_finite=False, driver="evd")
        difference = np.linalg.norm(block @ inner - inner * square, axis=0)
        misfit = np.stack([difference, _beside_the_waves(system, block, U, inner)])
        table, shape = observables(system, square, inner, misfit, root, chain)
        tables.extend([table] * multiplicity)
        if uniform is None:
            uniform = pure_waves(table, shape / np.sqrt(len(cells.orbit)), chain)
        if system.shapes:
            waves.append((U, inner))
    table = np.concatenate(tables, axis=1)
    order = np.argsort(table[0], kind="stable")
    modes = ModeSet(*table[:, order])
    if chain is not None and uniform is not None:
        modes = replace(modes, **resonances(uniform, network))
    solver = f"symmetry {cells.along[0]}x{cells.along[1]}"
    square = np.sign(modes.frequency) * (2 * np.pi * modes.frequency) ** 2
    modes.attributes = {"solver": solver} | at_zero(system, square) | certificate(0)
    part = choice.part(modes.frequency, system.zero_frequency)
    modes = subset(modes, part, choice)
    left_out = shapes_left_out(system, len(modes.frequency))
    modes.attributes |= left_out
    if system.shapes and not left_out:
        modes.mode_shape = _shapes_of_waves(system, waves, order[part])
    return modes


def _beside_the_waves(system: LinearSystem, block: Array, U: sp.csr_matrix, inner: Array) -> Floats:
    """Shape (b,): norms of A U w - U (U^H A U) w, zero in a perfect crystal; `inner` are the w."""
    A = system.scaled
    beside = (A @ U - U @ sp.csr_matrix(block)).tocsr()
    beside.data[abs(beside.data) <= ROUND_OFF * abs(A.data).max(initial=0.0)] = 0
    beside.eliminate_zeros()
    beside = beside[np.flatnonzero(np.diff(beside.indptr))]
    parts = np.array_split(inner, -(-inner.shape[1] // system.limits.together), axis=1)
    return np.concatenate([np.linalg.norm(beside @ part, axis=0) for part in parts])


def _shapes_of_waves(
    system: LinearSystem, waves: list[tuple[sp.csr_matrix, Array]], wanted: Ints
) -> Floats:
    """Shape (k, n, 6): those mode shapes of the Bloch waves U w that are `wanted` (k,).

    The waves of q and -q are each other's conjugates: sqrt(2) times real and imaginary part are
    two orthonormal standing waves of the same frequency. They are numbered block by block.
    """
    place = np.full(system.size, -1)
    place[wanted] = np.arange(len(wanted))
    shapes = np.empty((len(wanted), system.network.n_particles, 6))
    first = 0
    for U, inner in waves:
        wave = U @ inner
        standing = [wave.real]
        if np.iscomplexobj(wave):
            standing = [np.sqrt(2) * wave.real, np.sqrt(2) * wave.imag]
        for vector in standing:
            rows = place[first : first + vector.shape[1]]
            some = rows >= 0
            shapes[rows[some]] = particle_motion(vector[:, some], system.root, system.dof)
            first += vector.shape[1]
    return shapes
