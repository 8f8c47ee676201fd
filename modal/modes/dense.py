"""All modes of a packing, or any part of them, from dense matrices (Otsubo et al. 2017, Eq. 1).

Small networks are solved whole; a laterally periodic crystal is block-diagonalised by its lateral
translations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from modal.modes.effort import of_blocks, refuse_endless_search
from modal.modes.from_vectors import (
    TOGETHER,
    chain_of,
    found_modes,
    relative_residual,
    shapes_left_out,
)
from modal.modes.mode_set import Choice, ModeSet, certificate, subset
from modal.modes.observables import chi_z, particle_motion, planar_resonances, rotation_share
from modal.modes.translations import LateralTranslations, lateral_translations, symmetry_blocks
from modal.modes.unsymmetric import at_zero, whole_spectrum
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats, Ints

DENSE_LIMIT = 6000
"""Degrees of freedom up to which the dense solver (1.7 GB, two minutes) is used unasked."""

ROUND_OFF = 1e-14
"""Times the largest entry of A: what round-off leaves of entries that a symmetry makes equal."""


def all_modes(system: LinearSystem) -> ModeSet:
    """Every mode; dense, or by symmetry. InputError where neither fits."""
    return dense_modes(system, lambda frequency: slice(0, system.size), Choice("all"))


def dense_modes(system: LinearSystem, chosen: Callable[[Floats], slice], choice: Choice) -> ModeSet:
    """A part of all modes, from dense eigenproblems.

    `chosen` takes the ascending frequencies (size,) of all modes, Hz, and gives the slice of those
    that are wanted; `choice` says what they are. InputError where the network is too large.
    """
    group = _group_of(system)
    if not group.trivial:
        return _dense_by_symmetry(system, group, chosen, choice)
    if system.symmetric:
        square, vector = eigh(system.scaled.toarray(), overwrite_a=True)
    else:
        square, vector = whole_spectrum(system)
    part = chosen(frequency_of(square))
    modes = found_modes(system, square[part], vector[:, part], choice, "dense")
    modes.attributes |= certificate(0) | at_zero(system, square)
    return modes


def _group_of(system: LinearSystem) -> LateralTranslations:
    """The lateral translations of a network, which cut its eigenproblem into blocks.

    InputError where all modes would take too much memory or time.
    """
    group = LateralTranslations((1, 1), np.arange(system.network.n_particles)[None])
    if system.symmetric:
        group = lateral_translations(system.network, system.scaled, system.dof)
    cells = len(group.orbit)
    rows = system.size // cells
    cut = "with no lateral symmetry" if group.trivial else f"in {cells} blocks of {rows} rows"
    refuse_endless_search(
        system,
        of_blocks(rows, cells),
        f"all {system.size} modes {cut} take",
        "ask for the lowest, the highest or those of an interval",
    )
    return group


def memory_of_all(system: LinearSystem) -> str:
    """How `all_modes` will solve the system, and the memory that its largest matrices take."""
    cells = len(_group_of(system).orbit)
    rows = system.size // cells
    gigabytes = of_blocks(rows, cells).bytes / 1e9
    return f"{cells} dense blocks of {rows} rows, {gigabytes:.2g} GB at a time"


def _dense_by_symmetry(
    system: LinearSystem,
    group: LateralTranslations,
    chosen: Callable[[Floats], slice],
    choice: Choice,
) -> ModeSet:
    """Modes of one symmetry block after the other, each block a dense eigenproblem.

    A block belongs to one lateral wave vector q. Its modes are Bloch waves, of the same size in
    every lateral cell, so their observables are computed on one column of cells. Only the block of
    q = 0, laterally uniform motion, has planar resonances.
    """
    column = group.orbit[0]
    of_column = system.root.some(column, system.dof)
    in_column = np.full(system.network.n_particles, -1)
    for image in group.orbit:
        in_column[image] = np.arange(len(column))
    chain = chain_of(system.network)
    parts, waves = [], []
    resonances: tuple[Floats, ...] | None = None
    blocks = symmetry_blocks(system.scaled, group, system.dof)
    for block, U, multiplicity in blocks:
        square, inner = eigh(block, check_finite=False, driver="evd")
        shape = particle_motion(inner, of_column, system.dof)
        rotations = rotation_share(inner, system.dof)
        chain_chi = np.full(len(square), np.nan)
        if chain is not None:
            chain_chi = chi_z(shape, in_column[chain])
            if resonances is None:
                uniform = particle_motion(U @ inner, system.root, system.dof)
                resonances = planar_resonances(
                    frequency_of(square), uniform, rotations, chain, system.network
                )
        difference = np.linalg.norm(block @ inner - inner * square, axis=0)
        difference = np.stack([difference, _beside_the_waves(system.scaled, block, U, inner)])
        residual = relative_residual(difference, square, system.resolution)
        rows = (frequency_of(square), residual, chi_z(shape), chain_chi, rotations)
        parts.extend([np.array(rows)] * multiplicity)
        if system.shapes:
            waves.append((U, inner))
    table = np.concatenate(parts, axis=1)
    order = np.argsort(table[0], kind="stable")
    modes = ModeSet(*table[:, order])
    if resonances is not None:
        modes.resonance_frequency, modes.resonance_wavenumber, modes.resonance_shape = resonances
    solver = f"symmetry {group.cells[0]}x{group.cells[1]}"
    square = np.sign(modes.frequency) * (2 * np.pi * modes.frequency) ** 2
    modes.attributes = {"solver": solver} | at_zero(system, square) | certificate(0)
    part = chosen(modes.frequency)
    modes = subset(modes, part, choice)
    if system.shapes:
        left_out = shapes_left_out(system, len(modes.frequency))
        if left_out:
            modes.attributes["shapes_left_out"] = left_out
        else:
            modes.mode_shape = _shapes_of_waves(system, waves, order[part])
    return modes


def _beside_the_waves(A: sp.csr_matrix, block: Array, U: sp.csr_matrix, inner: Array) -> Floats:
    """Shape (b,): norms of A U w - U (U^H A U) w, zero in a perfect crystal; `inner` are the w."""
    beside = (A @ U - U @ sp.csr_matrix(block)).tocsr()
    beside.data[abs(beside.data) <= ROUND_OFF * abs(A.data).max(initial=0.0)] = 0
    beside.eliminate_zeros()
    beside = beside[np.flatnonzero(np.diff(beside.indptr))]
    together = (inner[:, k : k + TOGETHER] for k in range(0, inner.shape[1], TOGETHER))
    return np.concatenate([np.linalg.norm(beside @ some, axis=0) for some in together])


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
