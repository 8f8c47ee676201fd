"""What the paper's Tables 1 and 2 state of a case, measured from its files, with errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from analysis.case import Case
from analysis.estimators.chain_wavenumber import chain_wavenumber
from analysis.estimators.coherent import Coherent, coherent_wave, longest_waves
from analysis.estimators.damped_transform import chain_dispersion, mode_dispersion
from analysis.estimators.effective_medium import of_contacts, of_means
from analysis.estimators.low_pass import Edge, Passband, columns_of
from analysis.estimators.resonances import (
    Standing,
    fitted_wavenumbers,
    long_wave_velocity,
    standing_modes,
)
from analysis.estimators.ridge import Ridge, ridge
from analysis.estimators.scattering import Scattering
from analysis.estimators.transfer import Gain, at_frequency, network_gain, wall_velocity
from analysis.estimators.travel_time import (
    first_peak_times,
    first_peak_velocity,
    middle,
    travel_velocity,
)
from modal.formats.hdf5 import InputError
from modal.modes.highest import highest_modes
from modal.modes.problem import Eigenproblem
from modal.packing.rattlers import force_bearing
from modal.packing.state import contacts_per_particle, coordination_without_rattlers, void_ratio
from modal.stiffness.static_load import static_velocity
from modal.waves.signals import Signals

LOW_ORDER = 10
"""Low frequency means that of the standing wave r = 10, wavelength L / 5."""


@dataclass(frozen=True)
class Estimate:
    """A value and its uncertainty, in SI units; NaN where it is unknown."""

    value: float
    error: float = np.nan


class Measures:
    """Measurements of one case, each made when first asked for."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.row: Any = None
        """What `analysis.rows` has measured of it."""

    @cached_property
    def void_ratio(self) -> float:
        """Wall to wall."""
        return void_ratio(self.case.network)

    @cached_property
    def coordination(self) -> tuple[float, float]:
        """Contacts a particle: all, and among those that bear force."""
        network = self.case.network
        return float(contacts_per_particle(network).mean()), coordination_without_rattlers(network)[
            0
        ]

    @cached_property
    def first_peak(self) -> Estimate:
        """dL/dt of the linear wave's first peaks, middle half of the chain, m/s, with its error."""
        return self._first_peak(self._as_the_run(self.case.wave))

    @cached_property
    def yade_first_peak(self) -> Estimate:
        """The same of the YADE run; NaN where there is none."""
        record = self.case.signals
        return Estimate(np.nan) if record is None else self._first_peak(record)

    def _as_the_run(self, wave: Signals) -> Signals:
        """Motions of the linear wave as far as the run's record goes.

        A peak counts when it exceeds half of the particle's largest: later waves must be as far.
        """
        kept = wave.time <= self.passband.end(wave, self.passband.common) * (1 + 1e-9)
        motions = {
            name: getattr(wave, name)[kept]
            for name in ("time", "chain_displacement", "particle_displacement")
        }
        return replace(wave, **motions)

    def _first_peak(self, record: Signals) -> Estimate:
        """Slope over the chain; the error is the fit's."""
        network = self.case.network
        return Estimate(
            *first_peak_velocity(record, float(network.wall_position[0]), network.length)
        )

    @cached_property
    def columns(self) -> Estimate:
        """The same along every column of the sample, a sphere wide: mean and scatter of dL/dt.

        On the linear wave, which is recorded on every particle: what one chain is worth.
        """
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

    def of_balance(self, name: str) -> float:
        """A number of the energy balance of the YADE run; NaN without one."""
        record = self.case.signals
        books = None if record is None else record.balance
        return np.nan if books is None else float(getattr(books, name))

    @cached_property
    def off_linear(self) -> float:
        """YADE less the linear wave at its own times, relative L2: layers' means, or a chain's.

        Over the whole record; NaN without a run.
        """
        run = self.case.signals
        if run is None:
            return np.nan
        linear = self.case.linear()
        seen, wanted = run.layer_displacement, linear.layer_displacement
        if self.case.is_crystal or seen is None or wanted is None:
            seen, wanted = run.chain_displacement, linear.chain_displacement
        return float(np.linalg.norm(seen - wanted) / np.linalg.norm(wanted))

    @cached_property
    def coherent(self) -> Coherent:
        """The coherent wave of the linear record, to the highest frequency that is looked at."""
        return self._coherent(self.case.wave)

    @cached_property
    def yade_coherent(self) -> Coherent | None:
        """The same of the YADE run, where its layers were recorded."""
        record = self.case.signals
        if record is None or record.layer_displacement is None:
            return None
        return self._coherent(record)

    def _coherent(self, record: Signals) -> Coherent:
        case = self.case
        highest = (0.5 if case.is_crystal else 0.2) * of_contacts(case.network).velocity
        if case.is_crystal:  # slabs a diameter thick would beat with its layers
            record = replace(record, layer_displacement=None)
        return coherent_wave(record, case.network.length, highest=highest / case.diameter)

    @cached_property
    def low_frequency(self) -> float:
        """Frequency, Hz, of the wavelength L / 5."""
        return LOW_ORDER * self.long_wave.value / (2 * self.case.network.length)

    @cached_property
    def long_wave(self) -> Estimate:
        """V_P, m/s, of the longest waves of the linear wave: the reference for all else.

        For crystals by the damped transform, which is unbiased there.
        """
        if self.case.is_crystal:
            return Estimate(chain_dispersion(self.case.wave).velocity)
        return Estimate(*longest_waves(self.coherent))

    @cached_property
    def yade_long_wave(self) -> Estimate:
        """The same of the YADE run; NaN where there is none."""
        if self.case.is_crystal and self.case.signals is not None:
            return Estimate(chain_dispersion(self.case.signals).velocity)
        found = self.yade_coherent
        return Estimate(np.nan) if found is None else Estimate(*longest_waves(found))

    @cached_property
    def static(self) -> float:
        """V_P, m/s, of the springs under a steady push: no wave, no estimator of one.

        NaN for samples too short to have a bulk, or whose springs do not hold all of it.
        """
        try:
            return static_velocity(self.case.network)[0]
        except InputError:
            return np.nan

    @cached_property
    def walls(self) -> tuple[float, float]:
        """Phase and group velocity, m/s, between the wall stresses at the low frequency."""
        found = wall_velocity(self.case.wave, self.case.network.length)
        if found is None:
            return np.nan, np.nan
        f, phase, group, _ = found
        # The group velocity is a derivative: the slope of the phase over an octave about it.
        near = (f > 0.7 * self.low_frequency) & (f < 1.4 * self.low_frequency)
        delay = self.case.network.length / phase[near]
        slope = np.polyfit(f[near], f[near] * delay, 1)[0]
        return at_frequency(f, phase, self.low_frequency), self.case.network.length / slope

    @cached_property
    def standing(self) -> Standing | None:
        """Modes that bear the standing waves of a random packing; None without mode shapes."""
        modes = self.case.modes
        if self.case.is_crystal or modes is None or modes.mode_shape is None:
            return None
        return standing_modes(modes, self.case.network)

    @cached_property
    def resonances(self) -> tuple[np.ndarray, np.ndarray]:
        """f_r (Hz), kappa_r (1/m, Eq. 4): pure modes of a crystal, else those that bear the waves.

        Beyond the modes that can be told, and without their shapes, the structure factor's ridge.
        """
        modes, structure = self.case.modes, self.case.structure
        if modes is not None and modes.resonance_frequency is not None and self.case.is_crystal:
            return modes.resonance_frequency, modes.resonance_wavenumber
        own = np.empty(0) if self.standing is None else self.standing.frequency
        if structure is not None:
            f = structure.ridge()[0]
            known = structure.order <= len(own)
            f[known] = own[structure.order[known] - 1]
            return f, structure.wavenumber
        return own, np.pi * np.arange(1, len(own) + 1) / self.case.network.length

    @cached_property
    def first_resonance(self) -> float:
        """f_1, Hz, of the first P resonance: of its mode, else V_P / 2 L of the long waves."""
        f = self.resonances[0]
        return float(f[0]) if len(f) else 0.5 / self.passage

    @cached_property
    def modal_first(self) -> float:
        """V_P, m/s, of the first resonance by Eqs. 3 and 4: 2 L f_1; NaN without modes."""
        f = self.resonances[0]
        return 2 * self.case.network.length * float(f[0]) if len(f) else np.nan

    @cached_property
    def modal(self) -> Estimate:
        """V_P, m/s, of the modes' wave numbers by Eq. 4, from omega = V kappa (1 + b kappa^2)."""
        return Estimate(*long_wave_velocity(*self.resonances))

    @cached_property
    def modal_fitted(self) -> Estimate:
        """V_P, m/s, of wave numbers that are fitted to the modes' shapes."""
        modes, network = self.case.modes, self.case.network
        if modes is None:
            return Estimate(np.nan)
        if self.case.is_crystal and modes.resonance_shape is not None:
            f, distance = self.resonances[0], self.case.lattice.distance
            return Estimate(mode_dispersion(f, modes.resonance_shape, distance).velocity)
        if self.standing is None:
            return Estimate(np.nan)
        bearing = force_bearing(network)
        depth = network.position[bearing, 2] - network.wall_position[0]
        rows = self.standing.row[:LOW_ORDER]
        kappa = fitted_wavenumbers(modes.mode_shape[rows][:, bearing, 2], depth, network.length)
        return Estimate(*long_wave_velocity(self.standing.frequency[:LOW_ORDER], kappa))

    @cached_property
    def effective(self) -> tuple[float, float]:
        """V_P, m/s, by effective medium theory: of the contacts, and of the means alone."""
        network = self.case.network
        radius = 0.5 * self.case.diameter
        means = of_means(self.void_ratio, self.coordination[0], self.case.stress, radius)
        return of_contacts(network).velocity, means.velocity

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
    def edge_wavelength(self) -> tuple[float, float]:
        """Wavelength at a crystal's band edge / D, of linear wave and YADE run; NaN for others.

        Measured where the waves of the record turn round, not computed from the lattice (Eq. 7).
        """
        if not self.case.is_crystal:
            return np.nan, np.nan
        run = self.case.signals
        dem = np.nan if run is None else ridge(run).edge_wavelength
        return self.ridge.edge_wavelength / self.case.diameter, dem / self.case.diameter

    def wavelength_at(self, frequency: float, record: Signals | None = None) -> float:
        """Wavelength, m, along the chain of a record (the linear wave's) at a frequency, Hz.

        From the record as the threshold rule cuts it. Of a crystal from its ridge; NaN beyond the
        band edge, where no wave travels.
        """
        record = record or self.case.wave
        if self.case.is_crystal:
            return (self.ridge if record is self.case.wave else ridge(record)).wavelength(frequency)
        kappa = chain_wavenumber(
            record,
            frequency,
            self.case.network.length,
            velocity=self.long_wave.value,
            end=self.passband.end(record, self.passband.common),
            part=force_bearing(self.case.network)[record.chain_particle],
        )
        return 2 * np.pi / kappa

    def low_pass_wavelength(self, rule: int) -> float:
        """lambda / D of the linear wave at the frequency of a rule, in the order of `THRESHOLDS`.

        NaN where that frequency lies beyond the band edge of a crystal, as the rule's may.
        """
        return self.wavelength_at(self.low_pass[rule].value) / self.case.diameter

    def yade_wavelength(self, rule: int) -> float:
        """The same of the YADE run, at its own frequency; NaN where there is none."""
        if self.case.signals is None:
            return np.nan
        frequency = self.passband.of_yade[rule].value
        return self.wavelength_at(frequency, self.case.signals) / self.case.diameter

    @cached_property
    def f_max(self) -> float:
        """Highest natural frequency, Hz: of the files, else by `modal.modes.highest`."""
        modes, network = self.case.modes, self.case.network
        if modes is not None and len(modes.frequency) == 6 * network.n_particles:
            return float(modes.frequency[-1])
        found = self.case.highest
        if found is None:
            found = highest_modes(Eigenproblem.of(network), 1, certify=False)
        return float(found.frequency[-1])

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
    def gain(self) -> Gain:
        """Gain factor from the response file, else of the springs at the same resolution."""
        found = self.case.response
        if found is not None:
            return Gain(found.frequency, found.gain, found.resolution)
        return network_gain(self.case.network, self.case.passage)

    @cached_property
    def gain_place(self) -> float:
        """Frequency of the gain's first maximum, in f_1 = V_P / 2 L."""
        return self.gain.first_maximum()[0] * 2 * self.passage

    @cached_property
    def gain_orders(self) -> tuple[np.ndarray, np.ndarray]:
        """The gain's maxima (k,) as orders of two columns: f = r f_1, both walls held, and r - 1/2.

        Each maximum is looked up among the measured resonances r f_1, which bend with dispersion:
        the first is the order r at which a standing wave has its frequency, by interpolation; the
        second what is expected where the source wall is free of stress, 1/2, 3/2, ...
        """
        f, (f_r, kappa) = self.gain.maxima(), self.resonances
        if np.isfinite(self.low_pass[0].value):  # beyond it the walls hear no common wave
            f = f[f < self.low_pass[0].value]
        expected = np.arange(len(f)) + 0.5
        rising = np.isfinite(f_r) & (np.maximum.accumulate(np.nan_to_num(f_r)) == f_r)
        if rising.sum() < 2:
            return f / self.first_resonance, expected
        order = np.append(0.0, kappa[rising] * self.case.network.length / np.pi)
        return np.interp(f, np.append(0.0, f_r[rising]), order, right=np.nan), expected

    @property
    def passage(self) -> float:
        """Time, s, of the longest waves from wall to wall."""
        return self.case.network.length / self.long_wave.value

    @cached_property
    def gain_height(self) -> str:
        """The gain at its first maximum with its resolution, and an undamped column's under it."""
        height = self.gain.first_maximum()[1]
        if not np.isfinite(height):
            return ""
        same = self.gain.undamped(self.passage)
        return f"{height:.3g} at {self.gain.resolution:.0f} Hz (undamped column: {same:.3g})"


def groups(cases: list[Measures]) -> dict[str, list[Measures]]:
    """Cases by kind and mu_comp, each in order of stress: what the paper joins by lines."""
    found: dict[str, list[Measures]] = {}
    for m in sorted(cases, key=lambda m: m.case.stress):
        friction = f", mu_comp {m.case.mu_comp:g}" if np.isfinite(m.case.mu_comp) else ""
        name = "FCC" if m.case.is_crystal else f"random{friction}"
        found.setdefault(name, []).append(m)
    return found
