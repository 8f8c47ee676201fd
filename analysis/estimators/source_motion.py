"""How the source wall of a record has moved, by which a linear wave beside it is sent."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import make_interp_spline

from modal.tools.errors import InputError
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse, SampledMotion

SAME = 1e-6
"""In parts of the amplitude: displacements of the wall that are one."""
DENSER = 10
"""Straight pieces that stand for the wall's path between two times of a record."""
ORDER = 5
"""Of the curve through the recorded displacements: ten of them in a period leave 1e-5."""


def recorded_motion(record: Signals) -> Motion:
    """The pulse that amplitude and frequency of a record name, where that is what was recorded.

    Else the smooth curve through the recorded displacements. InputError where the wall had moved
    before the record begins, or is recorded too seldom.
    """
    time, d = record.time, record.source_displacement
    pulse = Pulse(record.amplitude, record.input_frequency)
    if abs(d - pulse.displacement(time)).max() <= SAME * abs(record.amplitude):
        return pulse
    if abs(d[0]) > SAME * abs(d).max():
        raise InputError(
            f"the source wall is at {d[0]:.3g} m where the record begins, {time[0]:.3g} s: how it "
            "came there is not known; record it from rest on"
        )
    if time[0] > 0:
        time, d = np.append(0.0, time), np.append(0.0, d)
    if len(time) <= ORDER:
        raise InputError(f"{len(time)} times of the source wall tell no motion; record more")
    fine = np.interp(np.arange(DENSER * (len(time) - 1) + 1) / DENSER, np.arange(len(time)), time)
    return SampledMotion(fine, np.append(0.0, make_interp_spline(time, d, ORDER)(fine)[1:]))


def sets_out(record: Signals) -> float:
    """The last time, s, at which the source wall of a record has not moved yet."""
    moved = abs(record.source_displacement) > SAME * abs(record.source_displacement).max()
    return float(record.time[max(int(np.argmax(moved)) - 1, 0)])


def at_rest(record: Signals) -> float:
    """The first time, s, from which on the source wall of a record stands still."""
    d = record.source_displacement
    moving = np.flatnonzero(abs(d - d[-1]) > SAME * np.ptp(d))
    return float(record.time[min(moving[-1] + 1, len(d) - 1)]) if len(moving) else 0.0
