"""The eigenproblem (K - omega^2 M) phi = 0 of a packing, and the observables of its modes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from modal.assembly import mass_diagonal, stiffness_diagonal, stiffness_matrix
from modal.chain import wall_to_wall_chain
from modal.floppy import FloppyModes, floppy_modes
from modal.mode_set import ModeSet
from modal.network import Network
from modal.operator import ContactOperator
from modal.resonance import PLANAR, chi_z, particle_motion, planar_resonances, rotation_share
from modal.storage import InputError

SMALL = 600
"""Degrees of freedom up to which the dense spectrum costs less than anything else."""
TOGETHER = 24
"""Modes that are measured together: bounds the memory."""
LARGEST_SHAPES = 4e9
"""Bytes of mode shapes up to which they are kept."""
_OBSERVABLES = ("residual", "chi_z", "chi_z_chain", "rotation_share")


@dataclass
class Eigenproblem:
    """A network and its matrices, each made when it is first asked for.

    dof: 6 or 3 a particle; solver: as in `of`; shapes: whether modes keep their shapes.
    """

    network: Network
    dof: int
    solver: str | None = None
    shapes: bool = True

    @classmethod
    def of(
        cls,
        network: Network,
        *,
        translations_only: bool = False,
        solver: str | None = None,
        shapes: bool = True,
    ) -> Eigenproblem:
        """The problem of a network; with `translations_only` rotations are held at zero.

        `solver` names the factorisation (`modal.factor.SOLVERS`); None lets memory decide.
        """
        return cls(network, 3 if translations_only else 6, solver, shapes)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.dof * self.network.n_particles

    @cached_property
    def mass(self) -> np.ndarray:
        """Shape (size,): M's diagonal."""
        return mass_diagonal(self.network, translations_only=self.dof == 3)

    @cached_property
    def diagonal(self) -> np.ndarray:
        """Shape (size,): the diagonal of A = M^-1/2 K M^-1/2."""
        return stiffness_diagonal(self.network, translations_only=self.dof == 3) / self.mass

    def assembled(self) -> sp.csr_matrix:
        """A = M^-1/2 K M^-1/2 as a sparse matrix, made anew: next to a factor it need not stay."""
        K = stiffness_matrix(self.network, translations_only=self.dof == 3)
        scale = 1 / np.sqrt(self.mass)
        K.data *= scale[K.indices]
        K.data *= np.repeat(scale, np.diff(K.indptr))
        return K

    @cached_property
    def scaled(self) -> sp.csr_matrix:
        """`assembled`, for what comes back to it."""
        return self.assembled()

    @cached_property
    def bound(self) -> float:
        """Largest row sum of A: an upper bound of the largest omega^2."""
        A = self.assembled()
        sizes = sp.csr_matrix((abs(A.data), A.indices, A.indptr), A.shape)
        return float((sizes @ np.ones(self.size)).max())

    @cached_property
    def operator(self) -> ContactOperator:
        """A without a matrix, where that is compiled."""
        return ContactOperator(self.network, translations_only=self.dof == 3, mass_scaled=True)

    @cached_property
    def floppy(self) -> FloppyModes:
        """Zero modes of the parts that nothing holds."""
        return floppy_modes(self.network, self.operator, self.mass, self.diagonal)

    def shifted(self, square: float) -> sp.csr_matrix:
        """A - square, with square an omega^2."""
        return (self.assembled() - square * sp.identity(self.size, format="csr")).tocsr()

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


def measure(
    problem: Eigenproblem,
    square: np.ndarray,
    vector: np.ndarray,
    chain: np.ndarray | None,
    norm: float,
    *,
    keep_shapes: bool = False,
) -> ModeSet:
    """Observables of modes given as unit vectors (size, k), a few modes at a time."""
    count = len(square)
    columns = {name: np.full(count, np.nan) for name in _OBSERVABLES}
    kept = np.empty((count, problem.network.n_particles, 6)) if keep_shapes else None
    pure = []
    for first in range(0, count, TOGETHER):
        some = slice(first, min(first + TOGETHER, count))
        unit = np.ascontiguousarray(vector[:, some])
        shape = particle_motion(unit, problem.mass, problem.dof)
        columns["chi_z"][some] = chi_z(shape)
        columns["rotation_share"][some] = rotation_share(unit, problem.dof)
        if chain is not None:
            columns["chi_z_chain"][some] = chi_z(shape, chain)
        if kept is not None:
            kept[some] = shape
        planar = columns["chi_z"][some] > PLANAR
        pure.append(shape[planar])
        difference = problem.operator.apply(unit)
        unit *= square[some]
        difference -= unit
        columns["residual"][some] = np.linalg.norm(difference, axis=0) / norm
    result = ModeSet(frequency=frequency_of(square), **columns, mode_shape=kept)
    if chain is not None:
        planar = columns["chi_z"] > PLANAR
        resonances = planar_resonances(
            result.frequency[planar],
            np.concatenate(pure),
            result.rotation_share[planar],
            chain,
            problem.network,
        )
        result.resonance_frequency, result.resonance_wavenumber = resonances[:2]
        result.resonance_shape = resonances[2]
    return result


def found_modes(
    problem: Eigenproblem,
    square: np.ndarray,
    vector: np.ndarray,
    interval: str,
    solver: str,
    norm: float | None = None,
) -> ModeSet:
    """Observables of modes, residuals relative to `norm` or the bound of all omega^2."""
    keep = problem.shapes and 8 * vector.size <= LARGEST_SHAPES
    norm = problem.bound if norm is None else norm
    modes = measure(problem, square, vector, problem.chain(), norm, keep_shapes=keep)
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
