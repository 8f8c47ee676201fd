"""Make larger packings by repeating one that is periodic along x or y.

A plane wave in the copies equals that in the small packing, so that a test of the size needs no
larger DEM run. The particles are numbered along z, with the copies of a particle next to each
other, so that the loops over contacts, which go along z, read memory in order.
"""

from dataclasses import replace

import numpy as np

from modal.packing.columns import frozen
from modal.packing.network import Network
from modal.packing.sample import Sample, sample_of_network
from modal.tools.errors import InputError


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """Return `times_x` by `times_y` copies of a network, side by side in a larger cell.

    Raises InputError if an axis of repetition is not periodic.
    """
    times = np.array([times_x, times_y, 1])
    if min(times) < 1 or (~network.cell_periodic & (times > 1)).any():
        raise InputError(
            "repeat",
            f"cannot repeat {times_x} by {times_y}",
            remedy=("give whole numbers from 1 on, of a packing that is periodic along the axis"),
        )
    copies = times_x * times_y
    shifts = network.require("cell_shift", "telling which copies touch")
    # The cells of the copies by their steps along x, y and z.
    cells = np.column_stack(
        [np.indices((times_x, times_y)).reshape(2, -1).T, np.zeros(copies, int)]
    )
    m = network.n_contacts
    # Copies are ordered along z; particles of one height keep their order.
    order = np.argsort(network.position[:, 2], kind="stable")
    first_copy = np.argsort(order) * copies
    original = np.repeat(order, copies)
    first_copy_i = first_copy[network.particle_i]
    first_copy_j = first_copy[network.partner]
    i = np.empty(m * copies, np.int64)
    j = np.empty(m * copies, np.int64)
    shift = np.empty((m * copies, 3), np.int8)
    for copy, cell in enumerate(cells):
        rows = slice(copy * m, (copy + 1) * m)
        shift[rows], inside = np.divmod(cell + shifts, times)
        partner = first_copy_j + inside[:, 0] * times_y + inside[:, 1]
        i[rows] = first_copy_i + copy
        j[rows] = np.where(network.with_wall, network.particle_j, partner)
    bodies = {name: data[original] for name, data in network.bodies().items()}
    bodies["position"] += np.tile(cells, (len(order), 1)) @ network.period_vectors
    vectors = network.cell_vectors
    if vectors is not None:
        vectors = vectors * np.asarray(times)[:, None]
    return replace(
        network.some(np.tile(np.arange(m, dtype=np.int32), copies)),
        **frozen(**bodies, particle_i=i, particle_j=j, cell_shift=shift),
        cell_size=network.cell_size * times,
        cell_vectors=vectors,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )


def repeat_sample(sample: Sample, times_x: int, times_y: int) -> Sample:
    """Return copies of a sample side by side, with its shear forces, as `repeat` does.

    Raises InputError for a sample in motion, and UnavailableError for clumps.
    """
    sample.refuse_clumps("repetition, to a sample,")
    if sample.velocity is not None or sample.strain_rate is not None:
        raise InputError(
            "in_motion", "the sample is in motion", remedy="bring it to rest first (relax)"
        )
    large = sample_of_network(repeat(sample.network(), times_x, times_y), sample.friction)
    return replace(
        sample,
        position=large.position,
        side=large.side,
        shear=large.shear,
        radii=large.radii,
        densities=large.densities,
        fixed=large.fixed,
        study=sample.study | {"repeated": f"{times_x} x {times_y}"},
    )
