"""Dynamic structure factors S_L and S_T of a cell that is periodic in all directions.

S(k, f) = sum_i |<e|i>|^2 delta(f - f_i) over all modes i, e the plane wave exp(i k x) of every
force-bearing sphere, of equal displacement along k (longitudinal, S_L) or across (transverse, S_T,
the mean over both directions across), normalised in the mass. The wave vectors are those that fit
into the cell; the resolution is that of `analysis.estimators.structure_factor`. Weights add up to
1, and their mean omega^2 is e's own.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.estimators.structure_factor import StructureFactor, power_of_patterns
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.system.root_mass import RootMass
from modal.tools.errors import InputError

POLARISATIONS = ("L", "T")


def wave_vectors(network: Network, orders: np.ndarray) -> np.ndarray:
    """Shape (R, 3), rad/m: those with `orders` (R, 3) periods along x, y and z of the cell."""
    orders = np.asarray(orders)
    if orders.ndim != 2 or orders.shape[1] != 3 or orders.dtype.kind != "i" or len(orders) == 0:
        raise InputError("wave vectors: give three whole numbers of periods for each")
    for axis in range(3):
        if orders[:, axis].any() and not network.cell_periodic[axis]:
            raise InputError(
                f"no plane wave goes along {'xyz'[axis]}, where the packing is not periodic; take "
                "standing waves (structure_factor) between walls"
            )
    if not orders.any(axis=1).all():
        raise InputError("wave vectors: 0 0 0 is no wave")
    periods = np.where(network.cell_periodic, network.cell_size, 1.0)
    return 2 * np.pi * orders / periods


def plane_patterns(network: Network, vector: np.ndarray, polarisation: str) -> np.ndarray:
    """Shape (6n, 2) or (6n, 4): cosine and sine of one wave, scaled by M^1/2, squares adding to 1.

    `vector` (3,), rad/m; of transverse waves both directions across it, with half the weight each.
    """
    if polarisation not in POLARISATIONS:
        raise InputError(f"polarisation {polarisation!r}: choose one of {', '.join(POLARISATIONS)}")
    bearing = force_bearing(network)
    if not bearing.any():
        raise InputError("no particle has two contacts; such a packing carries no wave")
    along = vector / np.linalg.norm(vector)
    frame = np.linalg.svd(along[None])[2]
    directions = frame[:1] if polarisation == "L" else frame[1:]
    phase = network.position @ vector
    pattern = np.zeros((network.n_particles, 6, 2 * len(directions)))
    for k, direction in enumerate(directions):
        for part, wave in enumerate((np.cos(phase), np.sin(phase))):
            pattern[:, :3, 2 * k + part] = (wave * bearing)[:, None] * direction
    pattern = RootMass.of(network).times(pattern.reshape(-1, 2 * len(directions)))
    return pattern / np.linalg.norm(pattern)


def plane_structure_factor(
    network: Network,
    orders: np.ndarray,
    polarisation: str = "L",
    resolution: float = 1e3,
    highest: float | None = None,
) -> StructureFactor:
    """S_L or S_T of plane waves with `orders` (R, 3) periods in the cell, to `highest`, Hz.

    About 2.4 f_max / resolution products with K for each longitudinal wave, twice as many for each
    transverse one.
    """
    if not 0 < resolution < np.inf:
        raise InputError("resolution must be a positive number of Hz")
    vectors = wave_vectors(network, orders)
    rows = []
    for vector in vectors:
        pattern = plane_patterns(network, vector, polarisation)
        frequency, power = power_of_patterns(
            network, partial(_columns, pattern), pattern.shape[1], resolution, highest
        )
        rows.append(power.sum(axis=0))
    wavenumber = np.linalg.norm(vectors, axis=1)
    return StructureFactor(frequency, np.asarray(orders), wavenumber, np.array(rows), resolution)


def _columns(pattern: np.ndarray, part: slice) -> np.ndarray:
    return pattern[:, part]
