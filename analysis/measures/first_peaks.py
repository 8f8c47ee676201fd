"""V_P of a case by the first peaks of its particles, along one chain and along every column."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.estimators.coherent import PASSAGES
from analysis.estimators.travel_time import cut, first_peak_velocity, first_peaks_of_columns
from analysis.measures.band_end import BandEnd
from analysis.value import Value, estimate
from modal.waves.signals import Signals


class FirstPeaks(BandEnd):
    """First peaks of one case, of the linear wave in as much of its record as the run has."""

    @cached_property
    def first_peak(self) -> Value:
        """dL/dt of the linear wave's first peaks, middle half of the chain, m/s.

        Its error is that of the fit and of the choice of the chain.
        """
        return self._first_peak(self._as_the_run(self.case.wave))

    @cached_property
    def yade_first_peak(self) -> Value:
        """The same of the YADE run; NaN where there is none."""
        record = self.case.signals
        return estimate(np.nan) if record is None else self._first_peak(record)

    def _as_the_run(self, wave: Signals) -> Signals:
        """Motions of the linear wave as far as the run's record goes."""
        run = self.case.signals
        return cut(wave, PASSAGES * self.case.passage if run is None else float(run.time[-1]))

    def _first_peak(self, record: Signals) -> Value:
        """Slope over the chain, with the error of the fit and the scatter over all columns."""
        network = self.case.network
        wall = float(network.wall_position[0])
        value, error = first_peak_velocity(record, wall, network.length)
        return estimate(value, float(np.hypot(error, np.nan_to_num(self.columns.error))))

    @cached_property
    def columns(self) -> Value:
        """The same along every column of the sample, a sphere wide: mean and scatter of dL/dt.

        Of the linear wave, which is recorded on every particle. The scatter says how much the
        velocity depends on which chain is taken. NaN where single particles are not recorded.
        """
        case = self.case
        return estimate(*first_peaks_of_columns(self._as_the_run(case.wave), case.network))
