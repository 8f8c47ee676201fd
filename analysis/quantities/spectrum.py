"""What the natural frequencies are: the highest, standing waves among the lowest, soft modes."""

from __future__ import annotations

import numpy as np

from analysis.estimators.excess import Excess
from analysis.estimators.resonances import standing_modes
from analysis.measuring import Measuring
from analysis.quantities.registry import DISORDER, on_request, quantity, without_signal
from analysis.value import Value, hertz, unknown
from modal.modes.eigenmodes import eigenmodes

FEWEST = 30
"""Modes below a peak of D(f) / f^2: from fewer each single one is a peak."""

HIGHEST_BRANCH = 0.15
"""Of the highest frequency: the modes of a narrow cell are not listed beyond."""


@without_signal("highest_frequency", "Hz", "highest natural frequency")
def highest_frequency(packing: Measuring) -> Value:
    """Of the mode that products with K find at the top; its residual bounds its error."""
    modes = packing.highest
    value, residual = float(modes.frequency[-1]), float(modes.residual[-1])
    return Value(value, "Hz", {"fit": residual * value / 2})


@quantity(
    "excess_peak",
    "Hz",
    "frequency at which D(f) / f^2 is largest: where soft modes are",
    exact=DISORDER,
)
def excess_peak(packing: Measuring) -> Value:
    """The boson peak; its error is half the width of a line of the density."""
    if packing.crystal:
        return unknown("Hz", "a crystal has no soft modes beside its waves")
    frequency, density, below = packing.density
    found = Excess.of(
        frequency, density, 6 * packing.network.n_particles, packing.highest.frequency[-1]
    )
    line = 4 * float(frequency[1] - frequency[0])
    if not np.isfinite(found.peak_frequency):
        text = f"resolution: no peak above {hertz(2.5 * line)}, below which lines of zero modes are"
        return unknown("Hz", text, *packing.of_one_sample)
    first, count = np.interp([2.5 * line, found.peak_frequency], frequency, below)
    if count - first < FEWEST:
        text = (
            f"resolution: {count - first:.0f} modes lie below the largest value at "
            f"{hertz(found.peak_frequency)}, the packing is too small to tell a peak from them"
        )
        return unknown("Hz", text, *packing.of_one_sample)
    return Value(found.peak_frequency, "Hz", {"resolution": line / 2}, packing.of_one_sample)


@on_request("resonances", "Hz", "of standing P-waves r = 1, 2, ... among the lowest modes")
def resonances(packing: Measuring) -> Value:
    """Of a crystal its pure modes, else the modes that bear the largest share of each wave."""
    modes, along_z, lacks = packing.modes
    f = modes.resonance_frequency
    if not packing.crystal or f is None:
        f = standing_modes(modes.frequency, along_z, packing.network).frequency
    if not len(f):
        return unknown("Hz", "no mode bears a standing wave", lacks)
    return Value(np.asarray(f), "Hz", {}).with_caveats(*packing.of_waves, *filter(None, [lacks]))


@on_request("chi_z", "1", "share of a mode's motion that is along z, over frequency (Eq. 2)")
def chi_z(packing: Measuring) -> Value:
    """Of all spheres, of each of the lowest modes."""
    modes, _, lacks = packing.modes
    caveats = packing.of_one_sample + tuple(filter(None, [lacks]))
    return Value(modes.chi_z, "1", {}, caveats, modes.frequency)


@on_request("chi_z_of_branches", "1", "chi_z of every mode up to 1.5 V_P / W, W the cell's width")
def chi_z_of_branches(packing: Measuring) -> Value:
    """Of all spheres. V_S / W and V_P / W are where further waves set in along a cell W wide."""
    width = packing.width * packing.diameter
    limit = 1.5 * float(packing.moduli.velocities((0, 0, 1))[0]) / width
    highest = min(limit, HIGHEST_BRANCH * packing.highest.frequency[-1])
    modes = eigenmodes(packing.network, below=highest, shapes=False)
    lacks = (f"{modes.missing} modes are missing",) if modes.missing else ()
    return Value(modes.chi_z, "1", {}, packing.of_one_sample + lacks, modes.frequency)


@quantity(
    "gain",
    "1",
    "stress on the receiver over that on the source wall, over frequency",
    exact="resonances without end, of which the record's window alone decides",
    asked=True,
)
def gain(packing: Measuring) -> Value:
    """Of P-waves, without damping."""
    found = packing.gain
    text = f"resolution: heights of resonances are those of lines {hertz(found.resolution)} wide"
    return Value(found.gain, "1", {}, (text, *packing.of_waves), found.frequency)
