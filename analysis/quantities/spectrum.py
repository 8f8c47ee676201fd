"""What the natural frequencies are: the highest, and where soft modes pile up."""

from __future__ import annotations

import numpy as np

from analysis.estimators.excess import Excess
from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value, unknown


@quantity("highest_frequency", "Hz", "highest natural frequency")
def highest_frequency(packing: Measuring) -> Value:
    """Of the mode that products with K find at the top; its residual bounds its error."""
    modes = packing.highest
    value, residual = float(modes.frequency[-1]), float(modes.residual[-1])
    return Value(value, "Hz", {"residual": residual * value / 2})


@quantity("excess_peak", "Hz", "frequency at which D(f) / f^2 is largest: where soft modes are")
def excess_peak(packing: Measuring) -> Value:
    """The boson peak; its error is half the width of a line of the density."""
    if packing.crystal:
        return unknown("Hz", "a crystal has no soft modes beside its waves")
    frequency, density, _ = packing.density
    found = Excess.of(
        frequency, density, 6 * packing.network.n_particles, packing.highest.frequency[-1]
    )
    line = 4 * float(frequency[1] - frequency[0])
    if not np.isfinite(found.peak_frequency):
        text = f"resolution: no peak above {2.5 * line:.3g} Hz, below which lines of zero modes are"
        return unknown("Hz", text)
    return Value(found.peak_frequency, "Hz", {"resolution": line / 2}, packing.of_one_sample)
