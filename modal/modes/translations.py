"""Lateral translations of a periodic crystal: K falls into small blocks, one per wavevector.

The network is searched for translations by 1/N of the period along x and y that map particles
on particles; they count only if K itself commutes with them (checked entry by entry). A column
of one cell then carries all modes: the block of wavevector q is U^H K U, where U spreads the
column over the cells with the phase q. Exact; q and -q share their frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.tools.arrays import Array, Floats, Ints

COMMUTE_TOLERANCE = 1e-9
"""Largest |P K P^T - K| relative to the largest entry of K that round-off explains."""


@dataclass(frozen=True)
class LateralTranslations:
    """Translations that map a crystal on itself, and which particles they map on each other.

    `cells`: number of cells along x and y. `orbit` (nx ny, n / (nx ny)): its first row holds the
    particles of one column of cells, row c their images in cell c = x + nx y.
    """

    cells: tuple[int, int]
    orbit: Ints

    @property
    def trivial(self) -> bool:
        """True where only the identity was found."""
        return self.cells == (1, 1)


def _mapping(network: Network, shift: Floats) -> Ints | None:
    """Shape (n,): the particle at the place of each particle moved by `shift` (3,), m, or None.

    None where a moved particle does not fall on another one, so that the shift is no symmetry.
    """
    from scipy.spatial import cKDTree  # a tenth of a second that only crystals are worth

    box = np.where(network.cell_periodic, network.cell_size, 0.0)
    tolerance = 1e-6 * network.radius.min()
    wrap = [axis for axis in range(3) if network.cell_periodic[axis]]
    place, moved = network.position.copy(), network.position + shift
    for axis in wrap:
        place[:, axis] %= box[axis]
        moved[:, axis] %= box[axis]
        place[place[:, axis] >= box[axis], axis] = 0.0
        moved[moved[:, axis] >= box[axis], axis] = 0.0
    low = place[:, 2].min()
    place[:, 2] -= low
    moved[:, 2] -= low
    distance, target = cKDTree(place, boxsize=box).query(moved)
    if distance.max() > tolerance or len(np.unique(target)) < len(target):
        return None
    return target


def _commutes(K: sp.csr_matrix, mapping: Ints, dof: int) -> bool:
    rows = (dof * mapping[:, None] + np.arange(dof)).ravel()
    difference = K[rows][:, rows] - K
    return abs(difference).max() <= COMMUTE_TOLERANCE * abs(K).max()


def lateral_translations(network: Network, K: sp.csr_matrix, dof: int) -> LateralTranslations:
    """Find the finest lateral translations that leave positions and K unchanged."""
    n = network.n_particles
    maps, cells = [], []
    for axis in (0, 1):
        found: Ints = np.arange(n)
        count = 1
        if network.cell_periodic[axis]:
            for trial in range(min(64, n), 1, -1):
                if n % trial:
                    continue
                shift = np.zeros(3)
                shift[axis] = network.cell_size[axis] / trial
                mapping = _mapping(network, shift)
                if mapping is not None and _commutes(K, mapping, dof):
                    found, count = mapping, trial
                    break
        maps.append(found)
        cells.append(count)
    identity: Ints = np.arange(n)
    powers_x = [identity]
    for _ in range(cells[0] - 1):
        powers_x.append(maps[0][powers_x[-1]])
    images = []
    for _ in range(cells[1]):
        images.extend(powers_x)
        powers_x = [maps[1][power] for power in powers_x]
    table = np.array(images)
    representative = np.flatnonzero(table.min(axis=0) == identity)
    if table.shape[0] * len(representative) != n:
        return LateralTranslations((1, 1), identity[None])
    return LateralTranslations((cells[0], cells[1]), table[:, representative])


def symmetry_blocks(
    scaled: sp.csr_matrix, group: LateralTranslations, dof: int
) -> Iterator[tuple[Array, sp.csr_matrix, int]]:
    """Yield (block (b, b), U (dof n, b), multiplicity) for each pair of wavevectors q, -q.

    `scaled` is M^-1/2 K M^-1/2. An eigenvector w of the block is the Bloch wave U w of the whole
    network, of the same size in every cell. The first block is the laterally uniform one (q = 0).
    """
    nx, ny = group.cells
    size = dof * group.orbit.shape[1]
    rows = (dof * group.orbit[:, :, None] + np.arange(dof)).reshape(nx * ny, size)
    cell = np.arange(nx * ny)
    done: set[tuple[int, int]] = set()
    for qy in range(ny):
        for qx in range(nx):
            if (qx, qy) in done:
                continue
            opposite = (-qx % nx, -qy % ny)
            done.update({(qx, qy), opposite})
            angle = 2 * np.pi * (qx * (cell % nx) / nx + qy * (cell // nx) / ny)
            real = opposite == (qx, qy)
            phase = np.cos(angle) if real else np.exp(1j * angle)
            values = np.repeat(phase / np.sqrt(nx * ny), size)
            U = sp.csr_matrix(
                (values, (rows.ravel(), np.tile(np.arange(size), nx * ny))),
                shape=(scaled.shape[0], size),
            )
            yield (U.conj().T @ scaled @ U).toarray(), U, 1 if real else 2
