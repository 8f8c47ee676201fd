"""Up to which frequency waves pass: the paper's threshold rule, and without its bias."""

from __future__ import annotations

import numpy as np

from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.low_pass import SHORTEST, Edge
from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value, unknown


@quantity("low_pass", "Hz", "frequency above which less than 2 % of the amplitude arrives")
def low_pass(packing: Measuring) -> Value:
    """The 2 % rule of Otsubo et al. (2017), section 5.1, as `analysis.estimators.low_pass` has it.

    Of random packings the mean over all columns of spheres, with their scatter; of crystals, and of
    records without single particles, along the one chain.
    """
    band, caveats = packing.passband, packing.of_waves
    edge = band.low_pass[0]
    if not edge.flat and np.isfinite(edge.value):
        caveats += (f"no plateau: it changes by {100 * edge.change:.0f} % to either side",)
    length = packing.network.length / packing.diameter
    if not packing.crystal and length < SHORTEST:
        text = f"too short: {length:.1f} D long, the rule needs {SHORTEST:g} D and reads too high"
        caveats += (text,)
    elif not packing.crystal and len(band.of_columns):
        edge = band.mean_of_columns
    return _value_of(edge, caveats)


def _value_of(edge: Edge, caveats: tuple[str, ...]) -> Value:
    if not np.isfinite(edge.value):
        return unknown("Hz", edge.why or "the rule finds no frequency", *caveats)
    return Value(edge.value, "Hz", {"chain": edge.error}, caveats)


@quantity("low_pass_unbiased", "Hz", "upper end of the band of P-waves, without a threshold")
def low_pass_unbiased(packing: Measuring) -> Value:
    """Of a crystal, whose band has an edge."""
    if not packing.crystal:
        return unknown("Hz", "disorder has no band edge: see ioffe_regel and attenuation")
    value, other = (
        chain_dispersion(packing.wave, order=order).low_pass_frequency for order in (2, 3)
    )
    return Value(value, "Hz", {"fit": value - other}, packing.of_waves)
