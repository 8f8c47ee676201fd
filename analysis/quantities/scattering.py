"""How waves fade: attenuation and quality factor over frequency, and where waves end."""

from __future__ import annotations

import numpy as np

from analysis.estimators.coherent import coherent_wave
from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value, unknown

WINDOWS = 3.0, 5.0
"""Damping of the window, in place of that of the estimator, by which an error is told."""


def _attenuation(packing: Measuring) -> tuple[Value, np.ndarray]:
    """Decay of the coherent amplitude, 1/m, at independent frequencies, and their group velocity.

    A window of another damping cuts the record elsewhere and passes on other noise: what it changes
    is the error, at a frequency or at its neighbours. A bias that grows as the square of the
    damping is as large.
    """
    wave, record = packing.coherent, packing.wave_of_layers
    others = [
        coherent_wave(
            record,
            packing.network.length,
            highest=wave.frequency[-1],
            points=len(wave.frequency),
            decay=decay,
        ).attenuation
        for decay in WINDOWS
    ]
    every = max(1, round(wave.resolution / (wave.frequency[1] - wave.frequency[0])))
    some = np.arange(every - 1, len(wave.frequency), every)
    some = some[np.isfinite([wave.attenuation[some], *(o[some] for o in others)]).all(axis=0)]
    if not len(some):
        return unknown("1/m", "no coherent wave is left to be read"), np.empty(0)
    error = abs(others[0] - others[1])[some]
    error = np.maximum.reduce([error, np.roll(error, 1), np.roll(error, -1)])
    value = Value(
        wave.attenuation[some], "1/m", {"window": error}, packing.of_waves, wave.frequency[some]
    )
    return value, wave.group_velocity[some]


@quantity("attenuation", "1/m", "decay of the coherent wave's amplitude along z, over frequency")
def attenuation(packing: Measuring) -> Value:
    """Of means over layers, from a pulse of the wall."""
    return _attenuation(packing)[0]


@quantity("quality", "1", "quality factor omega / (2 alpha v) of the coherent wave, over frequency")
def quality(packing: Measuring) -> Value:
    """alpha the attenuation, v the group velocity; unknown where alpha is not told from zero."""
    alpha, velocity = _attenuation(packing)
    if alpha.at is None:
        return unknown("1", *alpha.caveats)
    told = np.asarray(alpha.value) > 2 * np.asarray(alpha.error)
    if not told.any():
        return unknown("1", "attenuation is not told from zero at any frequency", *alpha.caveats)
    decay = np.where(told, alpha.value, np.nan)
    value = np.pi * alpha.at / (decay * velocity)
    return Value(value, "1", {"window": value * alpha.error / decay}, alpha.caveats, alpha.at)


@quantity("ioffe_regel", "Hz", "frequency at which the mean free path falls to half a wavelength")
def ioffe_regel(packing: Measuring) -> Value:
    """Between two standing waves; half of their distance is the error."""
    if packing.crystal:
        return unknown("Hz", "a crystal does not scatter its waves")
    found = packing.scattering
    if not np.isfinite(found.limit):
        return unknown("Hz", "no standing wave is as wide as it is high, as far as they are told")
    near = np.sort(abs(found.frequency[np.isfinite(found.width)] - found.limit))[:2].sum()
    return Value(found.limit, "Hz", {"resolution": near / 2}, packing.of_one_sample)
