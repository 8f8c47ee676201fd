"""Global stiffness matrix K (sparse) and mass matrix M (diagonal); walls are fixed bodies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from modal.formats.arrays import Floats
from modal.packing.network import Network
from modal.stiffness.law_tangent import law_tangent
from modal.stiffness.pre_stress import contact_tangent


def mass_diagonal(network: Network, *, translations_only: bool = False) -> Floats:
    """Shape (6n,) or (3n,): m, m, m, I, I, I of each particle; kg and kg m^2."""
    columns = [network.mass] * 3 + ([] if translations_only else [network.inertia] * 3)
    return np.column_stack(columns).ravel()


def stiffness_matrix(
    network: Network, *, translations_only: bool = False, pre_stress: str = "none"
) -> sp.csr_matrix:
    """Sparse K, (6n, 6n) or (3n, 3n); N/m, N, N m. Six (three) rows a particle, u then theta.

    `pre_stress` as in `modal.stiffness.pre_stress`: with "full" and "law" K is not symmetric. A
    particle that touches itself through a period has both sides of the contact on one block;
    repeated pairs add up.
    """
    return assembled(network, tangent_of(network, pre_stress), 3 if translations_only else 6)


def tangent_of(network: Network, pre_stress: str) -> Floats:
    """Shape (m, 12, 12): the tangent of each contact, one of `TANGENTS`."""
    if pre_stress == "law":
        return law_tangent(network)
    return contact_tangent(network, pre_stress)


def assembled(network: Network, local: Floats, size: int = 6) -> sp.csr_matrix:
    """Sparse (size n, size n) matrix from that of each contact, `local` (m, 12, 12).

    `size` of 3 keeps the translations alone.
    """
    n = network.n_particles
    i, j = network.particle_i, network.particle_j
    pair = j >= 0
    blocks = [local[:, :size, :size]]
    rows, columns = [i], [i]
    for row, column, a, b in ((j, j, 6, 6), (i, j, 0, 6), (j, i, 6, 0)):
        blocks.append(local[pair, a : a + size, b : b + size])
        rows.append(row[pair])
        columns.append(column[pair])
    block, row, column = np.concatenate(blocks), np.concatenate(rows), np.concatenate(columns)
    # Whole blocks are sorted and added up, a thirty-sixth of the indices that entries would take.
    order = np.lexsort((column, row))
    row, column = row[order], column[order]
    first = np.flatnonzero(np.diff(row, prepend=-1) | np.diff(column, prepend=-1))
    summed = np.add.reduceat(block[order], first, axis=0) if len(first) else block
    start = np.searchsorted(row[first], np.arange(n + 1))
    shape = size * n, size * n
    return sp.bsr_matrix((summed, column[first], start), shape).tocsr()


def stiffness_diagonal(network: Network, *, translations_only: bool = False) -> Floats:
    """Shape (6n,) or (3n,): diagonal of K without pre-stress, straight from the contacts.

    A unit motion e moves the contact point by b, which costs kt b^2 + (kn - kt) (n.b)^2: b = e
    for a displacement, e x l for a rotation about the centre.
    """
    own_image = network.particle_i == network.particle_j
    if own_image.any():
        # Both sides of the contact are on one block, with what couples them: leave it to K.
        images = network.some(own_image)
        part = stiffness_matrix(images, translations_only=translations_only).diagonal()
        others = network.some(~own_image)
        return part + stiffness_diagonal(others, translations_only=translations_only)
    pair = ~network.with_wall
    diagonal = np.zeros((network.n_particles, 3 if translations_only else 6))
    for end, lever, chosen in (
        (network.particle_i, network.lever_i, slice(None)),
        (network.particle_j, network.lever_j, pair),
    ):
        bodies = end[chosen]
        for axis, cost in enumerate(_costs(network, lever, translations_only)):
            diagonal[:, axis] += np.bincount(bodies, cost[chosen], len(diagonal))
    return diagonal.ravel()


def _costs(network: Network, lever: Floats, translations_only: bool) -> Iterator[Floats]:
    """Shape (m,), six or three times: what each unit motion of the body at `lever` (m, 3) costs.

    One axis after the other: of millions of contacts all of them would fill the memory.
    """
    n, kt = network.normal, network.stiffness_tangential
    more = network.stiffness_normal - kt
    for a in range(3):
        yield kt + more * n[:, a] ** 2
    if translations_only:
        return
    squared = (lever**2).sum(axis=1)
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        across = lever[:, b] * n[:, c] - lever[:, c] * n[:, b]
        yield kt * (squared - lever[:, a] ** 2) + more * across**2
