"""Modes below the first wave of a periodic cell: how many spheres move in each, and how.

The longest wave that fits into a cell has the frequency V_S over the cell's side; what lies below
it is no wave, but soft by the disorder of the packing alone. E. Lerner, G. During and E.
Bouchbinder, Phys. Rev. Lett. 117, 035501 (2016) took small cells for that reason.
"""

import numpy as np

from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request
from analysis.value import Value
from modal.modes.eigenmodes import eigenmodes
from modal.modes.mode_set import ModeSet
from modal.packing.precision import taken_as_exact
from modal.packing.state import contacts_per_particle
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError


@cached_on_packing
def lowest_wave(m: PackingData) -> float:
    """Hz: of the longest shear wave of a cell without walls, V_S over the cell's side."""
    if not m.network.cell_periodic.all():
        raise UnavailableError(
            "not_periodic",
            "between walls waves have other frequencies",
            remedy="take a periodic cell",
        )
    axes = zip(np.eye(3), m.network.cell_size, strict=True)
    return float(min(m.moduli.velocities(axis)[-1] / side for axis, side in axes))


@cached_on_packing
def soft_modes(m: PackingData) -> ModeSet:
    """All modes below the first wave, certified; zero modes are not among them."""
    modes = eigenmodes(taken_as_exact(m.network), below=lowest_wave(m))
    if modes.missing or not len(modes.frequency):
        raise UnavailableError(
            "not_converged", f"below the first wave {modes.missing} modes are missing of some"
        )
    return modes


@on_request("Hz", definition="slowest V_S along an axis over the side of a periodic cell")
def first_wave(packing: PackingData) -> Value:
    """Slowest V_S along an axis over the side of a periodic cell.

    By the moduli.
    """
    return Value(lowest_wave(packing), "Hz")


def _over_modes(packing: PackingData, value: Floats) -> Value:
    """A number of each mode below the first wave, over their frequencies."""
    return Value(value, "1", {}, packing.of_one_sample, soft_modes(packing).frequency)


@on_request("1", definition="spheres that take part in each mode below the first wave")
def soft_participation(packing: PackingData) -> Value:
    """Spheres that take part in each mode below the first wave.

    (sum e)^2 / sum e^2, e the kinetic energy of each, rotations included.
    """
    share = soft_modes(packing).participation(packing.network)
    return _over_modes(packing, share * packing.network.n_particles)


@on_request("1", definition="part of the kinetic energy in rotations, of the same modes")
def soft_rotation(packing: PackingData) -> Value:
    """Part of the kinetic energy in rotations, of the same modes.

    Of all spheres.
    """
    return _over_modes(packing, soft_modes(packing).rotation_share)


@on_request("1", definition="contacts of the sphere that moves most, of the same modes")
def soft_contacts(packing: PackingData) -> Value:
    """Contacts of the sphere that moves most, of the same modes.

    One with two or three is held loosely, whatever its surroundings.
    """
    square = (soft_modes(packing).shapes()[:, :, :3] ** 2).sum(axis=2)
    contacts = contacts_per_particle(packing.network)
    return _over_modes(packing, contacts[square.argmax(axis=1)].astype(float))
