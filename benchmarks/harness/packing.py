"""Packings of benchmarks: of known spectrum, of any size; bytes that a product K u moves."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

from benchmarks.harness.measure import ROOT, Job
from modal.exchange.registry import read
from modal.modes.eigenmodes import modes_of
from modal.modes.zero_modes import by_structure
from modal.packing.network import RECEIVER_WALL, Network
from modal.packing.tiling import repeat
from modal.preparation.random_packing import random_packing
from modal.system.contacts import motion_of_contacts, slip, springs
from modal.system.linear_system import LinearSystem, frequency_of
from modal.system.operator import ContactOperator
from modal.waves.motions import INPUT_FREQUENCY

SAMPLE = ROOT / "results" / "samples" / "case06.sample.h5"
"""35,201 spheres without friction at 100 kPa."""
STRESS = 1e5
"""Pa."""
ASPECT = 5.0
"""Length over width, long enough for waves, short enough for dense matrices of a wide packing."""


@dataclass(frozen=True)
class KnownPacking:
    """A random packing with its whole spectrum.

    Attributes
    ----------
    path : str
        File of its network.
    system : LinearSystem
        Its stiffness and masses.
    exact : ndarray (6 n,)
        All frequencies, Hz, ascending.
    """

    path: str
    system: LinearSystem
    exact: np.ndarray

    @classmethod
    def of(cls, spheres: int, job: Job) -> "KnownPacking":
        """Make a packing without friction at 100 kPa, and write it to the folder of the job."""
        network = random_packing(spheres, STRESS, aspect=ASPECT)
        system = LinearSystem.of(network)
        return cls(job.write(network), system, spectrum(system))

    @property
    def floppy(self) -> int:
        """Number of modes without energy; they come first in `exact`."""
        return by_structure(self.system).total

    def __str__(self) -> str:
        return (
            f"random packing without friction, {self.system.network.n_particles} spheres, "
            f"{self.system.size} degrees of freedom, {self.floppy} of them floppy"
        )


def by_energy(system: LinearSystem, first: int, count: int) -> np.ndarray:
    """Return frequencies (count,), Hz, of modes from number `first` on, by their springs' energy.

    omega^2 is the sum of d . k d over the contacts divided by u . M u, for dense eigenvectors u.
    The elongations d = B u of a low mode are small differences of its displacements, with an error
    of the unit round-off times f_max / f; a matrix K holds their squares, with this factor squared.
    """
    _, vectors = eigh(system.dynamical_matrix.toarray(), subset_by_index=[first, first + count - 1])
    u = system.sqrt_mass.over(vectors).reshape(-1, 6, count)
    network = system.network
    motion = np.stack([motion_of_contacts(network, mode) for mode in np.moveaxis(u, 2, 0)], axis=2)
    d = slip(network) @ motion
    energy = (d * (springs(network) @ d)).sum(axis=(0, 1))
    return frequency_of(energy / (vectors**2).sum(axis=0))


def spectrum(system: LinearSystem) -> np.ndarray:
    """Return all frequencies, Hz, ascending, from the dense mass-scaled matrix."""
    return frequency_of(eigh(system.dynamical_matrix.toarray(), eigvals_only=True))


def sample_or_small(spheres: int, quick: bool, aspect: float = ASPECT) -> Network:
    """Return the committed sample, or a new packing of `spheres` if `quick`."""
    if quick:
        return random_packing(spheres, STRESS, aspect=aspect)
    return read(SAMPLE)


def resized(sample: Network, spheres: int) -> Network:
    """Return the lower part of a sample with so many spheres, or copies of it side by side.

    Contacts of the lower part with spheres above the cut are removed. Its highest sphere gets a
    contact with the receiver wall, taken from the sample's upper end, so that a wave is received.
    """
    if spheres > 1.5 * sample.n_particles:
        times = round(spheres / sample.n_particles)
        across = max(d for d in range(1, int(np.sqrt(times)) + 1) if times % d == 0)
        return repeat(sample, times // across, across)
    if spheres >= sample.n_particles:
        return sample
    inside = np.flatnonzero((sample.particle_i < spheres) & (sample.particle_j < spheres))
    at_wall = np.flatnonzero(sample.particle_j == RECEIVER_WALL)[0]
    part = sample.with_contacts(np.append(inside, at_wall))
    low, high = sample.wall_position
    z = sample.position[:, 2]
    top = int(np.argmax(sample.position[:spheres, 2]))
    return replace(
        part,
        **{k: getattr(sample, k)[:spheres] for k in ("position", "radius", "mass", "inertia")},
        particle_i=np.append(part.particle_i[:-1], top),
        wall_position=np.array([low, z[top] + high - z[sample.particle_i[at_wall]]]),
    )


def step_and_records(network: Network, fraction: float, interval: float) -> tuple[float, int]:
    """Return a time step, s, of at most `fraction` of its limit, and the steps between records.

    The step divides the period of the pulse; the interval of the records, s, is that to half a
    step.
    """
    highest = float(modes_of(LinearSystem.of(network), highest=1, certify=False).frequency[-1])
    steps = math.ceil(math.pi * highest / (fraction * INPUT_FREQUENCY))
    return 1 / (INPUT_FREQUENCY * steps), max(1, round(steps * INPUT_FREQUENCY * interval))


def bytes_of(product: ContactOperator | csr_matrix) -> float:
    """Return the bytes that a product moves through memory.

    The loop over contacts also reads its result, a sparse matrix does not.
    """
    if isinstance(product, ContactOperator):
        per_row = 24.0 if product.has_loops else 16.0
        return product.nbytes + per_row * product.shape[0]
    arrays = (product.data, product.indices, product.indptr)
    return sum(array.nbytes for array in arrays) + 16.0 * product.shape[0]
