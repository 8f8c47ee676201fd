"""All modes of a packing, or the highest (Otsubo et al. 2017, Eq. 1).

Small networks are dense; a laterally periodic crystal is block-diagonalised by its translations;
the top of the spectrum goes to ARPACK. The low end and intervals: `modal.intervals`.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from modal.eigenproblem import (
    SMALL,
    Eigenproblem,
    check_count,
    found_modes,
    frequency_of,
    measure,
    subset,
)
from modal.krylov import start_block
from modal.mode_set import ModeSet
from modal.resonance import chi_z, particle_motion, planar_resonances, rotation_share
from modal.storage import InputError
from modal.symmetry import LateralTranslations, lateral_translations, symmetry_blocks

DENSE_LIMIT = 6000
"""Degrees of freedom up to which the dense solver (0.9 GB, about a minute) is used."""
RESIDUAL = 1e-9
"""Of the highest modes, relative to omega^2."""


def all_modes(problem: Eigenproblem) -> ModeSet:
    """Every mode; dense, or by symmetry. InputError where neither fits."""
    chain, norm = problem.chain(), problem.bound
    group = lateral_translations(problem.network, problem.scaled, problem.dof)
    if not group.trivial:
        return _all_by_symmetry(problem, group, chain, norm)
    if problem.size > DENSE_LIMIT:
        raise InputError(
            f"all {problem.size} modes would need {3 * 8 * problem.size**2 / 1e9:.0f} GB dense "
            f"(limit {DENSE_LIMIT} degrees of freedom) and the network has no lateral symmetry; "
            "ask for --lowest, --highest or --between"
        )
    square, vector = eigh(problem.scaled.toarray(), overwrite_a=True)
    modes = measure(problem, square, vector, chain, norm, keep_shapes=problem.size <= 600)
    modes.attributes = {"interval": "all", "certified": True, "solver": "dense"}
    return modes


def memory_of_all(problem: Eigenproblem) -> str:
    """How `all_modes` will solve the problem, and the memory that its largest matrices take."""
    group = lateral_translations(problem.network, problem.scaled, problem.dof)
    cells = 1 if group.trivial else len(group.orbit)
    size = problem.size // cells
    return f"{cells} dense blocks of {size} rows, {3 * 16 * size**2 / 1e9:.2g} GB at a time"


def _all_by_symmetry(
    problem: Eigenproblem,
    group: LateralTranslations,
    chain: np.ndarray | None,
    norm: float,
) -> ModeSet:
    """Modes block by block. A Bloch wave is of the same size in every cell, so one column of
    cells has the observables; only the laterally uniform block (q = 0) has planar resonances."""
    column = group.orbit[0]
    column_mass = problem.mass.reshape(-1, problem.dof)[column].ravel()
    in_column = np.full(problem.network.n_particles, -1)
    for image in group.orbit:
        in_column[image] = np.arange(len(column))
    column_chain = in_column[chain] if chain is not None else None
    parts = []
    resonances: tuple[np.ndarray, ...] | None = None
    blocks = symmetry_blocks(problem.scaled, group, problem.dof)
    for block, U, multiplicity in blocks:
        square, inner = eigh(block, check_finite=False, driver="evd")
        shape = particle_motion(inner, column_mass, problem.dof)
        rotations = rotation_share(inner, problem.dof)
        chain_chi = np.full(len(square), np.nan)
        if column_chain is not None:
            chain_chi = chi_z(shape, column_chain)
            if resonances is None:
                uniform = particle_motion(U @ inner, problem.mass, problem.dof)
                resonances = planar_resonances(
                    frequency_of(square), uniform, rotations, chain, problem.network
                )
        residual = np.linalg.norm(block @ inner - inner * square, axis=0) / norm
        rows = (frequency_of(square), residual, chi_z(shape), chain_chi, rotations)
        parts.extend([np.array(rows)] * multiplicity)
    table = np.concatenate(parts, axis=1)
    modes = ModeSet(*table[:, np.argsort(table[0], kind="stable")])
    if resonances is not None:
        modes.resonance_frequency, modes.resonance_wavenumber, modes.resonance_shape = resonances
    cells = f"{group.cells[0]}x{group.cells[1]}"
    modes.attributes = {"interval": "all", "certified": True, "solver": f"symmetry {cells}"}
    return modes


def highest_modes(problem: Eigenproblem, count: int) -> ModeSet:
    """The `count` highest modes, by ARPACK on products with A alone."""
    check_count(problem, count, problem.size)
    if problem.size <= SMALL or count > problem.size // 4:
        return subset(all_modes(problem), slice(problem.size - count, None), f"highest {count}")
    start = start_block(problem.size, 1)[:, 0]
    # A basis of half of ARPACK's usual size takes more products, which cost less than the basis.
    square, vector = eigsh(
        problem.operator, k=count, ncv=2 * count + 10, which="LA", v0=start, tol=RESIDUAL
    )
    order = np.argsort(square)
    vector = vector[:, order]
    modes = found_modes(
        problem, square[order], vector, f"highest {count}", "arpack", norm=square.max()
    )
    modes.attributes["certified"] = False
    return modes
