"""Find modes where K is not symmetric, because contacts carry shear forces.

The frequencies are still those of K phi = omega^2 M phi, but omega^2 may come in complex pairs, and
inertia counts do not apply. Small packings are solved with dense matrices. For larger ones both
ends of the spectrum are found by Arnoldi's method (ARPACK), without a certificate.
"""

import numpy as np
import scipy.sparse as sp

from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.zero_modes import by_structure
from modal.solvers.arnoldi import ArnoldiSettings, Shift, eigenpairs
from modal.solvers.factor import factorise
from modal.solvers.lanczos import start_block
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Bools, Floats
from modal.tools.errors import InputError

SHIFT_BELOW_ZERO = 1e-7
"""Distance below zero of the shift for the lowest modes, divided by A's largest diagonal entry."""
EXTRA_MODES = 8
"""Number of modes that are sought in addition to those requested, because of complex pairs and zero
modes."""


def real_part(square: Array) -> Floats:
    """Return real values (k,) in place of omega^2: the square of the real part of omega."""
    omega = np.sqrt(square.astype(complex))
    return np.where(square.imag != 0, omega.real**2, square.real)


def real_spectrum(square: Array, vector: Array) -> tuple[Floats, Floats]:
    """Return real omega^2 (k,), ascending, and unit vectors (size, k), from complex eigenpairs.

    A complex pair gives the same frequency twice, the real part of omega / 2 pi. Its two vectors
    span the plane in which the motion turns. They are not exact modes, as their residual shows.
    """
    real = real_part(square)
    vectors = np.where(square.imag < 0, vector.imag, vector.real)
    vectors /= np.linalg.norm(vectors, axis=0)
    order = np.argsort(real, kind="stable")
    return real[order], vectors[:, order]


def at_zero(system: LinearSystem, square: Floats) -> tuple[int, int]:
    """Return how many values of omega^2 are zero to round-off, and how many are negative."""
    floppy = abs(square) <= system.zero_threshold
    unstable = square < -system.zero_threshold
    return int(floppy.sum()), int(unstable.sum())


def modes_at_an_end(system: LinearSystem, choice: Choice) -> ModeSet:
    """Find the lowest modes above zero, or the highest ones, without a certificate.

    Raises InputError if they do not converge, or if a factor takes more than the memory.
    """
    count = choice.count
    # Motions that no contact resists are rows of zeros, left out of the matrix as held ones are.
    floppy = by_structure(system)
    is_floppy = np.asarray(floppy.basis.sum(axis=1)).ravel() != 0
    rows = system.free_rows[~is_floppy[system.free_rows]]
    A = system.dynamical_matrix[rows][:, rows].tocsc()
    shift = None
    if choice.kind == "lowest":
        sigma = -SHIFT_BELOW_ZERO * system.diagonal.max()
        factor = factorise(
            (A - sigma * sp.identity(len(rows))).tocsr(),
            symmetric=False,
            solver=system.solver,
            remedy="take pre-stress normal or a smaller packing",
        )
        shift = Shift(sigma, factor.solve)

    def is_elastic(square: Array) -> Bools:
        return real_part(square) > system.zero_threshold

    complex_square, complex_vector = eigenpairs(
        A.dot,
        start_block(len(rows), 1)[:, 0],
        count,
        is_elastic,
        ArnoldiSettings(first_count=count + EXTRA_MODES),
        shift,
    )
    square, vector = real_spectrum(complex_square, complex_vector)
    listed = choice.part(frequency_of(square), system.zero_frequency)
    if (square > system.zero_threshold).sum() < count:
        raise InputError(
            "mode_count", f"{count} modes asked of {len(rows)}", remedy="ask for fewer, or for all"
        )
    all_rows = np.zeros((system.size, count))
    all_rows[rows] = vector[:, listed]
    piece = Piece(square[listed], np.arange(count), lambda some: all_rows[:, some])
    modes = found_modes(system, [piece], count, choice)
    reason = f"K with pre-stress {system.pre_stress} is not symmetric: no exact count"
    modes.attributes |= {"solver": "arpack"} | certificate(0, reason)
    n_floppy, n_unstable = at_zero(system, square)
    return modes.with_zero_modes(n_floppy + floppy.total, n_unstable)
