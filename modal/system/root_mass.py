"""Multiply by M^1/2 and M^-1/2, with the mass matrix M of the bodies of a packing.

For v = M^1/2 u the equation of motion is v'' + A v = 0, A = M^-1/2 K M^-1/2. Spheres have one
moment of inertia, and M is diagonal. Bodies of another shape (clumps) have a tensor of inertia: M
then has a block of 3 by 3 for the rotations of each body.

A motion that a body cannot make (`Network.fixed`) has a row of zeros in M^1/2 and in M^-1/2, as if
its mass were infinite: A then has no entries in that row and that column, and v stays zero there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.assembly import mass_diagonal
from modal.tools.arrays import Array, Floats

MIN_FREE_INERTIA = 1e-12
"""Least principal moment of inertia of the turns that a body can make, divided by its inertia;
below it lies the round-off of a held turn."""


@dataclass(frozen=True)
class RootMass:
    """M^1/2 for motions (dof n,) with 6 or 3 entries for each body; kg^1/2 and kg^1/2 m.

    Attributes
    ----------
    diagonal : ndarray (dof n,)
        Diagonal of M^1/2; zero for held motions.
    turning, unturning : ndarray (n, 3, 3) or None
        Roots of the tensors of inertia, and their inverses, used for rotations instead of the
        diagonal; None for spheres.
    """

    diagonal: Floats
    turning: Floats | None = None
    unturning: Floats | None = None

    @classmethod
    def of(cls, network: Network, dof: int = 6) -> RootMass:
        """Compute M^1/2 of the bodies of a network, for translations alone if `dof` is 3."""
        diagonal = np.sqrt(mass_diagonal(network, dof))
        if network.fixed is not None:
            diagonal[network.fixed[:, :dof].ravel()] = 0.0
        if network.inertia_tensor is None or dof == 3:
            return cls(diagonal)
        tensor = network.inertia_tensor
        if network.fixed is not None:
            turns = ~network.fixed[:, 3:]
            tensor = tensor * turns[:, :, None] * turns[:, None, :]
        value, vector = np.linalg.eigh(tensor)
        # A held turn leaves an eigenvalue of zero, or its round-off.
        is_free = value > MIN_FREE_INERTIA * network.inertia[:, None]
        root = np.sqrt(np.where(is_free, value, 0.0))[:, None, :]
        transposed = vector.transpose(0, 2, 1)
        return cls(diagonal, (vector * root) @ transposed, _divide(vector, root) @ transposed)

    def times(self, u: Array) -> Array:
        """Return M^1/2 u for u of shape (dof n,) or (dof n, k)."""
        return self._scale(u, self.diagonal, self.turning)

    def over(self, v: Array) -> Array:
        """Return M^-1/2 v for v of shape (dof n,) or (dof n, k)."""
        return self._scale(v, _divide(1.0, self.diagonal), self.unturning)

    def _scale(self, u: Array, diagonal: Floats, turning: Floats | None) -> Array:
        """Return u times a diagonal; the matrices `turning`, if given, multiply the rotations."""
        scaled = u * diagonal.reshape(-1, *[1] * (u.ndim - 1))
        if turning is not None:
            by_body = (len(turning), 6, math.prod(u.shape[1:]))
            scaled.reshape(by_body)[:, 3:] = turning @ u.reshape(by_body)[:, 3:]
        return scaled

    def around_blocks(self, blocks: Floats) -> Floats:
        """Return M^-1/2 K M^-1/2 for K's blocks (n, 6, 6) of each body with itself."""
        inverses = self._inverse_blocks()
        return inverses @ blocks @ inverses

    def around(self, K: sp.bsr_matrix) -> sp.bsr_matrix:
        """Return M^-1/2 K M^-1/2 for K in blocks of bodies, which is overwritten."""
        n_bodies = len(K.indptr) - 1
        row = np.repeat(np.arange(n_bodies), np.diff(K.indptr))
        column = K.indices
        scale = _divide(1.0, self.diagonal).reshape(n_bodies, -1)
        if self.unturning is not None:
            scale[:, 3:] = 1.0
        K.data *= scale[row][:, :, None]
        K.data *= scale[column][:, None, :]
        if self.unturning is not None:
            K.data[:, 3:, :] = self.unturning[row] @ K.data[:, 3:, :]
            K.data[:, :, 3:] = K.data[:, :, 3:] @ self.unturning[column]
        return K

    def under(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return `rows` (k, dof n), which act on u, times M^-1/2: they then act on M^1/2 u."""
        return (rows @ self._inverse()).tocsr()

    def _inverse_blocks(self) -> Floats:
        """Return M^-1/2 of each body, shape (n, 6, 6)."""
        n_bodies = len(self.diagonal) // 6
        return self.over(np.tile(np.eye(6), (n_bodies, 1))).reshape(n_bodies, 6, 6)

    def _inverse(self) -> sp.csr_matrix:
        """Return M^-1/2 as a sparse matrix."""
        if self.unturning is None:
            return sp.diags(_divide(1.0, self.diagonal), format="csr")
        blocks = self._inverse_blocks()
        size = 6 * len(blocks)
        starts = np.arange(len(blocks) + 1)
        return sp.bsr_matrix((blocks, starts[:-1], starts), (size, size)).tocsr()


def _divide(numerator: Floats | float, root: Floats) -> Floats:
    """Return the numerator divided by roots of masses; zero where a root is zero."""
    shape = np.broadcast_shapes(np.shape(numerator), root.shape)
    return np.divide(numerator, root, out=np.zeros(shape), where=root > 0)
