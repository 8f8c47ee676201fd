"""Which frequencies a packing lets through: the paper's threshold rule, and what its choices do.

The rule (section 5.1 of Otsubo et al. 2017): f_low-pass is the frequency at which the amplitude
falls to 2 % (or 1 %) of the maximum; over distance it has a plateau, whose value is taken. Its free
choices are the threshold, the length of the record and how it ends, and whose displacement is
taken: `Passband` varies every one. The unbiased band edge of a crystal is in `damped_transform`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.estimators.coherent import PASSAGES
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

THRESHOLDS = (0.02, 0.01, 0.03, 0.05)
"""The paper's two first."""
WIDTH = 20.0
"""Stretch of a plateau, diameters."""
NEAR = 5.0
"""From where on distances count, diameters: nearer, the wall's own field is seen."""
REACH = {True: 0.7, False: 0.4}
"""Highest frequency that is looked at, V_P / D, of a crystal, whose band ends at 0.45, or not."""
FADE = 0.2
"""Part of a record, at its end, that fades out."""
RECORD = 1.5 * PASSAGES
"""Length of the linear wave's record, in passages from wall to wall of the affine wave."""
SURE = 0.9
"""Part of the spectrum below whose end it is seen that nothing more follows."""


def threshold_frequency(
    frequency: np.ndarray, amplitude: np.ndarray, threshold: float = 0.02
) -> np.ndarray:
    """Highest frequency (nc,) Hz at which each column exceeds threshold * its own maximum."""
    above = amplitude > threshold * amplitude.max(axis=0)
    last = amplitude.shape[0] - 1 - np.argmax(above[::-1], axis=0)
    return frequency[last]


@dataclass(frozen=True)
class Plateau:
    """Value of a distance curve where it is flattest: median, half the quartile distance, place."""

    value: float
    error: float
    start: float
    end: float


def flattest(
    distance: np.ndarray, values: np.ndarray, width: float, first: float, last: float
) -> Plateau:
    """The plateau of `values` (n,) over `distance` (n,), in m, chosen without an eye.

    Of all stretches of `width` between `first` and `last` the one in which the values change least:
    the least difference of the medians of its two halves, plus half its quartile distance. NaN
    where no stretch fits; values that are NaN do not count. Nearer than some diameters the wall's
    own field counts; farther than the record reaches, it ends before the slow high frequencies
    have come: `first` and `last` keep off both.
    """
    order = np.argsort(distance)
    order = order[np.isfinite(np.asarray(values)[order])]
    z, f = np.asarray(distance)[order], np.asarray(values)[order]
    best = Plateau(np.nan, np.nan, np.nan, np.nan)
    least = np.inf
    for start in np.arange(first, last - width + 1e-9 * width, width / 10):
        inside = (z >= start) & (z <= start + width)
        early = inside & (z < start + width / 2)
        if early.sum() < 2 or (inside & ~early).sum() < 2:
            continue
        half = np.subtract(*np.percentile(f[inside], [75, 25])) / 2
        change = abs(np.median(f[early]) - np.median(f[inside & ~early])) + half
        if change < least:
            least = change
            best = Plateau(float(np.median(f[inside])), float(half), start, start + width)
    return best


def threshold_curves(
    time: np.ndarray,
    displacement: np.ndarray,
    thresholds: tuple[float, ...],
    highest: float,
    fade: float = FADE,
) -> np.ndarray:
    """The threshold rule for every column of `displacement` (nt, p); shape (thresholds, p), Hz.

    NaN where the amplitude is still above the threshold close to `highest` (Hz). Four frequencies a
    record length. The last part, `fade`, of the record fades out by a half cosine: a cut in the
    middle of a motion spreads over all frequencies as 1 / f and would lie above the threshold.
    """
    step = float(time[1] - time[0])
    frequency = np.arange(0, min(highest, 0.5 / step), 1 / (4 * len(time) * step))
    past = np.clip((time - time[0]) / (time[-1] - time[0]) / fade - (1 / fade - 1), 0, 1)
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time) * np.cos(np.pi / 2 * past) ** 2
    found = np.empty((len(thresholds), displacement.shape[1]))
    for start in range(0, displacement.shape[1], 4096):  # some spectra at a time: memory
        part = slice(start, start + 4096)
        amplitude = abs(kernel @ displacement[:, part])
        for row, threshold in zip(found, thresholds, strict=True):
            row[part] = threshold_frequency(frequency, amplitude, threshold)
    found[found > SURE * frequency[-1]] = np.nan
    return found


def plateau(
    distance: np.ndarray, values: np.ndarray, reach: float, length: float, diameter: float
) -> Plateau:
    """The plateau of a threshold curve over distance from the source wall, all in m.

    Up to `reach`, as far as the front comes before the record fades, and off the receiver wall.
    """
    last = min(reach, length - NEAR * diameter)
    return flattest(distance, values, WIDTH * diameter, NEAR * diameter, last)


