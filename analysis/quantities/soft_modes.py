"""Measure the modes below the first wave of a periodic cell: participation and rotation.

The longest wave that fits into a cell has the frequency V_S divided by the cell's side. Modes below
this frequency are not waves, and are soft only because of disorder. E. Lerner, G. During and E.
Bouchbinder, Phys. Rev. Lett. 117, 035501 (2016) used small cells for this reason.
"""

from typing import NamedTuple

import numpy as np

from analysis.estimators.structure_factor import wave_vectors
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request
from analysis.quantities.spectrum import step_of_modes
from analysis.steps import Step
from analysis.value import Value
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import ModeSet
from modal.packing.precision import taken_as_exact
from modal.packing.state import contacts_per_particle
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError


class LowestWave(NamedTuple):
    """The longest shear wave of a periodic cell: velocity, m/s, and waves per length, 1/m."""

    velocity: float
    waves_per_length: float

    @property
    def frequency(self) -> float:
        """Return the frequency, Hz."""
        return self.velocity * self.waves_per_length


@cached_on_packing
def lowest_wave(packing: PackingData) -> LowestWave:
    """Return the shear wave of lowest frequency along an axis of a cell without walls.

    Raises UnavailableError for a cell that is not periodic along all three axes.
    """
    if not packing.network.cell_periodic.all():
        raise UnavailableError(
            "not_periodic",
            "between walls waves have other frequencies",
            remedy="take a periodic cell",
        )
    waves = []
    for vector in wave_vectors(packing.network, np.eye(3, dtype=int)):
        waves_per_length = float(np.linalg.norm(vector)) / (2 * np.pi)
        velocity = float(packing.moduli.velocities(vector)[-1])
        waves.append(LowestWave(velocity, waves_per_length))
    return min(waves, key=lambda wave: wave.frequency)


@cached_on_packing
def soft_modes(packing: PackingData) -> ModeSet:
    """Compute all modes below the first wave except zero modes, certified to be complete.

    Raises UnavailableError if there is none, or if modes are missing.
    """
    modes = eigenmodes(taken_as_exact(packing.network), below=lowest_wave(packing).frequency)
    if modes.missing or not len(modes.frequency):
        raise UnavailableError(
            "not_converged", f"below the first wave {modes.missing} modes are missing of some"
        )
    return modes


@on_request("Hz", definition="slowest V_S along an axis over the side of a periodic cell")
def first_wave(packing: PackingData) -> Value:
    """Measure the frequency of the longest shear wave by the moduli."""
    return Value(lowest_wave(packing).frequency, "Hz", steps=_steps_of_wave(packing))


def _steps_of_wave(packing: PackingData) -> tuple[Step, ...]:
    """Return the moduli, and the longest shear wave that follows from them, as steps."""
    wave = lowest_wave(packing)
    numbers = {
        "velocity": wave.velocity,
        "side": 1 / wave.waves_per_length,
        "frequency": wave.frequency,
    }
    return (
        Step("fit", "converged", {"residual": packing.moduli.error}),
        Step("window", "read", numbers),
    )


def _over_modes(packing: PackingData, numbers: Floats) -> Value:
    """Return numbers (k,) of modes below the first wave as a value at their frequencies."""
    modes = soft_modes(packing)
    steps = (*_steps_of_wave(packing), step_of_modes(packing, modes))
    return Value(numbers, "1", {}, packing.of_one_sample, modes.frequency, steps=steps)


@on_request("1", definition="spheres that take part in each mode below the first wave")
def soft_participation(packing: PackingData) -> Value:
    """Measure the participation number of each soft mode.

    It is (sum e)^2 / sum e^2, with e the kinetic energy of each sphere, rotations included.
    """
    share = soft_modes(packing).participation(packing.network)
    return _over_modes(packing, share * packing.network.n_particles)


@on_request("1", definition="part of the kinetic energy in rotations, of the same modes")
def soft_rotation(packing: PackingData) -> Value:
    """Measure the share of the kinetic energy of each soft mode that is in rotations."""
    return _over_modes(packing, soft_modes(packing).rotation_share)


@on_request("1", definition="contacts of the sphere that moves most, of the same modes")
def soft_contacts(packing: PackingData) -> Value:
    """Count the contacts of the sphere that moves most in each soft mode.

    A sphere with two or three contacts is always held loosely.
    """
    square = (soft_modes(packing).shapes()[:, :, :3] ** 2).sum(axis=2)
    contacts = contacts_per_particle(packing.network)
    return _over_modes(packing, contacts[square.argmax(axis=1)].astype(float))
