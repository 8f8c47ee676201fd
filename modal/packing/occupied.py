"""Where grains are in a cell that they do not fill: below a free surface, between free sides.

The void ratio of such a packing is that of cubes, a little wider than a sphere, all of whose
neighbours hold spheres too, so that neither a wall nor a surface is near. How far the cubes differ
is its error. The volume of the packing is that of its spheres at this void ratio, and a surface
lies where it would lie if the packing were as dense up to there (the dividing surface of Gibbs).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from modal.packing.columns import PART, RECEIVER_WALL, SOURCE_WALL
from modal.packing.contact_law import sphere_volume
from modal.packing.network import Network
from modal.tools.arrays import Bools, Floats

CUBE_IN_DIAMETERS = 1.5
"""Width of a cube: among equal spheres at random it holds four centres, and is never empty."""
LEAST_SOLID_FRACTION = 0.25
"""Of a cube that counts as holding spheres; within a packing cubes have 0.4 to 0.75."""
SCATTER_OF_CUBES = 0.1
"""Relative, of the solid fractions of single cubes, where there are too few to tell."""
FEW_CUBES = 8
GAP_IN_DIAMETERS = 1.0
"""Space beside the spheres from which on a side without a period is free: a cell as wide as its
packing leaves less."""
ROUGHNESS_IN_DIAMETERS = 0.5
"""By which the volume of a packing without a core ends before, or behind, its outermost spheres."""
DENSEST = 0.7405
"""Solid fraction of the densest packing of equal spheres."""
POINT_SPACING = 0.4
"""Of the points that stand for a sphere, in radii: their shares in two cubes are right to 1 %."""
END_NAMES = (("-x", "+x"), ("-y", "+y"), ("-z", "+z"))


@dataclass(frozen=True)
class Occupied:
    """What a packing with free ends fills.

    void_ratio, void_ratio_error: of its core; volume, m^3; cubes: how many the core has, 0 where
    the packing is too small for one and the space up to its outermost spheres is taken; low, high:
    ends along z, m; free (3, 2) bool: whether the lower and the upper end along each axis are.
    """

    void_ratio: float
    void_ratio_error: float
    volume: float
    cubes: int
    low: float
    high: float
    free: Bools

    @property
    def cross_section(self) -> float:
        """Mean area across z, m^2."""
        return self.volume / (self.high - self.low)

    @property
    def free_names(self) -> list[str]:
        """Names of the free ends, as -x or +z."""
        return [END_NAMES[axis][end] for axis, end in np.argwhere(self.free)]


def free_ends(network: Network) -> Bools:
    """Return which ends (3, 2) of the packing along x, y and z are free surfaces.

    Along z those whose wall nothing touches, along x and y both where the cell has no period and
    is wider than the spheres reach. A cell without a width there has none to compare with, and
    spheres without any contact are no packing.
    """
    free = np.zeros((3, 2), bool)
    if not network.n_contacts:
        return free
    radius = network.radius
    for axis in range(2):
        if network.cell_periodic[axis] or not network.cell_size[axis] > 0:
            continue
        along = network.position[:, axis]
        reach = (along + radius).max() - (along - radius).min()
        gap = GAP_IN_DIAMETERS * 2 * float(radius.mean())
        free[axis] = network.cell_size[axis] - reach > gap
    if network.length > 0 and not network.cell_periodic[2]:
        free[2] = [wall not in network.particle_j for wall in (SOURCE_WALL, RECEIVER_WALL)]
    return free


def occupied_part(network: Network) -> Occupied | None:
    """Return what the packing fills of its cell; None where no end is free, or the cell is flat."""
    return network.cached("occupied part", lambda: _occupied_part(network))


def _occupied_part(network: Network) -> Occupied | None:
    free = free_ends(network)
    if not free.any() or not network.length > 0 or not network.cell_size[:2].all():
        return None
    solid = float(sphere_volume(network.radius).sum())
    fractions = core_solid_fractions(network)
    if len(fractions):
        fraction = float(fractions.mean())
        scatter = SCATTER_OF_CUBES * fraction
        if len(fractions) >= FEW_CUBES:
            scatter = float(fractions.std(ddof=1))
        void_ratio = 1 / fraction - 1
        error = scatter / np.sqrt(len(fractions)) / fraction**2
        volume = solid / fraction
    else:
        volume, relative_error = _volume_of_extent(network, free)
        void_ratio = volume / solid - 1
        error = relative_error * volume / solid
    low, high = _ends_along_z(network, free, volume)
    return Occupied(void_ratio, float(error), volume, len(fractions), low, high, free)


def _extent(network: Network, free: Bools) -> Floats:
    """Shape (3, 2), m: where the packing begins and ends along each axis."""
    radius = network.radius[:, None]
    spheres = np.column_stack(
        [(network.position - radius).min(axis=0), (network.position + radius).max(axis=0)]
    )
    cell = np.column_stack([np.zeros(3), network.cell_size])
    cell[2] = network.wall_position
    return np.where(free, spheres, cell)


def _volume_of_extent(network: Network, free: Bools) -> tuple[float, float]:
    """Volume up to the centres of the outermost spheres, m^3, and its relative error."""
    diameter = 2 * float(network.radius.mean())
    centres = np.column_stack([network.position.min(axis=0), network.position.max(axis=0)])
    ends = np.where(free, centres, _extent(network, free))
    extent = np.maximum(np.diff(ends, axis=1)[:, 0], diameter / 2)
    solid = float(sphere_volume(network.radius).sum())
    volume = max(float(extent.prod()), solid / DENSEST)
    return volume, float((free.sum(axis=1) * ROUGHNESS_IN_DIAMETERS * diameter / extent).sum())


def _ends_along_z(network: Network, free: Bools, volume: float) -> tuple[float, float]:
    """Where the packing begins and ends along z, m."""
    low, high = _extent(network, free)[2]
    if free[:2].any() or not free[2].any():
        return float(low), float(high)
    height = volume / network.area
    if free[2].all():
        middle = (low + high) / 2
        return float(middle - height / 2), float(middle + height / 2)
    if free[2, 1]:
        return float(low), float(low + height)
    return float(high - height), float(high)


def core_solid_fractions(network: Network) -> Floats:
    """Return the solid fractions (k,) of the cubes with neither wall nor surface beside them."""
    periodic = network.cell_periodic
    low = np.where(periodic, 0.0, (network.position - network.radius[:, None]).min(axis=0))
    high = (network.position + network.radius[:, None]).max(axis=0)
    length = np.where(periodic, network.cell_size, high - low)
    # By volume, so that among small spheres a few large ones decide.
    diameter = 2 * float((network.radius**4).sum() / (network.radius**3).sum())
    apart = length / (CUBE_IN_DIAMETERS * diameter)
    count = np.maximum(np.where(periodic, np.floor(apart), np.ceil(apart)), 1).astype(int)
    cube = np.where(periodic, length / count, CUBE_IN_DIAMETERS * diameter)
    if count.prod() > 100 * (network.n_particles + 1000):
        return np.empty(0)  # spheres here and there in a wide space
    solid = np.zeros(count.prod())
    for place, volume in _points(network):
        index = np.floor((place - low) / cube).astype(int)
        index = np.where(periodic, index % count, np.clip(index, 0, count - 1))
        flat = np.ravel_multi_index(tuple(index.T), tuple(count))
        solid += np.bincount(flat, volume, len(solid))
    fraction = solid.reshape(count) / cube.prod()
    return fraction[_surrounded(fraction > LEAST_SOLID_FRACTION, periodic)]


def _points(network: Network) -> Iterator[tuple[Floats, Floats]]:
    """Points (k, 3), m, in the spheres and the volume (k,), m^3, that each stands for."""
    line = np.arange(-1 + POINT_SPACING / 2, 1, POINT_SPACING)
    ball = np.array([point for point in product(line, repeat=3) if np.dot(point, point) < 1])
    part = max(1, PART // 4)
    for first in range(0, network.n_particles, part):
        radius = network.radius[first : first + part]
        position = network.position[first : first + part]
        place = position[:, None] + radius[:, None, None] * ball
        volume = np.repeat(sphere_volume(radius) / len(ball), len(ball))
        yield place.reshape(-1, 3), volume


def _surrounded(full: Bools, periodic: Bools) -> Bools:
    """Return which cubes are full, with all of their neighbours; outside of the cell none is."""
    widths = [(0, 0) if wraps else (1, 1) for wraps in periodic]
    around = np.pad(full, widths)
    for axis in range(3):
        around = around & np.roll(around, 1, axis) & np.roll(around, -1, axis)
    inner = tuple(slice(None) if wraps else slice(1, -1) for wraps in periodic)
    return around[inner]
