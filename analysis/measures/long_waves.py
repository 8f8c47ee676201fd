"""V_P of a case by its longest waves, by its springs at rest and by theory; density, contacts."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.case import Case
from analysis.estimators.coherent import Coherent, longest_waves
from analysis.estimators.damped_transform import chain_dispersion
from analysis.estimators.effective_medium import moduli_of, of_contacts, of_means
from analysis.estimators.own_wave import coherent_of
from analysis.estimators.transfer import at_frequency, wall_velocity
from analysis.value import Value, estimate
from modal.packing.contact_law import sphere_volume
from modal.packing.state import contacts_per_particle, coordination_without_rattlers, void_ratio
from modal.waves.signals import Signals

LOW_ORDER = 10
"""Low frequency means that of the standing wave r = 10, wavelength L / 5."""


class LongWaves:
    """Density, contacts and long waves of one case, each measured when first asked for."""

    def __init__(self, case: Case) -> None:
        self.case = case

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
        return coherent_of(self.case.network, record, self.case.is_crystal)

    @cached_property
    def low_frequency(self) -> float:
        """Frequency, Hz, of the wavelength L / 5."""
        return LOW_ORDER * self.long_wave.value / (2 * self.case.network.length)

    @cached_property
    def long_wave(self) -> Value:
        """V_P, m/s, of the longest waves of the linear wave: the reference for all else.

        For crystals by the damped transform, which is unbiased there.
        """
        if self.case.is_crystal:
            return estimate(chain_dispersion(self.case.wave).velocity)
        return estimate(*longest_waves(self.coherent))

    @cached_property
    def yade_long_wave(self) -> Value:
        """The same of the YADE run; NaN where there is none."""
        if self.case.is_crystal and self.case.signals is not None:
            return estimate(chain_dispersion(self.case.signals).velocity)
        found = self.yade_coherent
        return estimate(np.nan) if found is None else estimate(*longest_waves(found))

    @property
    def passage(self) -> float:
        """Time, s, of the longest waves from wall to wall."""
        return self.case.network.length / self.long_wave.value

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
    def effective(self) -> tuple[float, float]:
        """V_P, m/s, by effective medium theory: of the contacts, and of the means alone."""
        network = self.case.network
        means = of_means(
            self.void_ratio,
            self.coordination[0],
            self.case.stress,
            0.5 * self.case.diameter,
            moduli_of(network),
            float(network.mass.sum() / sphere_volume(network.radius).sum()),
        )
        return of_contacts(network).velocity, means.velocity
