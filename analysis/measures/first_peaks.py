"""V_P of a case by the first peaks of its particles, along one chain and along every column."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from analysis.estimators.low_pass import columns_of
from analysis.estimators.travel_time import (
    first_peak_times,
    first_peak_velocity,
    middle,
    travel_velocity,
)
from analysis.measures.band_end import BandEnd
from analysis.measures.estimate import Estimate
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

RECORDED = 1.3
"""Passages of the affine wave that a run of a random case records (cases/random.table)."""


class FirstPeaks(BandEnd):
    """First peaks of one case, of the linear wave in as much of its record as the run has."""

    @cached_property
    def first_peak(self) -> Estimate:
        """dL/dt of the linear wave's first peaks, middle half of the chain, m/s.

        Its error is that of the fit and of the choice of the chain.
        """
        return self._first_peak(self._as_the_run(self.case.wave))

    @cached_property
    def yade_first_peak(self) -> Estimate:
        """The same of the YADE run; NaN where there is none."""
        record = self.case.signals
        return Estimate(np.nan) if record is None else self._first_peak(record)

    def _as_the_run(self, wave: Signals) -> Signals:
        """Motions of the linear wave as far as the run's record goes.

        A peak counts when it exceeds half of the particle's largest, which may come late: two
        records give the same peaks only if they are equally long.
        """
        run = self.case.signals
        end = RECORDED * self.case.passage if run is None else float(run.time[-1])
        kept = slice(int(np.searchsorted(wave.time, end * (1 + 1e-9), "right")))
        every = wave.particle_displacement
        return replace(
            wave,
            time=wave.time[kept],
            chain_displacement=wave.chain_displacement[kept],
            particle_displacement=None if every is None else every[kept],
        )

    def _first_peak(self, record: Signals) -> Estimate:
        """Slope over the chain, with the error of the fit and the scatter over all columns."""
        network = self.case.network
        wall = float(network.wall_position[0])
        value, error = first_peak_velocity(record, wall, network.length)
        return Estimate(value, float(np.hypot(error, np.nan_to_num(self.columns.error))))

    @cached_property
    def columns(self) -> Estimate:
        """The same along every column of the sample, a sphere wide: mean and scatter of dL/dt.

        Of the linear wave, which is recorded on every particle. The scatter says how much the
        velocity depends on which chain is taken. NaN where single particles are not recorded.
        """
        if self.case.wave.particle_displacement is None:
            return Estimate(np.nan)
        case, network = self.case, self.case.network
        bearing = np.flatnonzero(force_bearing(network))
        distance = network.position[bearing, 2] - network.wall_position[0]
        inside = middle(distance, network.length)
        bearing, distance = bearing[inside], distance[inside]
        wave = self._as_the_run(case.wave)
        times = first_peak_times(
            replace(wave, chain_displacement=wave.particle_displacement[:, bearing])
        )
        known = np.isfinite(times)
        bearing, distance, times = bearing[known], distance[known], times[known]
        column = columns_of(network, bearing)
        members = [np.flatnonzero(column == c) for c in np.unique(column)]
        speeds = [travel_velocity(distance[m], times[m])[0] for m in members if len(m) > 9]
        if not speeds:
            return Estimate(np.nan)
        scatter = float(np.std(speeds, ddof=1)) if len(speeds) > 1 else np.nan
        return Estimate(float(np.mean(speeds)), scatter)
