"""Exact signals of the planar crystal: a lattice of layers between two walls, in closed form.

A planar P-wave along [001] of an FCC crystal moves each layer as a whole, so it is that of a
lattice of n masses m with springs C (Eq. 8) and a wall spring at each end. The eigenmodes of the
tridiagonal matrix and Duhamel's integral give its motion without any time stepping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh_tridiagonal

from analysis.estimators.source_motion import recorded_motion
from modal.packing.network import Network
from modal.waves.oscillator import oscillation
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse

FLAT = 1e-3
"""Of a radius: how far the centres of one layer of a crystal may be apart along z."""
UPRIGHT = 1e-2
"""How far nz^2 of a contact between two layers may be from FCC's 1/2."""

ALIKE = 0.01
"""Relative standard deviation up to which masses, or springs, count as one."""


def is_fcc(network: Network) -> bool:
    """Whether the packing is an FCC crystal whose layers (001) are parallel to the walls.

    Equal flat layers at equal distances, and four contacts from each sphere to the next layer, at
    45 degrees; masses and springs alike, as theory has them. What its case is called does not
    matter.
    """
    z, radius = np.sort(network.position[:, 2]), float(network.radius.mean())
    layers = 1 + int((np.diff(z) > 0.5 * radius).sum())
    if layers < 3 or len(z) % layers or np.ptp(network.radius) > 1e-9 * radius:
        return False
    rows = z.reshape(layers, -1)
    uneven = max(np.ptp(rows, axis=1).max(), np.ptp(np.diff(rows.mean(axis=1))))
    between = (network.particle_j >= 0) & (abs(network.normal[:, 2]) > 0.1)
    bonds = 4 * rows.shape[1] * (layers - 1)
    slanted = abs(network.normal[between, 2] ** 2 - 0.5) < UPRIGHT
    flat = uneven < FLAT * radius and between.sum() == bonds and slanted.all()
    springs = network.stiffness_normal[between], network.stiffness_tangential[between]
    return bool(flat and all(x.std() <= ALIKE * x.mean() for x in (network.mass, *springs)))


@dataclass(frozen=True)
class LayerLattice:
    """`layers` masses (kg), springs C and wall springs (N/m), layer distance and area per mass.

    first, wall_gap: z of the first centre and its distance from the wall, m; area, m^2, turns
    the wall force into a stress.
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
        """The lattice whose theory belongs to an FCC crystal (`is_fcc`) of equal layers."""
        z = np.sort(network.position[:, 2])
        layers = 1 + int(np.count_nonzero(np.diff(z) > 0.5 * network.radius.min()))
        inner = network.particle_j >= 0
        vertical = inner & (np.abs(network.normal[:, 2]) > 0.1)
        kn = np.median(network.stiffness_normal[vertical])
        kt = np.median(network.stiffness_tangential[vertical])
        per_layer = network.n_particles / layers
        return cls(
            mass=float(network.mass.mean()),
            stiffness=float(2 * (kn + kt)),
            wall_stiffness=float(np.median(network.stiffness_normal[~inner])),
            distance=float((z[-1] - z[0]) / (layers - 1)),
            layers=layers,
            area=network.area / per_layer,
            wall_gap=float(z[0] - network.wall_position[0]),
        )

    @property
    def velocity(self) -> float:
        """Long-wave velocity, m/s (Eq. 6)."""
        return self.distance * np.sqrt(self.stiffness / self.mass)

    @property
    def low_pass_frequency(self) -> float:
        """f_low-pass, Hz (Eq. 10)."""
        return np.sqrt(self.stiffness / self.mass) / np.pi

    def eigenmodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Angular frequencies (n,) rad/s ascending, and orthonormal shapes (n, n) in columns."""
        diagonal = np.full(self.layers, 2 * self.stiffness)
        diagonal[[0, -1]] = self.stiffness + self.wall_stiffness
        off = np.full(self.layers - 1, -self.stiffness)
        square, shape = eigh_tridiagonal(diagonal / self.mass, off / self.mass)
        return np.sqrt(np.maximum(square, 0)), shape

    def follows(self, motion: Motion, time: np.ndarray) -> np.ndarray:
        """Exact displacement of each layer, (nt, n) m, for a motion of the wall (Duhamel)."""
        omega, shape = self.eigenmodes()
        push = self.wall_stiffness / self.mass * shape[0]
        return (push * oscillation(motion, omega**2, time).T) @ shape.T


def exact_twin(signals: Signals, lattice: LayerLattice) -> Signals:
    """The exact lattice at the very times and under the very motion of a recorded run."""
    return lattice_signals(lattice, signals.time, recorded_motion(signals))


def lattice_signals(
    lattice: LayerLattice, time: np.ndarray, motion: Motion | None = None
) -> Signals:
    """Signals of the exact lattice as a run would have recorded them at times (nt,), s.

    `motion` is the source wall's, by default the study's pulse.
    """
    motion = motion or Pulse()
    u, source = lattice.follows(motion, time), motion.displacement(time)
    spring = lattice.wall_stiffness / lattice.area
    return Signals(
        time=np.asarray(time, float),
        chain_particle=np.arange(lattice.layers),
        chain_position=lattice.wall_gap + lattice.distance * np.arange(float(lattice.layers)),
        chain_displacement=u,
        source_displacement=source,
        source_stress=spring * (source - u[:, 0]),
        receiver_stress=spring * u[:, -1],
        producer="exact",
        case="",
        amplitude=motion.amplitude,
        input_frequency=motion.frequency,
        time_step=float(time[1] - time[0]),
        run_time=0.0,
    )
