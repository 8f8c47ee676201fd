"""What the paper's Tables 1 and 2 state of a case, measured from its files, with errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import eigsh

from analysis.coherent import Coherent, coherent_wave
from analysis.dispersion import chain_dispersion, mode_dispersion
from analysis.effective_medium import of_contacts, of_means
from analysis.gain import Gain, gain_factor
from analysis.lowpass import Plateau, flattest, threshold_curves
from analysis.products import Products
from analysis.velocity import at_frequency, first_peak_times, wall_velocity
from modal.layers import force_bearing
from modal.operator import ContactOperator
from modal.statistics import contacts_per_particle, coordination_without_rattlers

LOW_ORDER = 10
"""Low frequency means that of the standing wave r = 10, wavelength L / 5."""
WIDTH = 20.0
"""Stretch of a plateau, diameters."""
NEAR = 5.0
"""From where on distances count, diameters: nearer, the wall's own field is seen."""


@dataclass(frozen=True)
class Estimate:
    """A value and its uncertainty, in SI units; NaN where it is unknown."""

    value: float
    error: float = np.nan


class Measures:
    """Measurements of one case, each made when first asked for."""

    def __init__(self, case: Products) -> None:
        self.case = case

    @cached_property
    def void_ratio(self) -> float:
        """Wall to wall."""
        network = self.case.network
        solid = float((4 / 3 * np.pi * network.radius**3).sum())
        return float(np.prod(network.cell_size[:2])) * network.length / solid - 1

    @cached_property
    def coordination(self) -> tuple[float, float]:
        """Contacts a particle: all, and among those that bear force."""
        network = self.case.network
        return float(contacts_per_particle(network).mean()), coordination_without_rattlers(network)[
            0
        ]

    @cached_property
    def first_peak(self) -> Estimate:
        """dL/dt of the first peaks along the chain, middle half, m/s; the error is the slope's."""
        record = self.case.record
        z, times = record.chain_position, first_peak_times(record)
        depth = (z - self.case.network.wall_position[0]) / self.case.network.length
        known = np.isfinite(times) & (depth > 0.25) & (depth < 0.75)
        if known.sum() < 5:
            return Estimate(np.nan)
        (slope, _), spread = np.polyfit(z[known], times[known], 1, cov=True)
        return Estimate(float(1 / slope), float(np.sqrt(spread[0, 0]) / slope**2))

    @cached_property
    def coherent(self) -> Coherent:
        """The coherent wave of the linear record, to the highest frequency that is looked at."""
        case = self.case
        highest = (0.5 if case.is_crystal else 0.2) * of_contacts(case.network).velocity
        highest /= case.diameter
        wave = case.wave
        if case.is_crystal:  # slabs a diameter thick would beat with its layers
            wave = replace(wave, layer_displacement=None)
        return coherent_wave(wave, case.network.length, highest=highest)

    @cached_property
    def low_frequency(self) -> float:
        """Frequency, Hz, of the wavelength L / 5."""
        return LOW_ORDER * self.long_wave.value / (2 * self.case.network.length)

    @cached_property
    def long_wave(self) -> Estimate:
        """V_P, m/s, of the longest waves: kappa over omega of the coherent wave, to zero.

        Extrapolated in f^2 over the lowest fifth of the frequencies; the error is the fit's. For
        crystals the damped transform, which is unbiased there.
        """
        if self.case.is_crystal:
            return Estimate(chain_dispersion(self.case.record).velocity)
        wave = self.coherent
        slowness = 1 / wave.phase_velocity
        known = np.flatnonzero(np.isfinite(slowness))
        known = known[2 : max(8, len(known) // 3)]
        if len(known) < 5:
            return Estimate(np.nan)
        fit, spread = np.polyfit(wave.frequency[known] ** 2, slowness[known], 1, cov=True)
        return Estimate(float(1 / fit[1]), float(np.sqrt(spread[1, 1]) / fit[1] ** 2))

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
    def resonances(self) -> tuple[np.ndarray, np.ndarray]:
        """f_r (Hz), kappa_r (1/m): pure modes of a crystal, else the structure factor's ridge."""
        modes, structure = self.case.modes, self.case.structure
        if modes is not None and modes.resonance_frequency is not None and self.case.is_crystal:
            return modes.resonance_frequency, modes.resonance_wavenumber
        if structure is not None:
            return structure.ridge()[0], structure.wavenumber
        return np.empty(0), np.empty(0)

    @cached_property
    def modal(self) -> Estimate:
        """V_P, m/s: slope of the modes' omega = V kappa (1 + b kappa^2), r = 2 ... 10."""
        f, kappa = self.resonances
        modes = self.case.modes
        if self.case.is_crystal and modes is not None and modes.resonance_shape is not None:
            chain = self.case.chain
            return Estimate(mode_dispersion(f, modes.resonance_shape, chain.distance).velocity)
        if len(f) < LOW_ORDER:
            return Estimate(np.nan)
        part = slice(1, LOW_ORDER)
        fit, spread = np.polyfit(kappa[part] ** 2, 2 * np.pi * f[part] / kappa[part], 1, cov=True)
        return Estimate(float(fit[1]), float(np.sqrt(spread[1, 1])))

    @cached_property
    def effective(self) -> tuple[float, float]:
        """V_P, m/s, by effective medium theory: of the contacts, and of the means alone."""
        network = self.case.network
        radius = 0.5 * self.case.diameter
        means = of_means(self.void_ratio, self.coordination[0], self.case.stress, radius)
        return of_contacts(network).velocity, means.velocity

    @property
    def highest(self) -> float:
        """Spectra are looked at up to 0.7 V_P / D of a crystal (edge: 0.45), 0.4 of others, Hz."""
        return (0.7 if self.case.is_crystal else 0.4) * self.long_wave.value / self.case.diameter

    @cached_property
    def thresholds(self) -> tuple[np.ndarray, np.ndarray]:
        """Distance of the layers (nl,) m, and their 2 % and 1 % frequencies (2, nl), Hz."""
        wave, walls = self.case.wave, self.case.network.wall_position
        z, u = wave.layer_position, wave.layer_displacement
        if self.case.is_crystal:  # its own layers, not slabs a diameter thick
            z, u = wave.chain_position, wave.chain_displacement
        return z - walls[0], threshold_curves(wave.time, u, (0.02, 0.01), self.highest)

    @cached_property
    def particle_thresholds(self) -> tuple[np.ndarray, np.ndarray]:
        """The same of every force-bearing particle: all chains of the sample, not one."""
        case = self.case
        bearing = np.flatnonzero(force_bearing(case.network))
        u = case.wave.particle_displacement[:, bearing]
        distance = case.network.position[bearing, 2] - case.network.wall_position[0]
        return distance, threshold_curves(case.wave.time, u, (0.02, 0.01), self.highest)

    @cached_property
    def low_pass(self) -> tuple[Plateau, Plateau]:
        """f_low-pass, Hz, by the 2 % and the 1 % rule: the plateau of the layers' values."""
        return self._plateaus(*self.thresholds)

    @cached_property
    def particle_low_pass(self) -> tuple[Plateau, Plateau]:
        """The same of single particles: its error is what the choice of a chain is worth."""
        return self._plateaus(*self.particle_thresholds)

    def _plateaus(self, distance: np.ndarray, found: np.ndarray) -> tuple[Plateau, Plateau]:
        """As far as half of what the record reaches, and off the receiver wall."""
        case, near = self.case, NEAR * self.case.diameter
        reach = 0.5 * case.wave.time[-1] * self.long_wave.value
        last = min(reach, case.network.length - near)
        two, one = (flattest(distance, row, WIDTH * case.diameter, near, last) for row in found)
        return two, one

    @cached_property
    def band_edge(self) -> float:
        """f_low-pass of a crystal, Hz, without the threshold's bias; NaN for others."""
        if not self.case.is_crystal:
            return np.nan
        return chain_dispersion(self.case.record).low_pass_frequency

    def wavelength_at(self, frequency: float) -> float:
        """Wavelength, m, of the coherent wave at a frequency, Hz.

        Where its wave number is no longer measured, from the structure factor's ridge.
        """
        if self.case.is_crystal:
            found = chain_dispersion(self.case.record)
            cosine = np.clip(found.cosine(2 * np.pi * frequency), -1, 1)
            return 2 * np.pi * found.distance / float(np.arccos(cosine))
        kappa = self.coherent.at(frequency, self.coherent.wavenumber)
        f, wavenumber = self.resonances
        rising = np.maximum.accumulate(f) == f if len(f) else np.zeros(0, bool)
        if not np.isfinite(kappa) and rising.sum() > 1:
            kappa = float(np.interp(frequency, f[rising], wavenumber[rising], right=np.nan))
        return 2 * np.pi / kappa

    @cached_property
    def f_max(self) -> float:
        """Highest natural frequency, Hz: of a full spectrum in the files, else by Lanczos."""
        modes, network = self.case.modes, self.case.network
        if modes is not None and len(modes.frequency) == 6 * network.n_particles:
            return float(modes.frequency[-1])
        operator = ContactOperator(network, mass_scaled=True)
        start = np.random.default_rng(1).standard_normal(operator.shape[0])
        square = eigsh(operator, k=1, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)
        return float(np.sqrt(square[0]) / (2 * np.pi))

    @cached_property
    def gain(self) -> Gain | None:
        """Gain factor from the response file, else of the linear wave, to 20 kHz."""
        if self.case.response is not None:
            return Gain(*self.case.response)
        record = self.case.long_wave
        return gain_factor(record, float(record.time[-1]))
