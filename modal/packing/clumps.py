"""Describe clumps: grains of overlapping spheres, their template, and their mass properties.

A template is a table of spheres. Its mass, centre and tensor of inertia are those of the union of
the spheres, in which a volume counts once, however many spheres overlap there.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

RAYS = 800
"""Number of rays along each side of the box in which a union is integrated; the error of volume and
tensor is some 1e-5."""
MAX_SPHERES = 50
"""Largest number of spheres of a template."""
MAX_RADIUS_RATIO = 10.0
"""Largest ratio of two radii of a template: pairs are sought as far as the largest reach."""
FORM = "four columns: x, y, z and radius of each sphere, all in one unit"


@dataclass(frozen=True)
class Clumps:
    """The k clumps to which the n spheres of a sample belong.

    Attributes
    ----------
    body : ndarray of int (n,)
        Number of each sphere's clump, from 0 on.
    arm : ndarray (n, 3)
        Vector from the centre of mass of its clump to each sphere, m.
    mass : ndarray (k,)
        Masses of the clumps, kg.
    tensor : ndarray (k, 3, 3)
        Tensors of inertia about the centres of mass, in the axes of the packing, kg m^2.
    """

    body: Ints
    arm: Floats
    mass: Floats
    tensor: Floats

    @property
    def first_members(self) -> Ints:
        """Index (k,) of the first sphere of each clump."""
        _, first = np.unique(self.body, return_index=True)
        return first


@dataclass(frozen=True)
class ClumpTemplate:
    """The spheres of a clump, relative to the centre of mass of their union.

    Attributes
    ----------
    arm : ndarray (s, 3)
        Centres of the spheres relative to the centre of mass, m.
    radius : ndarray (s,)
        m.
    volume : float
        Volume of the union, m^3.
    tensor : ndarray (3, 3)
        Tensor of inertia of the union about its centre of mass, divided by the density, m^5.
    """

    arm: Floats
    radius: Floats
    volume: float
    tensor: Floats

    @property
    def reach(self) -> float:
        """Largest distance of the surface from the centre of mass, m."""
        return float((np.linalg.norm(self.arm, axis=1) + self.radius).max())

    def scaled(self, radius: float) -> ClumpTemplate:
        """Return the template scaled to the volume of a sphere of this radius, m."""
        factor = (4 / 3 * np.pi * radius**3 / self.volume) ** (1 / 3)
        return ClumpTemplate(
            factor * self.arm,
            factor * self.radius,
            factor**3 * self.volume,
            factor**5 * self.tensor,
        )


def clump_template(position: Floats, radius: Floats) -> ClumpTemplate:
    """Return the template of spheres at `position` (s, 3) with `radius` (s,), m.

    The union is integrated over parallel rays; the integral along each ray is exact.

    >>> one = clump_template(np.zeros((1, 3)), np.ones(1))
    >>> round(one.volume / (4 / 3 * np.pi), 4), round(one.tensor[0, 0] / one.volume, 4)
    (1.0, 0.4)
    """
    low = (position - radius[:, None]).min(axis=0)
    high = (position + radius[:, None]).max(axis=0)
    step = (high - low)[:2] / RAYS
    x_of_rays = low[0] + step[0] * (np.arange(RAYS) + 0.5)
    y = low[1] + step[1] * (np.arange(RAYS) + 0.5)
    volume = 0.0
    first = np.zeros(3)
    second = np.zeros((3, 3))
    for x in x_of_rays:
        square = radius**2 - (x - position[:, 0]) ** 2 - (y[:, None] - position[:, 1]) ** 2
        half_chord = np.sqrt(np.maximum(square, 0.0))
        lengths, heights, squares = _integrals_of_union(
            position[:, 2] - half_chord, position[:, 2] + half_chord
        )
        volume += lengths.sum()
        first += np.array([x * lengths.sum(), y @ lengths, heights.sum()])
        second[0, 0] += x * x * lengths.sum()
        second[1, 1] += (y * y) @ lengths
        second[2, 2] += squares.sum()
        second[0, 1] += x * (y @ lengths)
        second[0, 2] += x * heights.sum()
        second[1, 2] += y @ heights
    area = step[0] * step[1]
    centre = first / volume
    second = np.triu(second) + np.triu(second, 1).T
    covariance = area * (second - volume * np.outer(centre, centre))
    tensor = np.trace(covariance) * np.eye(3) - covariance
    return ClumpTemplate(position - centre, radius, area * volume, tensor)


def _integrals_of_union(start: Floats, end: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the integrals (k,) of 1, z and z^2 over unions of intervals (k, s) along z."""
    order = np.argsort(start, axis=1)
    start = np.take_along_axis(start, order, axis=1)
    end = np.maximum.accumulate(np.take_along_axis(end, order, axis=1), axis=1)
    # What earlier intervals have covered is left out.
    start[:, 1:] = np.maximum(start[:, 1:], end[:, :-1])
    start = np.minimum(start, end)
    lengths = (end - start).sum(axis=1)
    heights = (end**2 - start**2).sum(axis=1) / 2
    squares = (end**3 - start**3).sum(axis=1) / 3
    return lengths, heights, squares


def read_template(path: str | Path) -> list[str]:
    """Return x y z radius of each sphere of a template, as words, from a table (*.csv).

    A first line of names is skipped. Raises InputError for any other file.
    """
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("unreadable", f"{path}: cannot be read ({error})") from None
    rows = [row for row in csv.reader(text.splitlines()) if row]
    words = [word.strip() for row in rows for word in row]
    names = {"x", "y", "z", "r", "radius"}
    if rows and {word.strip().lower() for word in rows[0]} <= names:
        words = words[len(rows[0]) :]
        rows = rows[1:]
    if any(len(row) != 4 for row in rows):
        raise InputError("clump", f"{path}", "no template of a clump", f"give {FORM}")
    parse_template(words)
    return words


def parse_template(words: Sequence[str]) -> ClumpTemplate:
    """Return the template given by the numbers x y z radius of each sphere, as words.

    Raises InputError for words that are not such numbers, and for spheres not joined by overlaps.
    """
    try:
        table = np.array([float(word) for word in words]).reshape(-1, 4)
    except ValueError:
        raise InputError(
            "clump", "the template of a clump is no table of numbers", remedy=f"give {FORM}"
        ) from None
    position = table[:, :3]
    radius = table[:, 3]
    is_usual = 0 < len(table) <= MAX_SPHERES and bool(np.isfinite(table).all())
    if not is_usual or not 0 < radius.max() <= MAX_RADIUS_RATIO * radius.min():
        raise InputError(
            "clump",
            "the template of a clump",
            f"it has 1 to {MAX_SPHERES} spheres with radii that differ at most "
            f"{MAX_RADIUS_RATIO:g} times",
            f"give {FORM}",
        )
    if not _hangs_together(position, radius):
        raise InputError(
            "clump", "the spheres of the clump do not overlap to one body", remedy="mend them"
        )
    return clump_template(position, radius)


def _hangs_together(position: Floats, radius: Floats) -> bool:
    """Return whether all spheres are joined by overlaps."""
    distance = np.linalg.norm(position[:, None] - position, axis=2)
    overlaps = distance < radius[:, None] + radius
    reached = np.zeros(len(radius), bool)
    reached[0] = True
    for _ in radius:
        reached |= overlaps[reached].any(axis=0)
    return bool(reached.all())
