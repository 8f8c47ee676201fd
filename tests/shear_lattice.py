"""S-waves of the crystal along [001]: layers that slide and turn, in closed form.

A transverse wave along z moves each layer of the FCC as a whole: by u along x and by an angle theta
about y. Let d be the distance of neighbours, du the slide of the upper of two layers against the
lower one, and S = d (theta + theta') / 2. The energy between two layers, for each sphere, is
((kn + 3 kt) du^2 - 4 sqrt(2) kt du S + 3 kt S^2) / 2; neighbours inside a layer add
kt d^2 theta^2 / 2. Two coupled branches follow, as in O. Mouraille's thesis (Twente, 2009). The
modes between walls are those of a banded matrix.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from modal.theory.fcc import FccLattice


def driven_by_pulse(time: np.ndarray, omega: np.ndarray, frequency: float) -> np.ndarray:
    """Return oscillators (nt, n), s^2, of omega (n,), rad/s, driven by one period of 1 - cos.

    This is the response to an endless 1 - cos, minus the same a period later, each by Duhamel's
    integral from rest.
    """
    drive = 2 * np.pi * frequency

    def endless(time: np.ndarray) -> np.ndarray:
        """Return the response to 1 - cos from t = 0 on."""
        t = np.maximum(time, 0.0)[:, None]
        static = 2 * (np.sin(omega * t / 2) / omega) ** 2
        beat = t * np.sinc((omega - drive) * t / (2 * np.pi))
        return static - beat * np.sin((omega + drive) * t / 2) / (omega + drive)

    return endless(np.asarray(time)) - endless(np.asarray(time) - 1 / frequency)


@dataclass(frozen=True)
class ShearLattice:
    """Layers of an FCC crystal between two flat walls, sliding along x, for S-waves along z.

    `layers` in number; wall_stiffness, N/m, tangential, and lever, m, from centre to wall.
    """

    crystal: FccLattice
    layers: int
    wall_stiffness: float
    lever: float

    @classmethod
    def of_crystal(cls, crystal: FccLattice, layers: int = 200) -> "ShearLattice":
        """Return the lattice of a crystal between flat walls of its own material."""
        root = np.sqrt(crystal.radius * crystal.wall_overlap)
        normal = 2 * crystal.material.effective_young * root
        tangential = float(normal * crystal.kt / crystal.kn)
        lever = crystal.radius - crystal.wall_overlap / 2
        return cls(crystal, layers, tangential, lever)

    @property
    def velocity(self) -> float:
        """Return the long-wave velocity, m/s: V^2 = (kn + kt) l^2 / m.

        Turning layers reduce the 3 kt of sliding layers to kt.
        """
        crystal = self.crystal
        return crystal.layer_distance * float(np.sqrt((crystal.kn + crystal.kt) / crystal.mass))

    def branches(self, kappa: np.ndarray) -> np.ndarray:
        """Return both branches (2, nk), rad/s, at wave numbers (nk,), rad/m."""
        crystal = self.crystal
        kn = crystal.kn
        kt = crystal.kt
        half = np.asarray(kappa, float) * crystal.layer_distance / 2
        sine = np.sin(half)
        cosine = np.cos(half)
        inertia = 0.4 * crystal.mass * crystal.radius**2
        # omega^2 of sliding alone and of turning alone, and the square of their coupling.
        slide = 4 * (kn + 3 * kt) * sine**2 / crystal.mass
        turn = kt * crystal.spacing**2 * (3 * cosine**2 + 1) / inertia
        coupling = 32 * (kt * crystal.spacing * sine * cosine) ** 2 / (crystal.mass * inertia)
        mean = (slide + turn) / 2
        root = np.sqrt((slide - turn) ** 2 / 4 + coupling)
        square = np.array([mean - root, mean + root])
        return np.sqrt(np.maximum(square, 0))

    def eigenmodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return angular frequencies (2n,), rad/s, and mass-scaled unit shapes (2n, 2n).

        Rows are u and theta of each layer in turn.
        """
        kn = self.crystal.kn
        kt = self.crystal.kt
        d = self.crystal.spacing
        n = self.layers
        # Slide and mean turn of a pair of layers in terms of u, theta, u', theta'.
        rows = np.array([[-1, 0, 1, 0], [0, d / 2, 0, d / 2]])
        coupling = -2 * np.sqrt(2) * kt
        spring = np.array([[kn + 3 * kt, coupling], [coupling, 3 * kt]])
        pair = rows.T @ spring @ rows
        K = np.zeros((2 * n, 2 * n))
        for layer in range(n - 1):
            ends = slice(2 * layer, 2 * layer + 4)
            K[ends, ends] += pair
        turns = np.arange(1, 2 * n, 2)
        K[turns, turns] += kt * d**2
        for end, lever in ((slice(0, 2), self.lever), (slice(2 * n - 2, 2 * n), -self.lever)):
            slip = np.array([-1, lever])
            K[end, end] += self.wall_stiffness * np.outer(slip, slip)
        scale = self._scale()
        square, shape = eigh(K * np.outer(scale, scale))
        return np.sqrt(np.maximum(square, 0)), shape

    def _scale(self) -> np.ndarray:
        """Return the inverse roots (2n,) of mass and moment of inertia of each layer in turn."""
        mass = self.crystal.mass
        inertia = 0.4 * mass * self.crystal.radius**2
        return np.tile(1 / np.sqrt([mass, inertia]), self.layers)

    def displacement(self, time: np.ndarray, amplitude: float, frequency: float) -> np.ndarray:
        """Return the exact u of each layer (nt, n), m, when the source wall moves by the pulse."""
        omega, shape = self.eigenmodes()
        scale = self._scale()
        push = amplitude * self.wall_stiffness * np.array([1, -self.lever]) * scale[:2]
        force = push @ shape[:2]
        motion = force * driven_by_pulse(time, omega, frequency)
        return (motion @ shape.T * scale)[:, ::2]
