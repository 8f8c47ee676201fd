"""What an S-wave of a case says: V_S, where its band ends, its dispersion and its gain.

The source wall slides along x or y, and all is recorded along it. The rules are those of the
P-wave, with what S-waves change: layers of a crystal turn as they slide, so that the neighbour
ratio of its chain is a polynomial of higher order.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.case import Case
from analysis.estimators.coherent import Coherent, coherent_wave, longest_waves
from analysis.estimators.damped_transform import Dispersion, chain_dispersion
from analysis.estimators.low_pass import Edge, Passband
from analysis.estimators.transfer import Gain, network_gain
from analysis.estimators.travel_time import first_peak_velocity
from analysis.value import Value, estimate
from modal.waves.signals import Signals

ORDER = 5
"""Of the crystal's neighbour ratio: turning layers bend cos(kappa l) over omega^2."""
LONGEST = 8.0
"""Wavelength, mean diameters, from which on a wave of a random packing counts as long."""


class ShearWave:
    """One record of a case's S-wave, each number measured when first asked for."""

    def __init__(self, case: Case, record: Signals) -> None:
        self.case, self.record = case, record

    @property
    def producer(self) -> str:
        """How tables and legends call what made the record."""
        return "YADE" if self.record.producer == "yade" else "linear wave"

    @cached_property
    def first_peak(self) -> Value:
        """V_S, m/s, of the first peaks along the chain's middle half."""
        network = self.case.network
        wall = float(network.wall_position[0])
        return estimate(*first_peak_velocity(self.record, wall, network.length))

    @cached_property
    def chain(self) -> Dispersion:
        """The dispersion of a crystal's chain."""
        return chain_dispersion(self.record, order=ORDER)

    @cached_property
    def coherent(self) -> Coherent:
        """The coherent wave of a random packing's layers, of long waves."""
        longest = self.first_peak.value / (LONGEST * self.case.diameter)
        return coherent_wave(self.record, self.case.network.length, highest=longest)

    @cached_property
    def long_wave(self) -> Value:
        """V_S, m/s, of the longest waves."""
        if self.case.is_crystal:
            return estimate(self.chain.velocity)
        return estimate(*longest_waves(self.coherent))

    @cached_property
    def low_pass(self) -> Edge:
        """f_low-pass, Hz, by the 2 % rule of the record's chain, cut by V_S."""
        case = self.case
        band = Passband(
            case.network,
            self.record,
            None,
            velocity=self.long_wave.value,
            crystal=case.is_crystal,
        )
        return band.low_pass[0]

    @property
    def dispersion(self) -> tuple[np.ndarray, np.ndarray]:
        """Wave number (k,), rad/m, and frequency (k,), Hz, of the wave as far as it is seen."""
        if self.case.is_crystal:
            kappa = np.linspace(0.01, 0.97, 97) * np.pi / self.chain.distance
            return kappa, self.chain.omega(kappa) / (2 * np.pi)
        wave = self.coherent
        seen = np.isfinite(wave.wavenumber)
        return wave.wavenumber[seen], wave.frequency[seen]

    @cached_property
    def gain(self) -> Gain:
        """Shear stress on the receiver over that on the source wall, of the springs."""
        case = self.case
        passage = case.network.length / self.long_wave.value
        return network_gain(case.network, passage, self.record.direction)
