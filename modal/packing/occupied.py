"""Find the part of a cell that a packing with free surfaces or free sides fills.

The void ratio of such a packing is the mean over cubes a little wider than a sphere. Only cubes
count whose neighbours all contain spheres, so that neither a wall nor a surface is near. The error
follows from the scatter of the cubes. The volume of the packing is that of its spheres at this void
ratio. A surface is placed as if the packing were equally dense up to it (the dividing surface of
Gibbs).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from modal.packing.columns import PART
from modal.packing.contact_law import sphere_volume
from modal.packing.ends import is_open_end
from modal.packing.network import Network
from modal.tools.arrays import Bools, Floats

CUBE_IN_DIAMETERS = 1.5
"""Width of a cube: among equal spheres at random it holds four centres and is never empty."""
MIN_CUBE_FRACTION = 0.25
"""Solid fraction below which a cube counts as empty; inside a packing, cubes have 0.4 to 0.75."""
DEFAULT_RELATIVE_SCATTER = 0.1
"""Relative standard deviation of the solid fractions of cubes that is assumed if a packing has too
few cubes to measure it."""
MIN_CUBES_FOR_SCATTER = 8
MIN_GAP_IN_DIAMETERS = 1.0
"""Least gap between spheres and the side of the cell, in diameters, with which a side without a
period counts as free; in a cell as wide as its packing the gap is smaller."""
ROUGHNESS_IN_DIAMETERS = 0.5
"""Uncertainty, in diameters, of the position at which a packing without a core ends."""
MAX_SOLID_FRACTION = 0.7405
"""Solid fraction of the densest packing of equal spheres."""
POINTS_STEP_IN_RADII = 0.4
"""Spacing of the points that represent a sphere: its shares in two cubes are right to 1 %."""
MAX_CUBES_PER_SPHERE = 100
"""Largest number of cubes for each sphere; beyond it, spheres are scattered in a wide space."""
END_NAMES = (("-x", "+x"), ("-y", "+y"), ("-z", "+z"))


@dataclass(frozen=True)
class Occupied:
    """The part of the cell that a packing with free ends fills.

    Attributes
    ----------
    void_ratio, void_ratio_error : float
        Void ratio of the packing's core, and its error.
    volume : float
        Volume of the packing, m^3.
    cubes : int
        Number of cubes in the core; 0 if the packing is too small for one. Void ratio and volume
        are then those of the space up to the outermost spheres.
    low, high : float
        Lower and upper end of the packing along z, m.
    free : ndarray of bool (3, 2)
        Whether the lower and the upper end along each axis are free.
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
        """Names of the free ends, such as "-x" and "+z"."""
        return [END_NAMES[axis][end] for axis, end in np.argwhere(self.free)]


