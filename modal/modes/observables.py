"""What a mode moves: chi_z, rotation share, and the P-wave resonances among the modes."""

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
"""chi_z above which a mode moves along z only."""


def observables(
    system: LinearSystem, square: Floats, unit: Array, chain: Ints | None
) -> tuple[Floats, Array]:
    """Shape (5, k): the frequency and `OBSERVABLES` of modes; and their shapes (k, n, 6), kg^-1/2.

    `square` (k,): omega^2, 1/s^2; `unit` (size, k): unit eigenvectors v of A, the shapes are
    M^-1/2 v; `chain` (nc,): the particles that join the walls, without which `chi_z_chain` is NaN.
    Where omega^2 is round-off of zero, |A v - omega^2 v| is divided by that round-off: zero modes
    then have a residual of order 1, not of infinity.
    """
    count, n, dof = len(square), system.network.n_particles, system.dof
    shape = np.zeros((count, n, 6), unit.dtype)
    shape[:, :, :dof] = system.sqrt_mass.over(unit).T.reshape(count, n, dof)
    # Real and imaginary parts lie beside each other, as columns.
    moved = system.operator.apply(unit.view(float)).view(unit.dtype)
    misfit = moved - unit * square
    floor = max(system.resolution, np.finfo(float).tiny)
    residual = np.linalg.norm(misfit, axis=0) / np.maximum(np.abs(square), floor)
    along = np.full(count, np.nan) if chain is None else chi_z(shape, chain)
    # Unit vectors hold the kinetic energy of each motion.
    energy = (np.abs(unit.T.reshape(count, n, dof)) ** 2).sum(axis=1)
    rotations = energy[:, 3:].sum(axis=1) / energy.sum(axis=1)
    return np.array([frequency_of(square), residual, chi_z(shape), along, rotations]), shape


def pure_waves(table: Floats, shape: Array, chain: Ints | None) -> Floats:
    """Shape (p, 1 + nc): of the modes that are pure P-waves frequency, and z-shape along the chain.

    `table` and `shape` as `observables` gives them. Of a pure P-wave chi_z is above `PLANAR`, and
    less than 1e-6 of its energy rotates.
    """
    if chain is None:
        return np.empty((0, 1))
    pure = (table[2] > PLANAR) & (table[4] < 1e-6)
    return np.column_stack([table[0, pure], shape[pure][:, chain, 2].real])


def resonances(waves: Floats, network: Network) -> dict[str, Any]:
    """The `resonance_` columns of a `ModeSet` from all its `pure_waves`: r = 1, 2, ...

    r is 1 and the sign changes along the chain. That is exact for planar modes of a layered
    crystal: they are the eigenvectors of a Jacobi matrix, whose r-th has r - 1 sign changes
    (Sturm). Of modes with the same r the one with the larger amplitude is kept. The wave number is
    pi r / L (Eqs. 3 and 4).
    """
    frequency, z = waves[:, 0], waves[:, 1:]
    sign = np.sign(z)
    order = 1 + (sign[:, 1:] * sign[:, :-1] < 0).sum(axis=1)
    largest = np.lexsort((-np.linalg.norm(z, axis=1), order))
    r, first = np.unique(order[largest], return_index=True)
    rows = largest[first]
    return {
        "resonance_frequency": frequency[rows],
        "resonance_wavenumber": np.pi * r / network.length,
        "resonance_shape": z[rows],
    }


class Piece(NamedTuple):
    """A part of a list: p modes that are found together.

    `square` (p,): omega^2, 1/s^2; `place` (p,): where they stand in the list; `unit` gives some of
    their unit eigenvectors of A, (size, s). Where these are complex, travelling waves, `place` is
    (2, p): sqrt(2) times real and imaginary part are two standing waves of one frequency, a place
    of -1 is not listed. `planar`: whether there may be pure P-waves among them.
    """

    square: Floats
    place: Ints
    unit: Callable[[slice], Array]
    planar: bool = True


def found_modes(
    system: LinearSystem, pieces: Iterable[Piece], count: int, choice: Choice
) -> ModeSet:
    """The modes with their observables, and with their shapes if these fit in `Limits.shapes`.

    The places of all pieces go up to `count` at most, without a gap. `choice` is what was asked
    for. `Limits.together` modes are measured at a time, which bounds the memory.
    """
    n, said, chain = system.network.n_particles, choice.attributes, None
    with suppress(InputError):  # where no chain joins the walls
        chain = wall_to_wall_chain(system.network)
    needed, limit = 48.0 * count * n, system.limits.shapes
    keep = system.shapes and needed <= limit
    if system.shapes and not keep:
        said["shapes_left_out"] = (
            f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit {limit / 1e9:.2g} GB); "
            "ask for fewer modes to have them"
        )
    kept = np.empty((count * keep, n, 6))
    table = np.empty((1 + len(OBSERVABLES), count))
    waves, found = [np.empty((0, 1 if chain is None else 1 + len(chain)))], 0
    for piece in pieces:
        standing = np.atleast_2d(piece.place)
        found += int((standing >= 0).sum())
        for first in range(0, len(piece.square), system.limits.together):
            some = slice(first, first + system.limits.together)
            unit = np.ascontiguousarray(piece.unit(some))
            measured, shape = observables(system, piece.square[some], unit, chain)
            parts = [shape.real, shape.imag] if np.iscomplexobj(shape) else [shape]
            for place, part in zip(standing[:, some], parts, strict=True):
                listed = place >= 0
                table[:, place[listed]] = measured[:, listed]
                if keep:
                    kept[place[listed]] = np.sqrt(len(parts)) * part[listed]
            if piece.planar:
                waves.append(pure_waves(measured, shape, chain))
    modes = ModeSet(*table[:, :found])
    modes.attributes = said | {"certified": False}
    if keep:
        modes.mode_shape = kept[:found]
    if chain is not None:
        modes = replace(modes, **resonances(np.concatenate(waves), system.network))
    return modes
