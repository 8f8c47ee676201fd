"""Find the equal parts along x and y of which a packing consists.

A wave from a wall that moves as a whole is the same in each part. Therefore one part in a smaller
cell is enough: its spheres touch images across the edges, and its matrix is P^T K P / n, where P
repeats a motion n times. The search looks for a shift by 1/p of a period, p a prime, that maps
every sphere and every contact onto another one. The resulting part is then searched in the same
way.
"""

from dataclasses import dataclass
from math import gcd
from typing import NamedTuple

import numpy as np

from modal.packing.columns import BOND_COLUMNS, RECEIVER_WALL, SOURCE_WALL
from modal.packing.neighbours import canonical
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats, Ints

SAME = 1e-9
"""Largest `difference` of parts that round-off can explain. Crystals of the study have some 1e-10:
positions are rounded, and an overlap is a small difference of positions."""
MAX_DISTANCE_IN_RADII = 1e-6
"""Distance, in smallest radii, within which a shifted sphere must fall onto another sphere, so that
it is clear onto which one. How alike the two spheres are follows from their contacts."""
ASLANT = np.array([1.0, 0.61803, 0.75488])
"""A direction to which no contact of a crystal is perpendicular. It distinguishes the contacts of
two spheres that touch more than once."""
STIFFNESSES = ("stiffness_normal", "stiffness_tangential")
PRE_STRESS = (
    "force_normal",
    "force_tangential",
    "overlap",
    "shear_growth",
    "motion_shortening",
    "torque_shortening",
)


@dataclass(frozen=True)
class Repeats:
    """A network of equal parts.

    Attributes
    ----------
    part : Network
        One part, in the smallest cell that was found, without `cell_shift`.
    first : ndarray (n / count,)
        Index in the network of each sphere of the part.
    member : ndarray (n,)
        Index in the part of the sphere that moves like each sphere of the network.
    count : int
        Number of parts.
    difference : float
        Upper bound of the difference of the parts: half the relative difference of stiffnesses and
        of masses, plus three times that of normals and of levers divided by the smallest radius. It
        bounds the relative difference, after a time 1 / omega_max, of the motion from that in a
        network of exactly equal parts (`modal.waves.forced_system`).
    """

    part: Network
    first: Ints
    member: Ints
    count: int
    difference: float


def lateral_repeats(network: Network, *, pre_stress: bool = False) -> Repeats:
    """Return the equal parts of which a network consists; the network itself if it has none.

    Most random packings are excluded by the common divisors of the numbers of spheres and contacts,
    the others by the spheres that touch the source wall.

    Parameters
    ----------
    network : Network
        The packing, periodic along x or y.
    pre_stress : bool, default False
        Whether the forces of the contacts must be equal, too.

    Returns
    -------
    Repeats
        One part, the number of parts, and their difference, at most `SAME`.

    Examples
    --------
    >>> import modal
    >>> lateral_repeats(modal.fcc(cells=(3, 2, 10))).count
    6
    """
    name = f"lateral repeats, {pre_stress}"
    repeats = network.cached(name, lambda: _find_finest(network, pre_stress))
    return repeats or undivided(network)


def undivided(network: Network) -> Repeats:
    """Return the network as a single part, without repeats."""
    every: Ints = np.arange(network.n_particles)
    return Repeats(network, every, every, 1, 0.0)


def _find_finest(network: Network, pre_stress: bool) -> Repeats | None:
    """Return the parts as `lateral_repeats` does, but None if there is one part only.

    Thus a network does not store a copy of itself.
    """
    if any(getattr(network, name) is not None for name in BOND_COLUMNS):
        return None  # bonds and clumps are not compared
    if network.cell_vectors is not None:
        return None  # nor are cells at angles
    columns: tuple[str, ...] = STIFFNESSES
    if pre_stress:
        columns += PRE_STRESS
    repeats = undivided(network)
    for axis in (0, 1):
        if not network.cell_periodic[axis]:
            continue
        for prime in _prime_factors(_common_divisor(repeats.part)):
            finer = _divide(repeats, axis, prime, columns)
            while finer is not None:
                repeats = finer
                finer = _divide(repeats, axis, prime, columns)
    if repeats.count == 1:
        return None
    return repeats


