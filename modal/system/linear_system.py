"""Build the linear system M u'' + C u' + K u = 0 of a packing, for modes, waves and moduli.

Its matrices and their bounds are computed when they are first needed, and kept with the network.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from weakref import finalize

import numpy as np
import scipy.sparse as sp

from modal.packing.columns import Cached
from modal.packing.network import Network
from modal.solvers.factor import SOLVERS, Factor, SoftMotions, factorise, named
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.assembly import diagonal_blocks, stiffness_blocks
from modal.system.contacts import SYMMETRIC, PreStress, Sliding, terms_of, with_sliding
from modal.system.damping import ContactDamping
from modal.system.imposed import Coupling, Imposed, put_on
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import refuse_unknown
from modal.tools.workload import MAX_SECONDS

COUNT_ROUND_OFF = 1e-11
"""Distance by which round-off of a factorisation may move an omega^2, divided by the largest
diagonal entry of A; mostly the distance is a tenth of this. Modes so close to a frequency may be
counted on either side of it."""
MAX_CACHED_BYTES = 2e8
"""Largest memory, bytes, of results of one kind (factors, lists of modes, the operator) that stay
with a network, so that the next call finds them."""
OPERATOR_BYTES_PER_CONTACT = 1000
"""Upper bound of the memory of an operator for each contact, bytes, also if the operator is a
matrix."""
MIN_COUNT_UNCERTAINTY = 1e-9
MAX_COUNT_UNCERTAINTY = 0.25
"""Bounds of the relative distance from a listed frequency at which modes are counted instead."""


@dataclass(frozen=True)
class Limits:
    """Sizes at which the search for modes changes its method; the defaults suit any packing.

    Attributes
    ----------
    small : int
        Degrees of freedom up to which computing the dense spectrum is always the cheapest method.
    dense : int
        Degrees of freedom up to which the dense spectrum is used for lists of a large part of all
        modes (1.7 GB, two minutes).
    part : int
        A list is a large part of all modes if it has more than one in `part`.
    unsymmetric : int
        Degrees of freedom up to which the dense spectrum is used for any list if K is not symmetric
        (half a minute).
    slice : int
        Largest number of modes from one factorisation; wider intervals are cut by exact counts. For
        35,201 spheres the basis of these modes takes as much memory as two factors; 300 modes about
        a shift take 2.8 solves each; 600 modes take 2.4 solves each and half of the factorisations.
    piece : int
        Spheres of a loose part whose null space is computed from a dense matrix; larger parts are
        cut into such pieces.
    shapes : float
        Bytes up to which mode shapes are kept, about 1,200 modes of 35,201 spheres.
    together : int
        Number of modes whose observables are computed at once, which bounds the memory.
    """

    small: int = 600
    dense: int = 6000
    part: int = 4
    unsymmetric: int = 3000
    slice: int = 700
    piece: int = 100
    shapes: float = 2e9
    together: int = 24


@dataclass
class LinearSystem:
    """A network with the matrices of its linear motion, each computed when first needed.

    Attributes
    ----------
    network : Network
        The packing. It already contains the changed springs of sliding contacts.
    pre_stress : str
        Terms of the carried forces in the stiffness (`modal.system.contacts`).
    dof : int
        Degrees of freedom of a particle: 6, or 3 with translations only.
    solver : str or None
        Name of the factorisation (`modal.solvers.factor.SOLVERS`); None for the fastest.
    shapes : bool
        Whether lists of modes keep their mode shapes.
    hours : float
        Longest allowed estimate of the time of a search, hours.
    limits : Limits
    damping : ContactDamping or None
        Dashpots of the contacts, which only waves and responses take into account.
    original_network : Network or None
        The network before the springs of sliding contacts were replaced.
    """

    network: Network
    pre_stress: PreStress = "none"
    dof: int = 6
    solver: str | None = None
    shapes: bool = True
    hours: float = MAX_SECONDS / 3600
    limits: Limits = Limits()
    damping: ContactDamping | None = None
    original_network: Network | None = None

    def __post_init__(self) -> None:
        if self.solver is not None:
            refuse_unknown("solver", self.solver, SOLVERS)
        terms_of(self.pre_stress)

    @classmethod
    def of(
        cls,
        network: Network,
        *,
        sliding: Sliding = "elastic",
        translations_only: bool = False,
        pre_stress: PreStress = "none",
        solver: str | None = None,
        shapes: bool = True,
        hours: float = MAX_SECONDS / 3600,
        limits: Limits = Limits(),
        damping: ContactDamping | None = None,
    ) -> LinearSystem:
        """Return the system of a network; raise InputError if a choice is unknown.

        `sliding` chooses the springs of contacts at the friction limit, and `translations_only`
        holds the rotations at zero; the other arguments are attributes of the system.
        """
        return cls(
            with_sliding(network, sliding),
            pre_stress=pre_stress,
            dof=3 if translations_only else 6,
            solver=solver,
            shapes=shapes,
            hours=hours,
            limits=limits,
            damping=damping,
            original_network=network,
        )

    @property
    def packing(self) -> Network:
        """The network to which results belong: the one before sliding contacts were replaced."""
        return self.original_network or self.network

    def cached(self, name: str, make: Callable[[], Cached], bytes: float = 0.0) -> Cached:
        """Return the result of `make`, computed once for systems that differ only in the solver.

        The network caches the result under the name, the degrees of freedom, the pre-stress and the
        limits: the result may depend on all of these. A result of more than `MAX_CACHED_BYTES` is
        computed again at every call.
        """
        if bytes > MAX_CACHED_BYTES:
            return make()
        key = f"{name}, {self.dof} a particle, {self.pre_stress}, {self.limits}"
        return self.network.cached(key, make)

    def cached_recent(
        self, name: str, key: Any, make: Callable[[], Cached], size: Callable[[Cached], float]
    ) -> Cached:
        """Return the result of `make` for a key; the most recent results are cached.

        The last results of a name are kept up to `MAX_CACHED_BYTES` in total; the function `size`
        returns the bytes of a result.
        """
        results = self.cached(name, dict[Any, Cached])
        if key in results:
            return results[key]
        result = make()
        if size(result) <= MAX_CACHED_BYTES:
            while results and sum(map(size, results.values())) + size(result) > MAX_CACHED_BYTES:
                oldest = next(iter(results))
                del results[oldest]
            results[key] = result
        return result

    @property
    def size(self) -> int:
        """Number of rows of matrices and vectors: the motions of all bodies, held ones included."""
        return self.dof * self.network.n_particles

    @property
    def free_rows(self) -> Ints:
        """Rows (degrees_of_freedom,) of the motions that the bodies can make."""
        return self.cached(
            "free rows", lambda: np.flatnonzero(self.network.free_motions[:, : self.dof])
        )

    @property
    def degrees_of_freedom(self) -> int:
        """Number of motions that the bodies can make."""
        if self.network.fixed is None:
            return self.size
        return len(self.free_rows)

    @property
    def held_motions(self) -> sp.csc_matrix:
        """Unit vectors (size, h) of the motions that bodies cannot make."""
        is_held = np.zeros(self.size, bool)
        if self.network.fixed is not None:
            is_held = self.network.fixed[:, : self.dof].ravel()
        rows = np.flatnonzero(is_held)
        columns = np.arange(len(rows))
        return sp.csc_matrix((np.ones(len(rows)), (rows, columns)), (self.size, len(rows)))

    @property
    def direct_solver(self) -> str | None:
        """Name of the direct factorisation; None for the fastest, or if the solver is iterative."""
        if self.solver is None or not named(self.solver).direct:
            return None
        return self.solver

    @property
    def symmetric(self) -> bool:
        """Whether K is symmetric; with all terms of the contact forces it is not."""
        return self.pre_stress in SYMMETRIC

    @property
    def semidefinite(self) -> bool:
        """Whether no motion can release energy: no spring is negative, and no force is carried."""
        if self.pre_stress != "none":
            return False
        kn = self.network.stiffness_normal
        kt = self.network.stiffness_tangential
        return min(kn.min(initial=0.0), kt.min(initial=0.0)) >= 0

    @property
    def sqrt_mass(self) -> RootMass:
        """The root M^1/2 of the mass matrix, kg^1/2 and kg^1/2 m."""
        return self.cached("root of the mass", lambda: RootMass.of(self.network, self.dof))

    @property
    def diagonal_blocks(self) -> Floats:
        """Blocks (n, dof, dof) of A of each particle with itself, 1/s^2; computed at every call."""
        blocks = diagonal_blocks(self.network, self.pre_stress)
        return RootMass.of(self.network).around_blocks(blocks)[:, : self.dof, : self.dof]

    @property
    def diagonal(self) -> Floats:
        """The diagonal (size,) of A = M^-1/2 K M^-1/2, 1/s^2."""
        return self.cached("diagonal", lambda: np.einsum("naa->na", self.diagonal_blocks).ravel())

    def assemble_dynamical_matrix(self) -> sp.csr_matrix:
        """Assemble A = M^-1/2 K M^-1/2, sparse (size, size), 1/s^2, at every call.

        The matrix is not kept, so that its memory is free while a factorisation is in use.
        """
        return _by_rows(self._assemble_blocks())

    def _assemble_blocks(self) -> sp.bsr_matrix:
        """Assemble A in blocks of bodies."""
        return self.sqrt_mass.around(stiffness_blocks(self.network, self.dof, self.pre_stress))

    @cached_property
    def dynamical_matrix(self) -> sp.csr_matrix:
        """A as from `assemble_dynamical_matrix`, kept for callers that use it repeatedly."""
        return self.assemble_dynamical_matrix()

    @cached_property
    def row_sum_bound(self) -> float:
        """An upper bound of all omega^2, 1/s^2: the largest sum of |A_ij| in a row.

        The bound holds with certainty, but may be twice too large; `spectral_bound` is closer.
        """
        return float(abs(self.assemble_dynamical_matrix()).sum(axis=1).max())

    @property
    def spectral_bound(self) -> float:
        """An upper bound of all omega^2, or of their real parts, 1/s^2, at most some 4 % too large.

        The bound is too low with the probability `modal.solvers.spectrum.FAILURE_PROBABILITY`.
        """
        return self.spectral_bound_and_cost[0]

    @property
    def spectral_bound_and_cost(self) -> tuple[float, int]:
        """The `spectral_bound`, 1/s^2, and the number of products with A that computing it took."""
        return self.cached("end", lambda: bound_of_spectrum(self.renumbered.symmetric_part()))

    @property
    def highest_frequency(self) -> float:
        """The frequency, Hz, that belongs to `spectral_bound`; 0 without stiffness."""
        return float(np.sqrt(max(self.spectral_bound, 0.0))) / (2 * np.pi)

    def count_uncertainty(self, square: float) -> float:
        """Return the relative distance from a frequency within which a count is uncertain.

        `square` is the omega^2 of the frequency, 1/s^2.
        """
        share = np.inf
        if square:
            share = COUNT_ROUND_OFF * self.diagonal.max() / abs(square)
        return float(np.clip(share, MIN_COUNT_UNCERTAINTY, MAX_COUNT_UNCERTAINTY))

    @property
    def resolution(self) -> float:
        """Round-off of an omega^2, 1/s^2: eps times A's largest diagonal entry."""
        return float(np.finfo(float).eps * self.diagonal.max(initial=0.0))

    @property
    def zero_threshold(self) -> float:
        """The omega^2, 1/s^2, up to which no factorisation can separate a mode from a zero mode."""
        return COUNT_ROUND_OFF * float(self.diagonal.max(initial=0.0))

    @property
    def zero_frequency(self) -> float:
        """The frequency, Hz, of `zero_threshold`."""
        return float(np.sqrt(self.zero_threshold)) / (2 * np.pi)

    @cached_property
    def operator(self) -> ContactOperator:
        """The product of A with vectors, computed contact by contact where numba is installed.

        A small operator is cached with the network.
        """
        return self.cached("operator", self._make_operator, self._operator_bytes)

    @cached_property
    def renumbered(self) -> ContactOperator:
        """`operator` with its bodies in the order of the loops (`ContactOperator.renumbered`)."""
        return self.cached(
            "renumbered operator",
            lambda: self._make_operator().renumbered(),
            self._operator_bytes,
        )

    @property
    def _operator_bytes(self) -> int:
        """An upper bound of the memory of an operator."""
        return OPERATOR_BYTES_PER_CONTACT * self.network.n_contacts

    def _make_operator(self) -> ContactOperator:
        """Return a new operator of A."""
        return ContactOperator(self.network, self.dof, mass_scaled=True, pre_stress=self.pre_stress)

    @cached_property
    def dashpots(self) -> LinearSystem | None:
        """A system whose matrix K is the damping matrix C of this one; None without dashpots."""
        if self.damping is None or self.damping.none:
            return None
        return LinearSystem(self.damping.dashpots(self.network), dof=self.dof)

    def put_on(self, imposed: Imposed) -> Coupling:
        """Compute the coupling of an imposed motion with the bodies.

        The coupling is in N and N m per metre or radian, with six rows for each body, and not
        mass-scaled.
        """
        return put_on(self.network, terms_of(self.pre_stress), imposed)

    def shifted(self, square: float) -> sp.csr_matrix:
        """Return A minus `square`, an omega^2 in 1/s^2, times the identity; sparse (size, size).

        The diagonal entries of held motions are positive instead, so that held motions do not
        change the number of negative eigenvalues.
        """
        return _by_rows(self._shifted_blocks(square))

    def _shift(self, square: float) -> Floats:
        """Return what `shifted` adds to the diagonal of A, 1/s^2, by bodies (n, dof)."""
        shift = np.full((self.network.n_particles, self.dof), -square)
        if self.network.fixed is not None:
            held = self.network.fixed[:, : self.dof]
            shift[held] = self.diagonal.max(initial=0.0) or 1.0
        return shift

    def _shifted_blocks(self, square: float) -> sp.bsr_matrix:
        """Return the matrix of `shifted` in blocks of bodies."""
        shift = self._shift(square)
        matrix = self._assemble_blocks()
        rows = np.repeat(np.arange(len(shift)), np.diff(matrix.indptr))
        own_blocks = np.flatnonzero(matrix.indices == rows)
        for k in range(self.dof):
            matrix.data[own_blocks, k, k] += shift[:, k]
        return matrix

    def factorised(
        self,
        square: float,
        *,
        definite: bool = False,
        solver: str | None = None,
        kept: bool = True,
        soft: SoftMotions | None = None,
    ) -> Factor:
        """Factorise A - `square`, with arguments as in `modal.solvers.factor.factorise`.

        The order of the rows may follow the longest side of the packing.
        """
        position = self.network.position
        along = position[:, np.argmax(np.ptp(position, axis=0))]
        if solver is not None and not named(solver).direct:
            shift = self._shift(square).reshape(-1, 1)
            return factorise(
                self._shifted_blocks(square),
                definite=definite,
                solver=solver,
                kept=kept,
                along=along,
                soft=soft,
                apply=lambda motion: self.operator.apply(motion) + shift * motion,
            )
        return factorise(
            self.shifted(square),
            definite=definite,
            solver=solver,
            kept=kept,
            along=np.repeat(along, self.dof),
        )

    def factor(
        self,
        square: float,
        *,
        definite: bool,
        solver: str | None = None,
        soft: SoftMotions | None = None,
    ) -> Factor:
        """Return a factorisation of A - `square`, by `solver` or the direct solver of the system.

        `soft` are the soft motions that an iterative solver needs.

        The last factorisations are cached with the network, up to `MAX_CACHED_BYTES` in total.
        """
        name = solver or self.direct_solver

        def make() -> Factor:
            factor = self.factorised(square, definite=definite, solver=name, soft=soft)
            if factor.bytes > MAX_CACHED_BYTES:
                return factor
            # Users may release a factor as usual; the memory goes with the last reference.
            shared = replace(factor, release=lambda: None)
            finalize(shared, factor.release).atexit = False
            return shared

        key = (square, definite, name)
        return self.cached_recent("factors", key, make, lambda factor: factor.bytes)


def _by_rows(blocks: sp.bsr_matrix) -> sp.csr_matrix:
    """Return a matrix in blocks by rows, without zeros, which would fill a factor."""
    matrix = blocks.tocsr()
    matrix.eliminate_zeros()
    return matrix


def frequency_of(square: Floats) -> Floats:
    """Return the frequency, Hz, of an omega^2, 1/s^2; negative for a negative omega^2.

    An omega^2 is negative if a mode is unstable, or by round-off.
    """
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)
