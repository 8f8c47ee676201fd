"""Motions of the source wall, and what an oscillator does when such a motion drives it.

A linear wave needs of its source only y(omega^2, t), the solution of y'' + omega^2 y = d(t) from
rest. It is known in closed form for the pulse of the study and for a motion given by samples.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from math import isqrt
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from modal.formats.hdf5 import write_text
from modal.tools.arguments import refuse_other_kinds
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.signals import source_pulse

AMPLITUDE = 2.5e-9
"""A of u = A (1 - cos 2 pi f t), m: the paper's double amplitude 2A is 5 nm."""
INPUT_FREQUENCY = 1e5
"""Nominal input frequency, Hz (Otsubo et al. 2017, section 2)."""
MOST_PERIODS = 1e4
"""Of a chirp."""


@runtime_checkable
class Motion(Protocol):
    """A motion of the source wall along its direction, at rest at zero until t = 0."""

    @property
    def amplitude(self) -> float:
        """Size of the displacement, m."""

    @property
    def frequency(self) -> float:
        """Nominal frequency, Hz."""

    @property
    def corners(self) -> Floats:
        """Times, s, ascending, between which the motion is smooth."""

    def displacement(self, time: Floats) -> Floats:
        """Shape (nt,), m: displacement d of the wall at the times (nt,), s."""

    def response(self, square: Floats, time: Floats) -> Floats:
        """Shape (nw, nt), m s^2: y(omega^2, t) for omega^2 (nw,) 1/s^2, ascending times (nt,) s."""


def _driven_from_rest(square: Floats, time: Floats, frequency: float) -> Floats:
    """Shape (nw, nt): response to 1 - cos(Omega t) switched on at t = 0, unit A.

    P(w) - (cos Omega t - cos wt)/(w^2 - Omega^2) with P(w) = (1 - cos wt)/w^2, written with
    sin(x)/x, which is smooth where w = 0 or w = Omega; far above Omega, where the two cancel, the
    same is Omega^2 (P(Omega) - P(w))/(w^2 - Omega^2).
    """
    omega = np.sqrt(np.maximum(square, 0))[:, None]
    drive = 2 * np.pi * frequency
    t = np.maximum(time, 0)[None, :]

    def half_product(a: Floats | float, b: Floats | float) -> Floats:
        # 2 sin(a t) sin(b t) / (4 a b) with a or b allowed to vanish.
        half: Floats = 0.5 * t**2 * np.sinc(a * t / np.pi) * np.sinc(b * t / np.pi)
        return half

    constant = half_product(omega / 2, omega / 2)
    # cos(Omega t) - cos(w t) = 2 sin((w + Omega) t / 2) sin((w - Omega) t / 2).
    near = constant - half_product((omega + drive) / 2, (omega - drive) / 2)
    above = omega > 2 * drive
    far = (drive / np.where(above, omega, np.inf)) ** 2
    return np.where(above, (half_product(drive / 2, drive / 2) - constant) * far / (1 - far), near)


def sines(omega: Floats, time: Floats) -> Floats:
    """Shape (nw, nt): sin(omega t) of frequencies (nw,), 1/s, at times (nt,), s.

    Of evenly spaced times by the theorem of addition, from the sines and cosines of some sqrt(nt)
    times and of as many differences: a third of the work, and no further off than the rounding of
    omega t is anyway.
    """
    span = isqrt(len(time))
    even = np.diff(time)
    if span < 2 or even.max() - even.min() > 4 * np.spacing(abs(time).max()):
        return np.sin(omega[:, None] * time)
    first, further = omega[:, None] * time[::span], omega[:, None] * (time[:span] - time[0])
    both = np.sin(first)[:, :, None] * np.cos(further)[:, None, :]
    both += np.cos(first)[:, :, None] * np.sin(further)[:, None, :]
    return both.reshape(len(omega), -1)[:, : len(time)]


def _squares(number: float) -> bool:
    """Whether a number and its square are neither 0 nor infinite."""
    return 1e-150 < abs(number) < 1e150