def free_ends(network: Network) -> Bools:
    """Return which ends (3, 2) of the packing along x, y and z are free surfaces.

    An end along z is free if nothing touches its wall and no held bodies are there. Both ends along
    x or y are free if there is no period and the cell is wider than the packing. Along an axis
    without a width there are no free ends. Spheres without any contact have no free ends at all.
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
        gap = MIN_GAP_IN_DIAMETERS * 2 * float(radius.mean())
        free[axis] = network.cell_size[axis] - reach > gap
    if network.length > 0 and not network.cell_periodic[2]:
        free[2] = [is_open_end(network, "source"), is_open_end(network, "receiver")]
    return free


def occupied_part(network: Network) -> Occupied | None:
    """Return the filled part of the cell; None if no end is free or the cell is flat."""
    return network.cached("occupied part", lambda: _occupied_part(network))


def _occupied_part(network: Network) -> Occupied | None:
    """Find the filled part as `occupied_part` does, without the cache."""
    free = free_ends(network)
    if not free.any() or not network.length > 0 or not network.cell_size[:2].all():
        return None
    network.refuse_angles("void ratio with free ends")
    solid = float(sphere_volume(network.radius).sum())
    fractions = core_solid_fractions(network)
    if len(fractions):
        fraction = float(fractions.mean())
        scatter = DEFAULT_RELATIVE_SCATTER * fraction
        if len(fractions) >= MIN_CUBES_FOR_SCATTER:
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
    """Return the lower and upper end (3, 2), m, of the packing along each axis."""
    radius = network.radius[:, None]
    spheres = np.column_stack(
        [(network.position - radius).min(axis=0), (network.position + radius).max(axis=0)]
    )
    cell = np.column_stack([np.zeros(3), network.cell_size])
    cell[2] = network.wall_position
    return np.where(free, spheres, cell)


def _volume_of_extent(network: Network, free: Bools) -> tuple[float, float]:
    """Return the volume up to the centres of the outermost spheres, m^3, and its relative error."""
    diameter = 2 * float(network.radius.mean())
    centres = np.column_stack([network.position.min(axis=0), network.position.max(axis=0)])
    ends = np.where(free, centres, _extent(network, free))
    extent = np.maximum(np.diff(ends, axis=1)[:, 0], diameter / 2)
    solid = float(sphere_volume(network.radius).sum())
    volume = max(float(extent.prod()), solid / MAX_SOLID_FRACTION)
    relative_errors = free.sum(axis=1) * ROUGHNESS_IN_DIAMETERS * diameter / extent
    return volume, float(relative_errors.sum())


def _ends_along_z(network: Network, free: Bools, volume: float) -> tuple[float, float]:
    """Return the lower and upper end of the packing along z, m."""
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
    """Return the solid fractions (k,) of the cubes that are not next to a wall or a surface."""
    periodic = network.cell_periodic
    low = np.where(periodic, 0.0, (network.position - network.radius[:, None]).min(axis=0))
    high = (network.position + network.radius[:, None]).max(axis=0)
    length = np.where(periodic, network.cell_size, high - low)
    # Weighted by volume, so that a few large spheres among small ones set the width of the cubes.
    diameter = 2 * float((network.radius**4).sum() / (network.radius**3).sum())
    cubes = length / (CUBE_IN_DIAMETERS * diameter)
    count = np.maximum(np.where(periodic, np.floor(cubes), np.ceil(cubes)), 1).astype(int)
    cube = np.where(periodic, length / count, CUBE_IN_DIAMETERS * diameter)
    if count.prod() > MAX_CUBES_PER_SPHERE * (network.n_particles + 1000):
        return np.empty(0)
    solid = np.zeros(count.prod())
    for place, volume in _sphere_points(network):
        index = np.floor((place - low) / cube).astype(int)
        index = np.where(periodic, index % count, np.clip(index, 0, count - 1))
        flat = np.ravel_multi_index(tuple(index.T), tuple(count))
        solid += np.bincount(flat, volume, len(solid))
    fraction = solid.reshape(count) / cube.prod()
    return fraction[_surrounded(fraction > MIN_CUBE_FRACTION, periodic)]


def _sphere_points(network: Network) -> Iterator[tuple[Floats, Floats]]:
    """Yield points (k, 3), m, inside the spheres and the volume (k,), m^3, that each represents."""
    line = np.arange(-1 + POINTS_STEP_IN_RADII / 2, 1, POINTS_STEP_IN_RADII)
    ball = np.array([point for point in product(line, repeat=3) if np.dot(point, point) < 1])
    part = max(1, PART // 4)
    for first in range(0, network.n_particles, part):
        radius = network.radius[first : first + part]
        position = network.position[first : first + part]
        place = position[:, None] + radius[:, None, None] * ball
        volume = np.repeat(sphere_volume(radius) / len(ball), len(ball))
        yield place.reshape(-1, 3), volume


def _surrounded(full: Bools, periodic: Bools) -> Bools:
    """Return which cubes are full and have only full neighbours, counting outer ones as empty."""
    widths = [(0, 0) if wraps else (1, 1) for wraps in periodic]
    around = np.pad(full, widths)
    for axis in range(3):
        around = around & np.roll(around, 1, axis) & np.roll(around, -1, axis)
    inner = tuple(slice(None) if wraps else slice(1, -1) for wraps in periodic)
    return around[inner]
