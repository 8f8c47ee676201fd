"""State of a packing: stresses, density, coordination and fabric, in total and along z.

Stresses follow from the contact forces (Love, Weber: force times branch vector, over the volume)
and, independently, from the forces on the walls. Along z each contact's share is spread over the
layers that its branch passes (the plane average of Irving and Kirkwood): in a packing at rest
sigma_zz is then the same in every layer, and the layers add up to the total exactly.
"""

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modal.formats.whole_file import write_text
from modal.packing.contact_law import sphere_volume
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.occupied import occupied_part
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.errors import UnavailableError

WALL_ZONE = 5.0
"""Depth to which a flat wall orders the spheres beside it, mean diameters."""
SURFACE_ZONE = 2.0
"""Depth to which a free surface is rough and loose, mean diameters."""
FORCES = ("force_normal", "force_tangential")


@dataclass
class Profile:
    """Layers along z, k in number.

    edges (k + 1,), m; stress (k, 3), Pa, along x, y, z, compression positive, or None where forces
    are absent; void_ratio, coordination (k,), contacts a particle; particles (k,), centres inside;
    bulk (k,) bool, further than `WALL_ZONE` from walls and `SURFACE_ZONE` from free ends.
    """

    edges: Floats
    stress: Floats | None
    void_ratio: Floats
    coordination: Floats
    particles: Ints
    bulk: Bools


def volume_between_walls(network: Network) -> float:
    """Area of the cell times the distance of the walls, m^3; InputError where there is none.

    Of a packing with free ends what it fills of that.
    """
    if occupied := occupied_part(network):
        return occupied.volume
    if not network.length > 0:
        raise UnavailableError(
            "no_volume",
            "the network has no volume (its walls are in one place)",
            remedy="give walls/position around it",
        )
    return network.area * network.length


def contact_forces(network: Network, purpose: str) -> Floats:
    """Shape (m, 3), N: what each contact exerts on its i; `purpose` as of `Network.require`."""
    along, across = (network.require(name, purpose) for name in FORCES)
    return across - along[:, None] * network.normal


def _virials(network: Network) -> tuple[Floats, Floats]:
    """Force times branch (m, 3, 3), N m, compression positive, and the branch's z (m,), m.

    A wall's branch ends on the wall's plane, so that the walls' work is counted to the last bit.
    """
    on_j, branch = -contact_forces(network, "stress"), network.branch
    return on_j[:, :, None] * branch[:, None, :], branch[:, 2]


def stress_tensor(network: Network) -> Floats:
    """Shape (3, 3), Pa: mean stress between the walls from the contact forces."""
    virial, _ = _virials(network)
    return virial.sum(axis=0) / volume_between_walls(network)


def void_ratio(network: Network) -> float:
    """Volume of voids over volume of spheres, wall to wall; what overlaps counts twice.

    Of a packing with free ends that of its core, as `modal.packing.occupied` has it.
    """
    if occupied := occupied_part(network):
        return occupied.void_ratio
    solid = float(sphere_volume(network.radius).sum())
    return volume_between_walls(network) / solid - 1


def wall_stress(network: Network) -> Floats:
    """Shape (2,), Pa: normal force on source and receiver wall over their area."""
    force = network.require("force_normal", "stress on the walls")
    push = [force[network.particle_j == wall].sum() for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return np.array(push) / network.area


def contacts_per_particle(network: Network) -> Ints:
    """Shape (n,): number of contacts, walls included."""
    n, j = network.n_particles, network.particle_j
    return np.bincount(network.particle_i, minlength=n) + np.bincount(j[j >= 0], minlength=n)


def fabric_tensor(network: Network) -> Floats:
    """Shape (3, 3): mean of n n^T over contacts of particles; 1/3 of unity if isotropic."""
    normal = network.normal[~network.with_wall]
    return normal.T @ normal / max(len(normal), 1)


def coordination_without_rattlers(network: Network) -> tuple[float, int]:
    """Mean number of contacts of a force-bearing particle, and the number of rattlers.

    Only contacts with walls and between force-bearing particles count; rattlers are all others.
    """
    bearing, wall = force_bearing(network), network.with_wall
    kept = bearing[network.particle_i] & (bearing[network.partner] | wall)
    ends = 2 * int(kept.sum()) - int((kept & wall).sum())
    return ends / max(int(bearing.sum()), 1), int((~bearing).sum())


def friction_used(network: Network, friction: float) -> Floats:
    """Shape (m,): shear force over friction times normal force; 1 at the limit, 0 without shear."""
    limit = friction * network.require("force_normal", "share of friction")
    shear = np.linalg.norm(network.require("force_tangential", "share of friction"), axis=1)
    return shear / np.where(shear > 0, limit, 1.0)


def layer_edges(network: Network, thickness: float | None = None) -> tuple[Floats, Bools]:
    """Edges (k + 1,), m, of layers as those of `profile`, and which (k,) are of the bulk."""
    diameter = 2 * float(network.radius.mean())
    low, high = network.wall_position
    zones = np.full(2, WALL_ZONE)
    if occupied := occupied_part(network):
        low, high = occupied.low, occupied.high
        zones[occupied.free[2]] = SURFACE_ZONE
    count = max(1, round((high - low) / (thickness or diameter)))
    edges = np.linspace(low, high, count + 1)
    reach = edges[[0, -1]] + np.array([1, -1]) * zones * diameter
    inner = (edges[:-1] >= reach[0]) & (edges[1:] <= reach[1])
    return edges, inner | bool(network.cell_periodic[2])


def profile(network: Network, thickness: float | None = None) -> Profile:
    """Layers of about `thickness`, m (one mean diameter), from wall to wall, or to a free surface.

    A sphere's volume is split at the edges as the spherical caps that they cut off; volume and
    force beyond a wall count to the last layer, beyond a period to the layer that they enter there.
    """
    edges, bulk = layer_edges(network, thickness)
    count = len(bulk)
    volume = volume_between_walls(network) / count
    z, radius = network.position[:, 2], network.radius
    solid, periodic = np.zeros(count + 1), bool(network.cell_periodic[2])
    solid[-1] = sphere_volume(radius).sum()
    for edge in range(count + 1) if periodic else range(1, count):
        height = np.clip(edges[edge] - _images(z, network) + radius, 0, 2 * radius)
        solid[edge] = (np.pi * height**2 * (radius - height / 3)).sum()
    layer = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, count - 1)
    particles = np.bincount(layer, minlength=count)
    ends = np.bincount(layer, contacts_per_particle(network), count)
    own, empty = np.diff(solid), np.full(count, np.inf)
    return Profile(
        edges=edges,
        stress=_stress_along_z(network, edges) / volume if has_forces(network) else None,
        void_ratio=np.divide(volume, own, out=empty, where=own > 0) - 1,
        coordination=ends / np.maximum(particles, 1),
        particles=particles,
        bulk=bulk,
    )


