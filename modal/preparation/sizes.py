"""Radii, densities and materials of spheres and walls, from words as users type them."""

from __future__ import annotations

from collections.abc import Sequence

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
from modal.packing.grading import CURVE, radii_of_curve
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

Words = Sequence[str | float]
"""Words and numbers as a user types them, for example ("two", 2, 0.5)."""

MAX_RADIUS_RATIO = 10.0
"""Ratio of the largest to the smallest radius: pairs are sought as far as the largest reach."""
MAX_LOGNORMAL_SPREAD = 0.7
"""Largest standard deviation of ln R; wider distributions soon exceed `MAX_RADIUS_RATIO`."""
KINDS = (
    f"lognormal SPREAD (of ln R, 0 to {MAX_LOGNORMAL_SPREAD:g}), two RATIO SHARE (of the large "
    "ones by volume), or a grading curve, *.csv, of diameters in m and per cent finer by mass"
)
DENSITIES = (
    "kg/m^3, one for all or several: two of a mixture of two sizes are of the small and of the "
    "large ones, others are dealt out at random in equal numbers"
)
WALLS = "Young's modulus, Pa, and Poisson's ratio of the walls"
RADIUS_RANGE = (1e-8, 10.0)
"""Range of radii, m: spheres that are neither molecules nor hills."""
DENSITY_RANGE = (10.0, 30_000.0)
"""Range of densities, kg/m^3: from foam to osmium; densities in g/cm^3 lie outside."""
POISSON_RANGE = (-1.0, 0.5)
"""Poisson's ratios of a stable isotropic solid; the ends are excluded."""
SOLID = (
    f"Young's modulus, Pa ({YOUNG_RANGE_PA[0]:g} to {YOUNG_RANGE_PA[1]:g}), "
    "Poisson's ratio (-1 to 0.5), density, "
    f"kg/m^3 ({DENSITY_RANGE[0]:g} to {DENSITY_RANGE[1]:g}), (mean) radius, m "
    f"({RADIUS_RANGE[0]:g} to {RADIUS_RANGE[1]:g}) of the spheres, and their contact model if it "
    "is another than hertz-mindlin"
)


def draw_radii(spheres: int, sizes: Words, seed: int) -> Floats:
    """Return the radius of each sphere (n,), m, in a random order that `seed` fixes.

    `sizes` is "lognormal" and the standard deviation of ln R; "two", the ratio of the radii and the
    share of the large spheres in the volume; or "curve" and pairs of a diameter, m, and the per
    cent of the mass that is finer. Radii of a curve are used as they are; others are scaled to the
    mean radius of the study's spheres. Log-normal radii, and those of a curve, are quantiles at (k
    + 1/2) / n, so that the set of sizes is not random. Raises InputError for other sizes.

    >>> radii = draw_radii(1000, ("two", 2, 0.5), seed=1)
    >>> float(radii.max() / radii.min()), len(np.unique(radii))
    (2.0, 2)
    """
    kind = str(sizes[0]) if sizes else ""
    numbers = _parse_numbers(sizes[1:])
    if kind == "lognormal" and len(numbers) == 1 and 0 < numbers[0] <= MAX_LOGNORMAL_SPREAD:
        radii = _lognormal_quantiles(spheres, numbers[0])
    elif (
        kind == "two"
        and len(numbers) == 2
        and 1 < numbers[0] <= MAX_RADIUS_RATIO
        and 0 < numbers[1] < 1
    ):
        radii = _two_sizes(spheres, *numbers)
    elif kind == CURVE and numbers:
        radii = radii_of_curve(spheres, numbers)
    else:
        raise InputError("sizes", f"sizes {join_words(sizes)}", remedy=f"give {KINDS}")
    size_ratio = float(radii.max() / radii.min())
    if kind == CURVE:
        # Few spheres may leave out the coarsest part of a curve.
        size_ratio = numbers[-2] / numbers[0]
    if size_ratio > MAX_RADIUS_RATIO:
        raise InputError(
            "size_ratio",
            f"sizes {join_words(sizes)}",
            f"radii from 1 to {size_ratio:.3g}, up to {MAX_RADIUS_RATIO:g} is allowed",
            "take a smaller spread",
        )
    if kind != CURVE:
        radii = RADIUS * radii / radii.mean()
    return np.random.default_rng(seed).permutation(radii)


def _lognormal_quantiles(spheres: int, spread: float) -> Floats:
    """Return the quantiles (n,) at (k + 1/2) / n of a log-normal distribution of median 1."""
    from scipy.special import ndtri  # the inverse of the normal distribution

    quantiles: Floats = np.exp(spread * ndtri((np.arange(spheres) + 0.5) / spheres))
    return quantiles


