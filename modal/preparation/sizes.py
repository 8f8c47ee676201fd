"""Sizes of spheres in a mixture: log-normal, or two radii; their mean is the study's radius."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modal.formats.hdf5 import InputError
from modal.packing.contact_law import RADIUS

WIDEST = 10.0
"""Ratio of the largest to the smallest radius: pairs are sought as far as the largest reach."""
KINDS = "lognormal SPREAD (of ln R, 0 to 0.7) or two RATIO SHARE (of the large ones by volume)"


def radii_of(spheres: int, sizes: Sequence[str | float], seed: int) -> np.ndarray:
    """Radius of each sphere (n,), m, in a random order that `seed` fixes.

    `sizes`: "lognormal" and the standard deviation of ln R, whose quantiles at (k + 1/2) / n are
    taken, so that the sizes themselves are not drawn; or "two", the ratio of the radii and the
    share of the large ones in the volume. InputError for what is neither.

    >>> radii = radii_of(1000, ("two", 2, 0.5), seed=1)
    >>> float(radii.max() / radii.min()), len(np.unique(radii))
    (2.0, 2)
    """
    kind, numbers = (str(sizes[0]) if sizes else ""), _numbers(sizes)
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
                f"--sizes two {ratio:g} {share:g}: that are {count} large ones of {spheres} "
                "spheres; take more spheres or another share"
            )
        radii = np.where(np.arange(spheres) < count, ratio, 1.0)
    else:
        raise InputError(f"--sizes {' '.join(map(str, sizes))}: give {KINDS}")
    if radii.max() > WIDEST * radii.min():
        raise InputError(
            f"--sizes {' '.join(map(str, sizes))}: radii from 1 to "
            f"{radii.max() / radii.min():.3g}; up to {WIDEST:g} is allowed, take a smaller spread"
        )
    radii = RADIUS * radii / radii.mean()
    return np.random.default_rng(seed).permutation(radii)


def _numbers(sizes: Sequence[str | float]) -> list[float]:
    try:
        return [float(number) for number in sizes[1:]]
    except ValueError:
        return []
