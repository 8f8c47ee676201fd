"""The linear system M u'' + C u' + K u = 0 of a packing: modes, waves, moduli are asked of it."""

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
from modal.solvers.factor import SOLVERS, Factor, factorise
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.assembly import own_blocks, stiffness_matrix
from modal.system.contacts import SYMMETRIC, terms_of, with_sliding
from modal.system.damping import ContactDamping
from modal.system.imposed import Coupling, Imposed, put_on
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.arrays import Floats
from modal.tools.errors import refuse_unknown
from modal.tools.workload import MAX_SECONDS

COUNTED = 1e-11
"""How far round-off of a factorisation may move an omega^2, relative to A's largest diagonal entry;
mostly it is a tenth of that. Modes so close to a frequency may be counted on either side of it."""
KEPT, CONTACT = 2e8, 1000
"""Bytes up to which answers of a kind are kept with a network for the next question, factors, lists
of modes, its operator, of which a contact takes no more than this, as a matrix."""
UNCERTAIN = 1e-9, 0.25
"""Limits of the relative distance from a listed frequency at which modes are counted instead."""


@dataclass(frozen=True)
class Limits:
    """Sizes from which on modes are sought in another way; the defaults suit any packing.

    Degrees of freedom: up to `small` the dense spectrum costs less than anything else; up to
    `dense` (1.7 GB, two minutes) it serves lists of a large part of all modes, one in `part`; up to
    `unsymmetric` (half a minute) it does so for the sake of some modes where K is not symmetric.
    `slice`: modes that one factorisation is asked for; wider intervals are cut by exact counts. Of
    35,201 spheres their basis takes as much memory as two factors; 300 modes about a shift take 2.8
    solves each, 600 take 2.4, and half of the factorisations. `piece`: spheres of a loose part
    whose null space is computed, dense; larger ones are cut into such pieces. `shapes`: bytes of
    mode shapes up to which they are kept, about 1,200 modes of 35,201 spheres. `together`: modes
    that are measured together, which bounds the memory.
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

    `pre_stress` says which terms of the contact forces the stiffness has, as in
    `modal.system.contacts`; `dof` is the number of degrees of freedom of a particle, 6, or 3 with
    translations only; `solver` names the factorisation (`modal.solvers.factor.SOLVERS`), None the
    fastest; `shapes` says whether lists of modes keep their mode shapes; a search whose estimated
    time exceeds `hours` is refused; `limits` as in `Limits`. `damping` of the contacts is known to
    waves and responses alone. `asked_of` is the network that was asked about, where `network` has
    other springs in the place of contacts that slide.
    """

    network: Network
    pre_stress: str = "none"
    dof: int = 6
    solver: str | None = None
    shapes: bool = True
    hours: float = MAX_SECONDS / 3600
    limits: Limits = Limits()
    damping: ContactDamping | None = None
    asked_of: Network | None = None

    def __post_init__(self) -> None:
        if self.solver is not None:
            refuse_unknown("solver", self.solver, SOLVERS)
        terms_of(self.pre_stress)

    @classmethod
    def of(
        cls,
        network: Network,
        *,
        sliding: str = "elastic",
        translations_only: bool = False,
        **options: Any,
    ) -> LinearSystem:
        """The system of a network, `options` as above; `translations_only` holds rotations at zero.

        `sliding` as of `modal.system.contacts.with_sliding`. InputError for unknown choices.
        """
        dof = 3 if translations_only else 6
        return cls(with_sliding(network, sliding), dof=dof, asked_of=network, **options)

    @property
    def packing(self) -> Network:
        """The network that was asked about, to which results belong."""
        return self.asked_of or self.network

    def cached(self, name: str, make: Callable[[], Cached], bytes: float = 0.0) -> Cached:
        """Return what `make` returns, made once for all systems that differ by the solver alone.

        The network keeps the result under the name together with the degrees of freedom, the
        pre-stress and the limits, on all of which it may depend. A result of more than `KEPT`
        bytes is made again at every call.
        """
        if bytes > KEPT:
            return make()
        key = f"{name}, {self.dof} a particle, {self.pre_stress}, {self.limits}"
        return self.network.cached(key, make)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.dof * self.network.n_particles

    @property
    def symmetric(self) -> bool:
        """Whether K is; with all terms of the contact forces it is not."""
        return self.pre_stress in SYMMETRIC

    @property
    def semidefinite(self) -> bool:
        """Whether no motion can release energy: no spring is negative, no force takes part."""
        springs = self.network.stiffness_normal, self.network.stiffness_tangential
        return self.pre_stress == "none" and min(k.min(initial=0.0) for k in springs) >= 0

    @property
    def sqrt_mass(self) -> RootMass:
        """M^1/2."""
        return self.cached("root of the mass", lambda: RootMass.of(self.network, self.dof))

    @property
    def own_blocks(self) -> Floats:
        """Shape (n, dof, dof): A's block of each particle with itself; computed at every call."""
        blocks = own_blocks(self.network, self.pre_stress)
        return RootMass.of(self.network).around_own(blocks)[:, : self.dof, : self.dof]

    @property
    def diagonal(self) -> Floats:
        """Shape (size,): the diagonal of A = M^-1/2 K M^-1/2."""
        return self.cached("diagonal", lambda: np.einsum("naa->na", self.own_blocks).ravel())

    def assemble_dynamical_matrix(self) -> sp.csr_matrix:
        """A = M^-1/2 K M^-1/2, sparse (size, size), 1/s^2; assembled at every call.

        It is not kept, so that its memory is free while a factorisation is in use.
        """
        return self.sqrt_mass.around(stiffness_matrix(self.network, self.dof, self.pre_stress))

    @cached_property
    def dynamical_matrix(self) -> sp.csr_matrix:
        """A as from `assemble_dynamical_matrix`, kept for callers that use it repeatedly."""
        return self.assemble_dynamical_matrix()

    @cached_property
    def bound(self) -> float:
        """Largest row sum of A: an upper bound of the largest omega^2."""
        return float(abs(self.assemble_dynamical_matrix()).sum(axis=1).max())

    @property
    def spectral_bound_and_cost(self) -> tuple[float, int]:
        """An upper bound of omega^2, or of its real part, by some 4 %, and its products."""
        return self.cached("end", lambda: bound_of_spectrum(self.renumbered.symmetric_part()))

    @property
    def spectral_bound(self) -> float:
        """That bound alone."""
        return self.spectral_bound_and_cost[0]

    @property
    def highest_frequency(self) -> float:
        """The frequency of that bound, Hz; 0 without stiffness."""
        return float(np.sqrt(max(self.spectral_bound, 0.0))) / (2 * np.pi)

    def count_uncertainty(self, square: float) -> float:
        """Relative distance from a frequency within which an exact count is uncertain.

        `square` is the omega^2 of the frequency, 1/s^2; the distance is within `UNCERTAIN`.
        """
        share = COUNTED * self.diagonal.max() / abs(square) if square else np.inf
        return float(np.clip(share, *UNCERTAIN))

    @property
    def resolution(self) -> float:
        """What round-off leaves of an omega^2 of zero: eps times A's largest diagonal entry."""
        return float(np.finfo(float).eps * self.diagonal.max(initial=0.0))

    @property
    def zero_threshold(self) -> float:
        """The omega^2, 1/s^2, below which no factorisation tells a mode from one at zero."""
        return COUNTED * float(self.diagonal.max(initial=0.0))

    @property
    def zero_frequency(self) -> float:
        """The same as a frequency, Hz."""
        return float(np.sqrt(self.zero_threshold)) / (2 * np.pi)

    @cached_property
    def operator(self) -> ContactOperator:
        """The product of A with vectors, computed contact by contact where numba is installed.

        A small one is kept with the network.
        """
        return self.cached("operator", self._operator, CONTACT * self.network.n_contacts)

    @cached_property
    def renumbered(self) -> ContactOperator:
        """The same with its bodies as the loops meet them (`ContactOperator.renumbered`)."""
        size = CONTACT * self.network.n_contacts
        return self.cached("renumbered operator", lambda: self._operator().renumbered(), size)

    def _operator(self) -> ContactOperator:
        return ContactOperator(self.network, self.dof, mass_scaled=True, pre_stress=self.pre_stress)

    @cached_property
    def dashpots(self) -> LinearSystem | None:
        """The system whose K is the C of this one; None where the contacts are elastic."""
        if self.damping is None or self.damping.none:
            return None
        return LinearSystem(self.damping.dashpots(self.network), dof=self.dof)

    def put_on(self, imposed: Imposed) -> Coupling:
        """How motions from outside, put on the contacts, and the bodies act on each other.

        In N and N m per metre or radian, six rows a body, as K u is; not mass-scaled.
        """
        return put_on(self.network, terms_of(self.pre_stress), imposed)

    def shifted(self, square: float) -> sp.csr_matrix:
        """A - square times the identity, sparse (size, size); `square` is an omega^2, 1/s^2."""
        return (
            self.assemble_dynamical_matrix() - square * sp.identity(self.size, format="csr")
        ).tocsr()

    def factorised(self, square: float, **options: Any) -> Factor:
        """A factorisation of A - `square`, `options` as of `modal.solvers.factor.factorise`.

        It is told where the rows lie along the longest side.
        """
        place = self.network.position
        along = np.repeat(place[:, np.argmax(np.ptp(place, axis=0))], self.dof)
        return factorise(self.shifted(square), along=along, **options)

    def factor(self, square: float, *, definite: bool, solver: str | None = None) -> Factor:
        """A factorisation of A - `square`, `definite` or not, by `solver` or the system's own.

        The last ones are kept with the network as long as they take `KEPT` bytes together.
        """
        name = solver or self.solver

        def make() -> Factor:
            factor = self.factorised(square, definite=definite, solver=name)
            if factor.bytes > KEPT:
                return factor
            kept = replace(factor, release=lambda: None)
            finalize(kept, factor.release).atexit = False
            return kept

        return self.kept("factors", (square, definite, name), make, lambda factor: factor.bytes)

    def kept(
        self, name: str, key: Any, make: Callable[[], Cached], size: Callable[[Cached], float]
    ) -> Cached:
        """What `make` gives for a key; the last ones of a name stay, `KEPT` bytes together."""
        known = self.cached(name, dict[Any, Cached])
        if key in known:
            return known[key]
        made = make()
        if size(made) <= KEPT:
            while known and sum(map(size, known.values())) + size(made) > KEPT:
                del known[next(iter(known))]
            known[key] = made
        return made


def frequency_of(square: Floats) -> Floats:
    """f = omega / 2 pi in Hz; negative omega^2 (unstable or round-off) gives negative f."""
    return np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)
