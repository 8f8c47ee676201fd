"""Random packings in memory, with friction and without: what `modal pack` writes."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from modal.arguments import checked
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.preparation import compress
from modal.preparation.protocol import NOMINAL_FRACTION, STRESSES, Study
from modal.preparation.random_packing import check_stress, random_sample
from modal.preparation.sizes import MIXTURE

SMALL_ASPECT = 2.5
"""Length over width of a packing of some hundred spheres."""


def width_of(spheres: int, aspect: float) -> float:
    """Width in diameters of a cell of `aspect`, length over width, at the nominal solid fraction.

    Zero, which no study accepts, for numbers that no cell can have.
    """
    if not (aspect > 0 and spheres > 0):
        return 0.0
    return float((spheres * math.pi / 6 / NOMINAL_FRACTION / aspect) ** (1 / 3))


@checked
def random_packing(
    spheres: int = 500,
    stress: float = 1e5,
    friction: float = 0.0,
    seed: int = 1,
    *,
    aspect: float = SMALL_ASPECT,
    sizes: Sequence[str | float] | None = None,
    densities: Sequence[float] | None = None,
    walls: Sequence[float] | None = None,
) -> Network:
    """A random packing of glass spheres between two flat walls, at rest under a pressure.

    `stress`, Pa, is the same along all axes; x and y are periodic, and `aspect` is the length over
    the width. Without `friction` the energy is minimised, a second for 500 spheres; with it, up to
    1, a cloud is compressed as `modal.preparation.protocol` says, some minutes. Equal numbers give
    equal packings, to the bit where the installed packages are equal as well: without numba sums
    are rounded otherwise, and from some hundred spheres on a contact that opens for that makes
    another packing of the same kind (e of 500 then differs by 2e-4). Spheres are equal unless
    `sizes` says ("lognormal", spread of ln R) or ("two", ratio of radii, share of the large ones by
    volume); `densities`, kg/m^3, are one for all or several (two of two sizes are of the small and
    of the large ones, others dealt out at random in equal numbers), and `walls` are Young's
    modulus, Pa, and Poisson's ratio of the walls, where they are not of glass. A warning says where
    a packing with friction has not settled; InputError, where one without does not come to rest, or
    where there is no such packing.

    >>> net = random_packing(spheres=100, stress=1e5, seed=3)
    >>> net.n_particles, net.study["void_ratio"] < 0.7
    (100, True)
    """
    if friction == 0:
        mixture: dict[str, Any] = {"sizes": sizes, "densities": densities, "walls": walls}
        return random_sample(spheres, stress, seed, aspect, **mixture).network()
    check_stress(stress)
    width = width_of(spheres, aspect)
    words = (" ".join(map(str, given or ())) for given in (sizes, densities, walls))
    said: dict[str, Any] = dict(zip(MIXTURE, words, strict=True))
    study = Study(friction, spheres, width, seed, **said)
    walk = [lower for lower in STRESSES if lower < stress] + [stress]
    with TemporaryDirectory() as folder:
        files = compress.walk(Path(folder), study, walk, "modal.random_packing", lambda text: None)
        sample = read_sample(files[-1][1])
    if not sample.study["settled"]:
        warnings.warn(
            f"the packing has not settled: stresses are off by {sample.study['stress_error']:.1e}, "
            f"residual {sample.study['unbalanced']:.1e}",
            stacklevel=2,
        )
    return sample.network()
