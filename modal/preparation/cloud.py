"""Spheres without contact, placed at random: where the compression of a packing begins."""

from __future__ import annotations

import math

import numpy as np

from modal.packing.sample import Sample
from modal.preparation.protocol import CLOUD, NOMINAL_FRACTION, Study
from modal.tools.errors import InputError

ROUNDS = 1000
"""Random points tried, in units of the number of spheres."""


def cloud(study: Study) -> Sample:
    """The spheres at solid fraction CLOUD, numbered along z, in a cell of its final proportions.

    Numbered along z, neighbours lie close together in memory.
    """
    material, radius = study.sphere
    diameter, radii = 2 * radius, study.radii
    length = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**2 * diameter
    if radii is not None:
        length *= float(((2 * radii / diameter) ** 3).mean())
    scale = (NOMINAL_FRACTION / CLOUD) ** (1 / 3)
    side, length = scale * study.width * diameter, scale * length
    sides, walls = np.array([side, side]), np.array([0.0, length])
    cell = side / diameter, length / diameter, study.seed
    if study.periodic:
        sizes = np.ones(study.spheres) if radii is None else 2 * radii / diameter
        places, order = places_of_sizes(sizes, *cell, whole=True)
    elif radii is None:
        places, order = random_places(study.spheres, *cell), np.arange(study.spheres)
    else:
        places, order = places_of_sizes(2 * radii / diameter, *cell)
    dense = study.each_density
    return Sample(
        diameter * places,
        sides,
        walls,
        study.mu_comp,
        radius=radius,
        material=material,
        radii=None if radii is None else radii[order],
        densities=None if dense is None else dense[order],
        wall_material=study.wall_material,
        periodic_z=study.periodic,
    )


def places_of_sizes(
    diameters: np.ndarray, side: float, length: float, seed: int, *, whole: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) of spheres of several `diameters` (n,), and which sphere is where (n,).

    Placed at random one by one where they fit, the largest first; sorted along z, which is periodic
    where they fill the `whole` cell. All lengths are in one unit.
    """
    period = length if whole else math.inf
    random, largest = np.random.default_rng(seed), float(diameters.max())
    cells = [max(1, int(extent / largest)) for extent in (side, side, length)]
    if min(cells) < 3:
        raise InputError(
            f"{len(diameters)} spheres at this width: the cell is narrower than three of the "
            "largest; take more spheres, or sizes that differ less"
        )
    bins: dict[tuple[int, ...], list[tuple[np.ndarray, float]]] = {}
    around = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    order = np.argsort(-diameters, kind="stable")
    places = np.empty((len(diameters), 3))
    for number, size in enumerate(diameters[order]):
        for _ in range(ROUNDS):
            point = random.random(3) * (side, side, length - (0 if whole else size))
            point[2] += 0 if whole else size / 2
            own = tuple((point / (side, side, length) * cells).astype(int).tolist())
            near = [
                other
                for a, b, c in around
                for other in bins.get(
                    (
                        (own[0] + a) % cells[0],
                        (own[1] + b) % cells[1],
                        (own[2] + c) % cells[2] if whole else own[2] + c,
                    ),
                    (),
                )
            ]
            if all(
                _apart(point - place, side, period) > (size + other) / 2 for place, other in near
            ):
                bins.setdefault(own, []).append((point, size))
                places[number] = point
                break
        else:
            raise InputError(
                f"{len(diameters)} spheres do not fit into the cloud; take another width"
            )
    upwards = np.argsort(places[:, 2], kind="stable")
    return places[upwards], order[upwards]


def _apart(branch: np.ndarray, side: float, period: float) -> float:
    """Distance of the nearest images, periodic across z and, with a finite period, along it."""
    x, y, z = branch.tolist()
    z -= period * round(z / period) if period < math.inf else 0.0
    return math.hypot(x - side * round(x / side), y - side * round(y / side), z)


def random_places(spheres: int, side: float, length: float, seed: int) -> np.ndarray:
    """Centres (n, 3), in diameters, of spheres placed at random one by one where they fit."""
    random = np.random.default_rng(seed)
    across, along = int(side), int(length)  # bins at least one diameter wide
    if along < 2:
        raise InputError(
            f"{spheres} spheres at this width: less than two layers; take a smaller width"
        )
    bins: dict[tuple[int, int, int], list[tuple[float, float, float]]] = {}
    around = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    places: list[tuple[float, float, float]] = []
    for _ in range(ROUNDS):
        points = random.random((spheres, 3)) * (side, side, length - 1) + (0, 0, 0.5)
        for x, y, z in points:
            i, j, k = int(x / side * across), int(y / side * across), int(z / length * along)
            near = (
                other
                for a, b, c in around
                for other in bins.get(((i + a) % across, (j + b) % across, k + c), ())
            )
            if all(
                (abs(x - u) - side * (abs(x - u) > side / 2)) ** 2
                + (abs(y - v) - side * (abs(y - v) > side / 2)) ** 2
                + (z - w) ** 2
                > 1
                for u, v, w in near
            ):
                bins.setdefault((i, j, k), []).append((x, y, z))
                places.append((x, y, z))
                if len(places) == spheres:
                    return np.array(sorted(places, key=lambda place: place[2]))
    raise InputError(f"{spheres} spheres do not fit into the cloud; take another width")
