"""How the source wall of a record has moved, and the record as it would be, had it moved otherwise.

The wave is linear in the motion. Under a window exp(-eta t), whose share at the record's end does
not matter, the transforms of two records stand to each other as those of their motions. Where the
recorded motion has next to nothing of a frequency, nothing of it is made up: the quotient is that
of least squares, P S* / (|S|^2 + e^2), with e a small part of the largest |S|.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse, SampledMotion

SAME = 1e-6
"""In parts of the amplitude: displacements of the wall that are one."""
DENSER = 10
"""Straight pieces that stand for the wall's path between two times of a record."""
ORDER = 5
"""Of the curve through the recorded displacements: ten of them in a period leave 1e-5."""
DECAY = 6.0
"""eta T of the window: what wraps round is damped to e^-12, as the record is padded to 2 T."""
FAINT = 1e-3
"""e over the largest |S| below which a frequency is not sent."""
MOVED = (
    *(f"{name}_displacement" for name in ("chain", "layer", "particle", "source")),
    *("source_stress", "receiver_stress"),
)
"""What of a record goes with the motion."""


def with_motions(record: Signals, change: Callable[[np.ndarray], np.ndarray], **more) -> Signals:
    """The record with all that goes with the motion changed; what it has not stays absent."""
    there = {name: found for name in MOVED if (found := getattr(record, name)) is not None}
    changed: dict[str, Any] = {name: change(found) for name, found in there.items()}
    return replace(record, **changed, **more)


def cut(record: Signals, end: float) -> Signals:
    """The record up to a time, s.

    A peak counts when it exceeds half of the particle's largest, which may come late: two records
    give the same peaks only if they are equally long.
    """
    kept = slice(int(np.searchsorted(record.time, end * (1 + 1e-9), "right")))
    return with_motions(record, lambda values: values[kept], time=record.time[kept])


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
        at = f"the source wall is at {d[0]:.3g} m where the record begins, {time[0]:.3g} s"
        raise UnavailableError(
            f"{at}: how it came there is not known; record it from rest on", code="not_from_rest"
        )
    if time[0] > 0:
        time, d = np.append(0.0, time), np.append(0.0, d)
    if len(time) <= ORDER:
        raise UnavailableError(
            f"{len(time)} times of the source wall tell no motion; record more",
            code="too_few_times",
        )
    from scipy.interpolate import make_interp_spline  # takes a third of a second to load

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


def as_of_pulse(record: Signals, pulse: Pulse) -> Signals:
    """The record of another motion as the same wall would have given it for a pulse.

    Amplitude and frequency become those of the pulse; the source's own displacement shows what of
    it the motion has sent.
    """
    time = record.time
    count = 2 * len(time)
    fade = np.exp(-DECAY * time / time[-1])

    def transform(values: np.ndarray) -> np.ndarray:
        return np.fft.rfft((values.T * fade).T, count, axis=0)

    sent = transform(record.source_displacement)
    ratio = transform(pulse.displacement(time)) * sent.conj()
    ratio /= abs(sent) ** 2 + (FAINT * abs(sent).max()) ** 2

    def answer(values: np.ndarray) -> np.ndarray:
        back = np.fft.irfft((ratio * transform(values).T).T, count, axis=0)[: len(time)]
        return (back.T / fade).T

    return with_motions(record, answer, amplitude=pulse.amplitude, input_frequency=pulse.frequency)
