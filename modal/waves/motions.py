"""Define motions of a source in time: pulses, chirps, steps, and sampled motions.

The default pulse is that of Otsubo et al. (2017). Bursts of laboratory transducers are in
`modal.waves.bursts`.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from modal.tools.arguments import frequencies, refuse_other_kinds
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers

AMPLITUDE = 2.5e-9
"""A of u = A (1 - cos 2 pi f t), m: the double amplitude 2A of Otsubo et al. is 5 nm."""
INPUT_FREQUENCY = 1e5
"""Nominal input frequency, Hz (Otsubo et al. 2017, section 2)."""
RECORDING_INTERVAL = 5e-7
"""Default upper bound of the time between YADE's records, s: five samples a period at 400 kHz."""
TIME_STEP_FRACTION = 0.05
"""Default time step of waves in YADE, divided by the stable limit. `python -m benchmarks defaults`
shows why."""
MAX_CHIRP_PERIODS = 1e4
"""Largest number of periods of a chirp, each of which takes a hundred samples."""
SAMPLES_PER_PERIOD = 100
"""Number of straight pieces in the shortest period of a sampled motion. They differ from a sine by
at most 5e-4 of its amplitude, (2 pi / 100)^2 / 8."""
MIN_SQUARABLE = 1e-150
MAX_SQUARABLE = 1e150
"""Bounds of the numbers whose squares are neither 0 nor infinite."""


@runtime_checkable
class Motion(Protocol):
    """A motion of the source along its direction, at rest at zero until t = 0."""

    @property
    def amplitude(self) -> float:
        """Size of the displacement, m."""

    @property
    def frequency(self) -> float:
        """Nominal frequency, Hz."""

    @property
    def corners(self) -> Floats:
        """Ascending times, s, between which the motion is smooth."""

    def displacement(self, time: Floats) -> Floats:
        """Return the displacement d of the source (nt,), m, at the times (nt,), s."""


def _is_squarable(number: float) -> bool:
    """Return whether a number and its square are neither 0 nor infinite."""
    return MIN_SQUARABLE < abs(number) < MAX_SQUARABLE


def refuse_no_wave(name: str, amplitude: float, frequency: float, cycles: float) -> None:
    """Raise InputError for an impossible amplitude, m, frequency, Hz, or number of periods.

    `name` is the name of the motion in the message, with its article.
    """
    hertz = float(frequencies(frequency))
    if not (_is_squarable(hertz) and _is_squarable(amplitude)):
        raise InputError(
            "no_wave",
            f"{name} of {amplitude:g} m and {frequency:g} Hz makes no wave",
            "the amplitude must not be 0, the frequency above 0, and the squares of both numbers",
        )
    if cycles < 1 or cycles != int(cycles):
        raise InputError(
            "cycles", f"{cycles} cycles", f"{name} has a whole number of them, from 1 on"
        )


@dataclass(frozen=True)
class Periods:
    """A whole number of periods of a motion, at rest before and after them.

    `amplitude` is in m, or N for a force, `frequency` in Hz; `NAME` is the name of the motion in
    messages, with its article. Raises InputError if the amplitude is zero, or the frequency or the
    number of periods is not positive.
    """

    NAME: ClassVar[str]

    amplitude: float
    frequency: float
    cycles: int

    def __post_init__(self) -> None:
        refuse_other_kinds(type(self), type(self).__name__, vars(self))
        refuse_no_wave(self.NAME, self.amplitude, self.frequency, self.cycles)

    @property
    def corners(self) -> Floats:
        """Times of the start and the end of the motion (2,), s."""
        return np.array([0.0, self.cycles / self.frequency])


@dataclass(frozen=True)
class Pulse(Periods):
    """A few periods of u = A (1 - cos 2 pi f t).

    Parameters
    ----------
    amplitude : float, default 2.5e-9
        Amplitude A, half the wall's stroke, m; negative for a motion in the opposite sense.
    frequency : float, default 1e5
        Frequency f, Hz.
    cycles : int, default 1
        Number of periods.

    Raises
    ------
    InputError
        If the amplitude is zero, or the frequency or the number of periods is not positive.

    Examples
    --------
    >>> Pulse(1e-9, 5e4).displacement(np.array([0.0, 1e-5, 3e-5]))
    array([0.e+00, 2.e-09, 0.e+00])
    """

    NAME = "a pulse"

    amplitude: float = AMPLITUDE
    frequency: float = INPUT_FREQUENCY
    cycles: int = 1

    def displacement(self, time: Floats) -> Floats:
        """Return the displacement d (nt,), m, at the times (nt,), s.

        The pulse is a sine whose phase is shifted by 270 degrees (Otsubo et al. 2017, Fig. 2a).
        """
        time = np.asarray(time)
        is_moving = (time > 0) & (time * self.frequency < self.cycles)
        # 1 - cos x = 2 sin^2 (x / 2) keeps its digits where the pulse is longer than the record.
        displacement = 2 * self.amplitude * np.sin(np.pi * self.frequency * time) ** 2
        return np.where(is_moving, displacement, 0.0)


