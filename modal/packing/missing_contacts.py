"""Places where spheres, or a sphere and a wall, overlap though the network has no contact there.

A network whose file has lost contacts, or whose program wrote the contacts of one kind alone, is a
sound network of a softer packing: nothing but the places of its spheres tells. It is not refused,
since contacts that were plastic, or that only just parted, may overlap without a force.
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from modal.packing.columns import Columns
from modal.packing.neighbours import images_within, periodic_pairs
from modal.tools.arrays import Floats, Ints

SIZE_STEP = 2.0
"""Radii of one class of sizes differ at most by this factor: among spheres alike few are near that
do not touch."""
IMAGES_AT_ONCE = 4096
"""Large spheres whose small neighbours are looked at together, to bound the memory."""
DEPTH_IN_MEAN_OVERLAPS = 0.1
"""Overlaps that are shallower are not counted: so much two descriptions of a packing may differ."""


class MissingContacts(NamedTuple):
    """How many contacts of spheres, and of spheres with a wall, are missing."""

    pairs: int
    with_wall: int

    def of_pairs(self, network: Columns) -> str:
        """In words, of the contacts between spheres."""
        known = int((~network.with_wall).sum())
        return (
            f"contacts missing: {self.pairs} pairs of spheres overlap without one, {known} have "
            "one; export all contacts"
        )

    def of_walls(self, network: Columns) -> str:
        """In words, of the contacts with walls."""
        low, high = network.wall_position
        return (
            f"contacts with walls missing: {self.with_wall} spheres reach beyond z = {low:g} or "
            f"{high:g} m without one; export these contacts, or bounds outside of the spheres "
            "where no wall stands"
        )


def missing_contacts(network: Columns) -> MissingContacts:
    """Return how many places overlap without a contact; none for bodies that are no spheres."""
    return network.cached("missing contacts", lambda: _missing_contacts(network))


def least_overlap(network: Columns, overlap: Floats) -> float:
    """Return the depth, m, from which an overlap counts, by those (m,), m, of the contacts."""
    round_off = 8 * float(np.spacing(abs(network.position).max() + 2 * network.radius.max()))
    mean = float(abs(overlap).mean()) if len(overlap) else 0.0
    return max(DEPTH_IN_MEAN_OVERLAPS * mean, round_off)


def overlaps_by_places(network: Columns) -> Floats:
    """Return the overlaps (m,), m, of the contacts by positions and radii."""
    other = np.where(network.with_wall, 0.0, network.radius[network.partner])
    reach = network.radius[network.particle_i] + other
    return reach - np.linalg.norm(network.branch, axis=1)


def _missing_contacts(network: Columns) -> MissingContacts:
    if network.inertia_tensor is not None:
        return MissingContacts(0, 0)
    known = overlaps_by_places(network)
    depth = least_overlap(network, known)
    wall = network.with_wall
    pairs = _overlapping_pairs(network, depth) - int((known[~wall] > depth).sum())
    with_wall = _overlapping_walls(network, depth) - int((known[wall] > depth).sum())
    return MissingContacts(max(pairs, 0), max(with_wall, 0))


def _overlapping_walls(network: Columns, depth: float) -> int:
    """Return how many spheres overlap a wall by more than `depth`, m; coincident walls are none."""
    low, high = network.wall_position
    if network.cell_periodic[2] or not high > low:
        return 0
    z, radius = network.position[:, 2], network.radius
    return int((radius - (z - low) > depth).sum() + (radius - (high - z) > depth).sum())


def _overlapping_pairs(network: Columns, depth: float) -> int:
    """Return how many pairs of spheres overlap by more than `depth`, m, each image once."""
    periodic, radius = network.cell_periodic, network.radius
    periods = np.where(periodic, network.cell_size, 0.0)
    position = network.position - network.position.min(axis=0)
    position[:, periodic] %= network.cell_size[periodic]
    # Along an axis without a period images lie beyond the reach of any sphere.
    open_side = position.max(axis=0) + 6 * radius.max()
    side = np.where(periodic, periods, open_side)[: 2 + int(periodic[2])]
    sizes = np.floor(np.log(radius / radius.min()) / np.log(SIZE_STEP) + 1e-9).astype(int)
    classes = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    count = 0
    for number, small in enumerate(classes):
        i, j, shift = periodic_pairs(position[small], side, 2 * float(radius[small].max()))
        apart = position[small[j]] - position[small[i]]
        apart[:, : len(side)] += shift[:, : len(side)] * side
        overlap = radius[small[i]] + radius[small[j]] - np.linalg.norm(apart, axis=1)
        count += int((overlap > depth).sum())
        for large in classes[number + 1 :]:
            count += _overlaps_of_classes(position, radius, side, depth, small, large)
    return count


def _overlaps_of_classes(
    position: Floats, radius: Floats, side: Floats, depth: float, small: Ints, large: Ints
) -> int:
    """Return how many of the `small` spheres and of the images of `large` ones overlap so deep.

    Small spheres are sorted into cubes as wide as the two reach; each large one looks at the cubes
    about its own.
    """
    reach = float(radius[small].max() + radius[large].max())
    images, owner, _ = images_within(position[large], side, reach)
    image_radius = radius[large][owner]
    places = position[small]
    low = np.minimum(places.min(axis=0), images.min(axis=0))
    cubes = ((places - low) / reach).astype(np.int64) + 1
    image_cubes = ((images - low) / reach).astype(np.int64) + 1
    count = np.maximum(cubes.max(axis=0), image_cubes.max(axis=0)) + 2
    strides = np.array([count[1] * count[2], count[2], 1])
    key, image_key = cubes @ strides, image_cubes @ strides
    order = np.argsort(key, kind="stable")
    key = key[order]
    deep = 0
    for first in range(0, len(images), IMAGES_AT_ONCE):
        some = slice(first, first + IMAGES_AT_ONCE)
        for step in product((-1, 0, 1), repeat=3):
            beside = image_key[some] + step @ strides
            begin = np.searchsorted(key, beside)
            number = np.searchsorted(key, beside, side="right") - begin
            image = np.repeat(np.arange(len(beside)) + first, number)
            ahead = np.arange(len(image)) - np.repeat(np.cumsum(number) - number, number)
            sphere = order[np.repeat(begin, number) + ahead]
            distance = np.linalg.norm(places[sphere] - images[image], axis=1)
            overlap = radius[small][sphere] + image_radius[image] - distance
            deep += int((overlap > depth).sum())
    return deep
