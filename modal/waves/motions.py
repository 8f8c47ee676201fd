"""Motions of the source: the pulse of the study, chirps, steps, and those given by samples."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from modal.tools.arguments import frequencies, refuse_other_kinds
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers

AMPLITUDE = 2.5e-9
"""A of u = A (1 - cos 2 pi f t), m: the paper's double amplitude 2A is 5 nm."""
INPUT_FREQUENCY = 1e5
"""Nominal input frequency, Hz (Otsubo et al. 2017, section 2)."""
RECORDING_INTERVAL = 5e-7
"""Longest interval between YADE's records, s, by default: five samples a period at 400 kHz."""
TIME_STEP_FRACTION = 0.05
"""Time step of YADE's wave over its limit, by default; `python -m benchmarks defaults`: why."""
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


def _squares(number: float) -> bool:
    """Whether a number and its square are neither 0 nor infinite."""
    return 1e-150 < abs(number) < 1e150


@dataclass(frozen=True)
class Pulse:
    """Some periods of u = A (1 - cos 2 pi f t).

    Parameters
    ----------
    amplitude : float, default 2.5e-9
        A, half the wall's stroke, m; negative the other way.
    frequency : float, default 1e5
        f, Hz.
    cycles : int, default 1
        Periods.

    Raises
    ------
    InputError
        For what makes no wave.

    Examples
    --------
    >>> Pulse(1e-9, 5e4).displacement(np.array([0.0, 1e-5, 3e-5]))
    array([0.e+00, 2.e-09, 0.e+00])
    """

    amplitude: float = AMPLITUDE
    frequency: float = INPUT_FREQUENCY
    cycles: int = 1

    def __post_init__(self) -> None:
        refuse_other_kinds(Pulse, "Pulse", vars(self))
        if not (_squares(float(frequencies(self.frequency))) and _squares(self.amplitude)):
            raise InputError(
                "input",
                f"a pulse of {self.amplitude:g} m and {self.frequency:g} Hz makes no wave",
                "the "
                "amplitude must not be 0, the frequency above 0, and the squares of both numbers",
            )
        if self.cycles < 1 or self.cycles != int(self.cycles):
            raise InputError(
                "input", f"{self.cycles} cycles", "a pulse has a whole number of them, from 1 on"
            )

    @property
    def corners(self) -> Floats:
        """Where the pulse starts and ends, (2,), s."""
        return np.array([0.0, self.cycles / self.frequency])

    def displacement(self, time: Floats) -> Floats:
        """d (nt,), m: of a sine its phase is shifted by 270 degrees (Otsubo et al., Fig. 2a)."""
        time = np.asarray(time)
        inside = (time > 0) & (time * self.frequency < self.cycles)
        # 1 - cos x = 2 sin^2 (x / 2) keeps its digits where the pulse is longer than the record.
        moved = 2 * self.amplitude * np.sin(np.pi * self.frequency * time) ** 2
        return np.where(inside, moved, 0.0)


@dataclass(frozen=True)
class SampledMotion:
    """A motion given at times (nt,), s, as displacements (nt,), m; straight lines in between.

    It starts from rest at t = 0 with d = 0, and keeps its last value afterwards.
    """

    time: Floats
    value: Floats

    def __post_init__(self) -> None:
        time = plain_numbers(self.time, "time", "s")
        value = plain_numbers(self.value, "displacement", "m")
        try:
            own = np.array([time, value], float)
        except (TypeError, ValueError):
            own = np.empty((2, 0))
        if own.ndim != 2 or own.shape[1] < 2 or not np.isfinite(own).all():
            raise InputError(
                "input", "a source motion needs at least two times, each with a displacement"
            )
        for name, column in zip(("time", "value"), own, strict=True):
            object.__setattr__(self, name, column)
        if self.time[0] != 0 or self.value[0] != 0 or (np.diff(self.time) <= 0).any():
            raise InputError(
                "input",
                "a source motion starts at time 0 with displacement 0 and its times increase",
                remedy="shift the record",
            )
        with np.errstate(over="ignore", invalid="ignore"):
            moves = _squares(self.frequency)
        if not moves:
            raise InputError(
                "input",
                "a source motion that never moves, or beyond what numbers can square, makes no "
                "wave",
                remedy="give displacements in m that are not all 0",
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


FINE = 100
"""Straight pieces in the shortest period of a motion that is given by samples: they leave a sine by
5e-4 of its amplitude at most, (2 pi / 100)^2 / 8."""


def chirp(amplitude: float, first: float, last: float, duration: float) -> SampledMotion:
    """A sine whose frequency goes evenly from `first` to `last`, Hz, in `duration`, s.

    Within sin^2(pi t / duration), so that it begins and ends at rest; `amplitude`, m, is that of
    its middle.
    """
    if not (np.isfinite(amplitude) and min(first, last, duration) > 0):
        raise InputError("input", "a chirp needs two frequencies and a duration, all above 0")
    if not max(first, last) * duration < MOST_PERIODS:
        raise InputError(
            "input", f"a chirp of more than {MOST_PERIODS} periods", remedy="take a shorter one"
        )
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
        raise InputError("input", f"a step that rises in {rise:g} s", remedy="give a time above 0")
    time = np.linspace(0, rise, FINE + 1)
    return SampledMotion(time, amplitude * (1 - np.cos(np.pi * time / rise)))


def read_motion(path: str | Path) -> SampledMotion:
    """A source motion from a text file of two columns: time in s, displacement in m."""
    try:
        with warnings.catch_warnings(action="error"):  # an empty file is one to numpy
            table = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError, UserWarning) as error:
        raise InputError(
            "input",
            f"{path}: not a table of numbers ({' '.join(str(error).split())})",
            remedy=("write two columns, time in s and displacement in m"),
        ) from error
    if table.shape[1:] != (2,):
        raise InputError(
            "input", f"{path}: {table.shape[-1]} columns", remedy="write two, time in s and d in m"
        )
    return SampledMotion(table[:, 0], table[:, 1])
