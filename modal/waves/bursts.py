"""Define motions of laboratory transducers: bursts of a sine, and square waves.

Both begin and end at zero. Without a window the velocity of a sine jumps at the start, like that of
a function generator's voltage; a window makes the spectrum narrower.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.errors import refuse_unknown
from modal.waves.motions import Periods

Window = Literal["none", "hann"]
"""Envelope of a burst: constant, or sin^2 from its start to its end (J. von Hann)."""
WINDOWS: tuple[Window, ...] = get_args(Window)
SQUARE_RISE_IN_PERIODS = 0.05
"""Time in which a square wave goes from one level to the other, in periods: an amplifier has one,
and a jump would be an infinite velocity."""


@dataclass(frozen=True)
class SineBurst(Periods):
    """A few periods of u = A sin(2 pi f t).

    Parameters
    ----------
    amplitude : float
        Amplitude A, m, or N for a force; negative for a burst that begins in the opposite sense.
    frequency : float
        Frequency f, Hz.
    cycles : int, default 1
        Number of periods.
    window : str, default "none"
        Envelope: "none", or "hann" for sin^2(pi f t / cycles).

    Raises
    ------
    InputError
        If the amplitude is zero, or the frequency or the number of periods is not positive.

    Examples
    --------
    >>> SineBurst(1e-9, 5e4).displacement(np.array([0.0, 5e-6, 15e-6, 3e-5])).round(12)
    array([ 0.e+00,  1.e-09, -1.e-09,  0.e+00])
    """

    NAME = "a burst"

    cycles: int = 1
    window: Window = "none"

    def __post_init__(self) -> None:
        super().__post_init__()
        refuse_unknown("window", self.window, WINDOWS)

    def displacement(self, time: Floats) -> Floats:
        """Return the displacement d (nt,), m, at the times (nt,), s."""
        phase = 2 * np.pi * self.frequency * np.asarray(time)
        is_moving = (phase > 0) & (phase < 2 * np.pi * self.cycles)
        displacement = self.amplitude * np.sin(phase)
        if self.window == "hann":
            displacement = displacement * np.sin(phase / (2 * self.cycles)) ** 2
        return np.where(is_moving, displacement, 0.0)


@dataclass(frozen=True)
class SquareWave(Periods):
    """A few periods of a square wave: A for half a period, then -A.

    It changes from level to level linearly in time, within `SQUARE_RISE_IN_PERIODS`.

    Parameters
    ----------
    amplitude : float
        Amplitude A, m, or N for a force; negative for a wave that begins in the opposite sense.
    frequency : float
        Frequency, Hz.
    cycles : int, default 1
        Number of periods.

    Raises
    ------
    InputError
        If the amplitude is zero, or the frequency or the number of periods is not positive.

    Examples
    --------
    >>> SquareWave(1e-9, 5e4).displacement(np.array([0.0, 5e-6, 15e-6, 3e-5]))
    array([ 0.e+00,  1.e-09, -1.e-09,  0.e+00])
    """

    NAME = "a square wave"

    cycles: int = 1

    @property
    def corners(self) -> Floats:
        """Times (4 cycles + 2,), s, at which a change of level starts or ends."""
        edges = np.arange(2 * self.cycles + 1) / 2
        half_rise = SQUARE_RISE_IN_PERIODS / 2
        first = np.array([0.0, half_rise])
        last = np.array([self.cycles - half_rise, self.cycles])
        inner = np.column_stack([edges[1:-1] - half_rise, edges[1:-1] + half_rise]).ravel()
        return np.concatenate([first, inner, last]) / self.frequency

    def displacement(self, time: Floats) -> Floats:
        """Return the displacement d (nt,), m, at the times (nt,), s."""
        halves = np.arange(2 * self.cycles)
        levels = np.where(halves % 2 == 0, self.amplitude, -self.amplitude)
        values = np.concatenate([[0.0], np.repeat(levels, 2), [0.0]])
        return np.interp(time, self.corners, values)
