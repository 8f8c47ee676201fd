"""Spheres placed at random: where a packing begins, with friction and without."""

import math
from itertools import chain, islice, repeat

import numpy as np

from modal.packing.sample import Sample
from modal.preparation.protocol import CLOUD, NOMINAL_FRACTION, Study
from modal.tools.errors import InputError

CROWDED = 0.5
"""Solid fraction of overlapping random points."""
ROUNDS = 1000
"""Random points tried for one sphere."""


def cloud(study: Study) -> Sample:
    """The spheres at the start of a path, numbered along z, in a cell of its final proportions.

    With friction at solid fraction CLOUD without contacts; without it at `CROWDED` wherever chance
    has put them. Numbered along z, neighbours lie close together in memory.
    """
    return dilute(study) if study.mu_comp else crowded(study)


def dilute(study: Study) -> Sample:
    """Spheres without contacts at solid fraction CLOUD."""
    mixture = study.mixture
    diameter, sizes = 2 * mixture.radius, np.ones(study.spheres)
    length = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**2 * diameter
    if mixture.radii is not None:
        sizes = 2 * mixture.radii / diameter
        length *= float((sizes**3).mean())
    scale = (NOMINAL_FRACTION / CLOUD) ** (1 / 3)
    side, length = scale * study.width * diameter, scale * length
    cell = side / diameter, length / diameter, study.seed
    places, order = random_places(sizes, *cell, whole=mixture.periodic)
    lengths = np.array([side, side, length])
    return mixture.sample(diameter * places, lengths, study.mu_comp, order)


def crowded(study: Study) -> Sample:
    """Overlapping random points in a cell whose length over width is that of equal spheres."""
    mixture = study.mixture
    radii = np.full(study.spheres, mixture.radius) if mixture.radii is None else mixture.radii
    aspect = study.spheres * math.pi / 6 / NOMINAL_FRACTION / study.width**3
    width = (math.pi / 6 * float(((2 * radii) ** 3).sum()) / CROWDED / aspect) ** (1 / 3)
    lengths = width * np.array([1.0, 1.0, aspect])
    if lengths.min() < 4 * radii.max():
        raise InputError(
            "input",
            f"{study.spheres} spheres at aspect {aspect:.3g}",
            "the cell is narrower than two diameters",
            "take more spheres, or an aspect nearer to 1",
        )
    points = np.random.default_rng(study.seed).random((study.spheres, 3))
    return mixture.sample(points[np.argsort(points[:, 2])] * lengths, lengths, 0.0)


def random_places(
    diameters: np.ndarray, side: float, length: float, seed: int, *, whole: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (n, 3) of spheres of `diameters` (n,), and which sphere is where (n,).

    Placed at random one by one where they fit, the largest first; sorted along z, which is periodic
    where they fill the `whole` cell. All lengths are in one unit.
    """
    count, largest = len(diameters), float(diameters.max())
    # Bins at least one diameter wide; with fewer than three a neighbour would lie on both sides.
    across, along = int(side / largest), int(length / largest)
    if across < 3 or along < (3 if whole else 2):
        raise InputError(
            "input",
            f"{count} spheres at this width",
            "the cell is narrower than three of the largest, or less than two layers",
            "take other numbers, or sizes that differ less",
        )
    order, random = np.argsort(-diameters, kind="stable"), np.random.default_rng(seed)
    points = chain.from_iterable(random.random((count, 3)).tolist() for _ in repeat(None))
    bins: dict[tuple[int, int, int], list[tuple[float, float, float, float]]] = {}
    around = [(a, b, c) for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)]
    places = np.empty((count, 3))
    for number, size in enumerate(diameters[order].tolist()):
        low, high = (0.0, length) if whole else (size / 2, length - size)
        for x, y, z in islice(points, ROUNDS):
            x, y, z = side * x, side * y, low + high * z
            i, j, k = int(x / side * across), int(y / side * across), int(z / length * along)
            near = (
                other
                for a, b, c in around
                for other in bins.get(
                    ((i + a) % across, (j + b) % across, (k + c) % along if whole else k + c), ()
                )
            )
            if all(
                (abs(x - u) - side * (abs(x - u) > side / 2)) ** 2
                + (abs(y - v) - side * (abs(y - v) > side / 2)) ** 2
                + (abs(z - w) - length * (whole and abs(z - w) > length / 2)) ** 2
                > ((size + other) / 2) ** 2
                for u, v, w, other in near
            ):
                bins.setdefault((i, j, k), []).append((x, y, z, size))
                places[number] = x, y, z
                break
        else:
            raise InputError(
                "input", f"{count} spheres do not fit into the cloud", remedy="take another width"
            )
    upwards = np.argsort(places[:, 2], kind="stable")
    return places[upwards], order[upwards]
