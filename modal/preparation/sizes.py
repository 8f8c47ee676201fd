"""Mixtures: radii, log-normal or two, whose mean is the study's; densities; walls of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from modal.packing.contact_law import (
    GLASS,
    HERTZ_MINDLIN,
    RADIUS,
    YOUNG_RANGE_PA,
    Elasticity,
    Material,
)
from modal.packing.contact_models import laws_of
from modal.packing.sample import Sample
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

WIDEST = 10.0
"""Ratio of the largest to the smallest radius: pairs are sought as far as the largest reach."""
MIXTURE = "sizes", "densities", "walls"
"""What tells a mixture: options of `pack`, words of a `Study`, columns of YADE's tables."""
NO_WALLS = "none"
"""Word for the walls of a cell that is periodic along z, without any."""
KINDS = "lognormal SPREAD (of ln R, 0 to 0.7) or two RATIO SHARE (of the large ones by volume)"
DENSITIES = (
    "kg/m^3, one for all or several: two of a mixture of two sizes are of the small and of the "
    "large ones, others are dealt out at random in equal numbers"
)
WALLS = "Young's modulus, Pa, and Poisson's ratio of the walls"
LARGE = (1e-8, 10.0)
"""m: radii of spheres that are neither molecules nor hills."""
DENSE = (10.0, 30_000.0)
"""kg/m^3: from foam to osmium; densities in g/cm^3 lie outside."""
SOLID = (
    f"Young's modulus, Pa ({YOUNG_RANGE_PA[0]:g} to {YOUNG_RANGE_PA[1]:g}), "
    "Poisson's ratio (-1 to 0.5), density, "
    f"kg/m^3 ({DENSE[0]:g} to {DENSE[1]:g}), (mean) radius, m ({LARGE[0]:g} to {LARGE[1]:g}) of "
    "the spheres, and their contact model if it is another than hertz-mindlin"
)


@dataclass(frozen=True)
class Mixture:
    """Of what spheres a packing is, and between what walls; the defaults are the study's glass.

    `radius`, m, is the mean of `radii` (n,), in a random order, or that of all; `densities` (n,),
    kg/m^3, go with them; each is None where all spheres are alike, the walls' material where they
    are of that of the spheres. A `periodic` cell has a period along z in place of walls.
    """

    material: Material = GLASS
    radius: float = RADIUS
    radii: Floats | None = None
    densities: Floats | None = None
    wall_material: Elasticity | None = None
    periodic: bool = False

    @classmethod
    def of(
        cls, spheres: int, seed: int, sizes: str, densities: str, walls: str, solid: str
    ) -> Mixture:
        """From words as the functions below have them, or none; InputError for others."""
        material, radius = solid_of(solid.split()) if solid else (GLASS, RADIUS)
        radii = radii_of(spheres, sizes.split(), seed) * (radius / RADIUS) if sizes else None
        dense = densities_of(spheres, densities.split(), radii, seed) if densities else None
        periodic = walls == NO_WALLS
        own = wall_material(walls.split()) if walls and not periodic else None
        return cls(material, radius, radii, dense, own, periodic)

    @property
    def hardness(self) -> float:
        """E* of the spheres over that of glass, with which stresses of the protocol grow."""
        return self.material.effective_young / GLASS.effective_young

    @property
    def tempo(self) -> float:
        """Rates of the protocol over those of the study's glass spheres."""
        lighter = GLASS.density / self.material.density
        return math.sqrt(self.hardness * lighter) * (RADIUS / self.radius)

    @cached_property
    def mean(self) -> Material:
        """That of the spheres with the density of the whole mixture, on which durations go by."""
        if self.densities is None:
            return self.material
        weights = None if self.radii is None else self.radii**3
        return replace(self.material, density=float(np.average(self.densities, weights=weights)))

    @cached_property
    def smallest(self) -> float:
        """Radius, m, of a sphere of the `mean` that vibrates as fast as the fastest one there is.

        A frequency goes as 1 / (R sqrt(density)), and as E*^(1/3) under a given force.
        """
        radius = self.radius if self.radii is None else float(self.radii.min())
        if self.densities is not None:
            radius *= math.sqrt(float(self.densities.min()) / self.mean.density)
        if self.wall_material:
            at_wall = self.material.against(self.wall_material).effective_young
            radius *= min(1.0, (self.material.effective_young / at_wall) ** (1 / 3))
        return radius

    def sample(
        self, position: Floats, lengths: Floats, friction: float, order: Ints | None = None
    ) -> Sample:
        """The spheres at `position` (n, 3), in an `order` (n,), in a cell of `lengths` (3,), m."""
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


def words(given: Mapping[str, Sequence[str | float] | None]) -> dict[str, str]:
    """What a `Mixture` is made of, of names and lists of words and numbers, those that are given.

    >>> words({"sizes": ("two", 2, 0.5), "walls": None})
    {'sizes': 'two 2 0.5'}
    """
    some = {name: listed for name, listed in given.items() if listed is not None and len(listed)}
    return {name: " ".join(map(str, listed)) for name, listed in some.items()}


