"""Compute stresses, density, coordination and fabric of a packing, in total and along z.

Stresses follow from the contact forces (Love, Weber: force times branch vector, divided by the
volume) and, independently, from the forces on the walls. Along z the contribution of each contact
is spread over the layers that its branch vector crosses (the plane average of Irving and Kirkwood):
in a packing at rest sigma_zz is then equal in all layers, and the layers add up to the total
exactly.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modal.formats.whole_file import write_text
from modal.packing.contact_law import sphere_volume
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.noted_laws import friction_bearing_force
from modal.packing.occupied import occupied_part
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.errors import UnavailableError

WALL_ZONE_IN_DIAMETERS = 5.0
"""Depth, in mean diameters, to which a flat wall orders the spheres beside it."""
SURFACE_ZONE_IN_DIAMETERS = 2.0
"""Depth, in mean diameters, to which a free surface is rough and loose."""
MIN_RISE_IN_RADII = 1e-12
"""Height of a branch vector below which it counts as horizontal, so that nothing is divided by
zero."""
FORCES = ("force_normal", "force_tangential")


@dataclass
class Profile:
    """The state of k layers along z.

    Attributes
    ----------
    edges : ndarray (k + 1,)
        Edges of the layers, m.
    stress : ndarray (k, 3) or None
        Normal stresses along x, y, z, Pa, compression positive; None if forces are absent.
    void_ratio, coordination : ndarray (k,)
        Void ratio, and mean number of contacts of a particle.
    particles : ndarray of int (k,)
        Number of sphere centres in each layer.
    bulk : ndarray of bool (k,)
        Whether the layer is further than `WALL_ZONE_IN_DIAMETERS` from walls and
        `SURFACE_ZONE_IN_DIAMETERS` from free ends.
    """

    edges: Floats
    stress: Floats | None
    void_ratio: Floats
    coordination: Floats
    particles: Ints
    bulk: Bools


def volume_between_walls(network: Network) -> float:
    """Return the area of the cell times the distance of the walls, m^3.

    If the packing has free ends, the volume is only that of the part of the cell that it fills.
    UnavailableError if there is no volume.
    """
    occupied = occupied_part(network)
    if occupied:
        return occupied.volume
    if not network.length > 0:
        raise UnavailableError(
            "no_volume",
            "the network has no volume (its walls are in one place)",
            remedy="give walls/position around it",
        )
    return network.area * network.length


def contact_forces(network: Network, purpose: str) -> Floats:
    """Return the force (m, 3), N, of each contact on i; `purpose` as in `Network.require`."""
    normal_force, tangential_force = (network.require(name, purpose) for name in FORCES)
    return tangential_force - normal_force[:, None] * network.normal


def _virials(network: Network) -> tuple[Floats, Floats]:
    """Return force times branch vector (m, 3, 3), N m, and the z of the branch vector (m,), m.

    Compression is positive. The branch vector of a contact with a wall ends on the wall's plane.
    """
    force_on_j = -contact_forces(network, "stress")
    branch = network.branch
    return force_on_j[:, :, None] * branch[:, None, :], branch[:, 2]


def stress_tensor(network: Network) -> Floats:
    """Return the mean stress (3, 3), Pa, between the walls from the contact forces."""
    virial, _ = _virials(network)
    return virial.sum(axis=0) / volume_between_walls(network)


def void_ratio(network: Network) -> float:
    """Return the volume of voids divided by that of spheres, from wall to wall.

    The volume of an overlap counts twice as solid. For a packing with free ends the void ratio is
    that of its core (`modal.packing.occupied`). UnavailableError if there is no volume.
    """
    occupied = occupied_part(network)
    if occupied:
        return occupied.void_ratio
    solid = float(sphere_volume(network.radius).sum())
    return volume_between_walls(network) / solid - 1


def wall_stress(network: Network) -> Floats:
    """Return the normal force on source and receiver wall divided by their area (2,), Pa."""
    force = network.require("force_normal", "stress on the walls")
    on_walls = [force[network.particle_j == wall].sum() for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return np.array(on_walls) / network.area


def contacts_per_particle(network: Network) -> Ints:
    """Return the number of contacts of each particle (n,), walls included."""
    n = network.n_particles
    j = network.particle_j
    return np.bincount(network.particle_i, minlength=n) + np.bincount(j[j >= 0], minlength=n)


def fabric_tensor(network: Network) -> Floats:
    """Return the mean (3, 3) of n n^T over contacts between particles; I / 3 if isotropic."""
    normal = network.normal[~network.with_wall]
    return normal.T @ normal / max(len(normal), 1)


def coordination_without_rattlers(network: Network) -> tuple[float, int]:
    """Return the mean number of contacts of a force-bearing particle, and the number of rattlers.

    Only contacts with walls or held bodies and between force-bearing particles count; rattlers are
    all other particles that are not held.
    """
    bearing = force_bearing(network)
    bearing_i = bearing[network.particle_i]
    bearing_j = bearing[network.partner] & ~network.with_wall
    with_held = network.with_held
    ends = 2 * int((bearing_i & bearing_j).sum()) + int(((bearing_i | bearing_j) & with_held).sum())
    return ends / max(int(bearing.sum()), 1), int((~bearing & ~network.held).sum())


def mobilised_per_particle(network: Network) -> float:
    """Return n_m: contacts at the friction limit divided by force-bearing particles.

    Only contacts that `coordination_without_rattlers` counts are counted. Raises UnavailableError
    if the network does not contain which contacts slide.
    """
    at_limit = network.require("sliding", "number of mobilised contacts")
    bearing = force_bearing(network)
    counts = bearing[network.particle_i] & (bearing[network.partner] | network.with_wall)
    return float((at_limit & counts).sum()) / max(int(bearing.sum()), 1)


def isostatic_coordination(mobilised: float) -> float:
    """Return the isostatic coordination number 4 + 2 n_m / 3: forces follow from balance alone.

    Spheres with friction have six equations of balance each, and three forces at each of z / 2
    contacts, minus one for each of the n_m = `mobilised` contacts at the friction limit (K.
    Shundyak, M. van Hecke, W. van Saarloos, Phys. Rev. E 75, 010301, 2007; S. Henkes, M. van Hecke,
    W. van Saarloos, EPL 90, 14003, 2010).

    >>> isostatic_coordination(0.0)
    4.0
    """
    return 4 + 2 * mobilised / 3


def friction_used(network: Network, friction: float) -> Floats:
    """Return the shear force of each contact (m,) divided by its friction limit.

    The limit is the friction times `modal.packing.noted_laws.friction_bearing_force`. The result is
    1 at the friction limit and 0 without shear. UnavailableError if forces are absent.
    """
    limit = friction * friction_bearing_force(network)
    shear = np.linalg.norm(network.require("force_tangential", "share of friction"), axis=1)
    return shear / np.where(shear > 0, limit, 1.0)


def layer_edges(network: Network, thickness: float | None = None) -> tuple[Floats, Bools]:
    """Return the edges (k + 1,), m, of the layers of `profile`, and which (k,) are in the bulk."""
    diameter = 2 * float(network.radius.mean())
    low, high = network.wall_position
    zones = np.full(2, WALL_ZONE_IN_DIAMETERS)
    occupied = occupied_part(network)
    if occupied:
        low = occupied.low
        high = occupied.high
        zones[occupied.free[2]] = SURFACE_ZONE_IN_DIAMETERS
    count = max(1, round((high - low) / (thickness or diameter)))
    edges = np.linspace(low, high, count + 1)
    bulk_low, bulk_high = edges[[0, -1]] + np.array([1, -1]) * zones * diameter
    inner = (edges[:-1] >= bulk_low) & (edges[1:] <= bulk_high)
    return edges, inner | bool(network.cell_periodic[2])


def profile(network: Network, thickness: float | None = None) -> Profile:
    """Compute the state of layers from wall to wall, or to a free surface.

    Layers are about `thickness`, m, thick, by default one mean diameter. The volume of a sphere is
    split at the edges into spherical caps. Volume and force beyond a wall count in the last layer;
    those beyond a period count in the layer at the other end of the cell.
    """
    edges, bulk = layer_edges(network, thickness)
    count = len(bulk)
    volume = volume_between_walls(network) / count
    z = network.position[:, 2]
    radius = network.radius
    solid_below = np.zeros(count + 1)
    solid_below[-1] = sphere_volume(radius).sum()
    for edge in _inner_edges(network, count):
        share = share_below(edges[edge] - _images(z, network), radius)
        solid_below[edge] = (sphere_volume(radius) * share).sum()
    layer = np.clip(np.searchsorted(edges, z, side="right") - 1, 0, count - 1)
    particles = np.bincount(layer, minlength=count)
    ends = np.bincount(layer, contacts_per_particle(network), count)
    solid = np.diff(solid_below)
    infinite = np.full(count, np.inf)
    stress = None
    if has_forces(network):
        stress = _virials_of_layers(network, edges) / volume
    return Profile(
        edges=edges,
        stress=stress,
        void_ratio=np.divide(volume, solid, out=infinite, where=solid > 0) - 1,
        coordination=ends / np.maximum(particles, 1),
        particles=particles,
        bulk=bulk,
    )


def share_below(clearance: Floats, radius: Floats) -> Floats:
    """Return the share of each sphere's volume below a plane `clearance` above its centre.

    This part of a sphere is a spherical cap; both arguments are (..., n), m.

    >>> share_below(np.array([-2.0, 0.0, 0.5, 1.0]), np.ones(4))
    array([0.     , 0.5    , 0.84375, 1.     ])
    """
    height = np.clip(1 + clearance / radius, 0, 2)
    share: Floats = height**2 * (3 - height) / 4
    return share


def _inner_edges(network: Network, count: int) -> range:
    """Return the range of the inner edges, which can cut a sphere or a branch vector."""
    if network.cell_periodic[2]:
        return range(count + 1)
    return range(1, count)


def _images(height: Floats, network: Network) -> Floats:
    """Return heights (1, k), m; with a period along z, also their images, (3, k)."""
    period = network.cell_size[2]
    shifts = np.array([-period, 0.0, period] if network.cell_periodic[2] else [0.0])
    return height + shifts[:, None]


def has_forces(network: Network) -> bool:
    """Return whether the forces of the contacts are known."""
    return all(getattr(network, name) is not None for name in FORCES)


def _virials_of_layers(network: Network, edges: Floats) -> Floats:
    """Return each layer's part (k, 3), N m, of force times branch vector, compression positive."""
    virial, rise = _virials(network)
    virial = np.einsum("caa->ca", virial)
    start = network.position[network.particle_i, 2]
    low = np.minimum(start, start + rise)
    min_rise = MIN_RISE_IN_RADII * float(network.radius.mean())
    span = np.maximum(abs(rise), min_rise)
    below = np.zeros((len(edges), 3))
    below[-1] = virial.sum(axis=0)
    for edge in _inner_edges(network, len(edges) - 1):
        share = np.clip((edges[edge] - _images(low, network)) / span, 0, 1)
        below[edge] = share.sum(axis=0) @ virial
    return np.diff(below, axis=0)


