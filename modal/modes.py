"""Natural frequencies and mode shapes: (K - omega^2 M) phi = 0 (Otsubo et al. 2017, Eq. 1).

Solved as M^-1/2 K M^-1/2 v = omega^2 v. Small networks are dense; a laterally periodic crystal
is block-diagonalised by its translations; the rest goes to ARPACK, in shift-invert mode with a
shift slightly below zero for the low end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from modal.assembly import mass_diagonal, stiffness_matrix
from modal.chain import wall_to_wall_chain
from modal.factor import factorise
from modal.mode_set import ModeSet
from modal.network import Network
from modal.resonance import chi_z, particle_motion, planar_resonances, rotation_share
from modal.storage import InputError
from modal.symmetry import LateralTranslations, lateral_translations, symmetry_blocks

DENSE_LIMIT = 6000
"""Degrees of freedom up to which the dense solver (0.9 GB, about a minute) is used."""
SHIFT = 1e-7
"""Shift below zero, relative to the largest diagonal entry, that keeps the factor definite."""


@dataclass
class Eigenproblem:
    """A network with its matrices: `scaled` = M^-1/2 K M^-1/2 (sparse), `mass` M's diagonal."""

    network: Network
    dof: int
    mass: np.ndarray
    scaled: sp.csr_matrix

    @classmethod
    def of(cls, network: Network, *, translations_only: bool = False) -> Eigenproblem:
        """Assemble K and M; with `translations_only` rotations are held at zero."""
        K = stiffness_matrix(network, translations_only=translations_only)
        mass = mass_diagonal(network, translations_only=translations_only)
        scale = sp.diags(1 / np.sqrt(mass))
        return cls(network, 3 if translations_only else 6, mass, (scale @ K @ scale).tocsr())

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.mass)

    def chain(self) -> np.ndarray | None:
        """The wall-to-wall chain, or None where the network has none."""
        try:
            return wall_to_wall_chain(self.network)
        except InputError:
            return None


def frequency_of(square: np.ndarray) -> np.ndarray:
    """f = omega / 2 pi in Hz; negative omega^2 (unstable or round-off) gives negative f."""
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)


def _measure(
    problem: Eigenproblem,
    square: np.ndarray,
    vector: np.ndarray,
    chain: np.ndarray | None,
    norm: float,
    *,
    keep_shapes: bool = False,
) -> ModeSet:
    """Observables of modes given as unit vectors (size, k)."""
    shape = particle_motion(vector, problem.mass, problem.dof)
    residual = np.linalg.norm(problem.scaled @ vector - vector * square, axis=0) / norm
    rotations = rotation_share(vector, problem.dof)
    result = ModeSet(
        frequency=frequency_of(square),
        residual=residual,
        chi_z=chi_z(shape),
        chi_z_chain=chi_z(shape, chain) if chain is not None else np.full(len(square), np.nan),
        rotation_share=rotations,
        mode_shape=shape if keep_shapes and np.isrealobj(shape) else None,
    )
    if chain is not None:
        resonances = planar_resonances(result.frequency, shape, rotations, chain, problem.network)
        result.resonance_frequency, result.resonance_wavenumber = resonances[:2]
        result.resonance_shape = resonances[2]
    return result


def _norm(problem: Eigenproblem) -> float:
    """Largest row sum of the scaled matrix: an upper bound of the largest eigenvalue."""
    return float(np.asarray(abs(problem.scaled).sum(axis=1)).max())


def all_modes(problem: Eigenproblem) -> ModeSet:
    """Every mode; dense, or by symmetry. InputError where neither fits."""
    chain, norm = problem.chain(), _norm(problem)
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
    modes = _measure(problem, square, vector, chain, norm, keep_shapes=problem.size <= 600)
    modes.attributes = {"interval": "all", "certified": True, "solver": "dense"}
    return modes


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


def start_vector(size: int) -> np.ndarray:
    """The same start every time, so that the same network gives the same digits."""
    return np.random.default_rng(20170729).standard_normal(size)


