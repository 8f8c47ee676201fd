"""K u without a matrix: one loop over the contacts, compiled by numba where it is installed.

It reads 64 bytes a contact where the sparse matrix holds 72 numbers, and all cores share it.
Without numba, of translations alone, and with pre-stress that makes K unsymmetric, the assembled
matrix does the same.
"""

from __future__ import annotations

import copy

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from modal.packing.network import Network
from modal.solvers.chebyshev import WIDTHS
from modal.system.assembly import stiffness_matrix
from modal.system.contact_order import OrderedContacts
from modal.system.contacts import SYMMETRIC
from modal.system.root_mass import RootMass
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.workload import refuse_above_memory

CONTACT_BYTES = 5000.0
"""Memory for each contact while its matrix is assembled, measured."""


class ContactOperator(LinearOperator):
    """K of a network, or M^-1/2 K M^-1/2, as an operator on (6n,) and (6n, k) arrays.

    Six entries a particle, u (m) then theta; three with a `dof` of 3. `mass_scaled` gives the
    operator whose eigenvalues are omega^2; `pre_stress` as in `modal.system.contacts`.
    Equal to the matrix of `modal.system.assembly` up to round-off; of three entries, and with
    "full" and "law", which are not symmetric, it is that matrix.
    """

    def __init__(
        self,
        network: Network,
        dof: int = 6,
        *,
        mass_scaled: bool = False,
        pre_stress: str = "none",
    ) -> None:
        from modal.tools.loops import numba  # not at import: it loads numba

        self.pre_stress, self.dof = pre_stress, dof
        self.order: Ints | None = None
        super().__init__(np.dtype(float), 2 * (dof * network.n_particles,))
        self._matrix: sp.csr_matrix | None = None
        self._unturning: Floats | None = None
        if numba is None or dof == 3 or pre_stress not in SYMMETRIC:
            task = f"the matrix of {network.n_contacts} contacts"
            remedy = (
                "take fewer; all motions with pre-stress none or normal take no matrix by numba"
            )
            refuse_above_memory(CONTACT_BYTES * network.n_contacts, task, remedy)
            matrix = stiffness_matrix(network, dof, pre_stress)
            self._matrix = RootMass.of(network, dof).around(matrix) if mass_scaled else matrix
            return
        self._contacts = OrderedContacts.of(network, pre_stress)
        self._scale = np.ones((network.n_particles, 2))
        if mass_scaled:
            self._scale = 1 / np.sqrt(np.column_stack([network.mass, network.inertia]))
            self._unturning = RootMass.of(network).unturning
        if self._unturning is not None:
            self._scale[:, 1] = 1

    def renumbered(self) -> ContactOperator:
        """The same operator on motions whose particles are numbered as its loops meet them.

        A third faster where these are numbered otherwise; `inward` and `outward` change to that
        numbering and back. Without the loops, the operator itself.
        """
        if self._matrix is not None:
            return self
        other = copy.copy(self)
        other._contacts, other.order = self._contacts.renumbered()
        other._scale = self._scale[other.order]
        if self._unturning is not None:
            other._unturning = self._unturning[other.order]
        return other

    def symmetric_part(self) -> ContactOperator:
        """(A + A^T) / 2: the real part of no eigenvalue of A lies above its top."""
        if self._matrix is None:
            return self
        other = copy.copy(self)
        other._matrix = ((self._matrix + self._matrix.T) / 2).tocsr()
        return other

    def inward(self, u: Array) -> Array:
        """Motions (dof n,) or (dof n, k) of the particles, numbered as by the operator."""
        if self.order is None:
            return u
        return u.reshape(len(self.order), self.dof, -1)[self.order].reshape(u.shape)

    def outward(self, u: Array) -> Array:
        """The inverse of `inward`."""
        if self.order is None:
            return u
        by_particle = u.reshape(len(self.order), self.dof, -1)
        out = np.empty_like(by_particle, order="C")
        out[self.order] = by_particle
        return out.reshape(u.shape)

    def combine(
        self,
        u: Array,
        out: Array,
        alpha: float,
        beta: float = 0.0,
        gamma: float = 0.0,
        *,
        sums: Floats | None = None,
    ) -> Array:
        """out = alpha K u + beta u + gamma out in place; u and out of shape (6n,) or (6n, k).

        Arrays in C order need no copies. Into `sums` (2, 6, k) are written, for each component and
        column, the sums over the particles of out out and of out u, `out` as it came.
        """
        if u.shape != out.shape or len(u) != self.shape[0]:
            raise ValueError(f"u and out have shapes {u.shape}, {out.shape}; take {self.shape[0]}")
        if np.iscomplexobj(u) or np.iscomplexobj(out):
            raise ValueError("motions are real: give real and imaginary parts as two columns")
        unturning = self._unturning
        if self._matrix is None and unturning is None:
            source = np.ascontiguousarray(u, dtype=float)
            target = np.ascontiguousarray(out, dtype=float)
            self._loop(source, target, (alpha, beta, gamma), sums)
            if target is not out:
                out[...] = target
            return out
        if sums is not None:
            sums[:] = component_sums(out, u, self.dof)
        force = self._matrix @ u if unturning is None else self._turned(u, unturning)
        out[...] = gamma * out if gamma else 0.0
        out += alpha * force
        if beta:
            out += beta * u
        return out

    def _turned(self, u: Floats, unturning: Floats) -> Floats:
        """K u with roots of tensors of inertia around the loops, whose masses are numbers."""
        by_body = (len(self._scale), self.dof, -1)
        turned, force = np.array(u, order="C"), np.zeros(u.shape)
        turned.reshape(by_body)[:, 3:] = unturning @ turned.reshape(by_body)[:, 3:]
        self._loop(turned, force, (1.0, 0.0, 0.0), None)
        force.reshape(by_body)[:, 3:] = unturning @ force.reshape(by_body)[:, 3:]
        return force

    def _loop(
        self, u: Floats, out: Floats, factors: tuple[float, float, float], sums: Floats | None
    ) -> None:
        """`combine` by the compiled loops, of real arrays in C order; alpha, beta, gamma."""
        from modal.system.loops import combine_by_slabs
        from modal.tools.loops import threads_for

        width = u.size // self.shape[0]
        on, shape = self._contacts, (-1, self.dof, width)
        more = on.lateral, on.aside, on.rolling
        known = width in WIDTHS and all(column is None for column in more)
        of_slabs = None if sums is None else np.zeros((len(on.slabs), 2, self.dof, width))
        combine_by_slabs(
            *(u.reshape(shape), out.reshape(shape), True if width == 1 else None),
            (0,) * width if known else None,
            *map(float, factors),
            *(on.rows, on.ends, on.slabs, on.pieces, on.fresh),
            *more,
            *(self._scale, of_slabs, threads_for(len(self._scale))),
        )
        if sums is not None and of_slabs is not None:
            sums[:] = of_slabs.sum(axis=0).reshape(sums.shape)

    def apply(self, u: Array) -> Array:
        """K u for u of shape (6n,) or (6n, k)."""
        return self.combine(u, np.empty(u.shape), 1.0)

    _matvec = _matmat = apply


def component_sums(a: Floats, b: Floats, dof: int = 6) -> Floats:
    """Shape (2, dof, k): sums over the particles of a a and a b, of motions a, b (dof n, k)."""
    first, second = (motion.reshape(len(a) // dof, dof, -1) for motion in (a, b))
    return np.stack([np.einsum("ncv,ncv->cv", first, of) for of in (first, second)])
