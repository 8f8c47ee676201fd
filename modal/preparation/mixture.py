"""Mixtures: the spheres and the walls of a packing, and the words that describe them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypedDict

import numpy as np

from modal.packing.contact_law import GLASS, RADIUS, Elasticity, Material
from modal.packing.grading import CURVE, read_grading
from modal.packing.sample import Sample
from modal.preparation.sizes import (
    Words,
    assign_densities,
    draw_radii,
    join_words,
    parse_solid,
    parse_wall_material,
)
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

MIXTURE: Final = ("sizes", "densities", "walls")
"""Names of what defines a mixture: options of `pack`, fields of a `Study`, columns of tables."""
NO_WALLS: Final = "none"
"""Word for the walls of a cell that is periodic along z and has no walls."""


class MixtureTexts(TypedDict):
    """Words of a mixture as texts, by the names of the fields of a `Study`; empty by default."""

    sizes: str
    densities: str
    walls: str
    solid: str


@dataclass(frozen=True)
class MixtureWords:
    """Words and numbers that describe spheres and walls, as a user types them.

    Attributes
    ----------
    sizes : sequence, optional
        Words of `draw_radii`, or the name of a grading curve, *.csv; equal spheres by default.
    densities : sequence, optional
        Words of `assign_densities`.
    walls : sequence, optional
        Words of `parse_wall_material`; a periodic cell has none.
    solid : sequence, optional
        Words of `parse_solid`; the study's glass by default.
    periodic : bool, default False
        Whether the cell has a period along z instead of walls.
    """

    sizes: Words | None = None
    densities: Words | None = None
    walls: Words | None = None
    solid: Words | None = None
    periodic: bool = False

    def texts(self) -> MixtureTexts:
        """Return the fields as texts; sizes that name a grading curve are read from its file.

        Raises InputError for walls of a periodic cell.

        >>> MixtureWords(sizes=("two", 2, 0.5), periodic=True).texts()
        {'sizes': 'two 2 0.5', 'densities': '', 'walls': 'none', 'solid': ''}
        """
        if self.periodic and self.walls is not None and len(self.walls):
            raise InputError(
                "walls_and_periodic",
                "walls of a cell that is periodic along z",
                "it has none",
                "leave one out",
            )
        sizes = self.sizes
        if sizes is not None and len(sizes) == 1 and str(sizes[0]).endswith(".csv"):
            sizes = read_grading(str(sizes[0]))
        return {
            "sizes": join_words(sizes),
            "densities": join_words(self.densities),
            "walls": NO_WALLS if self.periodic else join_words(self.walls),
            "solid": join_words(self.solid),
        }


@dataclass(frozen=True)
class Mixture:
    """Spheres and walls of a packing; the defaults are the study's equal glass spheres.

    Attributes
    ----------
    material : Material
        Material of the spheres.
    radius : float
        Mean radius, m.
    radii : ndarray (n,), optional
        Radius of each sphere, m, in a random order; None if all are equal.
    densities : ndarray (n,), optional
        Density of each sphere, kg/m^3; None if all have that of `material`.
    wall_material : Elasticity, optional
        Material of the walls; None if it is that of the spheres.
    periodic : bool
        Whether the cell has a period along z instead of walls.
    """

    material: Material = GLASS
    radius: float = RADIUS
    radii: Floats | None = None
    densities: Floats | None = None
    wall_material: Elasticity | None = None
    periodic: bool = False

    @classmethod
    def parse(
        cls, spheres: int, seed: int, sizes: str, densities: str, walls: str, solid: str
    ) -> Mixture:
        """Return the mixture that a study's words describe; empty words mean the defaults.

        Raises InputError for words that `draw_radii`, `assign_densities`, `parse_wall_material` or
        `parse_solid` refuse.
        """
        material = GLASS
        radius = RADIUS
        if solid:
            material, radius = parse_solid(solid.split())
        radii = None
        words = sizes.split()
        if words and words[0] == CURVE:
            radii = draw_radii(spheres, words, seed)
            radius = float(radii.mean())
        elif words:
            radii = draw_radii(spheres, words, seed) * (radius / RADIUS)
        sphere_densities = None
        if densities:
            sphere_densities = assign_densities(spheres, densities.split(), radii, seed)
        periodic = walls == NO_WALLS
        wall_material = None
        if walls and not periodic:
            wall_material = parse_wall_material(walls.split())
        return cls(material, radius, radii, sphere_densities, wall_material, periodic)

    @property
    def hardness(self) -> float:
        """E* of the spheres divided by that of glass; the protocol's stresses scale with it."""
        return self.material.effective_young / GLASS.effective_young

    @property
    def tempo(self) -> float:
        """Ratio of the protocol's strain rates for these spheres to those for the study's glass."""
        density_ratio = GLASS.density / self.material.density
        return math.sqrt(self.hardness * density_ratio) * (RADIUS / self.radius)

    @cached_property
    def mean(self) -> Material:
        """Material of the spheres with the mixture's mean density; it determines durations."""
        if self.densities is None:
            return self.material
        weights = None
        if self.radii is not None:
            weights = self.radii**3
        return replace(self.material, density=float(np.average(self.densities, weights=weights)))

    @cached_property
    def smallest(self) -> float:
        """Radius, m, of a sphere of the `mean` material that vibrates like the fastest sphere.

        A frequency varies as 1 / (R sqrt(density)), and as E*^(1/3) under a given force.
        """
        radius = self.radius
        if self.radii is not None:
            radius = float(self.radii.min())
        if self.densities is not None:
            radius *= math.sqrt(float(self.densities.min()) / self.mean.density)
        if self.wall_material:
            wall_modulus = self.material.against(self.wall_material).effective_young
            radius *= min(1.0, (self.material.effective_young / wall_modulus) ** (1 / 3))
        return radius

    def make_sample(
        self, position: Floats, lengths: Floats, friction: float, order: Ints | None = None
    ) -> Sample:
        """Return a sample of the mixture's spheres in a cell.

        Parameters
        ----------
        position : ndarray (n, 3)
            Centres, m.
        lengths : ndarray (3,)
            Lengths of the cell, m.
        friction : float
            Coefficient of friction.
        order : ndarray (n,), optional
            Which sphere of the mixture is at each centre; by default they are in order.
        """
        if order is None:
            order = np.arange(len(position))
        return Sample(
            position,
            lengths[:2],
            np.array([0.0, lengths[2]]),
            friction,
            radius=self.radius,
            material=self.material,
            radii=None if self.radii is None else self.radii[order],
            densities=None if self.densities is None else self.densities[order],
            wall_material=self.wall_material,
            periodic_z=self.periodic,
        )
