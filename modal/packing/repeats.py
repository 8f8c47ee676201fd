"""Lateral repeats: of how many equal parts along x and y a packing consists, and one of them.

A wave that a wall sends by moving as a whole is the same in each part. One of them, in the smaller
cell, then carries all of it: spheres across its edges touch their own images, and a sphere that
touches an image of itself has both sides of the contact (P^T K P / n, where P repeats a motion n
times, contact by contact). What is sought is a shift by 1/p of a period, p a prime, that maps every
sphere and every contact on another one; and then again one of what is left.
"""

from dataclasses import dataclass
from math import gcd

import numpy as np

from modal.packing.columns import OF_BONDS, RECEIVER_WALL, SOURCE_WALL
from modal.packing.neighbours import canonical
from modal.packing.network import Network
from modal.tools.arrays import Array, Ints

SAME = 1e-9
"""Largest `difference` that round-off explains. Of the crystals of the study it is
some 1e-10: the positions are rounded, and an overlap is a small difference of positions."""
NEAR = 1e-6
"""Smallest radii within which a shifted sphere must fall on another one. Which one that is has to
be certain; how alike they are is told by their contacts."""
ASLANT = np.array([1.0, 0.61803, 0.75488])
"""A direction to which no contact of a crystal is perpendicular: it tells those apart in which two
spheres touch more than once."""
OF_SPRINGS = ("stiffness_normal", "stiffness_tangential")
OF_PRE_STRESS = ("force_normal", "force_tangential", "overlap", "shear_growth",
                 "motion_shortening", "torque_shortening")  # fmt: skip


@dataclass(frozen=True)
class Repeats:
    """A network of `count` equal parts, n spheres in all.

    `part`: the network of one, of the size of the smallest cell found, without `cell_shift`;
    `first` (n / count,): the sphere that each of its spheres is; `member` (n,): the sphere of the
    part that moves as each sphere does. `difference` of the parts, at most: half that of the
    contacts' stiffnesses and of the spheres' masses, relative, and three times that of normals and
    levers, in terms of 1 and of the smallest radius. By this share of itself, at most, the motion
    of a wave differs after 1 / omega_max from that of a network of which all parts are equal
    (`modal.waves.forced_system`).
    """

    part: Network
    first: Ints
    member: Ints
    count: int
    difference: float


def lateral_repeats(network: Network, *, pre_stress: bool = False) -> Repeats:
    """The equal parts of which the network consists; one, itself, where it does not repeat itself.

    Of most random packings a glance is enough, at the common divisors of the numbers of spheres and
    contacts; of others one at the spheres that touch the source wall.

    Parameters
    ----------
    network : Network
        The packing, periodic along x or y.
    pre_stress : bool, default False
        Whether the forces of the contacts must be the same, too.

    Returns
    -------
    Repeats
        One part, their number, and by how much they differ: at most `SAME`, relative.

    Examples
    --------
    >>> import modal
    >>> lateral_repeats(modal.fcc(cells=(3, 2, 10))).count
    6
    """
    name = f"lateral repeats, {pre_stress}"
    finer = network.cached(name, lambda: _finest(network, pre_stress))
    return finer or undivided(network)


def undivided(network: Network) -> Repeats:
    """The network as the one part of itself."""
    every: Ints = np.arange(network.n_particles)
    return Repeats(network, every, every, 1, 0.0)


def _finest(network: Network, pre_stress: bool) -> Repeats | None:
    """As `lateral_repeats`; None of a network that does not repeat itself, which keeps no copy."""
    if any(getattr(network, name) is not None for name in OF_BONDS):
        return None  # bonds and clumps are not compared
    found = whole = undivided(network)
    columns = (*OF_SPRINGS, *(OF_PRE_STRESS if pre_stress else ()))
    for axis in (0, 1):
        for prime in _primes(_common(found.part)) if network.cell_periodic[axis] else ():
            while (finer := _parted(found, axis, prime, columns)) is not None:
                found = finer
    return None if found is whole else found


