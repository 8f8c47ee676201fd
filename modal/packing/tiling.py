"""Larger packings by repetition of one that is periodic sideways.

A plane wave in the copies is that of the small packing, so that a test of size needs no larger DEM
run. The copies are numbered along z, those of one particle one after the other: so the loops over
contacts, which go along z, go through memory once and straight ahead.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.packing.network import Network
from modal.packing.sample import Sample, shear_along
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError


def order_along_z(position: Floats) -> Ints:
    """Shape (n,): the particles at `position` (n, 3) along z; equally high ones as they come."""
    return np.argsort(position[:, 2], kind="stable")


def tiled(order: Ints, copies: int) -> tuple[Ints, Ints]:
    """Original (n copies,) and copy (n copies,) of each particle of the repeated packing."""
    return np.repeat(order, copies), np.tile(np.arange(copies), len(order))


def number_of(particle: Ints, copy: Ints, order: Ints, copies: int) -> Ints:
    """The number in the repeated packing of a copy of a particle; the inverse of `tiled`."""
    return np.argsort(order)[particle] * copies + copy


def _cells(times_x: int, times_y: int) -> Ints:
    """Shape (copies, 3): periods by which each copy is moved."""
    return np.array([(a, b, 0) for a in range(times_x) for b in range(times_y)])


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """The network repeated sideways across its periods: times_x times_y copies in a larger cell.

    InputError where the network has no period along an axis on which it is to be repeated.
    """
    copies, wanted = times_x * times_y, np.array([times_x, times_y, 1])
    if min(times_x, times_y) < 1 or (~network.cell_periodic & (wanted > 1)).any():
        raise InputError(
            f"cannot repeat {times_x} by {times_y}: the network must be periodic along the axis"
        )
    cell = _cells(times_x, times_y)
    order = order_along_z(network.position)
    i, j, shift, row = _copied_contacts(network, order, times_x, times_y)
    source, copy = tiled(order, copies)
    return replace(
        network.some(row),
        **(
            {name: data[source] for name, data in network.bodies().items()}
            | {"position": network.position[source] + cell[copy] * network.cell_size}
        ),
        particle_i=i,
        particle_j=j,
        cell_shift=shift,
        cell_size=network.cell_size * wanted,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )


def _copied_contacts(
    network: Network, order: Ints, times_x: int, times_y: int
) -> tuple[Ints, Ints, Ints, Ints]:
    """Ends i and j, periods (k, 3) and original (k,) of the contacts, copy by copy."""
    m, copies = network.n_contacts, times_x * times_y
    shifts = network.require("cell_shift", "telling which copies touch")
    i, j = np.empty((2, m * copies), np.int64)
    shift, row = np.empty((m * copies, 3), np.int8), np.tile(np.arange(m, dtype=np.int32), copies)
    wall, partner = network.with_wall, network.partner
    for own, cell in enumerate(_cells(times_x, times_y)):
        part = slice(own * m, (own + 1) * m)
        there = cell + shifts
        shift[part], inside = np.divmod(there, (times_x, times_y, 1))
        other = number_of(partner, inside[:, 0] * times_y + inside[:, 1], order, copies)
        i[part] = number_of(network.particle_i, np.array(own), order, copies)
        j[part] = np.where(wall, network.particle_j, other)
    return i, j, shift, row


def repeat_sample(sample: Sample, times_x: int, times_y: int) -> Sample:
    """The sample repeated sideways, with the shear forces of its contacts; see `repeat`.

    InputError for a sample in motion.
    """
    if min(times_x, times_y) < 1:
        raise InputError(f"cannot repeat {times_x} by {times_y}: give whole numbers from 1 on")
    if sample.velocity is not None or sample.strain_rate is not None:
        raise InputError("the sample is in motion; bring it to rest first (relax)")
    wanted = np.array([times_x, times_y])
    along_z = order_along_z(sample.position)
    source, copy = tiled(along_z, times_x * times_y)
    position = sample.position[source]
    offset: Floats = _cells(times_x, times_y)[:, :2] * sample.side
    for axis in range(2):
        position[:, axis] += offset[copy, axis]
    study = sample.study | {"repeated": f"{times_x} x {times_y}"}
    own = {name: getattr(sample, name) for name in ("radii", "densities")}
    own = {name: data if data is None else data[source] for name, data in own.items()}
    side = sample.side * wanted
    large = replace(sample, position=position, side=side, shear=None, study=study, **own)
    if sample.shear is None:
        return large
    # Shear forces stand in the order of the contacts, along tangents that follow from the normals.
    shear, _ = shear_along(repeat(sample.network(), times_x, times_y), large.contacts())
    return replace(large, shear=shear)
