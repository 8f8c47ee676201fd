"""Modes where K is not symmetric: with the shear forces that the contacts carry, no energy is.

Frequencies are then those of K phi = omega^2 M phi all the same, but omega^2 may come in complex
pairs, and no law of inertia counts them: small packings are solved whole, of larger ones the ends
of the spectrum by ARPACK's method of Arnoldi, without a certificate.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eig
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from modal.modes.counts import check_count
from modal.modes.mode_set import Choice, ModeSet, certificate
from modal.modes.observables import found_modes
from modal.modes.zero_modes import by_structure
from modal.solvers.factor import factorise
from modal.solvers.lanczos import start_block
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError

SHIFT = 1e-7
"""Shift below zero of the lowest modes, relative to A's largest diagonal entry."""
FURTHER = 8
"""More modes than asked for that are looked for: of complex pairs, and zero modes."""


def real_spectrum(square: Array, vector: Array) -> tuple[Floats, Floats]:
    """Of eigenvalues (k,) and vectors (size, k) the real omega^2, ascending, and unit vectors.

    A complex pair has one frequency twice, the real part of omega / 2 pi, and its two vectors span
    the plane in which it turns; their residual says how far they are from being modes.
    """
    omega = np.sqrt(square.astype(complex))
    growing = square.imag != 0
    real = np.where(growing, omega.real**2, square.real)
    turned = np.where(square.imag < 0, vector.imag, vector.real)
    turned /= np.linalg.norm(turned, axis=0)
    order = np.argsort(real, kind="stable")
    return real[order], turned[:, order]


def at_zero(system: LinearSystem, square: Floats) -> dict[str, int]:
    """Of so many omega^2 how many are zero to round-off, and how many below."""
    floppy, unstable = (
        (abs(square) <= system.zero_threshold).sum(),
        (square < -system.zero_threshold).sum(),
    )
    return {"floppy_modes": int(floppy), "unstable_modes": int(unstable)}


def whole_spectrum(system: LinearSystem) -> tuple[Floats, Floats]:
    """Every omega^2 (size,) and unit vector (size, size), as `real_spectrum` gives them."""
    square, vector = eig(system.scaled.toarray(), overwrite_a=True, check_finite=False)
    return real_spectrum(square, vector)


def modes_at_an_end(system: LinearSystem, count: int, *, highest: bool) -> ModeSet:
    """The `count` lowest modes above zero, or the highest ones, without a certificate.

    InputError where they do not converge, or where a factor takes more than the memory.
    """
    check_count(system, count, system.size)
    choice = Choice("highest" if highest else "lowest", count)
    # Motions that no contact meets are rows of zeros: they are left out of the matrix.
    unmet = by_structure(system)
    met = np.flatnonzero(np.asarray(unmet.basis.sum(axis=1)).ravel() == 0)
    A, ask = system.scaled[met][:, met].tocsc(), count + FURTHER
    given = {"v0": start_block(len(met), 1)[:, 0], "which": "LM"}
    if not highest:
        remedy = "take pre-stress normal or a smaller packing"
        sigma = -SHIFT * system.diagonal.max()
        shifted = (A - sigma * sp.identity(len(met))).tocsr()
        factor = factorise(shifted, symmetric=False, solver=system.solver, remedy=remedy)
        inverse = LinearOperator(A.shape, factor.solve, dtype=float)
        given |= {"sigma": sigma, "OPinv": inverse}
    while True:
        if ask > len(met) - 2:
            raise InputError(f"{count} modes asked of {len(met)}: ask for fewer, or for all")
        try:
            square, vector = eigs(A, k=ask, ncv=min(len(met), 3 * ask + 20), **given)
        except ArpackError as error:
            raise InputError(f"{count} modes did not converge; ask for fewer") from error
        square, vector = real_spectrum(square, vector)
        elastic = np.flatnonzero(square > system.zero_threshold)
        if len(elastic) >= count:
            break
        ask *= 2
    whole = np.zeros((system.size, len(square)))
    whole[met] = vector
    chosen = elastic[-count:] if highest else elastic[:count]
    modes = found_modes(system, square[chosen], whole[:, chosen], choice, "arpack")
    because = f"K with pre-stress {system.pre_stress} is not symmetric: no exact count"
    modes.attributes |= certificate(0, because) | at_zero(system, square)
    modes.attributes["floppy_modes"] += unmet.total
    return modes
