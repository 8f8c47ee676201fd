"""Modes where K is not symmetric: with the shear forces that the contacts carry, no energy is.

Frequencies are then those of K phi = omega^2 M phi all the same, but omega^2 may come in complex
pairs, and no law of inertia counts them: small packings are solved whole, of larger ones the ends
of the spectrum by ARPACK's method of Arnoldi, without a certificate.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp

from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import Piece, found_modes
from modal.modes.zero_modes import by_structure
from modal.solvers.arnoldi import eigenpairs
from modal.solvers.factor import factorise
from modal.solvers.lanczos import start_block
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError

SHIFT = 1e-7
"""Shift below zero of the lowest modes, relative to A's largest diagonal entry."""
FURTHER = 8
"""More modes than asked for that are looked for: of complex pairs, and zero modes."""


def real_part(square: Array) -> Floats:
    """Shape (k,): the real omega^2; of a complex one the square of omega's real part."""
    omega = np.sqrt(square.astype(complex))
    return np.where(square.imag != 0, omega.real**2, square.real)


def real_spectrum(square: Array, vector: Array) -> tuple[Floats, Floats]:
    """Of eigenvalues (k,) and vectors (size, k) the real omega^2, ascending, and unit vectors.

    A complex pair has one frequency twice, the real part of omega / 2 pi, and its two vectors span
    the plane in which it turns; their residual says how far they are from being modes.
    """
    real = real_part(square)
    turned = np.where(square.imag < 0, vector.imag, vector.real)
    turned /= np.linalg.norm(turned, axis=0)
    order = np.argsort(real, kind="stable")
    return real[order], turned[:, order]


def at_zero(system: LinearSystem, square: Floats) -> tuple[int, int]:
    """Of so many omega^2 how many are zero to round-off, and how many below."""
    floppy, unstable = abs(square) <= system.zero_threshold, square < -system.zero_threshold
    return int(floppy.sum()), int(unstable.sum())


def modes_at_an_end(system: LinearSystem, choice: Choice) -> ModeSet:
    """The lowest modes above zero, or the highest ones, without a certificate.

    InputError where they do not converge, or where a factor takes more than the memory.
    """
    count = choice.count
    # Motions that no contact meets are rows of zeros: they are left out of the matrix.
    unmet = by_structure(system)
    met = np.flatnonzero(np.asarray(unmet.basis.sum(axis=1)).ravel() == 0)
    A, given = system.dynamical_matrix[met][:, met].tocsc(), dict[str, Any]()
    if choice.kind == "lowest":
        remedy = "take pre-stress normal or a smaller packing"
        sigma = -SHIFT * system.diagonal.max()
        shifted = (A - sigma * sp.identity(len(met))).tocsr()
        factor = factorise(shifted, symmetric=False, solver=system.solver, remedy=remedy)
        given = {"sigma": sigma, "inverse": factor.solve}
    square, vector = eigenpairs(
        A.dot,
        start_block(len(met), 1)[:, 0],
        count,
        lambda square: real_part(square) > system.zero_threshold,
        ask=count + FURTHER,
        basis=0,
        **given,
    )
    square, vector = real_spectrum(square, vector)
    chosen = choice.part(frequency_of(square), system.zero_frequency)
    if (square > system.zero_threshold).sum() < count:
        raise InputError(
            "input", f"{count} modes asked of {len(met)}", remedy="ask for fewer, or for all"
        )
    whole = np.zeros((system.size, count))
    whole[met] = vector[:, chosen]
    piece = Piece(square[chosen], np.arange(count), lambda some: whole[:, some])
    modes = found_modes(system, [piece], count, choice)
    because = f"K with pre-stress {system.pre_stress} is not symmetric: no exact count"
    modes.attributes |= {"solver": "arpack"} | certificate(0, because)
    floppy, unstable = at_zero(system, square)
    return modes.with_zero_modes(floppy + unmet.total, unstable)
