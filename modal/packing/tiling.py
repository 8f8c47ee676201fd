"""Larger packings by repetition of one that is periodic sideways.

A plane wave in the copies is that of the small packing, so that a test of size needs no larger DEM
run. The copies are numbered along z, those of one particle one after the other: so the loops over
contacts, which go along z, go through memory once and straight ahead.
"""

from dataclasses import replace

import numpy as np

from modal.packing.columns import frozen
from modal.packing.network import Network
from modal.packing.sample import Sample, sample_of_network
from modal.tools.errors import InputError


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """The network repeated sideways across its periods: times_x times_y copies in a larger cell.

    InputError where the network has no period along an axis on which it is to be repeated.
    """
    times = np.array([times_x, times_y, 1])
    if min(times) < 1 or (~network.cell_periodic & (times > 1)).any():
        raise InputError(
            f"cannot repeat {times_x} by {times_y}: give whole numbers from 1 on, of a packing "
            "that is periodic along the axis"
        )
    shifts = network.require("cell_shift", "telling which copies touch")
    cells = np.array([(a, b, 0) for a in range(times_x) for b in range(times_y)])
    m, copies, wall = network.n_contacts, len(cells), network.with_wall
    # They stand along z, equally high ones as they come, the copies of one behind each other.
    order = np.argsort(network.position[:, 2], kind="stable")
    place, source = np.argsort(order) * copies, np.repeat(order, copies)
    first, second = place[network.particle_i], place[network.partner]
    i, j = np.empty((2, m * copies), np.int64)
    shift = np.empty((m * copies, 3), np.int8)
    for own, cell in enumerate(cells):
        part = slice(own * m, (own + 1) * m)
        shift[part], inside = np.divmod(cell + shifts, times)
        other = second + inside[:, 0] * times_y + inside[:, 1]
        i[part], j[part] = first + own, np.where(wall, network.particle_j, other)
    bodies = {name: data[source] for name, data in network.bodies().items()}
    bodies["position"] += np.tile(cells, (len(order), 1)) * network.cell_size
    return replace(
        network.some(np.tile(np.arange(m, dtype=np.int32), copies)),
        **frozen(**bodies, particle_i=i, particle_j=j, cell_shift=shift),
        cell_size=network.cell_size * times,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )


def repeat_sample(sample: Sample, times_x: int, times_y: int) -> Sample:
    """The sample repeated sideways, with the shear forces of its contacts; see `repeat`.

    InputError for a sample in motion.
    """
    if sample.velocity is not None or sample.strain_rate is not None:
        raise InputError("the sample is in motion; bring it to rest first (relax)")
    large = sample_of_network(repeat(sample.network(), times_x, times_y), sample.friction)
    names = ("position", "side", "shear", "radii", "densities")
    study = sample.study | {"repeated": f"{times_x} x {times_y}"}
    return replace(sample, study=study, **{name: getattr(large, name) for name in names})