def wavelength(velocity: float, f_low_pass: float) -> float:
    """lambda_low-pass, m, by Eq. 7, which holds for nearest neighbours alone: theory's 2 l."""
    return 2 * velocity / (np.pi * f_low_pass)


class Passband:
    """The threshold rule on the linear wave of a packing, `wave`, and beside it on a YADE `run`.

    The linear wave, recorded on every particle for `RECORD` passages, is the reference, because all
    choices can be made on it. `velocity` (m/s) is that of its long waves, `passage` (s) the time
    from wall to wall of the affine wave. A crystal has its own layers; in other packings layers are
    slabs a diameter thick.
    """

    def __init__(
        self,
        network: Network,
        wave: Signals,
        run: Signals | None,
        *,
        velocity: float,
        passage: float,
        crystal: bool,
    ) -> None:
        self.network, self.wave, self.run = network, wave, run
        self.velocity, self.passage, self.crystal = velocity, passage, crystal
        self.diameter = 2 * float(network.radius.mean())
        self.highest = REACH[crystal] * velocity / self.diameter

    @cached_property
    def layers(self) -> tuple[np.ndarray, np.ndarray]:
        """Distance of the layers (nl,) m, and their frequencies (thresholds, nl), Hz."""
        return self._of_layers(self.wave)

    @cached_property
    def yade(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The same of the YADE run's record; None where there is none, or none of layers."""
        record = self.run
        if record is None or (not self.crystal and record.layer_displacement is None):
            return None
        return self._of_layers(record)

    @cached_property
    def particles(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of every force-bearing particle: all chains of the sample, not one."""
        bearing = np.flatnonzero(force_bearing(self.network))
        u = self.wave.particle_displacement[:, bearing]
        distance = self.network.position[bearing, 2] - self.network.wall_position[0]
        return distance, threshold_curves(self.wave.time, u, THRESHOLDS, self.highest)

    @cached_property
    def low_pass(self) -> list[Plateau]:
        """f_low-pass, Hz, for each threshold: the plateau of the layers' values."""
        return self._plateaus(*self.layers, self.wave.time[-1])

    @cached_property
    def of_particles(self) -> list[Plateau]:
        """The same of single particles: its error is what the choice of a chain is worth."""
        return self._plateaus(*self.particles, self.wave.time[-1])

    @cached_property
    def of_yade(self) -> list[Plateau]:
        """The same of the YADE run's record, NaN where there is none."""
        if self.yade is None:
            return [Plateau(np.nan, np.nan, np.nan, np.nan)] * len(THRESHOLDS)
        return self._plateaus(*self.yade, self.run.time[-1])

    def of_record(self, passages: float, fade: float = FADE) -> list[Plateau]:
        """The layers' plateaus from a record of so many affine passages that ends by `fade`."""
        end = passages * self.passage
        distance, found = self._of_layers(self.wave, end, fade)
        return self._plateaus(distance, found, end, fade)

    def choices(self) -> list[tuple[str, Plateau]]:
        """What each choice makes of f_low-pass, the others kept."""
        rows = []
        for what, found in (
            ("layers", self.low_pass),
            ("single particles", self.of_particles),
            ("YADE record", self.of_yade),
        ):
            rows += [(f"{what}, {100 * t:g} %", p) for t, p in zip(THRESHOLDS, found, strict=True)]
        for passages in (1.0, PASSAGES):
            text = f"layers, 2 %, record of {passages:g} passages, not {RECORD:g}"
            rows.append((text, self.of_record(passages)[0]))
        for fade in (0.05, 0.5):
            text = f"layers, 2 %, last {100 * fade:g} % of the record fade, not {100 * FADE:g} %"
            rows.append((text, self.of_record(RECORD, fade)[0]))
        return rows

    def _of_layers(
        self, record: Signals, end: float = np.inf, fade: float = FADE
    ) -> tuple[np.ndarray, np.ndarray]:
        z, u = record.layer_position, record.layer_displacement
        if self.crystal:  # its own layers, not slabs a diameter thick
            z, u = record.chain_position, record.chain_displacement
        kept = record.time <= end * (1 + 1e-9)
        found = threshold_curves(record.time[kept], u[kept], THRESHOLDS, self.highest, fade)
        return z - self.network.wall_position[0], found

    def _plateaus(
        self, distance: np.ndarray, found: np.ndarray, end: float, fade: float = FADE
    ) -> list[Plateau]:
        """As far as the front comes before a record to `end` (s) fades, off the receiver wall."""
        end = (1 - fade) * end * self.velocity
        return [plateau(distance, row, end, self.network.length, self.diameter) for row in found]
