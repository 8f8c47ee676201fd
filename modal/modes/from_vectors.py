"""The observables of modes that were found, and whether their shapes are kept."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.modes.mode_set import OBSERVABLES, Choice, ModeSet
from modal.modes.observables import (
    PLANAR,
    chi_z,
    particle_motion,
    planar_resonances,
    rotation_share,
)
from modal.packing.chain import wall_to_wall_chain
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem, frequency_of
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError

TOGETHER = 24
"""Modes that are measured together: bounds the memory."""
LARGEST_SHAPES = 2e9
"""Bytes of mode shapes up to which they are kept: about 1,200 modes of 35,201 spheres."""


def relative_residual(difference: Array, square: Floats, resolution: float) -> Floats:
    """Shape (k,): |A v - omega^2 v| / omega^2 from `difference` (any, k) and omega^2 (k,).

    Where |omega^2| is smaller than `resolution`, which means that it is round-off, the difference
    is divided by `resolution` instead: zero modes then have a residual of order 1, not of infinity.
    """
    own = np.maximum(np.abs(square), max(resolution, np.finfo(float).tiny))
    return np.linalg.norm(difference, axis=0) / own


def measure(
    system: LinearSystem,
    square: Floats,
    vector: Floats,
    chain: Ints | None,
    *,
    keep_shapes: bool = False,
) -> ModeSet:
    """The observables of modes: frequency, residual, chi_z, rotation share, P resonances.

    `square` (k,): omega^2, 1/s^2; `vector` (size, k): unit eigenvectors of A. `chain` (nc,):
    particles of the wall-to-wall chain; without one there is no `chi_z_chain` (NaN) and no list of
    P resonances. With `keep_shapes` the mode shapes (k, n, 6) are in the result. `TOGETHER` modes
    are converted to shapes at a time, which bounds the memory.
    """
    count = len(square)
    columns: dict[str, Any] = {name: np.full(count, np.nan) for name in OBSERVABLES}
    kept = np.empty((count, system.network.n_particles, 6)) if keep_shapes else None
    pure = [np.empty((0, system.network.n_particles, 6))]
    for first in range(0, count, TOGETHER):
        some = slice(first, min(first + TOGETHER, count))
        unit = np.ascontiguousarray(vector[:, some])
        shape = particle_motion(unit, system.root, system.dof)
        columns["chi_z"][some] = chi_z(shape)
        columns["rotation_share"][some] = rotation_share(unit, system.dof)
        if chain is not None:
            columns["chi_z_chain"][some] = chi_z(shape, chain)
        if kept is not None:
            kept[some] = shape
        planar = columns["chi_z"][some] > PLANAR
        pure.append(shape[planar])
        difference = system.operator.apply(unit)
        unit *= square[some]
        difference -= unit
        columns["residual"][some] = relative_residual(difference, square[some], system.resolution)
    result = ModeSet(frequency=frequency_of(square), **columns, mode_shape=kept)
    if chain is not None:
        planar = columns["chi_z"] > PLANAR
        resonances = planar_resonances(
            result.frequency[planar],
            np.concatenate(pure),
            result.rotation_share[planar],
            chain,
            system.network,
        )
        result.resonance_frequency, result.resonance_wavenumber = resonances[:2]
        result.resonance_shape = resonances[2]
    return result


def chain_of(network: Network) -> Ints | None:
    """The particles of the wall-to-wall chain, or None if there is none."""
    try:
        return wall_to_wall_chain(network)
    except InputError:
        return None


def shapes_left_out(system: LinearSystem, count: int) -> str:
    """Why the shapes of `count` modes are not kept, or an empty text where they are."""
    needed = 48.0 * count * system.network.n_particles
    if needed <= LARGEST_SHAPES:
        return ""
    return (
        f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit {LARGEST_SHAPES / 1e9:.2g} "
        "GB); ask for fewer modes to have them"
    )


def found_modes(
    system: LinearSystem,
    square: Floats,
    vector: Floats,
    choice: Choice,
    solver: str,
    of: int = 0,
) -> ModeSet:
    """The modes with their observables, and with their shapes if these fit in `LARGEST_SHAPES`.

    `square` (k,) and `vector` (size, k) as in `measure`; `choice` is what was asked for, `solver`
    a text. `of` is the length of the whole list where these modes are a part of it.
    """
    left_out = shapes_left_out(system, max(of, len(square))) if system.shapes else ""
    keep = system.shapes and not left_out
    modes = measure(system, square, vector, chain_of(system.network), keep_shapes=keep)
    modes.attributes = choice.attributes | {"certified": False, "solver": solver}
    if left_out:
        modes.attributes["shapes_left_out"] = left_out
    return modes
