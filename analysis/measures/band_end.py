"""Low-pass frequency of a case and the wavelength there, by the paper's rule and without bias."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.estimators.chain_wavenumber import chain_wavenumber
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.low_pass import Edge, Passband
from analysis.estimators.ridge import Ridge, ridge
from analysis.measures.long_waves import LongWaves
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals


class BandEnd(LongWaves):
    """Where the band of one case ends; the threshold rule needs the speed of its long waves."""

    @cached_property
    def passband(self) -> Passband:
        """The threshold rule on the records of the case."""
        case = self.case
        return Passband(
            case.network,
            case.wave,
            case.signals,
            velocity=self.long_wave.value,
            crystal=case.is_crystal,
        )

    @cached_property
    def low_pass(self) -> list[Edge]:
        """f_low-pass, Hz, by the 2 %, 1 %, ... rule of the paper on the linear wave."""
        return self.passband.low_pass

    def edges(self, producer: str, whose: str, reference: str) -> list[Edge]:
        """f_low-pass by the thresholds, of `yade` or `linear`: `Passband.edges`, each made once."""
        band, yade = self.passband, producer == "yade"
        if (whose, reference) == ("chain", "map"):
            return band.of_yade if yade else band.low_pass
        key = producer, whose, reference
        if key not in self._edges:
            record = self.case.signals if yade else self.case.wave
            self._edges[key] = band.edges(record, whose, reference, band.common)
        return self._edges[key]

    @cached_property
    def _edges(self) -> dict[tuple[str, str, str], list[Edge]]:
        return {}

    @property
    def band(self) -> float:
        """What figures scale their frequencies by, Hz: f_low-pass, or a guess without one."""
        found = self.low_pass[0].value
        return found if np.isfinite(found) else 0.05 * self.long_wave.value / self.case.diameter

    @cached_property
    def band_edge(self) -> float:
        """f_low-pass of a crystal, Hz, without the threshold's bias; NaN for others."""
        if not self.case.is_crystal:
            return np.nan
        return chain_dispersion(self.case.wave).low_pass_frequency

    @cached_property
    def yade_band_edge(self) -> float:
        """The same of the YADE run."""
        if not self.case.is_crystal or self.case.signals is None:
            return np.nan
        return chain_dispersion(self.case.signals).low_pass_frequency

    @cached_property
    def ridge(self) -> Ridge:
        """Frequency over wave number along the chain of a crystal, linear wave."""
        return ridge(self.case.wave)

    @cached_property
    def yade_ridge(self) -> Ridge | None:
        """The same of the YADE run; None without one."""
        return None if self.case.signals is None else ridge(self.case.signals)

    @cached_property
    def edge_wavelength(self) -> tuple[float, float]:
        """Wavelength at a crystal's band edge / D, of linear wave and YADE run; NaN for others.

        Measured where the waves of the record turn round, not computed from the lattice (Eq. 7).
        """
        if not self.case.is_crystal:
            return np.nan, np.nan
        dem = np.nan if self.yade_ridge is None else self.yade_ridge.edge_wavelength
        return self.ridge.edge_wavelength / self.case.diameter, dem / self.case.diameter

    def wavelength_at(self, frequency: float, record: Signals | None = None) -> float:
        """Wavelength, m, along the chain of a record (the linear wave's) at a frequency, Hz.

        From the record as the threshold rule cuts it. Of a crystal from its ridge; NaN beyond the
        band edge, where no wave travels.
        """
        record = record or self.case.wave
        if self.case.is_crystal:
            own = self.yade_ridge if record is self.case.signals else self.ridge
            return np.nan if own is None else own.wavelength(frequency)
        kappa = chain_wavenumber(
            record,
            frequency,
            self.case.network.length,
            velocity=self.long_wave.value,
            end=self.passband.end(record, self.passband.common),
            part=force_bearing(self.case.network)[record.chain_particle],
        )
        return 2 * np.pi / kappa
