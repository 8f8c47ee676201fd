"""State of a packing: stresses, density, coordination and fabric, in total and along z.

Stresses follow from the contact forces (Love, Weber: force times branch vector, over the volume)
and, independently, from the forces on the walls. Along z each contact's share is spread over the
layers that its branch passes (the plane average of Irving and Kirkwood): in a packing at rest
sigma_zz is then the same in every layer, and the layers add up to the total exactly.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modal.display import quantity
from modal.formats.arrays import Array, Bools, Floats, Ints
from modal.formats.hdf5 import InputError, write_text
from modal.packing.contact_law import sphere_volume
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.order import crystalline
from modal.packing.rattlers import force_bearing

WALL_ZONE = 5.0
"""Depth to which a flat wall orders the spheres beside it, mean diameters."""
FORCES = ("force_normal", "force_tangential")
FURTHER: list[Callable[[Network], list[tuple[str, str]]]] = []
"""What other rooms add to the lines of `described`: names and texts."""


@dataclass
class Profile:
    """Layers along z, k in number.

    edges (k + 1,), m; stress (k, 3), Pa, along x, y, z, compression positive, or None where forces
    are absent; void_ratio, coordination (k,), contacts a particle; particles (k,), centres inside;
    bulk (k,) bool, further than `WALL_ZONE` from both walls.
    """

    edges: Floats
    stress: Floats | None
    void_ratio: Floats
    coordination: Floats
    particles: Ints
    bulk: Bools


def _volume(network: Network) -> float:
    if not network.length > 0:
        raise InputError(
            "the network has no volume (its walls are in one place); give walls/position around it"
        )
    return network.area * network.length


def _virials(network: Network) -> tuple[Floats, Floats]:
    """Force times branch (m, 3, 3), N m, compression positive, and the branch's z (m,), m.

    A wall's branch ends on the wall's plane, so that the walls' work is counted to the last bit.
    """
    branch = network.lever_i - network.lever_j
    wall = network.with_wall
    branch[wall, 2] = network.wall_distance[wall]
    along, across = (network.known(name, "stress") for name in FORCES)
    on_j = along[:, None] * network.normal - across
    return on_j[:, :, None] * branch[:, None, :], branch[:, 2]


def stress_tensor(network: Network) -> Floats:
    """Shape (3, 3), Pa: mean stress between the walls from the contact forces."""
    virial, _ = _virials(network)
    stress: Floats = virial.sum(axis=0) / _volume(network)
    return stress


def void_ratio(network: Network) -> float:
    """Volume of voids over volume of spheres, wall to wall; what overlaps counts twice."""
    solid = float(sphere_volume(network.radius).sum())
    return _volume(network) / solid - 1


def wall_stress(network: Network) -> Floats:
    """Shape (2,), Pa: normal force on source and receiver wall over their area."""
    force = network.known("force_normal", "stress on the walls")
    push = [force[network.particle_j == wall].sum() for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return np.array(push) / network.area


def contacts_per_particle(network: Network) -> Ints:
    """Shape (n,): number of contacts, walls included."""
    n, j = network.n_particles, network.particle_j
    return np.bincount(network.particle_i, minlength=n) + np.bincount(j[j >= 0], minlength=n)


def coordination_by_size(network: Network) -> tuple[Floats, Floats]:
    """Mean radius, m, and mean number of contacts in each quarter of the spheres by size.

    Shape (k,), k up to 4: spheres of one radius are never torn apart, so that two sizes give two
    numbers.
    """
    edges = np.unique(np.quantile(network.radius, [0.25, 0.5, 0.75], method="higher"))
    quarter = np.searchsorted(edges, network.radius, side="left")
    _, quarter, size = np.unique(quarter, return_inverse=True, return_counts=True)
    ends = contacts_per_particle(network)
    return np.bincount(quarter, network.radius) / size, np.bincount(quarter, ends) / size


def fabric_tensor(network: Network) -> Floats:
    """Shape (3, 3): mean of n n^T over contacts of particles; 1/3 of unity if isotropic."""
    normal = network.normal[~network.with_wall]
    return normal.T @ normal / max(len(normal), 1)


def coordination_without_rattlers(network: Network) -> tuple[float, int]:
    """Mean number of contacts of a force-bearing particle, and the number of rattlers.

    Only contacts with walls and between force-bearing particles count; rattlers are all others.
    """
    bearing = force_bearing(network)
    i, pair = network.particle_i, ~network.with_wall
    at_wall = bearing[i[~pair]]
    between = bearing[i[pair]] & bearing[network.particle_j[pair]]
    ends = 2 * int(between.sum()) + int(at_wall.sum())
    return ends / max(int(bearing.sum()), 1), int((~bearing).sum())


def friction_used(network: Network, friction: float) -> Floats:
    """Shape (m,): shear force over friction times normal force; 1 at the limit, 0 without shear."""
    limit = friction * network.known("force_normal", "share of friction")
    shear = np.linalg.norm(network.known("force_tangential", "share of friction"), axis=1)
    share: Floats = shear / np.where(shear > 0, limit, 1.0)
    return share


def profile(network: Network, thickness: float | None = None) -> Profile:
    """Layers of about `thickness`, m (one mean diameter), from wall to wall.

    A sphere's volume is split at the edges as the spherical caps that they cut off; volume and
    force beyond a wall count to the last layer, beyond a period to the layer that they enter there.
    """
    diameter = 2 * float(network.radius.mean())
    count = max(1, round(network.length / (thickness or diameter)))
    edges = np.linspace(network.wall_position[0], network.wall_position[1], count + 1)
    volume = _volume(network) / count
    z, radius = network.position[:, 2], network.radius
    solid, periodic = np.zeros(count + 1), bool(network.cell_periodic[2])
    solid[-1] = sphere_volume(radius).sum()
    for edge in range(count + 1) if periodic else range(1, count):
        height = np.clip(edges[edge] - _images(z, network) + radius, 0, 2 * radius)
        solid[edge] = (np.pi * height**2 * (radius - height / 3)).sum()
    layer = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, count - 1)
    particles = np.bincount(layer, minlength=count)
    ends = np.bincount(layer, contacts_per_particle(network), count)
    reach = edges[[0, -1]] + np.array([1, -1]) * WALL_ZONE * diameter
    return Profile(
        edges=edges,
        stress=_stress_along_z(network, edges) / volume if _has_forces(network) else None,
        void_ratio=volume / np.maximum(np.diff(solid), np.finfo(float).tiny) - 1,
        coordination=ends / np.maximum(particles, 1),
        particles=particles,
        bulk=periodic | ((edges[:-1] >= reach[0]) & (edges[1:] <= reach[1])),
    )


def _images(height: Floats, network: Network) -> Floats:
    """Shape (1, k) or (3, k): heights, m, with those a period below and above if there is one."""
    period = network.cell_size[2]
    shifts = np.array([-period, 0.0, period] if network.cell_periodic[2] else [0.0])
    images: Floats = height + shifts[:, None]
    return images


def _has_forces(network: Network) -> bool:
    return all(getattr(network, name) is not None for name in FORCES)


def _stress_along_z(network: Network, edges: Floats) -> Floats:
    """Shape (k, 3), N m: each layer's share of force times branch, compression positive."""
    virial, rise = _virials(network)
    virial = np.einsum("caa->ca", virial)
    start = network.position[network.particle_i, 2]
    thinnest = 1e-12 * float(network.radius.mean())
    low, span = np.minimum(start, start + rise), np.maximum(abs(rise), thinnest)
    below = np.zeros((len(edges), 3))
    below[-1] = virial.sum(axis=0)
    inner = range(len(edges)) if network.cell_periodic[2] else range(1, len(edges) - 1)
    for edge in inner:
        share = np.clip((edges[edge] - _images(low, network)) / span, 0, 1)
        below[edge] = share.sum(axis=0) @ virial
    return np.diff(below, axis=0)


