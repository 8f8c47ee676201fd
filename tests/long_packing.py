"""Random packings that are long enough for waves, and what is measured in one of them."""

from functools import cache

import analysis
import modal
from analysis.measurement import Measurement
from modal.packing.network import Network


@cache
def long_packing() -> Network:
    """Return 2,000 spheres without friction, more than sixty diameters long; packed once."""
    return modal.random_packing(spheres=2000, aspect=12, seed=3)


@cache
def measured_long_packing() -> Measurement:
    """Return all quantities that are measured by default in the long packing."""
    return analysis.measure(long_packing())


@cache
def thin_packing(seed: int) -> Network:
    """Return 200 spheres, 2 diameters wide and some forty long; packed once."""
    return modal.random_packing(spheres=200, aspect=20, seed=seed)
