"""What a mode moves: chi_z, rotation share, and the P-wave resonances among the modes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modal.modes.mode_set import OBSERVABLES, Choice, ModeSet, chi_z
from modal.packing.chain import wall_to_wall_chain
from modal.packing.network import Network
from modal.system.linear_system import LinearSystem, frequency_of
from modal.system.root_mass import RootMass
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError

PLANAR = 0.999
"""chi_z above which a mode moves along z only."""


def particle_motion(vector: Array, root: RootMass, dof: int) -> Array:
    """Shape (k, n, 6): mass-normalised shapes from unit vectors of the scaled problem.

    `vector` (n * dof, k) solves M^-1/2 K M^-1/2 v = omega^2 v with |v| = 1; the shape is
    M^-1/2 v. `root` is M^1/2, `dof` 3 or 6; rotations are zero where dof is 3.
    """
    n = len(vector) // dof
    shape = np.zeros((vector.shape[1], n, 6), vector.dtype)
    shape[:, :, :dof] = root.over(vector).T.reshape(-1, n, dof)
    return shape


def rotation_share(vector: Array, dof: int) -> Floats:
    """Shape (k,): part of the kinetic energy in rotations, from unit vectors (n * dof, k)."""
    if dof == 3:
        return np.zeros(vector.shape[1])
    energy = np.abs(vector.T.reshape(vector.shape[1], -1, 6)) ** 2
    return energy[:, :, 3:].sum(axis=(1, 2)) / energy.sum(axis=(1, 2))


def observables(
    system: LinearSystem,
    square: Floats,
    unit: Array,
    misfit: Array,
    root: RootMass,
    chain: Ints | None,
) -> tuple[Floats, Array]:
    """Shape (5, k): the frequency and `OBSERVABLES` of modes; and their shapes (k, n, 6).

    `square` (k,): omega^2, 1/s^2; `unit` (n dof, k): unit eigenvectors of A; `misfit` (any, k), of
    the length of A v - omega^2 v; `root`: M^1/2 of the n particles; `chain` (nc,): those that join
    the walls, without which `chi_z_chain` is NaN. Where omega^2 is round-off of zero, the misfit is
    divided by that round-off: zero modes then have a residual of order 1, not of infinity.
    """
    shape = particle_motion(unit, root, system.dof)
    floor = max(system.resolution, np.finfo(float).tiny)
    residual = np.linalg.norm(misfit, axis=0) / np.maximum(np.abs(square), floor)
    along = np.full(len(square), np.nan) if chain is None else chi_z(shape, chain)
    rotations = rotation_share(unit, system.dof)
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


def chain_of(network: Network) -> Ints | None:
    """The particles of the wall-to-wall chain, or None if there is none."""
    try:
        return wall_to_wall_chain(network)
    except InputError:
        return None


def shapes_left_out(system: LinearSystem, count: int) -> dict[str, str]:
    """Why the shapes of `count` modes are not kept although they were asked for; empty if not."""
    needed, limit = 48.0 * count * system.network.n_particles, system.limits.shapes
    if not system.shapes or needed <= limit:
        return {}
    return {
        "shapes_left_out": f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit "
        f"{limit / 1e9:.2g} GB); ask for fewer modes to have them"
    }


def found_modes(
    system: LinearSystem,
    square: Floats,
    vector: Floats,
    choice: Choice,
    solver: str,
    of: int = 0,
) -> ModeSet:
    """The modes with their observables, and with their shapes if these fit in `Limits.shapes`.

    `square` (k,): omega^2, 1/s^2; `vector` (size, k): unit eigenvectors of A; `choice` is what was
    asked for, `solver` a text. `of` is the length of the whole list where these modes are a part of
    it. `Limits.together` modes are converted to shapes at a time, which bounds the memory.
    """
    left_out = shapes_left_out(system, max(of, len(square)))
    keep, chain = system.shapes and not left_out, chain_of(system.network)
    kept = np.empty((len(square) * keep, system.network.n_particles, 6))
    tables = [np.empty((1 + len(OBSERVABLES), 0))]
    waves = [np.empty((0, 1 if chain is None else 1 + len(chain)))]
    for first in range(0, len(square), system.limits.together):
        some = slice(first, first + system.limits.together)
        unit = np.ascontiguousarray(vector[:, some])
        misfit = system.operator.apply(unit) - unit * square[some]
        table, shape = observables(system, square[some], unit, misfit, system.root, chain)
        tables.append(table)
        waves.append(pure_waves(table, shape, chain))
        if keep:
            kept[some] = shape
    modes = ModeSet(*np.concatenate(tables, axis=1))
    if keep:
        modes.mode_shape = kept
    if chain is not None:
        modes = replace(modes, **resonances(np.concatenate(waves), system.network))
    modes.attributes = choice.attributes | {"certified": False, "solver": solver} | left_out
    return modes
