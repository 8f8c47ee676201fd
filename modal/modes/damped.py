"""Find modes of a packing with viscous contacts: frequency, decay and quality factor of each.

(lambda^2 M + lambda C + K) phi = 0, lambda = -gamma + i omega. The modes near a frequency are found
by Arnoldi's method on the inverse of the state-space matrix about a shift, with one complex
factorisation of lambda^2 + lambda C + A (F. Tisseur and K. Meerbergen, SIAM Review 43, 235, 2001).
For a packing that is too large for this, `modal.modes.first_order.decay_rates` computes the decay
of the elastic modes to first order in the damping.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eig

from modal.modes.counts import check_count
from modal.modes.first_order import decay_rates as decay_rates
from modal.modes.zero_modes import by_structure
from modal.packing.network import Network
from modal.solvers.arnoldi import ArnoldiSettings, Shift, eigenpairs
from modal.solvers.factor import factorise
from modal.solvers.lanczos import SEED
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Bools, Complex, Floats
from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.tools.progress import progress

MAX_DENSE_SIZE = 200
"""Degrees of freedom up to which all modes are found at once from dense matrices: among many
motions without energy hardly any mode may oscillate."""
MIN_BASIS_VECTORS = 100
"""Least number of vectors of Arnoldi's method. With a fifth of them the memory is a fifth, but five
times as many solves are needed among modes that lie as close as those of a thousand spheres."""
MAX_SOLVES = 3000
"""Number of solves after which a search ends without success: ten times what the packings of the
documents have taken."""
MIN_RATE_SHARE = 1e-6
"""Rate of oscillation below which a motion counts as not oscillating, divided by the requested
rate. Motions without energy have a double rate of zero, which round-off spreads over some 1e-8 of
the requested rate."""

DECAY_RATES = "take decay_rates of elastic modes"
"""Text of the remedy where the search takes too much time or memory."""


@dataclass(frozen=True, repr=False)
class DampedModes:
    """The k oscillating modes of a damped packing, in ascending order of their frequencies.

    Attributes
    ----------
    frequency : ndarray (k,)
        Frequency of the oscillation, Hz.
    decay : ndarray (k,)
        Decay rate of the amplitude, 1/s.
    shape : ndarray (k, n, 6), complex
        Mode shapes of unit norm in the mass.
    residual : ndarray (k,)
        |(lambda^2 M + lambda C + K) phi| / |lambda|^2, mass-scaled.
    """

    frequency: Floats
    decay: Floats
    shape: Complex
    residual: Floats

    @property
    def quality(self) -> Floats:
        """Quality factors |lambda| / (2 gamma), (k,), infinite without damping."""
        rate = np.hypot(2 * np.pi * self.frequency, self.decay)
        with np.errstate(divide="ignore"):
            return rate / (2 * abs(self.decay))

    def __repr__(self) -> str:
        lowest = quantity(float(self.frequency[0]), "Hz")
        highest = quantity(float(self.frequency[-1]), "Hz")
        return (
            f"<DampedModes: {len(self.frequency)} modes from {lowest} to {highest}, quality "
            f"{self.quality.min():.4g} to {self.quality.max():.4g}>"
        )


@checked
def damped_modes(
    network: Network, damping: ContactDamping, *, near: float, count: int = 10
) -> DampedModes:
    """Find the `count` modes of a packing with viscous contacts that are nearest to `near`, Hz.

    The distance is that of the rate lambda from 2 pi i `near` in the complex plane: a mode that
    decays fast is far from its own frequency. Motions that do not oscillate, because they are
    overdamped or without energy, are left out. No count confirms that the list is complete: in a
    large packing some of several modes with the same rate, as crystals have, may be missing.

    Parameters
    ----------
    network : Network
        The packing.
    damping : ContactDamping
        Ratios of the dashpots, normal and tangential.
    near : float
        Frequency, Hz, above 0.
    count : int, default 10
        Number of modes.

    Returns
    -------
    DampedModes
        `frequency` Hz, `decay` 1/s, `quality`, each (count,); `shape` (count, n, 6).

    Raises
    ------
    InputError
        If fewer modes oscillate or converge, or the factorisation would take more than the memory;
        `decay_rates` of elastic modes takes less.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> modes = damped_modes(crystal, ContactDamping(0.02, 0.02), near=1e5, count=4)
    >>> modes.quality.round(1)
    array([12.3, 12. , 12. , 11.6])
    """
    system = LinearSystem.of(network)
    if not frequencies(near) > 0:
        raise InputError("frequency", f"modes near {near:g} Hz", remedy="give a frequency above 0")
    dense = system.size <= MAX_DENSE_SIZE
    available_modes = system.degrees_of_freedom
    if not dense:
        available_modes -= 2  # ARPACK's limit
    check_count(system, count, available_modes)
    A = system.assemble_dynamical_matrix()
    C = LinearSystem(damping.dashpots(network)).assemble_dynamical_matrix()  # M^-1/2 C M^-1/2, 1/s
    shift = 2j * np.pi * near
    min_rate = max(MIN_RATE_SHARE * abs(shift), 10 * np.sqrt(system.resolution))
    if dense:
        rate, phi = _find_all_rates(A, C, shift, min_rate)
    else:
        zero_modes = sp.hstack([by_structure(system).basis, system.held_motions], format="csr")
        rate, phi = _find_rates_near(A, C, zero_modes, shift, count, min_rate)
    if len(rate) < count:
        raise InputError(
            "mode_count",
            f"{count} modes asked, but only {len(rate)} oscillate",
            remedy="ask for fewer",
        )
    nearest = np.argsort(abs(rate - shift))[:count]
    order = nearest[np.argsort(rate[nearest].imag)]
    rate = rate[order]
    phi = phi[:, order] / np.linalg.norm(phi[:, order], axis=0)
    force = A @ phi + (C @ phi) * rate + phi * rate**2
    shape = system.sqrt_mass.over(phi).T.reshape(count, -1, 6)
    residual = np.linalg.norm(force, axis=0) / abs(rate) ** 2
    return DampedModes(rate.imag / (2 * np.pi), -rate.real, shape, residual)


def _find_all_rates(
    A: sp.csr_matrix, C: sp.csr_matrix, shift: complex, min_rate: float
) -> tuple[Complex, Complex]:
    """Find rates (k,) and motions (size, k) of all modes that oscillate faster than `min_rate`.

    Rates are in 1/s; `shift` sets the unit of velocities.
    """
    size = A.shape[0]
    unit = abs(shift)
    identity = unit * np.eye(size)
    rate, vector = eig(np.block([[0 * identity, identity], [-A.toarray() / unit, -C.toarray()]]))
    forwards = rate.imag > min_rate
    return rate[forwards], vector[:size, forwards]


def _find_rates_near(
    A: sp.csr_matrix,
    C: sp.csr_matrix,
    zero_modes: sp.csr_matrix,
    shift: complex,
    count: int,
    min_rate: float,
) -> tuple[Complex, Complex]:
    """Find rates and motions of `count` or more modes nearest to `shift`, 1/s, if so many exist.

    Motions without energy, orthonormal in `zero_modes` (size, f), are kept out: no dashpot resists
    them. Raises InputError if `MAX_SOLVES` solves are not enough.
    """
    size = A.shape[0]
    near = shift.imag / (2 * np.pi)
    identity = sp.identity(size, format="csr")
    # The shift lies on the imaginary axis: its square is real.
    shifted = (A + (shift**2).real * identity).tocsr()
    factor = factorise(shifted + 1j * shift.imag * C, remedy=DECAY_RATES)
    solves = progress(MAX_SOLVES, f"modes near {near:g} Hz, at most")

    def without_zero_modes(motion: Complex) -> Complex:
        return motion - zero_modes @ (zero_modes.T @ motion)

    def invert(state: Complex) -> Complex:
        if next(solves, None) is None:
            raise InputError(
                "not_converged",
                f"{count} modes near {near:g} Hz did not converge in {MAX_SOLVES} solves",
                remedy=f"ask for fewer, or near another frequency, or {DECAY_RATES}",
            )
        displacement = without_zero_modes(state[:size])
        velocity = without_zero_modes(state[size:])
        load = velocity + C @ displacement + shift * displacement
        solution = -without_zero_modes(factor.solve(load))
        return np.concatenate([solution, displacement + shift * solution])

    def apply(state: Complex) -> Complex:
        return np.concatenate([state[size:], -(A @ state[:size]) - C @ state[size:]])

    def oscillates(rate: Complex) -> Bools:
        return rate.imag > min_rate

    # Velocities are in units of the shift, as large as displacements.
    start = np.random.default_rng(SEED).standard_normal(2 * size) + 0j
    start[size:] *= abs(shift)
    rate, vector = eigenpairs(
        apply,
        invert(start),
        count,
        oscillates,
        ArnoldiSettings(count, basis=max(MIN_BASIS_VECTORS, 4 * count), tolerance=1e-10),
        Shift(shift, invert),
        what=f"modes near {near:g} Hz",
    )
    solves.close()
    factor.release()
    # Of a pair of conjugate rates, the one that turns forwards is the nearer one.
    forwards = oscillates(rate)
    return rate[forwards], vector[:size, forwards]
