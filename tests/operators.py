"""Operators with known eigenpairs, with the methods that solvers use of those of packings."""

import numpy as np


class Known:
    """An operator A = Q diag(square) Q^T, by default with Q = 1, which counts its products."""

    pre_stress = "none"

    def __init__(self, square, vector: np.ndarray | None = None) -> None:
        self.square = np.asarray(square, float)
        self.vector = vector
        self.shape = (len(self.square), len(self.square))
        self.products = 0

    def inward(self, u: np.ndarray) -> np.ndarray:
        """Return a vector in the numbering of the operator, which runs backwards unless Q = 1."""
        if self.vector is None:
            return u
        return u[::-1]

    outward = inward

    def apply(self, u: np.ndarray) -> np.ndarray:
        """Return A u, in the numbering of the caller."""
        self.products += u.size // len(u)
        if self.vector is not None:
            return self.vector @ (self.square[:, None] * (self.vector.T @ u))
        return (self.square * u.T).T

    def combine(self, u, out, alpha, beta=0.0, gamma=0.0, *, sums=None) -> np.ndarray:
        """Set out = alpha A u + beta u + gamma out, in the numbering of the operator."""
        product = self.outward(self.apply(self.inward(u)))
        result = alpha * product + beta * u
        if gamma:
            result = result + gamma * out
        out[:] = result
        return out


def rotation(size: int, seed: int) -> np.ndarray:
    """Return random orthonormal vectors, in columns."""
    return np.linalg.qr(np.random.default_rng(seed).standard_normal((size, size)))[0]