def _two_sizes(spheres: int, ratio: float, share: float) -> Floats:
    """Return radii (n,), `ratio` for the large spheres, which come first, and 1 for the small.

    Raises InputError if all spheres would have one size.
    """
    # Of n spheres the share s by volume: n_large q^3 / (n_large q^3 + n_small) = s.
    large_share = share / ratio**3 / (share / ratio**3 + 1 - share)
    count = round(large_share * spheres)
    if not 0 < count < spheres:
        raise InputError(
            "single_size",
            f"sizes two {ratio:g} {share:g}",
            f"that are {count} large ones of {spheres} spheres",
            "take more spheres or another share",
        )
    return np.where(np.arange(spheres) < count, ratio, 1.0)


def assign_densities(spheres: int, densities: Words, radii: Floats | None, seed: int) -> Floats:
    """Return the density of each sphere (n,), kg/m^3.

    `radii` (n,), m, is None for equal spheres. Two densities of a mixture of two sizes are those of
    the small and of the large spheres; otherwise each density is given to an equal number of
    spheres, in a random order that `seed` fixes. Raises InputError for values that are not
    densities.

    >>> small, large = 1.0, 2.0
    >>> assign_densities(3, (2500, 7800), np.array([large, small, large]), seed=1).tolist()
    [7800.0, 2500.0, 7800.0]
    """
    values = _parse_numbers(densities)
    lowest, highest = DENSITY_RANGE
    if not values or not all(lowest <= value <= highest for value in values):
        raise InputError(
            "densities",
            f"densities {join_words(densities)}",
            f"allowed are {lowest:g} to {highest:g}",
            f"give {DENSITIES}",
        )
    distinct_radii = np.empty(0)
    if radii is not None:
        distinct_radii = np.unique(radii)
    if radii is not None and len(distinct_radii) == len(values) == 2:
        return np.where(radii == distinct_radii[1], values[1], values[0])
    dealt = np.array(values)[np.arange(spheres) % len(values)]
    return np.random.default_rng([seed, len(values)]).permutation(dealt)


def parse_wall_material(words: Words) -> Elasticity:
    """Return the material of walls from Young's modulus, Pa, and Poisson's ratio.

    Raises InputError for other words.
    """
    values = _parse_numbers(words)
    if len(values) != 2 or not _is_elastic(*values):
        raise InputError(
            "wall_material",
            f"walls {join_words(words)}",
            f"allowed are {YOUNG_RANGE_PA[0]:g} to {YOUNG_RANGE_PA[1]:g} Pa, and -1 to 0.5",
            f"give {WALLS}, as 2.1e11 0.3",
        )
    return Elasticity(*values)


def parse_solid(words: Words) -> tuple[Material, float]:
    """Return the material of spheres and their (mean) radius, m, from the words of `SOLID`.

    Raises InputError for other words, or for a contact model that does not exist.
    """
    values = _parse_numbers(words[:4])
    model = join_words(words[4:]) or HERTZ_MINDLIN
    if len(values) == 4:
        young, poisson, density, radius = values
        is_solid = (
            _is_elastic(young, poisson)
            and DENSITY_RANGE[0] <= density <= DENSITY_RANGE[1]
            and RADIUS_RANGE[0] <= radius <= RADIUS_RANGE[1]
        )
        if is_solid:
            material = Material(young, poisson, density, model)
            laws_of(material)  # refuses an unknown model
            return material, radius
    example = f"{GLASS.young:g} {GLASS.poisson:g} {GLASS.density:g} {RADIUS:g}"
    raise InputError(
        "solid", f"spheres of {join_words(words)}", remedy=f"give {SOLID}, as {example}"
    )


def _is_elastic(young: float, poisson: float) -> bool:
    """Return whether Young's modulus, Pa, and Poisson's ratio lie in their ranges."""
    return (
        YOUNG_RANGE_PA[0] <= young <= YOUNG_RANGE_PA[1]
        and POISSON_RANGE[0] < poisson < POISSON_RANGE[1]
    )


def join_words(words: Words | None) -> str:
    """Return words and numbers as one text; an empty text for None.

    >>> join_words(("two", 2, 0.5))
    'two 2 0.5'
    """
    return "" if words is None else " ".join(map(str, words))


def _parse_numbers(words: Words) -> list[float]:
    """Return the numbers that the words are; an empty list if one of them is not a number."""
    try:
        return [float(word) for word in words]
    except ValueError:
        return []