def _images(height: Floats, network: Network) -> Floats:
    """Shape (1, k) or (3, k): heights, m, with those a period below and above if there is one."""
    period = network.cell_size[2]
    shifts = np.array([-period, 0.0, period] if network.cell_periodic[2] else [0.0])
    return height + shifts[:, None]


def has_forces(network: Network) -> bool:
    """Whether the forces of its contacts are known."""
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


def write_profile(path: str | Path, layers: Profile) -> None:
    """Write the layers as a table, *.csv: the middle of each, then what `Profile` has."""
    columns: dict[str, Array] = {"z_m": (layers.edges[1:] + layers.edges[:-1]) / 2}
    if layers.stress is not None:
        columns |= zip((f"stress_{a}{a}_Pa" for a in "xyz"), layers.stress.T, strict=True)
    columns |= {"void_ratio": layers.void_ratio, "coordination_number": layers.coordination}
    columns |= {"particles": layers.particles, "bulk": layers.bulk}
    text, table = io.StringIO(), np.column_stack(list(columns.values()))
    np.savetxt(text, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    write_text(path, text.getvalue())


def net_forces(network: Network) -> Floats:
    """Shape (n, 6), N and N m: force and torque that the contacts exert on each sphere."""
    force, load = contact_forces(network, "balance"), np.zeros((network.n_particles, 6))
    ends = ((network.particle_i, network.lever_i), (network.particle_j, network.lever_j))
    for end, lever in ends:
        body = end >= 0
        both = np.hstack([force, np.cross(lever, force)])
        for column in range(6):
            load[:, column] += np.bincount(end[body], both[body, column], len(load))
        # What acts on i acts on j the other way.
        np.negative(force, out=force)
    return load


def sizes_of_loads(load: Floats, radius: Floats) -> Floats:
    """Shape (n,), N: length of each sphere's force, its torque over its radius with it."""
    torque = load[:, 3:] / radius[:, None]
    return np.sqrt((load[:, :3] ** 2).sum(axis=1) + (torque**2).sum(axis=1))


def residual_forces(network: Network) -> Floats:
    """Shape (n,): net force and torque of each sphere over the mean normal force of a contact."""
    mean = abs(network.require("force_normal", "balance")).mean()
    return sizes_of_loads(net_forces(network), network.radius) / mean


def affine_stiffness(network: Network) -> Floats:
    """Shape (p,), J: what each contact between spheres adds to P-wave modulus times volume.

    If every sphere followed the mean strain along z and none turned: an upper bound, exact for
    crystals whose spheres are all centres of symmetry. (kn n_z^4 + kt (n_z^2 - n_z^4)) l^2 with
    the branch's length l; contacts with walls are left out.
    """
    pair = ~network.with_wall
    branch = network.branch[pair]
    nz2 = network.normal[pair, 2] ** 2
    kn, kt = network.stiffness_normal[pair], network.stiffness_tangential[pair]
    return (kn * nz2**2 + kt * (nz2 - nz2**2)) * (branch**2).sum(axis=1)


def unevenness(network: Network) -> float:
    """By which part P-waves are faster in one third of the length than in another.

    By the mean contact's stiffness times squared branch over the mean sphere's mass: as V^2 goes.
    """
    pair, branch, start = ~network.with_wall, network.branch, network.position[:, 2]
    middle = start[network.particle_i] + branch[:, 2] / 2
    stiffness = network.stiffness_normal * (branch**2).sum(axis=1)

    def means(height: Floats, values: Floats) -> Floats:
        part = (height - network.wall_position[0]) / network.length % 1
        third = (3 * part).astype(int) % 3  # of a rounding below zero the part is 1
        return np.bincount(third, values, 3) / np.maximum(np.bincount(third, minlength=3), 1)

    mass = means(start, network.mass)
    square = means(middle[pair], stiffness[pair]) / np.where(mass > 0, mass, np.inf)
    return float(np.sqrt(square.max() / square.min()) - 1) if square.min() > 0 else np.inf


def affine_velocity(network: Network) -> float:
    """P-wave velocity, m/s, of all contacts over the mass of all spheres, rattlers included.

    For times to be reckoned with in packings of any size. The ends count: n layers have n - 1
    distances, so a crystal's is sqrt(1 - 1/n) of that of its bulk.
    """
    return float(np.sqrt(affine_stiffness(network).sum() / network.mass.sum()))