def summary(network: Network, friction: float | None = None) -> dict[str, Any]:
    """Stresses, densities, coordination, fabric and order of a packing as plain numbers by name.

    For the `study` attributes and the command line. With the `friction` coefficient of the contacts
    also the largest share of it that a contact uses. Deviations along z are standard deviations
    over the layers of the bulk, relative to their mean. Numbers that need forces are left out where
    forces are absent, and those that need a volume where the cell has none.
    """
    forces = _has_forces(network)
    bearing, rattlers = coordination_without_rattlers(network)
    result: dict[str, Any] = {}
    try:
        volume = _volume(network)
    except InputError:
        volume = None
    if volume is not None:
        if forces:
            stress = stress_tensor(network)
            diagonal = np.diag(np.diag(stress))
            result["stress_pa"] = np.diag(stress).tolist()
            result["largest_off_diagonal_stress_pa"] = float(abs(stress - diagonal).max())
        if network.force_normal is not None and not network.cell_periodic[2]:
            result["wall_stress_pa"] = wall_stress(network).tolist()
        result["void_ratio"] = void_ratio(network)
    result |= {
        "coordination_number": float(contacts_per_particle(network).mean()),
        "coordination_number_without_rattlers": bearing,
        "rattlers": rattlers,
        "fabric_diagonal": np.diag(fabric_tensor(network)).tolist(),
    }
    if np.ptp(network.radius) > 1e-9 * network.radius.mean():
        radius, ends = coordination_by_size(network)
        result["radius_of_quarters_by_size_m"] = radius.tolist()
        result["coordination_number_of_quarters_by_size"] = ends.tolist()
    if network.sliding is not None:
        result["sliding_contacts"] = int(network.sliding.sum())
    # A contact without friction, or one that pulls, has no limit that its shear could share in.
    force = network.force_normal if forces else None
    if friction and network.n_contacts > 0 and force is not None and force.min() > 0:
        result["largest_share_of_friction"] = float(friction_used(network, friction).max())
    return result if volume is None else result | _along_z(network)


