"""Find the motion of a record's source wall, and compute the record for another motion.

The wave is linear in the motion. Under a window exp(-eta t), whose value at the record's end is
negligible, the transforms of two records have the same ratio as the transforms of their motions.
Frequencies that the recorded motion S hardly contains cannot be recovered, and the new record lacks
them: the ratio for the new motion P is found by regularised least squares, P S* / (|S|^2 + e^2),
with e a small part of the largest |S|.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from modal.tools.errors import UnavailableError
from modal.waves.motions import Motion, Pulse, SampledMotion
from modal.waves.signals import Signals

MOTION_TOLERANCE = 1e-6
"""Largest difference of two displacements of the wall that count as equal, relative to the
amplitude."""
PIECES_PER_INTERVAL = 10
"""Straight pieces that represent the wall's path between two times of a record."""
SPLINE_DEGREE = 5
"""Degree of the curve through the recorded displacements; with ten of them in a period its error is
1e-5."""
DECAY = 6.0
"""Damping eta T of the window over the record's length T. The record is padded to 2 T, so that what
wraps round is damped to e^-12."""
MIN_SPECTRUM_RATIO = 1e-3
"""The e of the ratio P S* / (|S|^2 + e^2), divided by the largest |S|: frequencies with a smaller
|S| do not pass into the new record."""
FOLLOWS_MOTION = (
    "chain_displacement",
    "layer_displacement",
    "particle_displacement",
    "source_displacement",
    "source_stress",
    "receiver_stress",
)
"""Fields of a record that are linear in the motion of the source."""


def _change_motions(record: Signals, change: Callable[[np.ndarray], np.ndarray]) -> dict[str, Any]:
    """Return the fields of a record that depend on the motion, if present, after `change`."""
    changed = {}
    for name in FOLLOWS_MOTION:
        values = getattr(record, name)
        if values is not None:
            changed[name] = change(values)
    return changed


def cut(record: Signals, end: float) -> Signals:
    """Return the record up to the time `end`, s.

    Two records give the same first peaks only if they are equally long: a peak counts if it exceeds
    half of the particle's largest displacement, which may occur late.
    """
    count = int(np.searchsorted(record.time, end * (1 + 1e-9), "right"))
    changed = _change_motions(record, lambda values: values[:count])
    return replace(record, **changed, time=record.time[:count])


def recorded_motion(record: Signals) -> Motion:
    """Return the motion of a record's source wall.

    It is the pulse that the record's amplitude and frequency define, if the recorded displacements
    agree with it; otherwise a smooth curve through these displacements. UnavailableError if the
    wall had moved before the record begins, or if the record has too few times.
    """
    time = record.time
    displacement = record.source_displacement
    pulse = Pulse(record.amplitude, record.input_frequency)
    difference = abs(displacement - pulse.displacement(time)).max()
    if difference <= MOTION_TOLERANCE * abs(record.amplitude):
        return pulse
    if abs(displacement[0]) > MOTION_TOLERANCE * abs(displacement).max():
        raise UnavailableError(
            "not_from_rest",
            f"the source wall is at {displacement[0]:.3g} m where the record begins, "
            f"{time[0]:.3g} s",
            "how it came there is not known",
            "record it from rest on",
        )
    if time[0] > 0:
        time = np.append(0.0, time)
        displacement = np.append(0.0, displacement)
    if len(time) <= SPLINE_DEGREE:
        raise UnavailableError(
            "too_few_times",
            f"{len(time)} times of the source wall do not define its motion",
            remedy="record more",
        )
    from scipy.interpolate import make_interp_spline  # takes a third of a second to load

    pieces = PIECES_PER_INTERVAL * (len(time) - 1)
    fine_time = np.interp(np.arange(pieces + 1) / PIECES_PER_INTERVAL, np.arange(len(time)), time)
    curve = make_interp_spline(time, displacement, SPLINE_DEGREE)
    return SampledMotion(fine_time, np.append(0.0, curve(fine_time)[1:]))


def sets_out(record: Signals) -> float:
    """Return the last recorded time, s, before the source wall begins to move."""
    distance = abs(record.source_displacement)
    first_moved = int(np.argmax(distance > MOTION_TOLERANCE * distance.max()))
    return float(record.time[max(first_moved - 1, 0)])


def at_rest(record: Signals) -> float:
    """Return the time, s, at which the source wall of a record comes to rest for good.

    The time is 0 if the wall never moves.
    """
    displacement = record.source_displacement
    distance = abs(displacement - displacement[-1])
    moving = np.flatnonzero(distance > MOTION_TOLERANCE * np.ptp(displacement))
    if len(moving) == 0:
        return 0.0
    return float(record.time[min(moving[-1] + 1, len(displacement) - 1)])


def as_of_pulse(record: Signals, pulse: Pulse) -> Signals:
    """Return the record that a pulse of the same wall would have given.

    Amplitude and frequency become those of the pulse. The displacement of the source shows which
    part of the pulse the recorded motion contained.
    """
    time = record.time
    count = 2 * len(time)
    window = np.exp(-DECAY * time / time[-1])

    def transform(values: np.ndarray) -> np.ndarray:
        return np.fft.rfft((values.T * window).T, count, axis=0)

    sent = transform(record.source_displacement)
    ratio = transform(pulse.displacement(time)) * sent.conj()
    ratio /= abs(sent) ** 2 + (MIN_SPECTRUM_RATIO * abs(sent).max()) ** 2

    def answer(values: np.ndarray) -> np.ndarray:
        damped = np.fft.irfft((ratio * transform(values).T).T, count, axis=0)[: len(time)]
        return (damped.T / window).T

    changed = _change_motions(record, answer)
    return replace(record, **changed, amplitude=pulse.amplitude, input_frequency=pulse.frequency)
