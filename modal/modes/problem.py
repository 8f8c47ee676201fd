"""The eigenproblem (K - omega^2 M) phi = 0 of a packing, and the observables of its modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh

from modal.formats.arrays import Array, Floats, Ints
from modal.formats.hdf5 import InputError
from modal.modes.mode_set import ModeSet
from modal.modes.observables import (
    PLANAR,
    chi_z,
    particle_motion,
    planar_resonances,
    rotation_share,
)
from modal.modes.zero_modes import FloppyModes, floppy_modes
from modal.packing.network import Made, Network
from modal.solvers.factor import SOLVERS
from modal.stiffness.matrices import mass_diagonal, stiffness_diagonal, stiffness_matrix
from modal.stiffness.operator import ContactOperator
from modal.waves.chain import wall_to_wall_chain
from modal.workload import LONGEST

SMALL = 600
"""Degrees of freedom up to which the dense spectrum costs less than anything else."""
TOGETHER = 24
"""Modes that are measured together: bounds the memory."""
LARGEST_SHAPES = 2e9
"""Bytes of mode shapes up to which they are kept: about 1,200 modes of 35,201 spheres."""
COUNTED = 1e-11
"""How far round-off of a factorisation may move an omega^2, relative to A's largest diagonal entry;
mostly it is a tenth of that. Modes so close to a frequency may be counted on either side of it."""
BLUR = 1e-9, 1e-6
"""Limits of the relative distance from a listed frequency at which modes are counted instead."""
_OBSERVABLES = ("residual", "chi_z", "chi_z_chain", "rotation_share")


@dataclass
class Eigenproblem:
    """A network with the matrices of its eigenproblem, each computed when first needed.

    `dof` is the number of degrees of freedom of a particle, 6, or 3 with translations only;
    `solver` as in `of`; `shapes` says whether lists of modes keep their mode shapes; a search
    whose estimated time exceeds `hours` is refused.
    """

    network: Network
    dof: int
    solver: str | None = None
    shapes: bool = True
    hours: float = LONGEST / 3600

    @classmethod
    def of(
        cls,
        network: Network,
        *,
        translations_only: bool = False,
        solver: str | None = None,
        shapes: bool = True,
        hours: float = LONGEST / 3600,
    ) -> Eigenproblem:
        """The problem of a network; with `translations_only` rotations are held at zero.

        `solver` names the factorisation (`modal.solvers.factor.SOLVERS`); None lets memory decide.
        """
        if solver not in (None, *SOLVERS, "layers"):
            raise InputError(f"solver {solver}: unknown; choose from {', '.join(SOLVERS)}")
        return cls(network, 3 if translations_only else 6, solver, shapes, hours)

    def _once(self, name: str, make: Callable[[], Made]) -> Made:
        """What does not depend on the settings, and is made once for all problems of a network."""
        return self.network.once(f"{name}, {self.dof} a particle", make)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.dof * self.network.n_particles

    @property
    def mass(self) -> Floats:
        """Shape (size,): M's diagonal."""
        short = self.dof == 3
        return self._once("mass", lambda: mass_diagonal(self.network, translations_only=short))

    @property
    def diagonal(self) -> Floats:
        """Shape (size,): the diagonal of A = M^-1/2 K M^-1/2."""

        def make() -> Floats:
            return stiffness_diagonal(self.network, translations_only=self.dof == 3) / self.mass

        return self._once("diagonal", make)

    def assembled(self) -> sp.csr_matrix:
        """A = M^-1/2 K M^-1/2, sparse (size, size), 1/s^2; assembled at every call.

        It is not kept, so that its memory is free while a factorisation is in use.
        """
        K = stiffness_matrix(self.network, translations_only=self.dof == 3)
        scale = 1 / np.sqrt(self.mass)
        K.data *= scale[K.indices]
        K.data *= np.repeat(scale, np.diff(K.indptr))
        return K

    @cached_property
    def scaled(self) -> sp.csr_matrix:
        """The matrix that `assembled` gives, kept for callers that use it repeatedly."""
        return self.assembled()

    @cached_property
    def bound(self) -> float:
        """Largest row sum of A: an upper bound of the largest omega^2."""
        A = self.assembled()
        sizes = sp.csr_matrix((abs(A.data), A.indices, A.indptr), A.shape)
        return float((sizes @ np.ones(self.size)).max())

    def blur(self, square: float) -> float:
        """Relative distance from a frequency within which an exact count is uncertain.

        `square` is the omega^2 of the frequency, 1/s^2; the distance is within `BLUR`.
        """
        share = COUNTED * self.diagonal.max() / abs(square) if square else np.inf
        return float(np.clip(share, *BLUR))

    @property
    def resolution(self) -> float:
        """What round-off leaves of an omega^2 of zero: eps times A's largest diagonal entry."""
        return float(np.finfo(float).eps * self.diagonal.max(initial=0.0))

    @cached_property
    def operator(self) -> ContactOperator:
        """The product of A with vectors, computed contact by contact where numba is installed."""
        return ContactOperator(self.network, translations_only=self.dof == 3, mass_scaled=True)

    @property
    def floppy(self) -> FloppyModes:
        """Zero modes (omega = 0): motions of particles that no contact resists."""

        def make() -> FloppyModes:
            return floppy_modes(self.network, self.operator, self.mass, self.diagonal)

        return self._once("floppy modes", make)

    @property
    def spectrum(self) -> Floats:
        """Shape (size,): every omega^2, ascending; for networks of up to `SMALL`."""

        def make() -> Floats:
            return eigh(self.scaled.toarray(), eigvals_only=True)

        return self._once("spectrum", make)

    def shifted(self, square: float) -> sp.csr_matrix:
        """A - square times the identity, sparse (size, size); `square` is an omega^2, 1/s^2."""
        return (self.assembled() - square * sp.identity(self.size, format="csr")).tocsr()

    def chain(self) -> Ints | None:
        """Indices of the particles of the wall-to-wall chain, or None if there is none."""
        try:
            return wall_to_wall_chain(self.network)
        except InputError:
            return None