def write_profile(
    path: str | Path, layers: Profile, further: Mapping[str, Floats] | None = None
) -> None:
    """Write the layers as a table, *.csv: the middle of each, then the columns of `Profile`.

    `further` columns (k,) by their names with units follow.
    """
    columns: dict[str, Array] = {"z_m": (layers.edges[1:] + layers.edges[:-1]) / 2}
    if layers.stress is not None:
        for axis, stress in zip("xyz", layers.stress.T, strict=True):
            columns[f"stress_{axis}{axis}_Pa"] = stress
    columns["void_ratio"] = layers.void_ratio
    columns["coordination_number"] = layers.coordination
    columns["particles"] = layers.particles
    columns["bulk"] = layers.bulk
    columns |= further or {}
    text = io.StringIO()
    table = np.column_stack(list(columns.values()))
    np.savetxt(text, table, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    write_text(path, text.getvalue())


def net_forces(network: Network) -> Floats:
    """Return force and torque (n, 6), N and N m, of the contacts on each sphere.

    They are zero along held motions, because the support balances them.
    """
    force = contact_forces(network, "balance")
    load = np.zeros((network.n_particles, 6))
    ends = ((network.particle_i, network.lever_i), (network.particle_j, network.lever_j))
    for end, lever in ends:
        is_sphere = end >= 0
        force_and_torque = np.hstack([force, np.cross(lever, force)])
        for column in range(6):
            values = force_and_torque[is_sphere, column]
            load[:, column] += np.bincount(end[is_sphere], values, len(load))
        # The force on j is opposite to that on i.
        np.negative(force, out=force)
    if network.moment is not None:
        pair = ~network.with_wall
        for axis in range(3):
            moment = network.moment[:, axis]
            load[:, 3 + axis] += np.bincount(network.particle_i, moment, len(load))
            load[:, 3 + axis] -= np.bincount(network.particle_j[pair], moment[pair], len(load))
    if network.fixed is not None:
        load[network.fixed] = 0.0
    return load


def sizes_of_loads(load: Floats, radius: Floats) -> Floats:
    """Return sqrt(F^2 + (T / R)^2) of each sphere (n,), N, with its force F and torque T."""
    torque = load[:, 3:] / radius[:, None]
    return np.sqrt((load[:, :3] ** 2).sum(axis=1) + (torque**2).sum(axis=1))


def residual_forces(network: Network) -> Floats:
    """Return net force and torque of each sphere (n,) divided by the mean normal force."""
    mean = abs(network.require("force_normal", "balance")).mean()
    return sizes_of_loads(net_forces(network), network.radius) / mean


def affine_stiffness(network: Network) -> Floats:
    """Return the affine contribution (p,), J, of each contact between spheres.

    The sum is P-wave modulus times volume if every sphere follows the mean strain along z and none
    turns: an upper bound, exact for crystals whose spheres are all centres of symmetry. A contact
    contributes (kn n_z^4 + kt (n_z^2 - n_z^4)) l^2, where l is the length of its branch vector;
    contacts with walls are left out.
    """
    pair = ~network.with_wall
    branch = network.branch[pair]
    nz2 = network.normal[pair, 2] ** 2
    kn = network.stiffness_normal[pair]
    kt = network.stiffness_tangential[pair]
    return (kn * nz2**2 + kt * (nz2 - nz2**2)) * (branch**2).sum(axis=1)


def unevenness(network: Network) -> float:
    """Return the relative excess of V_P in the fastest third over that in the slowest.

    V^2 is taken as proportional to the mean of stiffness times squared branch vector, divided by
    the mean mass. The result is infinite if a third has no springs.
    """
    pair = ~network.with_wall
    branch = network.branch
    z = network.position[:, 2]
    middle = z[network.particle_i] + branch[:, 2] / 2
    stiffness = network.stiffness_normal * (branch**2).sum(axis=1)
    mass = _means_of_thirds(network, z, network.mass)
    mean_stiffness = _means_of_thirds(network, middle[pair], stiffness[pair])
    square = mean_stiffness / np.where(mass > 0, mass, np.inf)
    if not square.min() > 0:
        return np.inf
    return float(np.sqrt(square.max() / square.min()) - 1)


def _means_of_thirds(network: Network, height: Floats, values: Floats) -> Floats:
    """Return the means (3,) of values (k,) at heights (k,), m, in each third of the length."""
    share_of_length = (height - network.wall_position[0]) / network.length % 1
    # Just below the source wall round-off makes the share 1.
    third = (3 * share_of_length).astype(int) % 3
    return np.bincount(third, values, 3) / np.maximum(np.bincount(third, minlength=3), 1)


def affine_velocity(network: Network) -> float:
    """Return the P-wave velocity, m/s, of affine motion, rattlers included.

    It is used to estimate travel times in packings of any size. For a crystal of n layers the
    result is sqrt(1 - 1/n) times the velocity in its bulk, because n layers have n - 1 distances.
    """
    return float(np.sqrt(affine_stiffness(network).sum() / network.mass.sum()))
