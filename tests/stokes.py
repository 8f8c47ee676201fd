"""Stokes' point force in an elastic solid: motion in closed form, near field included.

A force X(t) along x at the origin moves the point at the distance r along z by (K. Aki and P. G.
Richards, Quantitative Seismology, 2nd ed., Eq. 4.23, gamma_i gamma_j = 0)

    u_x = 1 / (4 pi rho) [ X(t - r / b) / (b^2 r) - 1 / r^3 int_{r/a}^{r/b} s X(t - s) ds ],

and a force along z moves it along z by

    u_z = 1 / (4 pi rho) [ X(t - r / a) / (a^2 r) + 2 / r^3 int_{r/a}^{r/b} s X(t - s) ds ],

with the velocities a of P- and b of S-waves. With Y' = X and Z' = Y the integral is that of the
parts -s Y(t - s) - Z(t - s) between its ends.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Stokes:
    """A point force of sine periods; velocities of P and S, m/s, density, kg/m^3, frequency, Hz."""

    v_p: float = 545.0
    v_s: float = 362.0
    density: float = 1700.0
    frequency: float = 1e4
    cycles: int = 1

    def force(self, time: np.ndarray) -> np.ndarray:
        """Return the force (nt,), N, of amplitude 1 N."""
        omega = 2 * np.pi * self.frequency
        inside = (time > 0) & (time < self.cycles / self.frequency)
        return np.where(inside, np.sin(omega * time), 0.0)

    def _integrals(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first and the second integral of the force (nt,), N s and N s^2."""
        omega = 2 * np.pi * self.frequency
        inside = np.clip(time, 0, self.cycles / self.frequency)
        first = (1 - np.cos(omega * inside)) / omega
        second = inside / omega - np.sin(omega * inside) / omega**2
        return first, second

    def _near_field(self, time: np.ndarray, r: float) -> np.ndarray:
        """Return the integral of the near field (nt,), N s^2."""

        def primitive(s: float) -> np.ndarray:
            first, second = self._integrals(time - s)
            return -s * first - second

        return primitive(r / self.v_s) - primitive(r / self.v_p)

    def transverse(self, time: np.ndarray, r: float) -> np.ndarray:
        """Return u_x (nt,), m, at the distance r, m, across a force along x."""
        far = self.force(time - r / self.v_s) / (self.v_s**2 * r)
        return (far - self._near_field(time, r) / r**3) / (4 * np.pi * self.density)

    def transverse_phase_delay(self, frequency: np.ndarray, r: float) -> np.ndarray:
        """Return the phase lag over omega (nf,), s, of u_x behind the force, in the cycle of r / b.

        With time dependence exp(i omega t) the integral over s of s exp(-i omega s) is closed.
        """
        omega = 2 * np.pi * frequency

        def primitive(s: float) -> np.ndarray:
            return np.exp(-1j * omega * s) * (1 + 1j * omega * s) / omega**2

        near = primitive(r / self.v_s) - primitive(r / self.v_p)
        transfer = np.exp(-1j * omega * r / self.v_s) / (self.v_s**2 * r) - near / r**3
        shift = np.angle(transfer * np.exp(1j * omega * r / self.v_s))
        return r / self.v_s - shift / omega
