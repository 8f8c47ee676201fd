"""Modes of a packing with viscous contacts: frequency, decay and quality factor of each.

(lambda^2 M + lambda C + K) phi = 0, lambda = -gamma + i omega. The modes near a frequency come from
Arnoldi's method on the inverse of the state-space matrix about a shift, with one complex
factorisation of lambda^2 + lambda C + A (F. Tisseur and K. Meerbergen, SIAM Review 43, 235, 2001).
Where the packing is too large for that, the decay of the elastic modes to first order in the
damping is `modal.modes.first_order.decay_rates`.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eig

from modal.modes.counts import check_count
from modal.modes.first_order import decay_rates as decay_rates
from modal.modes.zero_modes import by_structure
from modal.packing.network import Network
from modal.solvers.arnoldi import eigenpairs
from modal.solvers.factor import factorise
from modal.solvers.lanczos import SEED
from modal.system.assembly import stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Complex, Floats
from modal.tools.display import quantity
from modal.tools.errors import InputError
from modal.tools.progress import progress

FEW = 200
"""Degrees of freedom up to which all modes are found at once: hardly any may oscillate among many
motions without energy."""
BASIS = 100
"""Vectors of Arnoldi's method. A fifth of them take a fifth of the memory, and five times as many
solves among modes that lie as close as those of a thousand spheres."""
MOST = 3000
"""Solves before a search is given up: ten times what the packings of the documents have taken."""
STANDS = 1e-6
"""Of the frequency about which modes are sought: what is slower is taken for no oscillation.
Round-off spreads motions without energy, whose rates are zero twice, over some 1e-8 of it."""


@dataclass(frozen=True, repr=False)
class DampedModes:
    """k modes that oscillate, in ascending order of their frequencies.

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


@checked
def damped_modes(
    network: Network, damping: ContactDamping, *, near: float, count: int = 10
) -> DampedModes:
    """The `count` modes of a packing with viscous contacts that are nearest to `near`, Hz.

    Near is the rate lambda to 2 pi i `near` in the complex plane: a mode that decays fast is far
    from its own frequency. Motions that do not oscillate, overdamped or without energy, are not
    among them. No count says that the list is complete: of several modes with one rate, as crystals
    have, a large packing's list may lack some.

    Parameters
    ----------
    network : Network
        The packing.
    damping : ContactDamping
        Ratios of the dashpots, normal and tangential.
    near : float
        Hz, above 0.
    count : int, default 10
        How many modes.

    Returns
    -------
    DampedModes
        `frequency` Hz, `decay` 1/s, `quality`, each (count,); `shape` (count, n, 6).

    Raises
    ------
    InputError
        Where fewer oscillate or converge, and where the factorisation would take more than the
        memory: `decay_rates` of elastic modes then serves.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> found = damped_modes(crystal, ContactDamping(0.02, 0.02), near=1e5, count=4)
    >>> found.quality.round(1)
    array([12.3, 12. , 12. , 11.6])
    """
    system = LinearSystem.of(network)
    if not frequencies(near) > 0:
        raise InputError("input", f"modes near {near:g} Hz", remedy="give a frequency above 0")
    check_count(system, count, system.size - (0 if system.size <= FEW else 2))
    A = system.assemble_dynamical_matrix()
    C = system.sqrt_mass.around(stiffness_matrix(damping.dashpots(network)))  # M^-1/2 C M^-1/2, 1/s
    shift = 2j * np.pi * near
    slow = max(STANDS * abs(shift), 10 * np.sqrt(system.resolution))
    if system.size <= FEW:
        rate, phi = _all_rates(A, C, shift, slow)
    else:
        rate, phi = _rates_near(A, C, by_structure(system).basis, shift, count, slow)
    if len(rate) < count:
        raise InputError(
            "input", f"{count} modes asked, but only {len(rate)} oscillate", remedy="ask for fewer"
        )
    nearest = np.argsort(abs(rate - shift))[:count]
    order = nearest[np.argsort(rate[nearest].imag)]
    rate, phi = rate[order], phi[:, order] / np.linalg.norm(phi[:, order], axis=0)
    left = A @ phi + (C @ phi) * rate + phi * rate**2
    shape = system.sqrt_mass.over(phi).T.reshape(count, -1, 6)
    residual = np.linalg.norm(left, axis=0) / abs(rate) ** 2
    return DampedModes(rate.imag / (2 * np.pi), -rate.real, shape, residual)


def _all_rates(
    A: sp.csr_matrix, C: sp.csr_matrix, shift: complex, slow: float
) -> tuple[Complex, Complex]:
    """Rates (k,) and motions (size, k) of all modes that oscillate faster than `slow`, 1/s."""
    size, unit = A.shape[0], abs(shift)
    identity = unit * np.eye(size)
    rate, vector = eig(np.block([[0 * identity, identity], [-A.toarray() / unit, -C.toarray()]]))
    forwards = rate.imag > slow
    return rate[forwards], vector[:size, forwards]


def _rates_near(
    A: sp.csr_matrix, C: sp.csr_matrix, free: sp.csr_matrix, shift: complex, count: int, slow: float
) -> tuple[Complex, Complex]:
    """The same of those nearest to `shift`, 1/s, `count` or more, as far as there are so many.

    Motions without energy, orthonormal in `free` (size, f), are kept out: they meet no dashpot.
    InputError where `MOST` solves are not enough.
    """
    size = A.shape[0]
    identity = sp.identity(size, format="csr")
    # A shift on the imaginary axis: its square is real.
    stiff = (A + (shift**2).real * identity).tocsr()
    remedy, near = "take decay_rates of elastic modes", shift.imag / (2 * np.pi)
    factor = factorise(stiff + 1j * shift.imag * C, remedy=remedy)
    solves = progress(MOST, f"modes near {near:g} Hz, at most")

    def elastic(motion: Complex) -> Complex:
        return motion - free @ (free.T @ motion)

    def invert(state: Complex) -> Complex:
        if next(solves, None) is None:
            raise InputError(
                "input",
                f"{count} modes near {near:g} Hz did not converge in {MOST} solves",
                remedy=(f"ask for fewer, or near another frequency, or {remedy}"),
            )
        first, second = elastic(state[:size]), elastic(state[size:])
        place = -elastic(factor.solve(second + C @ first + shift * first))
        return np.concatenate([place, first + shift * place])

    def apply(state: Complex) -> Complex:
        return np.concatenate([state[size:], -(A @ state[:size]) - C @ state[size:]])

    # Velocities in units of the shift, as large as displacements.
    start = np.random.default_rng(SEED).standard_normal(2 * size) + 0j
    start[size:] *= abs(shift)
    # Of a pair of conjugate rates the one that turns forwards, which is the nearer one.
    rate, vector = eigenpairs(
        apply,
        invert(start),
        count,
        lambda rate: rate.imag > slow,
        inverse=invert,
        sigma=shift,
        ask=count,
        basis=max(BASIS, 4 * count),
        tolerance=1e-10,
        what=f"modes near {near:g} Hz",
    )
    solves.close()
    factor.release()
    forwards = rate.imag > slow
    return rate[forwards], vector[:size, forwards]