def radii_of(spheres: int, sizes: Sequence[str | float], seed: int) -> np.ndarray:
    """Radius of each sphere (n,), m, in a random order that `seed` fixes.

    `sizes`: "lognormal" and the standard deviation of ln R, whose quantiles at (k + 1/2) / n are
    taken, so that the sizes themselves are not drawn; or "two", the ratio of the radii and the
    share of the large ones in the volume. InputError for what is neither.

    >>> radii = radii_of(1000, ("two", 2, 0.5), seed=1)
    >>> float(radii.max() / radii.min()), len(np.unique(radii))
    (2.0, 2)
    """
    kind, numbers = (str(sizes[0]) if sizes else ""), _numbers(sizes[1:])
    if kind == "lognormal" and len(numbers) == 1 and 0 < numbers[0] <= 0.7:
        from scipy.special import ndtri  # the inverse of the normal distribution

        radii = np.exp(numbers[0] * ndtri((np.arange(spheres) + 0.5) / spheres))
    elif kind == "two" and len(numbers) == 2 and 1 < numbers[0] <= WIDEST and 0 < numbers[1] < 1:
        ratio, share = numbers
        # Of n spheres the share s by volume: n_large q^3 / (n_large q^3 + n_small) = s.
        large = share / ratio**3 / (share / ratio**3 + 1 - share)
        count = round(large * spheres)
        if not 0 < count < spheres:
            raise InputError(
                "input",
                f"sizes two {ratio:g} {share:g}",
                f"that are {count} large ones of {spheres} spheres",
                "take more spheres or another share",
            )
        radii = np.where(np.arange(spheres) < count, ratio, 1.0)
    else:
        raise InputError("input", f"sizes {' '.join(map(str, sizes))}", remedy=f"give {KINDS}")
    if radii.max() > WIDEST * radii.min():
        raise InputError(
            "input",
            f"sizes {' '.join(map(str, sizes))}",
            f"radii from 1 to {radii.max() / radii.min():.3g}",
            f"up to {WIDEST:g} is allowed, take a smaller spread",
        )
    radii = RADIUS * radii / radii.mean()
    return np.random.default_rng(seed).permutation(radii)


def densities_of(
    spheres: int, densities: Sequence[str | float], radii: np.ndarray | None, seed: int
) -> np.ndarray:
    """Density of each sphere (n,), kg/m^3, of `radii` (n,), m, or of equal spheres.

    Two densities of a mixture of two sizes are those of the small and of the large ones; others are
    dealt out in equal numbers, in a random order that `seed` fixes. InputError for what is none.

    >>> small, large = 1.0, 2.0
    >>> densities_of(3, (2500, 7800), np.array([large, small, large]), seed=1).tolist()
    [7800.0, 2500.0, 7800.0]
    """
    given = _numbers(densities)
    if not given or not all(DENSE[0] <= one <= DENSE[1] for one in given):
        raise InputError(
            "input",
            f"densities {' '.join(map(str, densities))}",
            f"give {DENSITIES}",
            f"from {DENSE[0]:g} to {DENSE[1]:g}",
        )
    kinds = np.unique(radii) if radii is not None else np.empty(0)
    if radii is not None and len(kinds) == len(given) == 2:
        return np.where(radii == kinds[1], given[1], given[0])
    dealt = np.array(given)[np.arange(spheres) % len(given)]
    return np.random.default_rng([seed, len(given)]).permutation(dealt)


def wall_material(words: Sequence[str | float]) -> Elasticity:
    """What walls are made of, from Young's modulus, Pa, and Poisson's ratio; else InputError."""
    given = _numbers(words)
    if len(given) != 2 or not (
        YOUNG_RANGE_PA[0] <= given[0] <= YOUNG_RANGE_PA[1] and -1 < given[1] < 0.5
    ):
        raise InputError(
            "input",
            f"walls {' '.join(map(str, words))}",
            f"give {WALLS}, as 2.1e11 0.3",
            f"from {YOUNG_RANGE_PA[0]:g} to {YOUNG_RANGE_PA[1]:g} Pa, and from -1 to 0.5",
        )
    return Elasticity(*given)


def solid_of(words: Sequence[str | float]) -> tuple[Material, float]:
    """What spheres are made of and their (mean) radius, m: `SOLID`; else InputError."""
    given, model = _numbers(words[:4]), " ".join(map(str, words[4:])) or HERTZ_MINDLIN
    if len(given) == 4:
        young, poisson, density, radius = given
        sound = YOUNG_RANGE_PA[0] <= young <= YOUNG_RANGE_PA[1] and -1 < poisson < 0.5
        if sound and DENSE[0] <= density <= DENSE[1] and LARGE[0] <= radius <= LARGE[1]:
            material = Material(young, poisson, density, model)
            laws_of(material)  # refuses a model that there is not
            return material, radius
    raise InputError(
        "input",
        f"spheres of {' '.join(map(str, words))}",
        remedy=(f"give {SOLID}, as {GLASS.young:g} {GLASS.poisson:g} {GLASS.density:g} {RADIUS:g}"),
    )


def _numbers(words: Sequence[str | float]) -> list[float]:
    """What the words say; none where one of them is no number."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []
