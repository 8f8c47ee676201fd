"""Compute the observables of modes: chi_z, rotation share, and the P-wave resonances among them."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from modal.modes.mode_set import OBSERVABLES, Choice, ModeSet, chi_z
from modal.packing.chain import wall_to_wall_chain
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError

PLANAR = 0.999
"""Least chi_z of a mode that moves along z only."""
MAX_ROTATION_SHARE = 1e-6
"""Largest share of the kinetic energy in rotations of a mode that may be a pure P-wave."""


def observables(
    system: LinearSystem, square: Floats, unit: Array, chain: Ints | None
) -> tuple[Floats, Array]:
    """Compute the frequency and `OBSERVABLES` of modes, (5, k), and their shapes (k, n, 6).

    Parameters
    ----------
    system : LinearSystem
    square : ndarray (k,)
        omega^2, 1/s^2.
    unit : ndarray (size, k)
        Unit eigenvectors v of A; the shapes are M^-1/2 v, kg^-1/2.
    chain : ndarray (nc,) or None
        The particles that join the walls; without them `chi_z_chain` is NaN.

    If omega^2 is round-off of zero, the residual |A v - omega^2 v| is divided by that round-off:
    the residual of a zero mode is then of order 1, and not infinite.
    """
    count = len(square)
    n = system.network.n_particles
    dof = system.dof
    shape = np.zeros((count, n, 6), unit.dtype)
    shape[:, :, :dof] = system.sqrt_mass.over(unit).T.reshape(count, n, dof)
    # Real and imaginary parts lie beside each other, as columns.
    product = system.operator.apply(unit.view(float)).view(unit.dtype)
    misfit = product - unit * square
    floor = max(system.resolution, np.finfo(float).tiny)
    residual = np.linalg.norm(misfit, axis=0) / np.maximum(np.abs(square), floor)
    chi_z_chain = np.full(count, np.nan) if chain is None else chi_z(shape, chain)
    # The squares of a unit vector are the kinetic energy of each motion.
    energy = (np.abs(unit.T.reshape(count, n, dof)) ** 2).sum(axis=1)
    rotation_share = energy[:, 3:].sum(axis=1) / energy.sum(axis=1)
    columns = [frequency_of(square), residual, chi_z(shape), chi_z_chain, rotation_share]
    return np.array(columns), shape


def pure_waves(table: Floats, shape: Array, chain: Ints | None) -> Floats:
    """Return frequencies and z-displacements along the chain of the pure P-waves, (p, 1 + nc).

    The first column holds frequencies, Hz, the others displacements, kg^-1/2.

    `table` and `shape` are the results of `observables`. A pure P-wave has a chi_z above `PLANAR`
    and a share of rotations below `MAX_ROTATION_SHARE`.
    """
    if chain is None:
        return np.empty((0, 1))
    pure = (table[2] > PLANAR) & (table[4] < MAX_ROTATION_SHARE)
    return np.column_stack([table[0, pure], shape[pure][:, chain, 2].real])


def resonances(waves: Floats, network: Network) -> dict[str, Any]:
    """Return the `resonance_` columns of a `ModeSet`, for r = 1, 2, ..., from all its `pure_waves`.

    The number r of a resonance is 1 plus the number of sign changes along the chain. This is exact
    for planar modes of a layered crystal: they are the eigenvectors of a Jacobi matrix, and the
    r-th of these has r - 1 sign changes (Sturm). If several modes have the same r, the one with the
    largest amplitude is taken. The wave number is pi r / L (Eqs. 3 and 4).
    """
    frequency = waves[:, 0]
    z = waves[:, 1:]
    sign = np.sign(z)
    order = 1 + (sign[:, 1:] * sign[:, :-1] < 0).sum(axis=1)
    largest_first = np.lexsort((-np.linalg.norm(z, axis=1), order))
    r, first = np.unique(order[largest_first], return_index=True)
    rows = largest_first[first]
    return {
        "resonance_frequency": frequency[rows],
        "resonance_wavenumber": np.pi * r / network.length,
        "resonance_shape": z[rows],
    }


class Piece(NamedTuple):
    """A part of a list: p modes that are found together.

    Attributes
    ----------
    square : ndarray (p,)
        omega^2, 1/s^2.
    place : ndarray (p,) or (2, p)
        Places in the list. Complex eigenvectors are travelling waves. Their real and imaginary
        parts, times sqrt(2), are two standing waves of one frequency, each with its place; a wave
        whose place is -1 is not listed.
    unit : callable
        Function that returns the unit eigenvectors of A, (size, s), for a slice of s modes.
    planar : bool
        Whether the part may contain pure P-waves.
    """

    square: Floats
    place: Ints
    unit: Callable[[slice], Array]
    planar: bool = True


def found_modes(
    system: LinearSystem, pieces: Iterable[Piece], count: int, choice: Choice
) -> ModeSet:
    """Return a list of modes with observables, and with shapes if `Limits.shapes` allows them.

    The places of all pieces are 0 to `count` - 1 at most, without a gap. `choice` is the request.
    `Limits.together` modes are computed at a time, which bounds the memory.
    """
    n = system.network.n_particles
    attributes = choice.attributes
    chain = None
    with suppress(InputError):  # where no chain joins the walls
        chain = wall_to_wall_chain(system.network)
    needed = 48.0 * count * n
    limit = system.limits.shapes
    keeps_shapes = system.shapes and needed <= limit
    if system.shapes and not keeps_shapes:
        attributes["shapes_left_out"] = (
            f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit {limit / 1e9:.2g} GB); "
            "ask for fewer modes to have them"
        )
    shapes = np.empty((count if keeps_shapes else 0, n, 6))
    table = np.empty((1 + len(OBSERVABLES), count))
    waves = [np.empty((0, 1 if chain is None else 1 + len(chain)))]
    n_listed = 0
    for piece in pieces:
        places = np.atleast_2d(piece.place)
        n_listed += int((places >= 0).sum())
        for first in range(0, len(piece.square), system.limits.together):
            some = slice(first, first + system.limits.together)
            unit = np.ascontiguousarray(piece.unit(some))
            columns, shape = observables(system, piece.square[some], unit, chain)
            standing = [shape.real, shape.imag] if np.iscomplexobj(shape) else [shape]
            for place, wave in zip(places[:, some], standing, strict=True):
                listed = place >= 0
                table[:, place[listed]] = columns[:, listed]
                if keeps_shapes:
                    shapes[place[listed]] = np.sqrt(len(standing)) * wave[listed]
            if piece.planar:
                waves.append(pure_waves(columns, shape, chain))
    modes = ModeSet(*table[:, :n_listed])
    modes.attributes = attributes | {"certified": False}
    if keeps_shapes:
        modes.mode_shape = shapes[:n_listed]
    if chain is not None:
        modes = replace(modes, **resonances(np.concatenate(waves), system.network))
    return modes
