"""Place spheres at random: the first state of a path, with friction and without."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, product

import numpy as np
from scipy.spatial.transform import Rotation

from modal.packing.clumps import ClumpTemplate
from modal.packing.sample import Sample
from modal.preparation.study import CLOUD_FRACTION, NOMINAL_FRACTION, Study
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

CROWDED_FRACTION = 0.5
"""Solid fraction of random points with overlaps, from which the enthalpy is minimised."""
MAX_TRIALS = 1000
"""Number of random points tried for one sphere before the cloud counts as full."""
NEIGHBOURS = tuple(product((-1, 0, 1), repeat=3))
"""Offsets of a bin itself and of the 26 bins around it."""


def make_cloud(study: Study) -> Sample:
    """Return the first state of a path, in a cell with the proportions of the final one.

    With friction they fill `CLOUD_FRACTION` without contacts; without friction they overlap at
    random at `CROWDED_FRACTION`. They are numbered along z, so that neighbours lie close together
    in memory. Raises InputError if the cell is too narrow or the spheres do not fit.
    """
    if study.mu_comp:
        template = study.template
        if template is None:
            cloud = _make_dilute_cloud(study)
        else:
            cloud = _make_clump_cloud(study, template)
        return replace(cloud, rolling=study.rolling, twisting=study.twisting)
    return _make_crowded_cloud(study)


def _make_dilute_cloud(study: Study) -> Sample:
    """Return spheres without contacts at solid fraction `CLOUD_FRACTION`."""
    mixture = study.mixture
    diameter = 2 * mixture.radius
    relative_diameters = np.ones(study.spheres)
    length = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**2 * diameter
    if mixture.radii is not None:
        relative_diameters = 2 * mixture.radii / diameter
        length *= float((relative_diameters**3).mean())
    expansion = (NOMINAL_FRACTION / CLOUD_FRACTION) ** (1 / 3)
    side = expansion * study.width * diameter
    length = expansion * length
    centres, order = place_at_random(
        relative_diameters,
        side / diameter,
        length / diameter,
        study.seed,
        periodic_z=mixture.periodic,
    )
    lengths = np.array([side, side, length])
    return mixture.make_sample(diameter * centres, lengths, study.mu_comp, order)


def _make_clump_cloud(study: Study, template: ClumpTemplate) -> Sample:
    """Return clumps without contacts, turned at random, each in a sphere of its own."""
    mixture = study.mixture
    diameter = 2 * mixture.radius
    expansion = (NOMINAL_FRACTION / study.cloud_fraction) ** (1 / 3)
    side = expansion * study.width * diameter
    length = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**2 * diameter
    length = expansion * length
    around = 2 * template.reach
    centres, _ = place_at_random(
        np.ones(study.spheres),
        side / around,
        length / around,
        study.seed,
        periodic_z=mixture.periodic,
    )
    turns = Rotation.random(study.spheres, np.random.default_rng([study.seed, 1])).as_matrix()
    arm = np.einsum("kij,sj->ksi", turns, template.arm).reshape(-1, 3)
    members = len(template.radius)
    position = np.repeat(around * centres, members, axis=0) + arm
    lengths = np.array([side, side, length])
    periodic = np.array([True, True, mixture.periodic])
    position -= np.where(periodic, np.floor(position / lengths) * lengths, 0.0)
    density = mixture.material.density
    tensor = density * turns @ template.tensor @ turns.transpose(0, 2, 1)
    radii = np.tile(template.radius, study.spheres)
    return Sample(
        position,
        lengths[:2],
        np.array([0.0, length]),
        study.mu_comp,
        radius=float(template.radius.mean()),
        material=mixture.material,
        radii=radii if np.ptp(template.radius) > 0 else None,
        wall_material=mixture.wall_material,
        periodic_z=mixture.periodic,
        body=np.repeat(np.arange(study.spheres), members),
        arm=arm,
        body_mass=np.full(study.spheres, density * template.volume),
        body_tensor=tensor,
    )


def _make_crowded_cloud(study: Study) -> Sample:
    """Return overlapping random spheres in a cell with the aspect that equal spheres would have."""
    mixture = study.mixture
    radii = mixture.radii
    if radii is None:
        radii = np.full(study.spheres, mixture.radius)
    aspect = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**3
    solid_volume = math.pi / 6 * float(((2 * radii) ** 3).sum())
    width = (solid_volume / CROWDED_FRACTION / aspect) ** (1 / 3)
    lengths = width * np.array([1.0, 1.0, aspect])
    if lengths.min() < 4 * radii.max():
        raise InputError(
            "narrow_cell",
            f"{study.spheres} spheres at aspect {aspect:.3g}",
            "the cell is narrower than two diameters",
            "take more spheres, or an aspect nearer to 1",
        )
    points = np.random.default_rng(study.seed).random((study.spheres, 3))
    return mixture.make_sample(points[np.argsort(points[:, 2])] * lengths, lengths, 0.0)


class _Bins:
    """Spheres sorted into bins at least one diameter wide: contacts lie in neighbouring bins."""

    def __init__(self, side: float, length: float, diameter: float, *, periodic_z: bool) -> None:
        self.side = side
        self.length = length
        self.periodic_z = periodic_z
        self.lateral_count = int(side / diameter)
        self.axial_count = int(length / diameter)
        self._spheres: dict[tuple[int, int, int], list[tuple[float, float, float, float]]] = {}

    def is_free(self, x: float, y: float, z: float, diameter: float) -> bool:
        """Return whether a sphere at this place overlaps none of those in the bins."""
        i, j, k = self._bin_indices(x, y, z)
        for a, b, c in NEIGHBOURS:
            layer = k + c
            if self.periodic_z:
                layer %= self.axial_count
            key = ((i + a) % self.lateral_count, (j + b) % self.lateral_count, layer)
            for other_x, other_y, other_z, other_diameter in self._spheres.get(key, ()):
                dx = self._lateral_distance(x, other_x)
                dy = self._lateral_distance(y, other_y)
                dz = abs(z - other_z)
                if self.periodic_z and dz > self.length / 2:
                    dz -= self.length
                if dx**2 + dy**2 + dz**2 <= ((diameter + other_diameter) / 2) ** 2:
                    return False
        return True

    def add(self, x: float, y: float, z: float, diameter: float) -> None:
        """Put a sphere into its bin."""
        self._spheres.setdefault(self._bin_indices(x, y, z), []).append((x, y, z, diameter))

    def _bin_indices(self, x: float, y: float, z: float) -> tuple[int, int, int]:
        i = int(x / self.side * self.lateral_count)
        j = int(y / self.side * self.lateral_count)
        k = int(z / self.length * self.axial_count)
        return i, j, k

    def _lateral_distance(self, first: float, second: float) -> float:
        """Return the distance to the nearest lateral image; the sign has no meaning."""
        distance = abs(first - second)
        if distance > self.side / 2:
            distance -= self.side
        return distance


def place_at_random(
    diameters: Floats, side: float, length: float, seed: int, *, periodic_z: bool = False
) -> tuple[Floats, Ints]:
    """Return centres (n, 3) of spheres without contacts, and which sphere is at each of them (n,).

    The spheres of `diameters` (n,) are placed one by one where they fit, the largest first, and
    sorted along z. All lengths have the same unit. Raises InputError if the cell is narrower than
    three of the largest spheres, or if the spheres do not fit.
    """
    count = len(diameters)
    largest = float(diameters.max())
    bins = _Bins(side, length, largest, periodic_z=periodic_z)
    # With fewer than three bins along a period a neighbour would lie on both sides.
    min_axial_count = 3 if periodic_z else 2
    if bins.lateral_count < 3 or bins.axial_count < min_axial_count:
        raise InputError(
            "narrow_cell",
            f"{count} spheres at this width",
            "the cell is narrower than three of the largest, or less than two layers",
            "take other numbers, or sizes that differ less",
        )
    order = np.argsort(-diameters, kind="stable")
    points = _random_points(seed, count)
    centres = np.empty((count, 3))
    for number, diameter in enumerate(diameters[order].tolist()):
        lowest = 0.0 if periodic_z else diameter / 2
        height = length if periodic_z else length - diameter
        for u, v, w in islice(points, MAX_TRIALS):
            x = side * u
            y = side * v
            z = lowest + height * w
            if bins.is_free(x, y, z, diameter):
                bins.add(x, y, z, diameter)
                centres[number] = x, y, z
                break
        else:
            raise InputError(
                "cloud_full",
                f"{count} spheres do not fit into the cloud",
                remedy="take another width",
            )
    upwards = np.argsort(centres[:, 2], kind="stable")
    return centres[upwards], order[upwards]


def _random_points(seed: int, count: int) -> Iterator[tuple[float, float, float]]:
    """Yield random points of the unit cube without end, drawn `count` at a time."""
    random = np.random.default_rng(seed)
    while True:
        yield from random.random((count, 3)).tolist()