@dataclass(frozen=True)
class Pulse:
    """Some periods of u = A (1 - cos 2 pi f t), one by default; A in m, frequency f in Hz."""

    amplitude: float = AMPLITUDE
    frequency: float = INPUT_FREQUENCY
    cycles: int = 1

    def __post_init__(self) -> None:
        refuse_other_kinds(Pulse, "Pulse", vars(self))
        if not (self.frequency > 0 and _squares(self.frequency) and _squares(self.amplitude)):
            raise InputError(
                f"a pulse of {self.amplitude:g} m and {self.frequency:g} Hz makes no wave: the "
                "amplitude must not be 0, the frequency above 0, and the squares of both numbers"
            )
        if self.cycles < 1 or self.cycles != int(self.cycles):
            raise InputError(f"{self.cycles} cycles: a pulse has a whole number of them, from 1 on")

    @property
    def corners(self) -> Floats:
        """Where the pulse starts and ends, (2,), s."""
        return np.array([0.0, self.cycles / self.frequency])

    def displacement(self, time: Floats) -> Floats:
        """d (nt,), m."""
        return source_pulse(time, self.amplitude, self.frequency, self.cycles)

    def response(self, square: Floats, time: Floats) -> Floats:
        """Shape (nw, nt), m s^2: y in closed form, during the pulse and after it.

        What the pulse leaves behind is a free oscillation. With the duration T, Omega T = 2 pi n,
        y = 2 Omega^2 / (Omega^2 - w^2) sin(w T / 2) / w sin(w (t - T / 2)) / w.
        """
        period, drive = self.cycles / self.frequency, 2 * np.pi * self.frequency
        omega = np.sqrt(np.maximum(square, 0))
        result = np.empty((len(square), len(time)))
        over = int(np.searchsorted(time, period))
        result[:, :over] = _driven_from_rest(square, time[:over], self.frequency)
        # Two forms of sin(w T / 2) / (w (Omega^2 - w^2)), each smooth on its side of Omega / 2: as
        # Omega T / 2 is n pi, sin(w T / 2) = (-1)^n sin((w - Omega) T / 2).
        low, high = np.minimum(omega, drive / 2), np.maximum(omega, drive / 2)
        below = np.sinc(low * period / (2 * np.pi)) / (drive**2 - low**2)
        above = (
            (-1) ** (self.cycles + 1)
            * np.sinc((high - drive) * period / (2 * np.pi))
            / ((high + drive) * high)
        )
        left = drive**2 * period * np.where(omega < drive / 2, below, above)
        late, swings = time[over:] - period / 2, omega > 0
        swing = sines(omega, late)
        np.multiply(swing, (left / np.where(swings, omega, 1.0))[:, None], out=result[:, over:])
        result[~swings, over:] = left[~swings, None] * late
        result *= self.amplitude
        return result