def _common(network: Network) -> int:
    """What divides the numbers of spheres, of contacts, and of those with either wall."""
    walls = [int((network.particle_j == wall).sum()) for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return gcd(network.n_particles, network.n_contacts, *walls)


def _primes(number: int) -> list[int]:
    """The primes that divide a number, ascending; none of 0."""
    divisors = [d for d in range(2, number + 1) if number % d == 0]
    return [d for d in divisors if all(d % other for other in divisors if other < d)]


def _parted(whole: Repeats, axis: int, prime: int, columns: tuple[str, ...]) -> Repeats | None:
    """The repeats of a `prime`-th of the width along an axis, or None."""
    network = whole.part
    if _common(network) % prime:
        return None
    at_wall = np.unique(network.particle_i[network.particle_j == SOURCE_WALL])
    if _images(network, at_wall, axis, prime) is None:
        return None
    image = _images(network, np.arange(network.n_particles), axis, prime)
    compared = None if image is None else _compared(network, image, columns)
    if image is None or compared is None:
        return None
    contact, difference = compared
    # Any part is at most half the way round from any other.
    difference *= prime // 2
    if not difference <= SAME:
        return None
    # Of a sphere, or a contact, and its images the one with the lowest number stays.
    own, their = _lowest(image, prime), _lowest(contact, prime)
    first = np.flatnonzero(own == np.arange(len(own)))
    member = np.searchsorted(first, own)
    kept = network.some(their == np.arange(len(their)))
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


def _lowest(image: Ints, times: int) -> Ints:
    """Shape (k,): the lowest number that `image` (k,) leads each to, applied so many `times`."""
    lowest: Ints = np.arange(len(image))
    here = lowest
    for _ in range(times - 1):
        here = image[here]
        lowest = np.minimum(lowest, here)
    return lowest


def _images(network: Network, spheres: Ints, axis: int, parts: int) -> Ints | None:
    """Shape (k,): on which of the `spheres` (k,) each one falls, or None where one falls on none.

    They are moved along the axis by the cell's width over `parts`.
    """
    from scipy.spatial import KDTree  # not at import: most packings have no parts

    axes, period = network.cell_periodic, np.where(network.cell_periodic, network.cell_size, 0.0)
    place, moved = np.repeat(network.position[None, spheres], 2, axis=0)
    moved[:, axis] += period[axis] / parts
    for at in (place, moved):
        at[:, axes] %= period[axes]
        at[at == period] = 0.0  # what lay a rounding below zero
    near = NEAR * float(network.radius.min())
    _, image = KDTree(place, boxsize=period).query(moved, distance_upper_bound=near)
    return image if np.array_equal(np.sort(image), np.arange(len(spheres))) else None


def _compared(network: Network, image: Ints, columns: tuple[str, ...]) -> tuple[Ints, float] | None:
    """Shape (m,): the contact on which each one falls; and the largest difference of both.

    `image` (n,) is the sphere on which each one falls. None where contacts fall on none.
    """
    i, j = network.particle_i, network.particle_j
    moved = image[i], np.where(network.with_wall, j, image[network.partner])
    slant = (network.normal @ ASLANT)[:, None]
    here, *ends, _, turned = canonical(i, j, slant)
    there, *moved_ends, _, turned_there = canonical(*moved, slant)
    # What stands at one place of both orders is a contact and what falls on it.
    if not np.array_equal(ends, moved_ends):
        return None
    contact = np.empty_like(here)
    contact[there] = here
    sign = np.where(turned == turned_there, 1.0, -1.0)[:, None]
    reach = float(network.radius.min())
    levers = [network.lever_i[here], network.lever_j[here]]
    other = np.where(sign > 0, *levers), np.where(sign > 0, *levers[::-1])
    shape = max(
        _most(network.normal[there] - sign * network.normal[here], 1.0),
        _most(network.lever_i[there] - other[0], reach),
        _most(network.lever_j[there] - other[1], reach),
    )
    spheres = (getattr(network, name) for name in ("radius", "mass", "inertia"))
    mass = max(_most(data[image] - data, data) for data in spheres)
    stiffness = 0.0
    for name in columns:
        data = getattr(network, name)
        if data is None:
            continue
        if name in OF_SPRINGS:
            # Contacts without stiffness fall on such ones.
            own = _most(data[there] - data[here], np.where(data == 0, 1.0, data)[here])
        else:
            facing = sign * data[here] if data.ndim > 1 else data[here]
            own = _most(data[there] - facing, float(abs(data).max(initial=0.0)) or 1.0)
        stiffness = max(stiffness, own)
    return contact, (stiffness + mass) / 2 + 3 * shape


def _most(difference: Array, scale: Array | float) -> float:
    return float(abs(difference / scale).max(initial=0.0))
