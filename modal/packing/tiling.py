"""Larger packings by repetition of one that is periodic sideways.

A plane wave in the copies is that of the small packing, so that a test of size needs no larger DEM
run. The copies are numbered along z, those of one particle one after the other: so the loops over
contacts, which go along z, go through memory once and straight ahead.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.packing.columns import frozen
from modal.packing.network import Network
from modal.packing.sample import Sample, sample_of_network
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError


class Copies:
    """`times` (x, y) copies of a packing side by side, across its periods.

    `source`, `cell` (k, 3): the original, and the cell in periods, of each repeated particle. They
    stand along z, equally high ones as they come, the copies of one behind each other. InputError
    where there is no period along an axis on which it is to be repeated.
    """

    def __init__(self, position: Floats, periodic: Bools, times: tuple[int, int]) -> None:
        self.times = np.array([*times, 1])
        if min(times) < 1 or (~periodic & (self.times > 1)).any():
            raise InputError(
                f"cannot repeat {times[0]} by {times[1]}: give whole numbers from 1 on, of a "
                "packing that is periodic along the axis"
            )
        self._cells = np.array([(a, b, 0) for a in range(times[0]) for b in range(times[1])])
        order = np.argsort(position[:, 2], kind="stable")
        self._place = np.argsort(order) * len(self._cells)
        self.source = np.repeat(order, len(self._cells))
        self.cell = np.tile(self._cells, (len(order), 1))

    def contacts(self, i: Ints, j: Ints, shifts: Ints) -> tuple[Ints, Ints, Ints, Ints]:
        """Rows of the contacts, of m, that the copies have; their ends and periods."""
        m, copies, wall = len(i), len(self._cells), j < 0
        ends = self._place[i], self._place[np.where(wall, 0, j)]
        one, two = np.empty((2, m * copies), np.int64)
        shift = np.empty((m * copies, 3), np.int8)
        for own in range(copies):
            part = slice(own * m, (own + 1) * m)
            shift[part], inside = np.divmod(self._cells[own] + shifts, self.times)
            one[part] = ends[0] + own
            other = ends[1] + inside[:, 0] * self.times[1] + inside[:, 1]
            two[part] = np.where(wall, j, other)
        return np.tile(np.arange(m, dtype=np.int32), copies), one, two, shift


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """The network repeated sideways across its periods: times_x times_y copies in a larger cell.

    InputError where the network has no period along an axis on which it is to be repeated.
    """
    copies = Copies(network.position, network.cell_periodic, (times_x, times_y))
    shifts = network.require("cell_shift", "telling which copies touch")
    row, i, j, shift = copies.contacts(network.particle_i, network.particle_j, shifts)
    bodies = {name: data[copies.source] for name, data in network.bodies().items()}
    bodies["position"] += copies.cell * network.cell_size
    return replace(
        network.some(row),
        **frozen(**bodies, particle_i=i, particle_j=j, cell_shift=shift),
        cell_size=network.cell_size * copies.times,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )


def repeat_sample(sample: Sample, times_x: int, times_y: int) -> Sample:
    """The sample repeated sideways, with the shear forces of its contacts; see `repeat`.

    InputError for a sample in motion.
    """
    if sample.velocity is not None or sample.strain_rate is not None:
        raise InputError("the sample is in motion; bring it to rest first (relax)")
    periodic = np.array([*sample.periodic_sides, True])
    copies = Copies(sample.position, periodic, (times_x, times_y))
    position = sample.position[copies.source]
    position[:, :2] += copies.cell[:, :2] * sample.side
    own = {name: getattr(sample, name) for name in ("radii", "densities")}
    own = {name: data if data is None else data[copies.source] for name, data in own.items()}
    large = replace(
        sample,
        position=position,
        side=sample.side * copies.times[:2],
        shear=None,
        study=sample.study | {"repeated": f"{times_x} x {times_y}"},
        **own,
    )
    if sample.shear is None:
        return large
    copies_in_network = repeat(sample.network(), times_x, times_y)
    return replace(large, shear=sample_of_network(copies_in_network, sample.friction).shear)