def _common_divisor(network: Network) -> int:
    """Return the greatest common divisor of the numbers of spheres, contacts and wall contacts.

    The contacts with each wall are counted separately.
    """
    at_walls = [int((network.particle_j == wall).sum()) for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return gcd(network.n_particles, network.n_contacts, *at_walls)


def _prime_factors(number: int) -> list[int]:
    """Return the primes that divide a number, ascending; none for 0."""
    divisors = [d for d in range(2, number + 1) if number % d == 0]
    return [d for d in divisors if all(d % other for other in divisors if other < d)]


def _divide(whole: Repeats, axis: int, prime: int, columns: tuple[str, ...]) -> Repeats | None:
    """Return the repeats of 1/`prime` of the width along an axis, or None if there are none.

    `columns` are the properties of contacts that must be equal.
    """
    network = whole.part
    if _common_divisor(network) % prime:
        return None
    at_wall = np.unique(network.particle_i[network.particle_j == SOURCE_WALL])
    if _match_spheres(network, at_wall, axis, prime) is None:
        return None
    image = _match_spheres(network, np.arange(network.n_particles), axis, prime)
    if image is None:
        return None
    contact_image = _match_contacts(network, image)
    if contact_image is None:
        return None
    # Any part is at most half the way round from any other.
    difference = _largest_difference(network, image, contact_image, columns) * (prime // 2)
    if not difference <= SAME:
        return None
    # Of a sphere, or a contact, and its images the one with the lowest number stays.
    lowest_sphere = _lowest_image(image, prime)
    lowest_contact = _lowest_image(contact_image.row, prime)
    first = np.flatnonzero(lowest_sphere == np.arange(len(lowest_sphere)))
    member = np.searchsorted(first, lowest_sphere)
    kept = network.some(lowest_contact == np.arange(len(lowest_contact)))
    size = kept.cell_size.copy()
    size[axis] /= prime
    part = kept.unchecked(
        **{name: data[first] for name, data in kept.bodies().items()},
        particle_i=member[kept.particle_i],
        particle_j=np.where(kept.with_wall, kept.particle_j, member[kept.partner]),
        cell_size=size,
        cell_shift=None,
    )
    return Repeats(
        part,
        whole.first[first],
        member[whole.member],
        whole.count * prime,
        whole.difference + difference,
    )


def _lowest_image(image: Ints, times: int) -> Ints:
    """Return the lowest number (k,) that each number reaches if a map is applied repeatedly.

    `image` (k,) is the map, which is applied up to `times` times.
    """
    lowest: Ints = np.arange(len(image))
    current = lowest
    for _ in range(times - 1):
        current = image[current]
        lowest = np.minimum(lowest, current)
    return lowest


def _match_spheres(network: Network, spheres: Ints, axis: int, parts: int) -> Ints | None:
    """Return the sphere (k,) onto which a shift maps each of the `spheres`, or None.

    The shift along the axis is the cell's width divided by `parts`.
    """
    from scipy.spatial import KDTree  # not at import: most packings have no parts

    axes = network.cell_periodic
    period = np.where(axes, network.cell_size, 0.0)
    position = network.position[spheres]
    shifted = position.copy()
    shifted[:, axis] += period[axis] / parts
    for points in (position, shifted):
        points[:, axes] %= period[axes]
        points[points == period] = 0.0  # what lay a rounding below zero
    near = MAX_DISTANCE_IN_RADII * float(network.radius.min())
    _, image = KDTree(position, boxsize=period).query(shifted, distance_upper_bound=near)
    if not np.array_equal(np.sort(image), np.arange(len(spheres))):
        return None
    return image


class _ContactImage(NamedTuple):
    """Contacts and their images.

    contact, image (m,): contacts in canonical order, and for each the one that the shift maps onto
    it. row (m,): the contact onto which the shift maps each contact. sign (m, 1): -1 if the ends of
    contact and image are exchanged.
    """

    row: Ints
    contact: Ints
    image: Ints
    sign: Floats


def _match_contacts(network: Network, image: Ints) -> _ContactImage | None:
    """Return the contact onto which a shift maps each contact, or None without a match.

    `image` (n,) is the sphere onto which the shift maps each sphere.
    """
    i = network.particle_i
    j = network.particle_j
    slant = (network.normal @ ASLANT)[:, None]
    image_i = image[i]
    image_j = np.where(network.with_wall, j, image[network.partner])
    here, *ends, _, turned = canonical(i, j, slant)
    there, *image_ends, _, image_turned = canonical(image_i, image_j, slant)
    # In the k-th place of both orders are a contact and the one that falls onto it.
    if not np.array_equal(ends, image_ends):
        return None
    row = np.empty_like(here)
    row[there] = here
    sign = np.where(turned == image_turned, 1.0, -1.0)[:, None]
    return _ContactImage(row, here, there, sign)


def _largest_difference(
    network: Network, image: Ints, contacts: _ContactImage, columns: tuple[str, ...]
) -> float:
    """Return the `difference` (see `Repeats`) of spheres and contacts from their images."""
    if network.fixed is not None and (network.fixed[image] != network.fixed).any():
        return np.inf
    _, here, there, sign = contacts
    reach = float(network.radius.min())
    lever_i = np.where(sign > 0, network.lever_i[here], network.lever_j[here])
    lever_j = np.where(sign > 0, network.lever_j[here], network.lever_i[here])
    shape = max(
        _largest(network.normal[there] - sign * network.normal[here], 1.0),
        _largest(network.lever_i[there] - lever_i, reach),
        _largest(network.lever_j[there] - lever_j, reach),
    )
    mass = 0.0
    for values in (network.radius, network.mass, network.inertia):
        mass = max(mass, _largest(values[image] - values, values))
    stiffness = 0.0
    for name in columns:
        data = getattr(network, name)
        if data is None:
            continue
        if name in STIFFNESSES:
            # Contacts without stiffness fall onto others without.
            scale = np.where(data == 0, 1.0, data)[here]
            difference = _largest(data[there] - data[here], scale)
        else:
            facing = sign * data[here] if data.ndim > 1 else data[here]
            largest_value = float(abs(data).max(initial=0.0)) or 1.0
            difference = _largest(data[there] - facing, largest_value)
        stiffness = max(stiffness, difference)
    return (stiffness + mass) / 2 + 3 * shape


def _largest(difference: Array, scale: Array | float) -> float:
    """Return the largest absolute difference divided by a scale; 0 for an empty array."""
    return float(abs(difference / scale).max(initial=0.0))
