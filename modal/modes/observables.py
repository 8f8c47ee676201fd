"""What a mode moves: chi_z, rotation share, and the P-wave resonances among the modes."""

from __future__ import annotations

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


def resonance_order(shape_z: Floats) -> Ints:
    """Shape (k,): r = 1 + sign changes of the z-shape along the chain (k, nc).

    Exact for planar modes of a layered crystal: they are the eigenvectors of a Jacobi matrix,
    whose r-th eigenvector has r - 1 sign changes (Sturm).
    """
    sign = np.sign(shape_z)
    return 1 + (sign[:, 1:] * sign[:, :-1] < 0).sum(axis=1)


def planar_resonances(
    frequency: Floats, shape: Array, rotations: Floats, chain: Ints, net: Network
) -> tuple[Floats, Floats, Floats]:
    """The pure P-wave modes r = 1, 2, ...: frequency (R,), wave number (R,), z-shape (R, nc).

    `frequency` (k,) Hz, `shape` (k, n, 6) and `rotations` (k,), the rotation share, belong to k
    modes; `chain` (nc,) are particles. A mode is taken where chi_z > `PLANAR` over all particles
    and less than 1e-6 of its energy rotates; of modes with the same r the one with the larger
    amplitude along the chain is kept. The wave number is pi r / L (Eqs. 3 and 4).
    """
    pure = (chi_z(shape) > PLANAR) & (rotations < 1e-6)
    frequency, z = frequency[pure], shape[pure][:, chain, 2].real
    order = resonance_order(z)
    best: dict[int, int] = {}
    for row, r in enumerate(order):
        if r not in best or np.linalg.norm(z[row]) > np.linalg.norm(z[best[r]]):
            best[int(r)] = row
    ordered = sorted(best)
    rows = [best[r] for r in ordered]
    kappa = np.pi * np.array(ordered, float) / net.length
    return frequency[rows], kappa, z[rows].reshape(len(rows), len(chain))


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
    P resonances. With `keep_shapes` the mode shapes (k, n, 6) are in the result. `Limits.together`
    modes are converted to shapes at a time, which bounds the memory.
    """
    count = len(square)
    columns: dict[str, Any] = {name: np.full(count, np.nan) for name in OBSERVABLES}
    kept = np.empty((count, system.network.n_particles, 6)) if keep_shapes else None
    pure = [np.empty((0, system.network.n_particles, 6))]
    for first in range(0, count, system.limits.together):
        some = slice(first, min(first + system.limits.together, count))
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
    if needed <= system.limits.shapes:
        return ""
    return (
        f"{count} mode shapes would take {needed / 1e9:.2g} GB (limit "
        f"{system.limits.shapes / 1e9:.2g} GB); ask for fewer modes to have them"
    )


def found_modes(
    system: LinearSystem,
    square: Floats,
    vector: Floats,
    choice: Choice,
    solver: str,
    of: int = 0,
) -> ModeSet:
    """The modes with their observables, and with their shapes if these fit in `Limits.shapes`.

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