@dataclass(frozen=True)
class SampledMotion:
    """A motion given at times (nt,), s, as displacements (nt,), m; straight lines in between.

    It starts from rest at t = 0 with d = 0, and keeps its last value afterwards.
    """

    time: Floats
    value: Floats

    def __post_init__(self) -> None:
        try:
            own = np.array([self.time, self.value], float)
        except (TypeError, ValueError):
            own = np.empty((2, 0))
        if own.ndim != 2 or own.shape[1] < 2 or not np.isfinite(own).all():
            raise InputError("a source motion needs at least two times, each with a displacement")
        for name, column in zip(("time", "value"), own, strict=True):
            object.__setattr__(self, name, column)
        if self.time[0] != 0 or self.value[0] != 0 or (np.diff(self.time) <= 0).any():
            raise InputError(
                "a source motion starts at time 0 with displacement 0 and its times increase; "
                "shift the record"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            moves = _squares(self.frequency)
        if not moves:
            raise InputError(
                "a source motion that never moves, or beyond what numbers can square, makes no "
                "wave; give displacements in m that are not all 0"
            )

    @property
    def amplitude(self) -> float:
        """Half of the range of the displacement, m."""
        return float(np.ptp(self.value)) / 2

    @property
    def frequency(self) -> float:
        """Root mean square of the velocity over that of the displacement, over 2 pi; Hz.

        For a sine it is the sine's own frequency.
        """
        step = np.diff(self.time)
        speed = ((np.diff(self.value) / step) ** 2 * step).sum()
        left, right = self.value[:-1], self.value[1:]
        size = ((left**2 + left * right + right**2) / 3 * step).sum()
        return float(np.sqrt(speed / size)) / (2 * np.pi) if size > 0 else 0.0

    @property
    def corners(self) -> Floats:
        """The times of the samples, (nt,), s."""
        return self.time

    def displacement(self, time: Floats) -> Floats:
        """d (nt,), m."""
        return np.interp(time, self.time, self.value)

    def response(self, square: Floats, time: Floats) -> Floats:
        """Shape (nw, nt), m s^2: y, exact for a displacement of straight lines.

        It is computed from one corner of d, or one of the times asked for, to the next, in closed
        form for the straight line between them.
        """
        nodes = np.union1d(self.time[self.time < time[-1]], time)
        d = self.displacement(nodes)
        omega = np.sqrt(np.maximum(square, 0))
        y, rate = np.zeros(len(omega)), np.zeros(len(omega))
        result = np.zeros((len(omega), len(time)))
        wanted = np.searchsorted(nodes, time)
        column = {int(node): k for k, node in enumerate(wanted)}
        for k in range(1, len(nodes)):
            h = nodes[k] - nodes[k - 1]
            slope = (d[k] - d[k - 1]) / h
            x = omega * h
            sine = h * np.sinc(x / np.pi)  # sin(w h) / w
            versine = h**2 / 2 * np.sinc(x / (2 * np.pi)) ** 2  # (1 - cos(w h)) / w^2
            cosine = np.cos(x)
            lag = h**3 * _lag(x)  # (h - sin(w h) / w) / w^2
            y, rate = (
                y * cosine + rate * sine + d[k - 1] * versine + slope * lag,
                rate * cosine - y * omega**2 * sine + d[k - 1] * sine + slope * versine,
            )
            if k in column:
                result[:, column[k]] = y
        return result


def _lag(x: Floats) -> Floats:
    """(x - sin x) / x^3, by its series where the difference would cancel."""
    small = np.where(abs(x) < 0.5, x, 0.0) ** 2
    series = 1 / 6 - small / 120 + small**2 / 5040 - small**3 / 362880 + small**4 / 39916800
    large = np.where(abs(x) < 0.5, 1.0, x)
    return np.where(abs(x) < 0.5, series, (large - np.sin(large)) / large**3)


FINE = 100
"""Straight pieces in the shortest period of a motion that is given by samples: they leave a sine by
5e-4 of its amplitude at most, (2 pi / 100)^2 / 8."""


def chirp(amplitude: float, first: float, last: float, duration: float) -> SampledMotion:
    """A sine whose frequency goes evenly from `first` to `last`, Hz, in `duration`, s.

    Within sin^2(pi t / duration), so that it begins and ends at rest; `amplitude`, m, is that of
    its middle.
    """
    if not (np.isfinite(amplitude) and min(first, last, duration) > 0):
        raise InputError("a chirp needs two frequencies and a duration, all above 0")
    if not max(first, last) * duration < MOST_PERIODS:
        raise InputError(f"a chirp of more than {MOST_PERIODS} periods: take a shorter one")
    count = max(2, int(np.ceil(FINE * max(first, last) * duration)))
    time = np.linspace(0, duration, count + 1)
    phase = 2 * np.pi * (first * time + (last - first) * time**2 / (2 * duration))
    value = amplitude * np.sin(np.pi * time / duration) ** 2 * np.sin(phase)
    value[[0, -1]] = 0
    return SampledMotion(time, value)


def step(amplitude: float, rise: float) -> SampledMotion:
    """To twice the `amplitude`, m, in the time `rise`, s, along A (1 - cos(pi t / rise)); it stays.

    The stroke is that of a pulse of the same amplitude.
    """
    if not (np.isfinite(amplitude) and 0 < rise < np.inf):
        raise InputError(f"a step that rises in {rise:g} s: give a time above 0")
    time = np.linspace(0, rise, FINE + 1)
    return SampledMotion(time, amplitude * (1 - np.cos(np.pi * time / rise)))


def write_motion(path: str | Path, motion: SampledMotion) -> None:
    """The motion as a text of two columns, time in s and displacement in m; see `read_motion`."""
    rows = zip(motion.time.tolist(), motion.value.tolist(), strict=True)
    write_text(path, "".join(f"{time!r} {value!r}\n" for time, value in rows))


def read_motion(path: str | Path) -> SampledMotion:
    """A source motion from a text file of two columns: time in s, displacement in m."""
    try:
        with warnings.catch_warnings(action="error"):  # an empty file is one to numpy
            table = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError, UserWarning) as error:
        raise InputError(
            f"{path}: not a table of numbers ({' '.join(str(error).split())}); write two columns, "
            "time in s and displacement in m"
        ) from error
    if table.shape[1:] != (2,):
        raise InputError(f"{path}: {table.shape[-1]} columns; write two, time in s and d in m")
    return SampledMotion(table[:, 0], table[:, 1])