def extreme_modes(problem: Eigenproblem, count: int, end: str) -> ModeSet:
    """The `count` lowest or highest modes (`end` is "lowest" or "highest")."""
    if not 1 <= count <= problem.size:
        raise InputError(
            f"{count} modes asked, the network has {problem.size} degrees of freedom; ask for 1 "
            f"to {problem.size}"
        )
    norm, chain = _norm(problem), problem.chain()
    if problem.size <= 600 or count > problem.size // 4:
        modes = all_modes(problem)
        chosen = slice(0, count) if end == "lowest" else slice(problem.size - count, None)
        return _subset(modes, chosen, f"{end} {count}")
    v0 = start_vector(problem.size)
    if end == "highest":
        square, vector = eigsh(problem.scaled, k=count, which="LA", v0=v0, tol=1e-13)
        solver = "arpack"
    else:
        sigma = -SHIFT * problem.scaled.diagonal().max()
        solve, _ = factorise(problem.scaled - sigma * sp.identity(problem.size, format="csr"))
        inverse = LinearOperator((problem.size,) * 2, matvec=solve, dtype=float)
        square, vector = eigsh(problem.scaled, k=count, sigma=sigma, OPinv=inverse, v0=v0, tol=0)
        solver = "arpack shift-invert superlu"
    order = np.argsort(square)
    keep = 8 * count * problem.size <= 4e9
    modes = _measure(problem, square[order], vector[:, order], chain, norm, keep_shapes=keep)
    modes.attributes = {"interval": f"{end} {count}", "certified": False, "solver": solver}
    if end == "lowest":
        # The list is complete if nothing below its top is missing; the top itself may be one of
        # several equal frequencies, of which only some were asked for.
        edge = modes.frequency[-1] * (1 - 1e-6)
        found = int((modes.frequency < edge).sum())
        modes.attributes["certified"] = count_below(problem, edge) == found
    return modes


def _subset(modes: ModeSet, chosen: slice, interval: str) -> ModeSet:
    per_mode = ("frequency", "residual", "chi_z", "chi_z_chain", "rotation_share", "mode_shape")
    for name in per_mode:
        data = getattr(modes, name)
        setattr(modes, name, data[chosen] if data is not None else None)
    low, high = modes.frequency[0], modes.frequency[-1]
    if modes.resonance_frequency is not None:
        inside = (modes.resonance_frequency >= low) & (modes.resonance_frequency <= high)
        for name in ("resonance_frequency", "resonance_wavenumber", "resonance_shape"):
            setattr(modes, name, getattr(modes, name)[inside])
    modes.attributes["interval"] = interval
    return modes


def modes_between(problem: Eigenproblem, low: float, high: float) -> ModeSet:
    """Every mode with low <= f < high, Hz, certified by the counts at both ends."""
    if not (np.isfinite(low) and np.isfinite(high)) or high <= low:
        raise InputError(f"the interval {low:g} to {high:g} Hz is empty; give the lower end first")
    below_low = count_below(problem, low) if low > 0 else 0
    wanted = count_below(problem, high) - below_low
    if wanted == 0:
        empty = np.empty(0)
        attributes = {"interval": f"{low:g} {high:g}", "certified": True, "solver": "count"}
        return ModeSet(empty, empty, empty, empty, empty, attributes=attributes)
    modes = extreme_modes(problem, below_low + wanted, "lowest")
    modes = _subset(modes, slice(below_low, below_low + wanted), f"{low:g} {high:g}")
    modes.attributes["certified"] = len(modes.frequency) == wanted
    return modes


def count_below(problem: Eigenproblem, frequency: float) -> int:
    """Exact number of modes below `frequency` (Hz), zero-energy modes included.

    The inertia of K - omega^2 M (Sylvester's law), or the dense spectrum of a small network.
    """
    if not np.isfinite(frequency):
        raise InputError(f"{frequency} is not a frequency; give a number of Hz")
    square = (2 * np.pi * frequency) ** 2
    if frequency <= 0:
        return 0
    if problem.size <= 600:
        values = eigh(problem.scaled.toarray(), eigvals_only=True)
        return int((values < square).sum())
    _, negative = factorise(
        (problem.scaled - square * sp.identity(problem.size, format="csr")).tocsr()
    )
    if negative is None:
        raise InputError(
            f"the factorisation at {frequency:g} Hz had to pivot, its count is not certain; "
            "ask at a slightly different frequency"
        )
    return negative
