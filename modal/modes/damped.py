"""Modes of a packing with viscous contacts: frequency, decay and quality factor of each.

(lambda^2 M + lambda C + K) phi = 0, lambda = -gamma + i omega. The modes near a frequency come from
Arnoldi's method on the inverse of the state-space matrix about a shift, with one complex
factorisation of lambda^2 + lambda C + A (F. Tisseur and K. Meerbergen, SIAM Review 43, 235, 2001).
Where the packing is too large for that, the decay of the elastic modes to first order in the
damping is `decay_rates`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigs, splu

from modal.arguments import checked
from modal.display import axes_of, quantity
from modal.formats.arrays import Complex, Floats
from modal.formats.hdf5 import InputError
from modal.modes.mode_set import ModeSet
from modal.modes.problem import Eigenproblem
from modal.packing.network import Network
from modal.solvers.factor import SUPERLU_FILL
from modal.stiffness.damping import ContactDamping
from modal.stiffness.matrices import stiffness_matrix
from modal.stiffness.operator import ContactOperator
from modal.workload import refuse_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class DampedModes:
    """k modes, the nearest to a frequency, in ascending order of theirs.

    frequency (k,) Hz, of the oscillation; decay (k,) 1/s, of the amplitude; shape (k, n, 6),
    complex, of unit norm in the mass; residual (k,), |(lambda^2 M + lambda C + K) phi| over
    |lambda|^2, mass-scaled.
    """

    frequency: Floats
    decay: Floats
    shape: Complex
    residual: Floats

    @property
    def quality(self) -> Floats:
        """Shape (k,): quality factor |lambda| / (2 gamma), infinite without damping."""
        size = np.hypot(2 * np.pi * self.frequency, self.decay)
        with np.errstate(divide="ignore"):
            return size / (2 * abs(self.decay))

    def __repr__(self) -> str:
        ends = " to ".join(quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
        return (
            f"<DampedModes: {len(self.frequency)} modes from {ends}, quality "
            f"{self.quality.min():.4g} to {self.quality.max():.4g}>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the quality factor over frequency; returns the Axes."""
        ax = axes_of(ax)
        ax.semilogy(self.frequency / 1e3, self.quality, ".")
        ax.set(xlabel="frequency, kHz", ylabel="quality factor")
        return ax


@checked
def damped_modes(
    network: Network, damping: ContactDamping, *, near: float, count: int = 10
) -> DampedModes:
    """The `count` modes with a frequency nearest to `near`, Hz, of a packing with viscous contacts.

    Motions without energy are not among them if `near` lies above zero far enough. InputError where
    the factorisation would take more than the memory: `decay_rates` of elastic modes then serves.

    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> found = damped_modes(crystal, ContactDamping(0.02, 0.02), near=1e5, count=4)
    >>> found.quality.round(1)
    array([12.3, 12. , 12. , 11.6])
    """
    problem = Eigenproblem.of(network)
    if not (0 < near < np.inf and 1 <= count <= problem.size - 2):
        raise InputError(
            f"{count} modes near {near:g} Hz: give a frequency above 0, and 1 to "
            f"{problem.size - 2} modes"
        )
    A = problem.assembled()
    C = _scaled_dashpots(problem, damping)
    refuse_above(
        0.0,
        2 * SUPERLU_FILL * A.nnz,
        "complex modes take seconds to hours",
        "take decay_rates of elastic modes",
    )
    size, shift = problem.size, 2j * np.pi * near
    identity = sp.identity(size, format="csr")
    factor = splu((A + shift * C + shift**2 * identity).tocsc())

    def invert(state: Complex) -> Complex:
        first, second = state[:size], state[size:]
        place = -factor.solve(second + C @ first + shift * first)
        return np.concatenate([place, first + shift * place])

    def apply(state: Complex) -> Complex:
        return np.concatenate([state[size:], -(A @ state[:size]) - C @ state[size:]])

    whole = (2 * size, 2 * size)
    # Velocities in units of the shift, as large as displacements.
    start = np.random.default_rng(20170729).standard_normal(2 * size) + 0j
    start[size:] *= abs(shift)
    rate, vector = eigs(
        LinearOperator(whole, apply, dtype=complex),
        k=count,
        sigma=shift,
        OPinv=LinearOperator(whole, invert, dtype=complex),
        v0=start,
        tol=1e-10,
    )
    order = np.argsort(rate.imag)
    rate, phi = rate[order], vector[:size, order]
    phi = phi / np.linalg.norm(phi, axis=0)
    left = A @ phi + (C @ phi) * rate + phi * rate**2
    shape = (phi / np.sqrt(problem.mass)[:, None]).T.reshape(count, -1, 6)
    residual = np.linalg.norm(left, axis=0) / abs(rate) ** 2
    return DampedModes(rate.imag / (2 * np.pi), -rate.real, shape, residual)


def decay_rates(modes: ModeSet, network: Network, damping: ContactDamping) -> Floats:
    """Shape (k,), 1/s: decay of the amplitude of elastic modes, phi C phi / 2 for unit mass.

    First order in the damping, for modes that it does not mix: of equal frequencies the modes may
    be listed in another mixture than the damping would have, but their sum is right. InputError
    where the mode shapes were not kept.
    """
    shape = modes.shapes().reshape(len(modes.frequency), -1).T
    dashpots = ContactOperator(damping.dashpots(network))
    return np.einsum("ik,ik->k", shape, dashpots.apply(np.ascontiguousarray(shape))) / 2


def _scaled_dashpots(problem: Eigenproblem, damping: ContactDamping) -> sp.csr_matrix:
    """M^-1/2 C M^-1/2, sparse (size, size), 1/s."""
    scale = sp.diags(1 / np.sqrt(problem.mass))
    return (scale @ stiffness_matrix(damping.dashpots(problem.network)) @ scale).tocsr()