def slipping(network: Network) -> Network:
    """The network with contacts at the friction limit held by their normal springs only."""
    sliding = network.known("sliding", "knowing which contacts slip")
    tangential = np.where(sliding, 0.0, network.stiffness_tangential)
    return replace(network, stiffness_tangential=tangential)


def frequency_of(square: Floats) -> Floats:
    """f = omega / 2 pi in Hz; negative omega^2 (unstable or round-off) gives negative f."""
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)


def relative_residual(difference: Array, square: Floats, resolution: float) -> Floats:
    """Shape (k,): |A v - omega^2 v| / omega^2 from `difference` (size, k) and omega^2 (k,).

    Where |omega^2| is smaller than `resolution`, which means that it is round-off, the difference
    is divided by `resolution` instead: zero modes then have a residual of order 1, not of infinity.
    """
    own = np.maximum(np.abs(square), max(resolution, np.finfo(float).tiny))
    return np.linalg.norm(difference, axis=0) / own


def measure(
    problem: Eigenproblem,
    square: Floats,
    vector: Floats,
    chain: Ints | None,
    *,
    keep_shapes: bool = False,
) -> ModeSet:
    """The observables of modes: frequency, residual, chi_z, rotation share, P resonances.

    `square` (k,): omega^2, 1/s^2; `vector` (size, k): unit eigenvectors of A. `chain` (nc,):
    particles of the wall-to-wall chain; without one there is no `chi_z_chain` (NaN) and no list of
    P resonances. With `keep_shapes` the mode shapes (k, n, 6) are in the result. `TOGETHER` modes
    are converted to shapes at a time, which bounds the memory.
    """
    count = len(square)
    columns: dict[str, Any] = {name: np.full(count, np.nan) for name in _OBSERVABLES}
    kept = np.empty((count, problem.network.n_particles, 6)) if keep_shapes else None
    pure = [np.empty((0, problem.network.n_particles, 6))]
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
        columns["residual"][some] = relative_residual(difference, square[some], problem.resolution)
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


def shapes_left_out(problem: Eigenproblem, count: int) -> str:
    """Why the shapes of `count` modes are not kept, or an empty text where they are."""
    needed = 48.0 * count * problem.network.n_particles
    if needed <= LARGEST_SHAPES:
        return ""
    return (
        f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit {LARGEST_SHAPES / 1e9:.2g} "
        "GB); ask for fewer modes to have them"
    )


def found_modes(
    problem: Eigenproblem,
    square: Floats,
    vector: Floats,
    interval: str,
    solver: str,
    of: int = 0,
) -> ModeSet:
    """The modes with their observables, and with their shapes if these fit in `LARGEST_SHAPES`.

    `square` (k,) and `vector` (size, k) as in `measure`; `interval` and `solver` are texts for the
    attributes. `of` is the length of the whole list where these modes are a part of it.
    """
    left_out = shapes_left_out(problem, max(of, len(square))) if problem.shapes else ""
    keep = problem.shapes and not left_out
    modes = measure(problem, square, vector, problem.chain(), keep_shapes=keep)
    modes.attributes = {"interval": interval, "certified": False, "solver": solver}
    if left_out:
        modes.attributes["shapes_left_out"] = left_out
    return modes


def certificate(missing: int, because: str = "") -> dict[str, Any]:
    """Attributes that say whether a list is complete, and how many modes it lacks.

    `because` says why no count was made. A `missing` below zero is a count that contradicts.
    """
    if missing > 0:
        because = f"{missing} modes are missing: they did not converge"
    if missing < 0:
        because = f"{-missing} more modes were found than the exact count allows"
    attributes = {"certified": not because, "missing": max(missing, 0)}
    return attributes | ({"uncertified_because": because} if because else {})


def subset(modes: ModeSet, chosen: slice, interval: str) -> ModeSet:
    """A list of the `chosen` modes only, with those P resonances whose frequencies it contains.

    `interval` is the text that describes the new list in its attributes.
    """
    arrays: dict[str, Any] = {}
    for name in ("frequency", *_OBSERVABLES, "mode_shape"):
        data = getattr(modes, name)
        arrays[name] = None if data is None else data[chosen]
    resonance = modes.resonance_frequency
    if resonance is not None:
        inside = np.isin(resonance, arrays["frequency"])
        for name in ("resonance_frequency", "resonance_wavenumber", "resonance_shape"):
            arrays[name] = getattr(modes, name)[inside]
    return replace(modes, **arrays, attributes={**modes.attributes, "interval": interval})


def check_count(problem: Eigenproblem, count: int, available_modes: int) -> None:
    """Raise InputError unless `count` is whole and 1 <= `count` <= `available_modes`.

    `available_modes` is the number of modes that can be listed: all degrees of freedom, less the
    zero modes where these are not listed.
    """
    if not (isinstance(count, int | np.integer) and 1 <= count <= available_modes):
        raise InputError(
            f"{count} modes asked, the network has {problem.size} degrees of freedom and "
            f"{available_modes} modes to list; ask for 1 to {available_modes}"
        )
