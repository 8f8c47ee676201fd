"""Count places where spheres, or a sphere and a wall, overlap without a contact in the network.

If a file lacks contacts, or a program wrote only contacts of one kind, the network looks like that
of a softer packing: only the positions of its spheres show that contacts are missing. Such a
network is not refused, since spheres may overlap without a force after plastic contact.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from modal.packing.columns import Columns
from modal.packing.neighbours import images_within, periodic_pairs
from modal.tools.arrays import Bools, Floats, Ints

SIZE_STEP = 2.0
"""Largest ratio of radii within one class of sizes: among similar spheres few pairs are near each
other without touching."""
IMAGES_PER_PART = 4096
"""Number of large spheres whose small neighbours are sought together, which bounds the memory."""
MIN_DEPTH_IN_MEAN_OVERLAPS = 0.1
"""Least depth of an overlap that is counted, divided by the mean overlap: two descriptions of a
packing may differ by less."""


class MissingContacts(NamedTuple):
    """Numbers of missing contacts between spheres (`pairs`), and of spheres with a wall."""

    pairs: int
    with_wall: int

    def describe_pairs(self, network: Columns) -> str:
        """Describe the missing contacts between spheres in a sentence."""
        known = int((~network.with_wall).sum())
        return (
            f"contacts missing: {self.pairs} pairs of spheres overlap without one, {known} have "
            "one; export all contacts"
        )

    def describe_walls(self, network: Columns) -> str:
        """Describe the missing contacts with walls in a sentence."""
        low, high = network.wall_position
        return (
            f"contacts with walls missing: {self.with_wall} spheres reach beyond z = {low:g} or "
            f"{high:g} m without one; export these contacts, or bounds outside of the spheres "
            "where no wall stands"
        )


def missing_contacts(network: Columns) -> MissingContacts:
    """Return how many contacts are missing; zero for bodies that are not spheres."""
    return network.cached("missing contacts", lambda: _missing_contacts(network))


def least_overlap(network: Columns, overlap: Floats) -> float:
    """Return the least overlap, m, that is counted, from the contacts' overlaps (m,), m."""
    round_off = 8 * float(np.spacing(abs(network.position).max() + 2 * network.radius.max()))
    mean = float(abs(overlap).mean()) if len(overlap) else 0.0
    return max(MIN_DEPTH_IN_MEAN_OVERLAPS * mean, round_off)


def overlaps_by_places(network: Columns) -> Floats:
    """Compute the overlaps (m,), m, of the contacts from positions and radii."""
    radius_j = np.where(network.with_wall, 0.0, network.radius[network.partner])
    reach = network.radius[network.particle_i] + radius_j
    return reach - np.linalg.norm(network.branch, axis=1)


def _missing_contacts(network: Columns) -> MissingContacts:
    """Count missing contacts as `missing_contacts` does, without the cache."""
    if network.inertia_tensor is not None:
        return MissingContacts(0, 0)
    overlap = overlaps_by_places(network)
    depth = least_overlap(network, overlap)
    is_deep = overlap > depth
    wall = network.with_wall
    deep_at_walls = int((is_deep & wall & ~network.held[network.particle_i]).sum())
    pairs = _count_pairs(network, depth, np.ones(network.n_particles, bool))
    pairs -= int(is_deep[~wall].sum())
    if network.fixed is not None:
        # Held bodies do not act on each other, and programs may leave out their contacts.
        held = network.held
        between_held = ~wall & held[network.particle_i] & held[network.partner]
        pairs -= _count_pairs(network, depth, held) - int(is_deep[between_held].sum())
    with_wall = _count_at_walls(network, depth) - deep_at_walls
    return MissingContacts(max(pairs, 0), max(with_wall, 0))


def _count_at_walls(network: Columns, depth: float) -> int:
    """Count spheres that move and overlap a wall by more than `depth`, m.

    Two walls at the same height mean that there are none.
    """
    low, high = network.wall_position
    if network.cell_periodic[2] or not high > low:
        return 0
    moves = ~network.held
    z = network.position[moves, 2]
    radius = network.radius[moves]
    return int((radius - (z - low) > depth).sum() + (radius - (high - z) > depth).sum())


def _count_pairs(network: Columns, depth: float, selection: Bools) -> int:
    """Count pairs of selected spheres (n,) that overlap by more than `depth`, m.

    A pair is counted once for each image.
    """
    periodic = network.cell_periodic
    radius = network.radius[selection]
    if not len(radius):
        return 0
    position = network.position[selection] - network.position.min(axis=0)
    if network.cell_vectors is None:
        position[:, periodic] %= network.cell_size[periodic]
    else:
        position -= np.floor(network.in_periods(position)) @ network.period_vectors
    # Along an axis without a period images lie beyond the reach of any sphere.
    open_side = np.ptp(position, axis=0) + 6 * radius.max()
    if network.cell_vectors is None:
        side = np.where(periodic, network.cell_size, open_side)[: 2 + int(periodic[2])]
    else:
        side = network.period_vectors + np.diag(np.where(periodic, 0.0, open_side))
    vectors = side
    if side.ndim == 1:
        vectors = np.diag([*side, 0.0][:3])
    sizes = np.floor(np.log(radius / radius.min()) / np.log(SIZE_STEP) + 1e-9).astype(int)
    classes = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    count = 0
    for number, small in enumerate(classes):
        i, j, shift = periodic_pairs(position[small], side, 2 * float(radius[small].max()))
        branch = position[small[j]] - position[small[i]]
        branch += shift @ vectors
        overlap = radius[small[i]] + radius[small[j]] - np.linalg.norm(branch, axis=1)
        count += int((overlap > depth).sum())
        for large in classes[number + 1 :]:
            count += _count_between_classes(position, radius, side, depth, small, large)
    return count


def _count_between_classes(
    position: Floats, radius: Floats, side: Floats, depth: float, small: Ints, large: Ints
) -> int:
    """Count pairs of `small` and `large` spheres that overlap by more than `depth`, m.

    Small spheres are sorted into cubes whose width is the largest distance of a pair; the
    neighbours of a large sphere, or of one of its images, are in the 27 cubes around it.
    """
    reach = float(radius[small].max() + radius[large].max())
    images, original, _ = images_within(position[large], side, reach)
    image_radius = radius[large][original]
    small_position = position[small]
    small_radius = radius[small]
    low = np.minimum(small_position.min(axis=0), images.min(axis=0))
    cubes = ((small_position - low) / reach).astype(np.int64) + 1
    image_cubes = ((images - low) / reach).astype(np.int64) + 1
    count = np.maximum(cubes.max(axis=0), image_cubes.max(axis=0)) + 2
    strides = np.array([count[1] * count[2], count[2], 1])
    key = cubes @ strides
    image_key = image_cubes @ strides
    order = np.argsort(key, kind="stable")
    key = key[order]
    total = 0
    for first in range(0, len(images), IMAGES_PER_PART):
        part = slice(first, first + IMAGES_PER_PART)
        for step in product((-1, 0, 1), repeat=3):
            cube = image_key[part] + step @ strides
            begin = np.searchsorted(key, cube)
            number = np.searchsorted(key, cube, side="right") - begin
            image = np.repeat(np.arange(len(cube)) + first, number)
            rank = np.arange(len(image)) - np.repeat(np.cumsum(number) - number, number)
            sphere = order[np.repeat(begin, number) + rank]
            distance = np.linalg.norm(small_position[sphere] - images[image], axis=1)
            overlap = small_radius[sphere] + image_radius[image] - distance
            total += int((overlap > depth).sum())
    return total
