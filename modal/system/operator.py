"""Multiply by K without a matrix: a loop over the contacts, compiled where numba is installed.

The loop reads 64 bytes for each contact, where the sparse matrix has 72 numbers, and runs on all
cores. Without numba, for translations alone, and with a pre-stress that makes K unsymmetric, the
assembled matrix is used instead.
"""

from __future__ import annotations

import copy

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from modal.packing.network import Network
from modal.solvers.chebyshev import WIDTHS
from modal.system.assembly import stiffness_blocks
from modal.system.contact_order import OrderedContacts
from modal.system.contacts import SYMMETRIC, PreStress
from modal.system.root_mass import RootMass
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.workload import refuse_above_memory

ASSEMBLY_BYTES_PER_CONTACT = 5000.0
"""Memory while the matrix of contacts is assembled, measured."""


class ContactOperator(LinearOperator):
    """K of a network, or M^-1/2 K M^-1/2, as an operator on (6n,) and (6n, k) arrays.

    A particle has six entries, u (m) then theta, or three with a `dof` of 3. `mass_scaled` gives
    the operator whose eigenvalues are omega^2; `pre_stress` is described in
    `modal.system.contacts`. The operator equals the matrix of `modal.system.assembly` up to
    round-off; with a `dof` of 3, and with the pre-stress "full" or "law", it multiplies by this
    matrix.
    """

    def __init__(
        self,
        network: Network,
        dof: int = 6,
        *,
        mass_scaled: bool = False,
        pre_stress: PreStress = "none",
    ) -> None:
        from modal.tools.loops import numba  # not at import: it loads numba

        self.pre_stress = pre_stress
        self.dof = dof
        self.order: Ints | None = None
        super().__init__(np.dtype(float), 2 * (dof * network.n_particles,))
        self._matrix: sp.csr_matrix | None = None
        self._unturning: Floats | None = None
        self._free: Bools | None = None
        if numba is None or dof == 3 or pre_stress not in SYMMETRIC:
            refuse_above_memory(
                ASSEMBLY_BYTES_PER_CONTACT * network.n_contacts,
                f"the matrix of {network.n_contacts} contacts",
                "take fewer; all motions with pre-stress none or normal take no matrix by numba",
            )
            matrix = stiffness_blocks(network, dof, pre_stress)
            if mass_scaled:
                matrix = RootMass.of(network, dof).around(matrix)
            self._matrix = matrix.tocsr()
            return
        self._contacts = OrderedContacts.from_network(network, pre_stress)
        self._scale = np.ones((network.n_particles, 2))
        if mass_scaled:
            self._scale = 1 / np.sqrt(np.column_stack([network.mass, network.inertia]))
            self._unturning = RootMass.of(network).unturning
        if self._unturning is not None:
            self._scale[:, 1] = 1
        if mass_scaled and network.fixed is not None:
            self._hold(network.fixed)

    def _hold(self, fixed: Bools) -> None:
        """Give a scale of zero to held motions (n, 6).

        The loops have one scale for the displacements of a body and one for its rotations. If only
        one or two of three motions are held, motions and forces are also multiplied by `_free` (n,
        6), outside the loops.
        """
        by_kind = fixed.reshape(-1, 2, 3)
        all_held = by_kind.all(axis=2)
        self._scale[all_held] = 0.0
        if (by_kind.any(axis=2) & ~all_held).any():
            self._free = ~fixed

    def renumbered(self) -> ContactOperator:
        """Return the operator with particles renumbered in the order of its loops.

        This operator is a third faster; `inward` and `outward` convert motions to its numbering and
        back. Without loops the operator itself is returned.
        """
        if self._matrix is not None:
            return self
        other = copy.copy(self)
        other._contacts, other.order = self._contacts.renumbered()
        other._scale = self._scale[other.order]
        if self._unturning is not None:
            other._unturning = self._unturning[other.order]
        if self._free is not None:
            other._free = self._free[other.order]
        return other

    def symmetric_part(self) -> ContactOperator:
        """Return (A + A^T) / 2; its largest eigenvalue bounds the real part of those of A."""
        if self._matrix is None:
            return self
        other = copy.copy(self)
        other._matrix = ((self._matrix + self._matrix.T) / 2).tocsr()
        return other

    @property
    def has_loops(self) -> bool:
        """Whether products use compiled loops over contacts, not a matrix."""
        return self._matrix is None

    @property
    def nbytes(self) -> int:
        """Return the bytes of all arrays that a product reads, except the motions."""
        if self._matrix is not None:
            arrays = [self._matrix.data, self._matrix.indices, self._matrix.indptr]
        else:
            arrays = [*self._contacts, self._scale]
        return sum(array.nbytes for array in arrays if array is not None)

    def inward(self, u: Array) -> Array:
        """Return motions (dof n,) or (dof n, k) of the particles in the operator's numbering."""
        if self.order is None:
            return u
        return u.reshape(len(self.order), self.dof, -1)[self.order].reshape(u.shape)

    def outward(self, u: Array) -> Array:
        """Return motions, given in the operator's numbering, in that of the particles."""
        if self.order is None:
            return u
        renumbered = u.reshape(len(self.order), self.dof, -1)
        by_particle = np.empty_like(renumbered, order="C")
        by_particle[self.order] = renumbered
        return by_particle.reshape(u.shape)

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
        """Set out = alpha K u + beta u + gamma out in place, for arrays (6n,) or (6n, k).

        Arrays in C order need no copies. `sums` (2, 6, k) receive, for each component and column,
        the sums over the particles of the products out out and out u, with the values of `out`
        before the call.
        """
        if u.shape != out.shape or len(u) != self.shape[0]:
            raise ValueError(f"u and out have shapes {u.shape}, {out.shape}; take {self.shape[0]}")
        if np.iscomplexobj(u) or np.iscomplexobj(out):
            raise ValueError("motions are real: give real and imaginary parts as two columns")
        if self._matrix is None and self._unturning is None and self._free is None:
            source = np.ascontiguousarray(u, dtype=float)
            target = np.ascontiguousarray(out, dtype=float)
            self._loop(source, target, (alpha, beta, gamma), sums)
            if target is not out:
                out[...] = target
            return out
        if sums is not None:
            sums[:] = component_sums(out, u, self.dof)
        force = self._multiply_beside_loops(u) if self._matrix is None else self._matrix @ u
        # A `gamma` of 0 also clears a NaN.
        out[...] = gamma * out if gamma else 0.0
        out += alpha * force
        if beta:
            out += beta * u
        return out

    def _multiply_beside_loops(self, u: Floats) -> Floats:
        """Return K u for bodies with tensors of inertia, or with one or two of three motions held.

        The loops scale by the masses alone; the inverse roots of the tensors, `_unturning`
        (n, 3, 3), and `_free` are multiplied before and after.
        """
        by_body = (len(self._scale), self.dof, -1)
        scaled = np.array(u, order="C")
        force = np.zeros(u.shape)
        self._scale_beside_loops(scaled.reshape(by_body))
        self._loop(scaled, force, (1.0, 0.0, 0.0), None)
        self._scale_beside_loops(force.reshape(by_body))
        return force

    def _scale_beside_loops(self, motion: Floats) -> None:
        """Multiply motions or forces (n, 6, k), in place, by the factors that the loops lack."""
        if self._unturning is not None:
            motion[:, 3:] = self._unturning @ motion[:, 3:]
        if self._free is not None:
            motion *= self._free[:, :, None]

    def _loop(
        self, u: Floats, out: Floats, factors: tuple[float, float, float], sums: Floats | None
    ) -> None:
        """Run `combine` by the compiled loops, for real arrays in C order."""
        from modal.system.loops import Division, Factors, Vectors, combine_by_slabs
        from modal.tools.loops import threads_for

        width = u.size // self.shape[0]
        shape = (-1, self.dof, width)
        contacts = self._contacts
        single = True if width == 1 else None
        springs_alone = contacts.lateral is None and contacts.aside is None
        springs_alone = springs_alone and contacts.rolling is None
        # Loops are compiled for these numbers of columns, and springs alone.
        columns = (0,) * width if springs_alone and width in WIDTHS else None
        slab_sums = None
        if sums is not None:
            slab_sums = np.zeros((len(contacts.slabs), 2, self.dof, width))
        combine_by_slabs(
            contacts,
            self._scale,
            Vectors(u.reshape(shape), out.reshape(shape)),
            Factors(*map(float, factors)),
            columns,
            slab_sums,
            Division(single, threads_for(len(self._scale))),
        )
        if sums is not None and slab_sums is not None:
            sums[:] = slab_sums.sum(axis=0).reshape(sums.shape)

    def apply(self, u: Array) -> Array:
        """Return K u for u of shape (6n,) or (6n, k)."""
        return self.combine(u, np.empty(u.shape), 1.0)

    _matvec = _matmat = apply


def component_sums(a: Floats, b: Floats, dof: int = 6) -> Floats:
    """Return the sums over particles of the products a a and a b, for motions (dof n, k).

    The shape is (2, dof, k).
    """
    by_particle = (len(a) // dof, dof, -1)
    a = a.reshape(by_particle)
    b = b.reshape(by_particle)
    return np.stack([np.einsum("ncv,ncv->cv", a, a), np.einsum("ncv,ncv->cv", a, b)])
