"""What the paper's Tables 1 and 2 state of a case, measured from its files, with errors.

One idea a module, each standing on the one before: long waves, end of the band, first peaks,
eigenmodes; here what needs several of them.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from analysis.case import Case
from analysis.estimators import excess as density_over_waves
from analysis.estimators.excess import Excess
from analysis.estimators.scattering import Scattering
from analysis.estimators.transfer import Gain, network_gain
from analysis.measures.eigenmodes import Eigenmodes
from analysis.measures.shear_wave import ShearWave

MISCOUNTED = 0.75
"""Orders between a maximum and where it is expected, above which it is another's: 1/2 would be a
resonance of two held walls, 1 the next maximum."""


class Measures(Eigenmodes):
    """Measurements of one case, each made when first asked for; its last: scattering, gain, DEM."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self.row: Any = None
        """What `analysis.rows` has measured of it."""

    @cached_property
    def shear(self) -> list[ShearWave]:
        """Its S-waves, YADE's first; none where no wall has slid."""
        return [ShearWave(self.case, record) for record in self.case.shear]

    @cached_property
    def scattering(self) -> Scattering | None:
        """Width of the structure factor's ridge over frequency; None without one."""
        if self.case.structure is None:
            return None
        return Scattering.of(self.case.structure, self.long_wave.value, self.case.diameter)

    @cached_property
    def free_path(self) -> float:
        """Mean free path of the coherent wave at f_low-pass, 2 %, in diameters."""
        if self.scattering is None:
            return np.nan
        return self.scattering.free_path(self.low_pass[0].value)

    @cached_property
    def excess(self) -> Excess:
        """Density of states over that of plane waves; empty without one."""
        if self.case.density is None:
            return density_over_waves.UNKNOWN
        frequency, density, _ = self.case.density
        return Excess.of(frequency, density, 6 * self.case.network.n_particles, self.f_max)

    @cached_property
    def gain(self) -> Gain:
        """Gain factor from the response file, else of the springs at the same resolution."""
        found = self.case.response
        if found is not None:
            return Gain(found.frequency, found.gain, found.resolution)
        return network_gain(self.case.network, self.case.passage)

    @cached_property
    def gain_orders(self) -> tuple[np.ndarray, np.ndarray]:
        """The gain's maxima (k,) as orders of two columns: f = r f_1, both walls held, and r - 1/2.

        Each maximum is looked up among the measured resonances r f_1, which bend with dispersion:
        the first is the order r at which a standing wave has its frequency, by interpolation; the
        second what is expected where the source wall is free of stress, 1/2, 3/2, ... They end
        where a maximum is missing or one too many, an order off, and they no longer count.
        """
        f = self.gain.maxima()
        if np.isfinite(self.low_pass[0].value):  # beyond it the walls hear no common wave
            f = f[f < self.low_pass[0].value]
        orders, expected = self._orders(f), np.arange(len(f)) + 0.5
        lost = np.flatnonzero(~(abs(orders - expected) < MISCOUNTED))
        counted = slice(None, lost[0] if len(lost) else None)
        return orders[counted], expected[counted]

    @cached_property
    def free_held(self) -> np.ndarray:
        """Orders (k,) of the exact modes of a crystal whose source end is free; empty for others.

        There the stress at the source wall is zero while the receiver's is not: the gain's maxima.
        """
        if not self.case.is_crystal:
            return np.empty(0)
        return self._orders(self.case.lattice.eigenmodes(source_held=False)[0] / (2 * np.pi))

    def _orders(self, f: np.ndarray) -> np.ndarray:
        """Orders of frequencies (k,), Hz, among the measured resonances, by interpolation."""
        f_r, kappa = self.resonances
        rising = np.isfinite(f_r) & (np.maximum.accumulate(np.nan_to_num(f_r)) == f_r)
        if rising.sum() < 2:
            return f / self.first_resonance
        order = np.append(0.0, kappa[rising] * self.case.network.length / np.pi)
        return np.interp(f, np.append(0.0, f_r[rising]), order, right=np.nan)

    @cached_property
    def gain_height(self) -> str:
        """The gain at its first maximum with its resolution, and an undamped column's under it."""
        height = self.gain.first_maximum()[1]
        if not np.isfinite(height):
            return ""
        same = self.gain.undamped(self.passage)
        return f"{height:.3g} at {self.gain.resolution:.0f} Hz (undamped column: {same:.3g})"

    def of_balance(self, name: str) -> float:
        """A number of the energy balance of the YADE run; NaN without one."""
        record = self.case.signals
        books = None if record is None else record.balance
        return np.nan if books is None else float(getattr(books, name))

    @cached_property
    def off_linear(self) -> float:
        """YADE less the linear wave at the times of both, relative L2: layers' means, or a chain's.

        Over the whole record; NaN without a run.
        """
        run = self.case.signals
        if run is None:
            return np.nan
        linear = self.case.wave
        every = round(float(linear.time[1]) / float(run.time[1]))
        seen, wanted = run.layer_displacement, linear.layer_displacement
        if self.case.is_crystal or seen is None or wanted is None:
            seen, wanted = run.chain_displacement, linear.chain_displacement
        seen = seen[::every][: len(wanted)]
        wanted = wanted[: len(seen)]
        return float(np.linalg.norm(seen - wanted) / np.linalg.norm(wanted))
