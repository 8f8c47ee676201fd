"""Random packings in memory, with friction and without: what `modal pack` writes."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from modal.arguments import checked
from modal.packing.network import Network
from modal.packing.sample import read_sample
from modal.preparation import compress
from modal.preparation.protocol import NOMINAL_FRACTION, STRESSES, Study
from modal.preparation.random_packing import check_stress, random_sample

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
) -> Network:
    """A random packing of glass spheres between two flat walls, at rest under a pressure.

    `stress`, Pa, is the same along all axes; x and y are periodic, and `aspect` is the length over
    the width. Without `friction` the energy is minimised, a second for 500 spheres; with it, up to
    1, a cloud is compressed as `modal.preparation.protocol` says, some minutes. Equal numbers give
    equal packings, to the bit where the installed packages are equal as well: without numba sums
    are rounded otherwise, and from some hundred spheres on a contact that opens for that makes
    another packing of the same kind (e of 500 then differs by 2e-4). Spheres are equal unless
    `sizes` says ("lognormal", spread of ln R) or ("two", ratio of radii, share of the large ones by
    volume). A warning says where a packing with friction has not settled; InputError, where one
    without does not come to rest, or where there is no such packing.

    >>> net = random_packing(spheres=100, stress=1e5, seed=3)
    >>> net.n_particles, net.study["void_ratio"] < 0.7
    (100, True)
    """
    if friction == 0:
        return random_sample(spheres, stress, seed, aspect, sizes=sizes).network()
    check_stress(stress)
    words = " ".join(map(str, sizes or ()))
    width = width_of(spheres, aspect)
    study = Study(mu_comp=friction, spheres=spheres, width=width, seed=seed, sizes=words)
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