@dataclass(frozen=True)
class SampledMotion:
    """A motion given by displacements (nt,), m, at times (nt,), s; straight lines in between.

    The motion starts from rest at t = 0 with d = 0, and keeps its last value afterwards. Raises
    InputError for samples that do not describe such a motion.
    """

    time: Floats
    value: Floats

    def __post_init__(self) -> None:
        time = plain_numbers(self.time, "time", "s")
        value = plain_numbers(self.value, "displacement", "m")
        try:
            samples = np.array([time, value], float)
        except (TypeError, ValueError):
            samples = np.empty((2, 0))
        if samples.ndim != 2 or samples.shape[1] < 2 or not np.isfinite(samples).all():
            raise InputError(
                "motion_samples",
                "a source motion needs at least two times, each with a displacement",
            )
        for name, column in zip(("time", "value"), samples, strict=True):
            object.__setattr__(self, name, column)
        if self.time[0] != 0 or self.value[0] != 0 or (np.diff(self.time) <= 0).any():
            raise InputError(
                "motion_samples",
                "a source motion starts at time 0 with displacement 0 and its times increase",
                remedy="shift the record",
            )
        with np.errstate(over="ignore", invalid="ignore"):
            makes_wave = _is_squarable(self.frequency)
        if not makes_wave:
            raise InputError(
                "no_wave",
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
        """Root mean square velocity divided by root mean square displacement and by 2 pi, Hz.

        For a sine this is its frequency.
        """
        step = np.diff(self.time)
        square_velocity = ((np.diff(self.value) / step) ** 2 * step).sum()
        left = self.value[:-1]
        right = self.value[1:]
        square_displacement = ((left**2 + left * right + right**2) / 3 * step).sum()
        if not square_displacement > 0:
            return 0.0
        return float(np.sqrt(square_velocity / square_displacement)) / (2 * np.pi)

    @property
    def corners(self) -> Floats:
        """Times of the samples (nt,), s."""
        return self.time

    def displacement(self, time: Floats) -> Floats:
        """Return the displacement d (nt,), m, at the times (nt,), s."""
        return np.interp(time, self.time, self.value)


def chirp(amplitude: float, first: float, last: float, duration: float) -> SampledMotion:
    """Return a sine whose frequency changes linearly from `first` to `last`, Hz, in `duration`, s.

    Its envelope is sin^2(pi t / duration), so that the motion begins and ends at rest; `amplitude`,
    m, is the amplitude in the middle. Raises InputError for impossible numbers.
    """
    if not (np.isfinite(amplitude) and min(first, last, duration) > 0):
        raise InputError("chirp", "a chirp needs two frequencies and a duration, all above 0")
    if not max(first, last) * duration < MAX_CHIRP_PERIODS:
        raise InputError(
            "chirp",
            f"a chirp of more than {MAX_CHIRP_PERIODS} periods",
            remedy="take a shorter one",
        )
    count = max(2, int(np.ceil(SAMPLES_PER_PERIOD * max(first, last) * duration)))
    time = np.linspace(0, duration, count + 1)
    phase = 2 * np.pi * (first * time + (last - first) * time**2 / (2 * duration))
    displacement = amplitude * np.sin(np.pi * time / duration) ** 2 * np.sin(phase)
    displacement[[0, -1]] = 0
    return SampledMotion(time, displacement)


def step(amplitude: float, rise: float) -> SampledMotion:
    """Return a motion that rises to twice the `amplitude`, m, in `rise`, s, and stays there.

    The displacement is A (1 - cos(pi t / rise)): the stroke is that of a pulse of the same
    amplitude. Raises InputError if `rise` is not above 0.
    """
    if not (np.isfinite(amplitude) and 0 < rise < np.inf):
        raise InputError(
            "rise_time", f"a step that rises in {rise:g} s", remedy="give a time above 0"
        )
    time = np.linspace(0, rise, SAMPLES_PER_PERIOD + 1)
    return SampledMotion(time, amplitude * (1 - np.cos(np.pi * time / rise)))


def read_motion(path: str | Path) -> SampledMotion:
    """Read a source motion from a text file of two columns: time in s, displacement in m.

    Raises InputError if the file is not such a table.
    """
    try:
        with warnings.catch_warnings(action="error"):  # numpy warns of an empty file
            table = np.loadtxt(path, ndmin=2)
    except (OSError, ValueError, UserWarning) as error:
        detail = " ".join(str(error).split())
        raise InputError(
            "not_a_table",
            f"{path}: not a table of numbers ({detail})",
            remedy="write two columns, time in s and displacement in m",
        ) from error
    if table.shape[1:] != (2,):
        raise InputError(
            "not_a_table",
            f"{path}: {table.shape[-1]} columns",
            remedy="write two, time in s and d in m",
        )
    return SampledMotion(table[:, 0], table[:, 1])
