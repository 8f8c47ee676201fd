"""Compute the waves of an FCC crystal in closed form: planar P-waves and all Bloch branches.

The crystal is that of `modal.packing.crystal`; planar P-waves follow Eqs. 5-10 of Otsubo et al.
2017. With rotations the Bloch problem has six branches.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.packing.crystal import NORMALS, STEPS, FccPacking
from modal.tools.arrays import Complex, Floats
from modal.tools.display import Drawn, quantity


def dispersion(kappa: Floats, C: float, m: float, distance: float) -> Floats:
    """Return omega(kappa) = 2 sqrt(C/m) |sin(l kappa / 2)|, rad/s (Eqs. 5 and 9).

    The wave number `kappa` is in 1/m, C in N/m, m in kg, and the `distance` l of layers in m.
    """
    return 2 * np.sqrt(C / m) * np.abs(np.sin(distance * np.asarray(kappa) / 2))


def frequency_of_equal_turns(kt: float, lever: float, inertia: float) -> float:
    """Return the frequency, Hz, at which all spheres of an FCC crystal turn alike about any axis.

    At each of the twelve contacts of a sphere both ends slide against each other by 2 l, where l is
    the `lever`, m: omega^2 = 16 kt l^2 / I. No other motion is faster. `kt` in N/m, `inertia` I in
    kg m^2.
    """
    return float(np.sqrt(16 * kt * lever**2 / inertia) / (2 * np.pi))


@dataclass(frozen=True, repr=False)
class FccLattice(FccPacking, Drawn):
    """An endless face-centred cubic crystal of spheres, whose waves are known in closed form.

    Planar P-waves along z follow Eqs. 5-10 of Otsubo et al. 2017, section 3; `bloch` returns all
    six branches at any wavevector, rotations included.

    Parameters
    ----------
    stress : float, default 1e5
        Isotropic stress, Pa; it sets overlaps and stiffnesses by the contact law.
    radius : float, default 1.27e-3
        Radius of the spheres, m.
    material : Material, default glass
        60 GPa, Poisson's ratio 0.2, 2,230 kg/m^3.

    Raises
    ------
    InputError
        If the stress is not positive, or too high for the contact law.

    Examples
    --------
    >>> crystal = FccLattice(stress=1e5)
    >>> round(crystal.low_pass_frequency), round(crystal.velocity)
    (137616, 776)
    """

    def __repr__(self) -> str:
        return (
            f"<FccLattice: {quantity(self.stress, 'Pa')}, f_low-pass "
            f"{quantity(self.low_pass_frequency, 'Hz')}, V_P {self.velocity:.4g} m/s>"
        )

    def draw(self, ax: Any) -> None:
        """Draw the dispersion along z: all branches, and P-waves by Eq. 9."""
        along = np.linspace(0, 1, 101)
        kappa = np.pi / self.layer_distance * along
        branches = np.array([self.bloch(np.array([0.0, 0.0, k]))[0] for k in kappa])
        lines = ax.plot(along, branches / 1e3, color="0.6", linewidth=1)
        lines[0].set_label("all branches")
        omega = dispersion(kappa, self.C, self.mass, self.layer_distance)
        ax.plot(along, omega / (2e3 * np.pi), label="P-waves, Eq. 9")
        ax.set(xlabel=r"$\kappa l / \pi$", ylabel="frequency, kHz", xlim=(0, 1), ylim=(0, None))
        ax.legend()

    @property
    def C(self) -> float:
        """Return the stiffness between layers per sphere, 2 (kN + kT), N/m (Eq. 8)."""
        return 2 * (self.kn + self.kt)

    @property
    def low_pass_frequency(self) -> float:
        """Return f_low-pass = sqrt(C/m) / pi, Hz (Eq. 10)."""
        return np.sqrt(self.C / self.mass) / np.pi

    @property
    def velocity(self) -> float:
        """Return the velocity of long P-waves along z, l sqrt(C/m), m/s (Eq. 6).

        l is the distance of layers, C the stiffness between them, m the mass of a sphere.
        """
        return self.layer_distance * np.sqrt(self.C / self.mass)

    @property
    def highest_frequency(self) -> float:
        """Return the highest natural frequency of the endless crystal, Hz.

        In this mode all spheres turn alike, as in `frequency_of_equal_turns`.
        """
        inertia = 0.4 * self.mass * self.radius**2
        return frequency_of_equal_turns(self.kt, self.spacing / 2, inertia)

    @property
    def stiffness(self) -> Floats:
        """Return the elastic moduli (6, 6), Pa, in the order xx yy zz yz zx xy, engineering shears.

        Every sphere is a centre of symmetry, so that a uniform strain E moves no sphere beyond the
        mean. Nor does it turn any: the torque on a sphere is -kt l^2 sum n x (E n) over its
        contacts, the antisymmetric part of E times sum n n^T, which cubic symmetry makes 4 times
        unity. Therefore C = 1/V sum over six contacts of d^2 times (kn - kt) n n n n + kt times the
        symmetrised 1 n n (K. Walton, J. Mech. Phys. Solids 35, 213, 1987), with V = d^3 / sqrt(2).
        In the axes of the cube C11 = sqrt(2) (kn + kt) / d, C12 = (kn - kt) / (sqrt(2) d), C44 =
        C11 / 2; here x and y are turned by 45 degrees about z, which is an axis of the cube.
        """
        difference = self.kn - self.kt
        C = np.diag([2 * self.kt] * 3 + [self.kt] * 3)
        C[:3, :3] += difference * np.array([[1.25, 0.25, 0.5], [0.25, 1.25, 0.5], [0.5, 0.5, 1]])
        C[3:, 3:] += difference * np.diag([0.5, 0.5, 0.25])
        return np.sqrt(2) / self.spacing * C

    def neighbours(self) -> Floats:
        """Return the unit vectors (12, 3) towards the neighbours of a sphere."""
        half = NORMALS[: len(STEPS)]
        return np.concatenate([half, -half])

    def bloch_matrix(self, wavevector: Floats) -> Complex:
        """Return M^-1/2 K(k) M^-1/2, shape (6, 6), Hermitian, 1/s^2, for `wavevector` (3,), 1/m."""
        n = self.neighbours()
        stiffness = (self.kn - self.kt) * n[:, :, None] * n[:, None, :] + self.kt * np.eye(3)
        # Matrices that multiply by the lever from the left, column by column.
        lever = self.spacing / 2 * n[:, None]
        turn = np.cross(lever, np.eye(3)).transpose(0, 2, 1)
        identity = np.broadcast_to(np.eye(3), turn.shape)
        sphere = np.concatenate([-identity, turn], axis=2)
        neighbour = np.concatenate([identity, turn], axis=2)
        phase = np.exp(1j * self.spacing * n @ np.asarray(wavevector, float))
        matrix = np.einsum("cai,cab,cbj->ij", sphere, stiffness, sphere).astype(complex)
        matrix += np.einsum("cai,cab,cbj,c->ij", sphere, stiffness, neighbour, phase)
        inertia = 0.4 * self.mass * self.radius**2
        scale = 1 / np.sqrt(np.repeat([self.mass, inertia], 3))
        return matrix * scale[:, None] * scale

    def bloch(self, wavevector: Floats) -> tuple[Floats, Complex]:
        """Return the branches at a wavevector (3,), 1/m.

        Frequencies (6,), Hz, ascend; the vectors (6, 6) are columns.
        """
        square, vectors = np.linalg.eigh(self.bloch_matrix(wavevector))
        return np.sqrt(np.maximum(square, 0)) / (2 * np.pi), vectors
