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


def _copies(position: Floats, times_x: int, times_y: int) -> tuple[Ints, Ints, Ints]:
    """Original and cell (k, 3), in periods, of each repeated particle; the place of each original.

    They stand along z, equally high ones as they come, the copies of one behind each other.
    """
    cells = np.array([(a, b, 0) for a in range(times_x) for b in range(times_y)])
    order = np.argsort(position[:, 2], kind="stable")
    source, cell = np.repeat(order, len(cells)), np.tile(cells, (len(order), 1))
    return source, cell, np.argsort(order) * len(cells)


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """The network repeated sideways across its periods: times_x times_y copies in a larger cell.

    InputError where the network has no period along an axis on which it is to be repeated.
    """
    copies, wanted = times_x * times_y, np.array([times_x, times_y, 1])
    if min(times_x, times_y) < 1 or (~network.cell_periodic & (wanted > 1)).any():
        raise InputError(
            f"cannot repeat {times_x} by {times_y}: the network must be periodic along the axis"
        )
    source, cell, place = _copies(network.position, times_x, times_y)
    m, wall = network.n_contacts, network.with_wall
    shifts = network.require("cell_shift", "telling which copies touch")
    ends = place[network.particle_i], place[network.partner]
    i, j = np.empty((2, m * copies), np.int64)
    shift, row = np.empty((m * copies, 3), np.int8), np.tile(np.arange(m, dtype=np.int32), copies)
    for own in range(copies):
        part = slice(own * m, (own + 1) * m)
        shift[part], inside = np.divmod(cell[own] + shifts, wanted)
        i[part] = ends[0] + own
        other = ends[1] + inside[:, 0] * times_y + inside[:, 1]
        j[part] = np.where(wall, network.particle_j, other)
    bodies = {name: data[source] for name, data in network.bodies().items()}
    bodies["position"] += cell * network.cell_size
    return replace(
        network.some(row),
        **bodies,
        particle_i=i,
        particle_j=j,
        cell_shift=shift,
        cell_size=network.cell_size * wanted,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )


def repeat_sample(sample: Sample, times_x: int, times_y: int) -> Sample:
    """The sample repeated sideways, with the shear forces of its contacts; see `repeat`.

    InputError for a sample in motion.
    """
    if min(times_x, times_y) < 1:
        raise InputError(f"cannot repeat {times_x} by {times_y}: give whole numbers from 1 on")
    if sample.velocity is not None or sample.strain_rate is not None:
        raise InputError("the sample is in motion; bring it to rest first (relax)")
    source, cell, _ = _copies(sample.position, times_x, times_y)
    position = sample.position[source]
    position[:, :2] += cell[:, :2] * sample.side
    study = sample.study | {"repeated": f"{times_x} x {times_y}"}
    own = {name: getattr(sample, name) for name in ("radii", "densities")}
    own = {name: data if data is None else data[source] for name, data in own.items()}
    side = sample.side * [times_x, times_y]
    large = replace(sample, position=position, side=side, shear=None, study=study, **own)
    if sample.shear is None:
        return large
    # Shear forces stand in the order of the contacts, along tangents that follow from the normals.
    shear, _ = shear_along(repeat(sample.network(), times_x, times_y), large.contacts())
    return replace(large, shear=shear)
