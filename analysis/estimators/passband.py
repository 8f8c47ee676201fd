"""Which frequencies a packing lets through, by the threshold rule, and what the rule's choices do.

The rule has free choices: the threshold, the length of the record and how it ends, and whose
displacement is taken. Every one is varied here; the paper's rule is 2 % (and 1 %) on one chain.
The linear wave recorded on every particle serves as the reference, because all choices can be made
on it; a YADE run's record is judged by the same rule beside it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.case import PASSAGES, Products
from analysis.estimators.low_pass import FADE, Plateau, flattest, threshold_curves
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

THRESHOLDS = (0.02, 0.01, 0.03, 0.05)
"""The paper's two first."""
WIDTH = 20.0
"""Stretch of a plateau, diameters."""
NEAR = 5.0
"""From where on distances count, diameters: nearer, the wall's own field is seen."""


class Passband:
    """The threshold rule on the records of one case with long-wave velocity `velocity` (m/s)."""

    def __init__(self, case: Products, velocity: float) -> None:
        self.case, self.velocity = case, velocity
        # A crystal's band ends at 0.45 V_P / D.
        self.highest = (0.7 if case.is_crystal else 0.4) * velocity / case.diameter

    @cached_property
    def layers(self) -> tuple[np.ndarray, np.ndarray]:
        """Distance of the layers (nl,) m, and their frequencies (thresholds, nl), Hz."""
        return self._of_layers(self.case.wave)

    @cached_property
    def yade(self) -> tuple[np.ndarray, np.ndarray] | None:
        """The same of the YADE run's record; None where there is none, or none of layers."""
        record = self.case.signals
        if record is None or (not self.case.is_crystal and record.layer_displacement is None):
            return None
        return self._of_layers(record)

    @cached_property
    def particles(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of every force-bearing particle: all chains of the sample, not one."""
        case = self.case
        bearing = np.flatnonzero(force_bearing(case.network))
        u = case.wave.particle_displacement[:, bearing]
        distance = case.network.position[bearing, 2] - case.network.wall_position[0]
        return distance, threshold_curves(case.wave.time, u, THRESHOLDS, self.highest)

    @cached_property
    def low_pass(self) -> list[Plateau]:
        """f_low-pass, Hz, for each threshold: the plateau of the layers' values."""
        return self._plateaus(*self.layers, self.case.wave.time[-1])

    @cached_property
    def of_particles(self) -> list[Plateau]:
        """The same of single particles: its error is what the choice of a chain is worth."""
        return self._plateaus(*self.particles, self.case.wave.time[-1])

    @cached_property
    def of_yade(self) -> list[Plateau]:
        """The same of the YADE run's record, NaN where there is none."""
        if self.yade is None:
            return [Plateau(np.nan, np.nan, np.nan, np.nan)] * len(THRESHOLDS)
        return self._plateaus(*self.yade, self.case.signals.time[-1])

    def of_record(self, passages: float, fade: float = FADE) -> list[Plateau]:
        """The layers' plateaus from a record of so many affine passages that ends by `fade`."""
        end = passages * self.case.passage
        distance, found = self._of_layers(self.case.wave, end, fade)
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
        whole = 1.5 * PASSAGES
        for passages in (1.0, PASSAGES):
            text = f"layers, 2 %, record of {passages:g} passages, not {whole:g}"
            rows.append((text, self.of_record(passages)[0]))
        for fade in (0.05, 0.5):
            text = f"layers, 2 %, last {100 * fade:g} % of the record fade, not {100 * FADE:g} %"
            rows.append((text, self.of_record(whole, fade)[0]))
        return rows

    def _of_layers(
        self, record: Signals, end: float = np.inf, fade: float = FADE
    ) -> tuple[np.ndarray, np.ndarray]:
        z, u = record.layer_position, record.layer_displacement
        if self.case.is_crystal:  # its own layers, not slabs a diameter thick
            z, u = record.chain_position, record.chain_displacement
        kept = record.time <= end * (1 + 1e-9)
        found = threshold_curves(record.time[kept], u[kept], THRESHOLDS, self.highest, fade)
        return z - self.case.network.wall_position[0], found

    def _plateaus(
        self, distance: np.ndarray, found: np.ndarray, end: float, fade: float = FADE
    ) -> list[Plateau]:
        """As far as the front comes before a record to `end` (s) fades, off the receiver wall."""
        case, near = self.case, NEAR * self.case.diameter
        last = min((1 - fade) * end * self.velocity, case.network.length - near)
        return [flattest(distance, row, WIDTH * case.diameter, near, last) for row in found]
