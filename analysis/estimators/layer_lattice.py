"""Compute exact signals of a planar crystal, a lattice of layers between two walls.

A planar P-wave along [001] of an FCC crystal moves each layer as a whole. The layers move like a
chain of n masses m with springs C (Eq. 8) and a wall spring at each end. The eigenmodes of the
tridiagonal matrix and Duhamel's integral give this motion without time steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh_tridiagonal

from analysis.estimators.source_motion import recorded_motion
from modal.packing.network import Network
from modal.waves.motions import Motion, Pulse
from modal.waves.oscillator import oscillation
from modal.waves.signals import Signals

MAX_UNEVENNESS_IN_RADII = 1e-3
"""Largest range of z in one layer, and of the distances between layers, in radii."""
MAX_SLANT_ERROR = 1e-2
"""Largest deviation of nz^2 from 1/2, the value in FCC, for contacts between two layers; nz is the
z component of the unit normal."""
MIN_SLANT = 0.1
"""Least |nz| of a contact between two layers."""
MAX_RELATIVE_SPREAD = 0.01
"""Largest standard deviation of masses or stiffnesses, relative to the mean, that theory allows,
which has equal ones."""
CONTACTS_TO_NEXT_LAYER = 4


def is_fcc(network: Network) -> bool:
    """Return whether a packing is an FCC crystal whose layers (001) are parallel to the walls.

    Such a packing has equal spheres, flat layers of equal number at equal distances, and four
    contacts at 45 degrees from each sphere to the next layer; masses and stiffnesses are alike.
    """
    z = np.sort(network.position[:, 2])
    radius = float(network.radius.mean())
    layers = 1 + int((np.diff(z) > 0.5 * radius).sum())
    if layers < 3 or len(z) % layers or np.ptp(network.radius) > 1e-9 * radius:
        return False
    rows = z.reshape(layers, -1)
    unevenness = max(np.ptp(rows, axis=1).max(), np.ptp(np.diff(rows.mean(axis=1))))
    if not unevenness < MAX_UNEVENNESS_IN_RADII * radius:
        return False
    between = _between_layers(network)
    if between.sum() != CONTACTS_TO_NEXT_LAYER * rows.shape[1] * (layers - 1):
        return False
    if not (abs(network.normal[between, 2] ** 2 - 0.5) < MAX_SLANT_ERROR).all():
        return False
    properties = (
        network.mass,
        network.stiffness_normal[between],
        network.stiffness_tangential[between],
    )
    return all(bool(x.std() <= MAX_RELATIVE_SPREAD * x.mean()) for x in properties)


def _between_layers(network: Network) -> np.ndarray:
    """Return which contacts (m,) join spheres of two layers."""
    return (network.particle_j >= 0) & (abs(network.normal[:, 2]) > MIN_SLANT)


@dataclass(frozen=True)
class LayerLattice:
    """A row of equal masses, joined by equal springs, between two walls.

    Attributes
    ----------
    mass : float
        Mass, kg.
    stiffness, wall_stiffness : float
        Stiffness of the spring between two masses, and of that between an end mass and its wall,
        N/m.
    distance : float
        Distance of neighbouring masses, m.
    layers : int
        Number of masses.
    area : float
        Cross-section per mass, m^2, which turns forces on walls into stresses.
    wall_gap : float
        Distance of the first mass from the source wall, m.
    """

    mass: float
    stiffness: float
    wall_stiffness: float
    distance: float
    layers: int = 200
    area: float = 1.0
    wall_gap: float = 0.0

    @classmethod
    def of_network(cls, network: Network) -> LayerLattice:
        """Build the lattice that describes an FCC crystal of equal layers (`is_fcc`)."""
        z = np.sort(network.position[:, 2])
        layers = 1 + int(np.count_nonzero(np.diff(z) > 0.5 * network.radius.min()))
        between = _between_layers(network)
        normal_stiffness = np.median(network.stiffness_normal[between])
        tangential_stiffness = np.median(network.stiffness_tangential[between])
        at_wall = network.particle_j < 0
        spheres_per_layer = network.n_particles / layers
        return cls(
            mass=float(network.mass.mean()),
            stiffness=float(2 * (normal_stiffness + tangential_stiffness)),
            wall_stiffness=float(np.median(network.stiffness_normal[at_wall])),
            distance=float((z[-1] - z[0]) / (layers - 1)),
            layers=layers,
            area=network.area / spheres_per_layer,
            wall_gap=float(z[0] - network.wall_position[0]),
        )

    @property
    def velocity(self) -> float:
        """Return the long-wave velocity, m/s (Eq. 6)."""
        return self.distance * np.sqrt(self.stiffness / self.mass)

    @property
    def low_pass_frequency(self) -> float:
        """Return f_low-pass, Hz (Eq. 10)."""
        return np.sqrt(self.stiffness / self.mass) / np.pi

    def eigenmodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return angular frequencies (n,), rad/s, ascending, and orthonormal shapes (n, n).

        The columns of the second array are the shapes.
        """
        diagonal = np.full(self.layers, 2 * self.stiffness)
        diagonal[[0, -1]] = self.stiffness + self.wall_stiffness
        off_diagonal = np.full(self.layers - 1, -self.stiffness)
        square, shape = eigh_tridiagonal(diagonal / self.mass, off_diagonal / self.mass)
        return np.sqrt(np.maximum(square, 0)), shape

    def respond(self, motion: Motion, time: np.ndarray) -> np.ndarray:
        """Return the exact displacement (nt, n), m, of each layer for a motion of the source wall.

        `time` (nt,) is in s. The response is Duhamel's integral over the eigenmodes.
        """
        omega, shape = self.eigenmodes()
        push = self.wall_stiffness / self.mass * shape[0]
        return (push * oscillation(motion, omega**2, time).T) @ shape.T


def exact_twin(signals: Signals, lattice: LayerLattice) -> Signals:
    """Return exact signals of a lattice for the times and the motion of a recorded run."""
    return lattice_signals(lattice, signals.time, recorded_motion(signals))


def lattice_signals(
    lattice: LayerLattice, time: np.ndarray, motion: Motion | None = None
) -> Signals:
    """Return the signals that a run of the exact lattice would record at times (nt,), s.

    `motion` is that of the source wall, by default the study's pulse.
    """
    if motion is None:
        motion = Pulse()
    displacement = lattice.respond(motion, time)
    source = motion.displacement(time)
    stress_per_displacement = lattice.wall_stiffness / lattice.area
    return Signals(
        time=np.asarray(time, float),
        chain_particle=np.arange(lattice.layers),
        chain_position=lattice.wall_gap + lattice.distance * np.arange(float(lattice.layers)),
        chain_displacement=displacement,
        source_displacement=source,
        source_stress=stress_per_displacement * (source - displacement[:, 0]),
        receiver_stress=stress_per_displacement * displacement[:, -1],
        producer="exact",
        case="",
        amplitude=motion.amplitude,
        input_frequency=motion.frequency,
        time_step=float(time[1] - time[0]),
        run_time=0.0,
    )
