"""The eigenproblem (K - omega^2 M) phi = 0 of a packing, its matrices made once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from modal.modes.zero_modes import FloppyModes, floppy_modes
from modal.packing.chain import wall_to_wall_chain
from modal.packing.columns import Made
from modal.packing.network import Network
from modal.solvers.factor import SOLVERS
from modal.system.assembly import own_blocks, stiffness_matrix
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError
from modal.tools.workload import LONGEST

SMALL = 600
"""Degrees of freedom up to which the dense spectrum costs less than anything else."""
COUNTED = 1e-11
"""How far round-off of a factorisation may move an omega^2, relative to A's largest diagonal entry;
mostly it is a tenth of that. Modes so close to a frequency may be counted on either side of it."""
BLUR = 1e-9, 0.25
"""Limits of the relative distance from a listed frequency at which modes are counted instead."""


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

    def once(self, name: str, make: Callable[[], Made]) -> Made:
        """What does not depend on the settings, and is made once for all problems of a network."""
        return self.network.once(f"{name}, {self.dof} a particle", make)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.dof * self.network.n_particles

    @property
    def root(self) -> RootMass:
        """M^1/2."""
        return self.once("root of the mass", lambda: RootMass.of(self.network, self.dof))

    @property
    def diagonal(self) -> Floats:
        """Shape (size,): the diagonal of A = M^-1/2 K M^-1/2."""

        def make() -> Floats:
            own = RootMass.of(self.network).around_own(own_blocks(self.network))
            return np.einsum("naa->na", own)[:, : self.dof].ravel()

        return self.once("diagonal", make)

    def assembled(self) -> sp.csr_matrix:
        """A = M^-1/2 K M^-1/2, sparse (size, size), 1/s^2; assembled at every call.

        It is not kept, so that its memory is free while a factorisation is in use.
        """
        K = stiffness_matrix(self.network, translations_only=self.dof == 3)
        return self.root.around(K)

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

    @property
    def zero(self) -> float:
        """The omega^2, 1/s^2, below which no factorisation tells a mode from one at zero."""
        return COUNTED * float(self.diagonal.max(initial=0.0))

    @cached_property
    def operator(self) -> ContactOperator:
        """The product of A with vectors, computed contact by contact where numba is installed."""
        return ContactOperator(self.network, translations_only=self.dof == 3, mass_scaled=True)

    @property
    def semidefinite(self) -> bool:
        """Whether no motion can release energy, since no spring has a negative stiffness."""
        springs = self.network.stiffness_normal, self.network.stiffness_tangential
        return bool(min(k.min(initial=0.0) for k in springs) >= 0)

    @property
    def floppy(self) -> FloppyModes:
        """Zero modes: motions that no contact resists, as the structure of the contacts shows them.

        How many there are beside these: `modal.modes.collective`. It shows none where springs of
        negative stiffness may balance others.
        """

        def make() -> FloppyModes:
            if not self.semidefinite:
                return FloppyModes(sp.csc_matrix((self.size, 0)), 0, 0, 0, 0, whole=False)
            return floppy_modes(self.network, self.operator, self.root, self.diagonal, self.zero)

        return self.once("floppy modes", make)

    @property
    def spectrum(self) -> Floats:
        """Shape (size,): every omega^2, ascending; for networks of up to `SMALL`."""

        def make() -> Floats:
            return eigh(self.scaled.toarray(), eigvals_only=True)

        return self.once("spectrum", make)

    def shifted(self, square: float) -> sp.csr_matrix:
        """A - square times the identity, sparse (size, size); `square` is an omega^2, 1/s^2."""
        return (self.assembled() - square * sp.identity(self.size, format="csr")).tocsr()

    def chain(self) -> Ints | None:
        """Indices of the particles of the wall-to-wall chain, or None if there is none."""
        try:
            return wall_to_wall_chain(self.network)
        except InputError:
            return None


def frequency_of(square: Floats) -> Floats:
    """f = omega / 2 pi in Hz; negative omega^2 (unstable or round-off) gives negative f."""
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)


def frequencies(given: ArrayLike) -> Floats:
    """The frequencies as an array, Hz; InputError where one is no number from 0 on."""
    try:
        asked = np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise InputError(f"frequency is {given!r}, not numbers of Hz") from error
    wrong = ~(np.isfinite(asked) & (asked >= 0))
    if wrong.any():
        raise InputError(f"{asked[wrong][0]:g} Hz is no frequency; give a number from 0 Hz on")
    return asked


def check_count(problem: Eigenproblem, count: int, available_modes: int) -> None:
    """Raise InputError unless `count` is whole and 1 <= `count` <= `available_modes`.

    `available_modes` is the number of modes that can be listed: all degrees of freedom, less the
    zero modes where these are not listed.
    """
    if available_modes < 1 or not problem.diagonal.any():
        raise InputError(
            f"no modes to list: no spring holds any of the {problem.size} motions; see the "
            "contacts with `info`"
        )
    if not (isinstance(count, int | np.integer) and 1 <= count <= available_modes):
        raise InputError(
            f"{count} modes asked, the network has {problem.size} degrees of freedom and "
            f"{available_modes} modes to list; ask for 1 to {available_modes}"
        )
