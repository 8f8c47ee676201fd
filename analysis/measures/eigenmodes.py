"""What a case's eigenmodes say: resonances, V_P by them, the highest frequency, chi_z."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from analysis.estimators.damped_transform import mode_dispersion
from analysis.estimators.resonances import (
    Standing,
    fitted_wavenumbers,
    long_wave_velocity,
    standing_modes,
)
from analysis.measures.first_peaks import FirstPeaks
from analysis.measures.long_waves import LOW_ORDER
from analysis.value import Value, estimate
from modal.modes.eigenmodes import highest_modes
from modal.packing.rattlers import force_bearing
from modal.packing.state import contacts_per_particle
from modal.system.linear_system import LinearSystem

SAME = 1e-6
"""Relative difference of two frequencies that are one mode's, of two searches."""


class Eigenmodes(FirstPeaks):
    """The eigenmodes of one case, where there are any."""

    @cached_property
    def standing(self) -> Standing | None:
        """Modes that bear the standing waves of a random packing; None without mode shapes."""
        if self.case.is_crystal or self.case.z_shapes is None:
            return None
        return standing_modes(self.case.modes.frequency, self.case.z_shapes, self.case.network)

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
    def modal(self) -> Value:
        """V_P, m/s, of the modes' wave numbers by Eq. 4, from omega = V kappa (1 + b kappa^2)."""
        return estimate(*long_wave_velocity(*self.resonances))

    @cached_property
    def modal_fitted(self) -> Value:
        """V_P, m/s, of wave numbers that are fitted to the modes' shapes."""
        modes, network = self.case.modes, self.case.network
        if modes is None:
            return estimate(np.nan)
        if self.case.is_crystal and modes.resonance_shape is not None:
            f, distance = self.resonances[0], self.case.lattice.distance
            return estimate(mode_dispersion(f, modes.resonance_shape, distance).velocity)
        if self.standing is None:
            return estimate(np.nan)
        bearing = force_bearing(network)
        depth = network.position[bearing, 2] - network.wall_position[0]
        rows = self.standing.row[:LOW_ORDER]
        kappa = fitted_wavenumbers(self.case.z_shapes[rows][:, bearing], depth, network.length)
        return estimate(*long_wave_velocity(self.standing.frequency[:LOW_ORDER], kappa))

    @cached_property
    def f_max(self) -> float:
        """Highest natural frequency, Hz: of the files, else by `modal.modes.eigenmodes`."""
        modes, network = self.case.modes, self.case.network
        if modes is not None and len(modes.frequency) == 6 * network.n_particles:
            return float(modes.frequency[-1])
        found = self.case.highest
        if found is None:
            found = highest_modes(LinearSystem.of(network), 1, certify=False)
        return float(found.frequency[-1])

    @cached_property
    def highest_seat(self) -> tuple[float, float]:
        """How many spheres move in the highest mode (participation), contacts of the first.

        NaN without its shape.
        """
        found = self.case.highest
        if found is None or found.mode_shape is None:
            return np.nan, np.nan
        moved = (found.mode_shape[-1] ** 2)[:, :3].sum(axis=1)
        contacts = contacts_per_particle(self.case.network)[int(np.argmax(moved))]
        return float(moved.sum() ** 2 / (moved**2).sum()), float(contacts)

    @cached_property
    def moved(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Frequency (k,) Hz, chi_z of all particles and of the chain (k,), of each list of modes.

        Lists are complete in their intervals: of a later one only what lies beyond the one before.
        """
        lists = [s for s in (self.case.modes, self.case.band) if s is not None and len(s.frequency)]
        found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        end = -np.inf
        for modes in sorted(lists, key=lambda s: float(s.frequency[0])):
            new = modes.frequency > end * (1 + SAME)
            if new.any():
                found.append((modes.frequency[new], modes.chi_z[new], modes.chi_z_chain[new]))
                end = float(modes.frequency[-1])
        return found

    def chi_between(self, low: float, high: float, chain: bool) -> tuple[np.ndarray, np.ndarray]:
        """Natural frequencies (k,) between two Hz, and chi_z of each (k,).

        Of the chain, as in the paper, or of all particles; empty where no mode is at hand.
        """
        if not self.moved:
            return np.empty(0), np.empty(0)
        f, every, along = (np.concatenate(part) for part in zip(*self.moved, strict=True))
        inside = (f > low) & (f < high)
        return f[inside], (along if chain else every)[inside]

    def largest_chi(self, low: float, high: float, chain: bool) -> tuple[float, str]:
        """Largest chi_z between two Hz, and of which modes."""
        f, chi = self.chi_between(low, high, chain)
        if not len(f):
            return np.nan, ""
        return float(chi.max()), f"{len(f)} modes, {f.min() / 1e3:.2f}-{f.max() / 1e3:.2f} kHz"

    def mean_chi(self, low: float, high: float) -> Value:
        """Mean chi_z of the chain between two Hz, 1/3 where motion has no direction.

        Its error is the standard error of as many independent modes.
        """
        chi = self.chi_between(low, high, chain=True)[1]
        if len(chi) < 2:
            return estimate(np.nan)
        return estimate(float(chi.mean()), float(chi.std(ddof=1) / len(chi) ** 0.5))
