"""M^1/2 of a packing's bodies: of v = M^1/2 u the equation of motion is v'' + A v = 0.

A = M^-1/2 K M^-1/2. Spheres have one moment of inertia, and M is diagonal. A body of another shape,
a clump, has a tensor: M is then diagonal but for its block of rotations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.assembly import mass_diagonal
from modal.tools.arrays import Array, Floats, Ints


@dataclass(frozen=True)
class RootMass:
    """M^1/2 on motions (dof n,), dof 6 or 3 entries a body; kg^1/2, kg^1/2 m.

    diagonal (dof n,); turning, unturning (n, 3, 3): root of the tensors of inertia and its inverse,
    which stand in the place of the diagonal's rotations, or None.
    """

    diagonal: Floats
    turning: Floats | None = None
    unturning: Floats | None = None

    @classmethod
    def of(cls, network: Network, dof: int = 6) -> RootMass:
        """That of a network's bodies; with a dof of 3 for their translations alone."""
        diagonal = np.sqrt(mass_diagonal(network, dof))
        if network.inertia_tensor is None or dof == 3:
            return cls(diagonal)
        value, vector = np.linalg.eigh(network.inertia_tensor)
        root = np.sqrt(value)[:, None, :]
        turned = vector.transpose(0, 2, 1)
        return cls(diagonal, (vector * root) @ turned, (vector / root) @ turned)

    def times(self, u: Array) -> Array:
        """M^1/2 u for u of shape (dof n,) or (dof n, k)."""
        return self._scaled(u, self.diagonal, self.turning)

    def over(self, v: Array) -> Array:
        """M^-1/2 v for v of shape (dof n,) or (dof n, k)."""
        return self._scaled(v, 1 / self.diagonal, self.unturning)

    def _scaled(self, u: Array, diagonal: Floats, turning: Floats | None) -> Array:
        out = u * diagonal.reshape(-1, *[1] * (u.ndim - 1))
        if turning is not None:
            by_body = (len(turning), 6, math.prod(u.shape[1:]))
            out.reshape(by_body)[:, 3:] = turning @ u.reshape(by_body)[:, 3:]
        return out

    def some(self, bodies: Ints, dof: int = 6) -> RootMass:
        """That of some bodies, by their numbers (k,)."""
        diagonal = self.diagonal.reshape(-1, dof)[bodies].ravel()
        if self.turning is None or self.unturning is None:
            return RootMass(diagonal)
        return RootMass(diagonal, self.turning[bodies], self.unturning[bodies])

    def around_own(self, blocks: Floats) -> Floats:
        """Shape (n, 6, 6): M^-1/2 K M^-1/2 of each body's own block of K (n, 6, 6)."""
        sides = self._own_inverses()
        return sides @ blocks @ sides

    def around(self, K: sp.csr_matrix) -> sp.csr_matrix:
        """M^-1/2 K M^-1/2; the matrix that is given may be worked on in place."""
        if self.unturning is None:
            scale = 1 / self.diagonal
            K.data *= scale[K.indices]
            K.data *= np.repeat(scale, np.diff(K.indptr))
            return K
        return (self._inverse() @ K @ self._inverse()).tocsr()

    def under(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Of rows that read u, those that read M^1/2 u."""
        return (rows @ self._inverse()).tocsr()

    def _own_inverses(self) -> Floats:
        """Shape (n, 6, 6): M^-1/2 of each body."""
        bodies = len(self.diagonal) // 6
        return self.over(np.tile(np.eye(6), (bodies, 1))).reshape(bodies, 6, 6)

    def _inverse(self) -> sp.csr_matrix:
        """M^-1/2, sparse."""
        if self.unturning is None:
            return sp.diags(1 / self.diagonal, format="csr")
        blocks = self._own_inverses()
        number, size = np.arange(len(blocks) + 1), 6 * len(blocks)
        return sp.bsr_matrix((blocks, number[:-1], number), (size, size)).tocsr()