def described(network: Network) -> list[tuple[str, str]]:
    """The packing in a few lines, names and texts: sizes, stresses, voids, contacts a sphere."""
    wall = int(network.with_wall.sum())
    told = summary(network)
    size = " x ".join(quantity(side, "m") for side in network.cell_size)
    rows = [
        ("spheres", f"{network.n_particles}, diameters {_range(2 * network.radius, 'm')}"),
        ("cell", f"{size}, {_ends(network)}"),
        ("contacts", f"{network.n_contacts}, {wall} of them with the walls"),
    ]
    for name, words in (("stress_pa", "stress xx, yy, zz"), ("wall_stress_pa", "stress on walls")):
        if name in told:
            rows.append((words, ", ".join(quantity(value, "Pa") for value in told[name])))
    if "void_ratio" in told:
        rows.append(("void ratio", f"{told['void_ratio']:.4f}"))
    bearing, rattlers = told["coordination_number_without_rattlers"], told["rattlers"]
    without = f", {bearing:.3f} without {rattlers} rattlers" if rattlers else ""
    rows.append(("coordination number", f"{told['coordination_number']:.3f}{without}"))
    return rows + [row for more in FURTHER for row in more(network)]


def _ends(network: Network) -> str:
    if network.cell_periodic[2]:
        return "periodic along z"
    return f"walls {quantity(network.length, 'm')} apart"


def _range(values: np.ndarray, unit: str) -> str:
    low, high = float(values.min()), float(values.max())
    same = high - low <= 1e-9 * high
    return quantity(high, unit) if same else f"{quantity(low, unit)} to {quantity(high, unit)}"


def _along_z(network: Network) -> dict[str, Any]:
    """The share of crystalline spheres, and how the bulk differs along z."""
    layers, result = profile(network), dict[str, Any]()
    periodic = bool(network.cell_periodic[0] and network.cell_periodic[1])
    if periodic and np.ptp(network.radius) <= 1e-9 * network.radius.mean():
        ordered, edges = crystalline(network), layers.edges
        result["crystalline_share"] = float(ordered.mean())
        if layers.bulk.any():
            z, inner = network.position[:, 2], np.flatnonzero(layers.bulk)
            inside = (z >= edges[inner[0]]) & (z < edges[inner[-1] + 1])
            result["crystalline_share_of_bulk"] = float(ordered[inside].mean())
    if layers.bulk.any():
        density = 1 / (1 + layers.void_ratio[layers.bulk])
        result["void_ratio_of_bulk"] = float(1 / density.mean() - 1)
        weight, ends = layers.particles[layers.bulk], layers.coordination[layers.bulk]
        result["coordination_number_of_bulk"] = float(ends @ weight / max(weight.sum(), 1))
        result["solid_fraction_deviation_along_z"] = float(density.std() / density.mean())
        result["coordination_number_deviation_along_z"] = float(ends.std() / ends.mean())
        if layers.stress is not None:
            along = layers.stress[layers.bulk]
            scale = np.maximum(abs(along.mean(axis=0)), np.finfo(float).tiny)
            result["stress_deviation_along_z"] = (along.std(axis=0) / scale).tolist()
    return result


def write_profile(path: str | Path, layers: Profile) -> None:
    """Write the layers as a table, *.csv: the middle of each, then what `Profile` has."""
    columns: dict[str, Array] = {"z_m": (layers.edges[1:] + layers.edges[:-1]) / 2}
    if layers.stress is not None:
        columns |= zip(
            ("stress_xx_Pa", "stress_yy_Pa", "stress_zz_Pa"), layers.stress.T, strict=True
        )
    columns |= {
        "void_ratio": layers.void_ratio,
        "coordination_number": layers.coordination,
        "particles": layers.particles,
        "bulk": layers.bulk,
    }
    text, table = io.StringIO(), np.column_stack(list(columns.values()))
    np.savetxt(text, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    write_text(path, text.getvalue())


def net_forces(network: Network) -> Floats:
    """Shape (n, 6), N and N m: force and torque that the contacts exert on each sphere."""
    along, across = (network.known(name, "balance") for name in FORCES)
    force = -along[:, None] * network.normal
    force += across
    load = np.zeros((network.n_particles, 6))
    for end, lever in (
        (network.particle_i, network.lever_i),
        (network.particle_j, network.lever_j),
    ):
        body = end >= 0
        for axis in range(3):
            one, two = (axis + 1) % 3, (axis + 2) % 3
            torque = lever[:, one] * force[:, two] - lever[:, two] * force[:, one]
            for column, moment in ((axis, force[:, axis]), (3 + axis, torque)):
                load[:, column] += np.bincount(end[body], moment[body], len(load))
        # What acts on i acts on j the other way.
        np.negative(force, out=force)
    return load
