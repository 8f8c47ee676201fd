"""The eigenproblem (K - omega^2 M) phi = 0 of a packing, and the observables of its modes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from modal.assembly import mass_diagonal, stiffness_matrix
from modal.chain import wall_to_wall_chain
from modal.floppy import FloppyModes, floppy_modes
from modal.mode_set import ModeSet
from modal.network import Network
from modal.resonance import chi_z, particle_motion, planar_resonances, rotation_share
from modal.storage import InputError

SMALL = 600
"""Degrees of freedom up to which the dense spectrum costs less than anything else."""


@dataclass
class Eigenproblem:
    """A network with its matrices: `scaled` = M^-1/2 K M^-1/2 (sparse), `mass` M's diagonal."""

    network: Network
    dof: int
    mass: np.ndarray
    scaled: sp.csr_matrix
    solver: str | None = None

    @classmethod
    def of(
        cls, network: Network, *, translations_only: bool = False, solver: str | None = None
    ) -> Eigenproblem:
        """Assemble K and M; with `translations_only` rotations are held at zero.

        `solver` names the factorisation (`modal.factor.SOLVERS`); None lets memory decide.
        """
        K = stiffness_matrix(network, translations_only=translations_only)
        mass = mass_diagonal(network, translations_only=translations_only)
        scale = sp.diags(1 / np.sqrt(mass))
        dof = 3 if translations_only else 6
        return cls(network, dof, mass, (scale @ K @ scale).tocsr(), solver)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.mass)

    @cached_property
    def floppy(self) -> FloppyModes:
        """Zero modes of the parts that nothing holds."""
        return floppy_modes(self.network, self.scaled, self.mass)

    def shifted(self, square: float) -> sp.csr_matrix:
        """A - square, with square an omega^2."""
        return (self.scaled - square * sp.identity(self.size, format="csr")).tocsr()

    def chain(self) -> np.ndarray | None:
        """The wall-to-wall chain, or None where the network has none."""
        try:
            return wall_to_wall_chain(self.network)
        except InputError:
            return None


def slipping(network: Network) -> Network:
    """The network with contacts at the friction limit held by their normal springs only."""
    tangential = np.where(network.sliding, 0.0, network.stiffness_tangential)
    return replace(network, stiffness_tangential=tangential)


def frequency_of(square: np.ndarray) -> np.ndarray:
    """f = omega / 2 pi in Hz; negative omega^2 (unstable or round-off) gives negative f."""
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)


def spectral_bound(problem: Eigenproblem) -> float:
    """Largest row sum of the scaled matrix: an upper bound of the largest eigenvalue."""
    return float(np.asarray(abs(problem.scaled).sum(axis=1)).max())


def measure(
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


def found_modes(
    problem: Eigenproblem, square: np.ndarray, vector: np.ndarray, interval: str, solver: str
) -> ModeSet:
    """Observables of modes; shapes are kept up to 4 GB."""
    keep = 8 * vector.size <= 4e9
    chain, norm = problem.chain(), spectral_bound(problem)
    modes = measure(problem, square, vector, chain, norm, keep_shapes=keep)
    modes.attributes = {"interval": interval, "certified": False, "solver": solver}
    return modes


def subset(modes: ModeSet, chosen: slice, interval: str) -> ModeSet:
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


def check_count(problem: Eigenproblem, count: int, available_modes: int) -> None:
    if not 1 <= count <= available_modes:
        raise InputError(
            f"{count} modes asked, the network has {problem.size} degrees of freedom and "
            f"{available_modes} modes to list; ask for 1 to {available_modes}"
        )
