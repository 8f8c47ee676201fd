"""Zero-energy motions of parts that nothing holds: found by structure, proved by small null spaces.

A sphere with fewer than three contacts can turn or swing freely: six motions without a contact,
three about a single contact point, one about the line through two. Taking such spheres away with
their contacts leaves others with fewer than three, so the loose parts are peeled off, one layer
after the other. Held by the rest, which is taken as fixed, each connected loose part is a small
matrix; its null space, padded with zeros, is a null space of K, since K has no negative direction
and no energy means no stretched contact. Clusters that touch no wall are loose as a whole. Whether
the rest really is rigid is for the exact count of `modal.inertia` to say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components

from modal.network import Network

NULL = 1e-10
"""An eigenvalue is zero below this share of its part's largest one: far above round-off, and
below it only parts whose stiffnesses differ by 1e10."""
HELD_BY = 3
"""Contacts that hold a sphere in all six directions."""
LARGEST_PART = 1500
"""Spheres of a part whose null space is still computed dense; larger ones count as held."""


@dataclass
class FloppyModes:
    """Zero modes: `basis` (size, z) orthonormal in the mass-scaled degrees of freedom, sparse.

    How many each kind gives: free_particles, loose_clusters (without a wall), hinged (loose parts
    that touch the rest), spinning (spheres that nothing but normal springs hold).
    """

    basis: sp.csc_matrix
    free_particles: int = 0
    loose_clusters: int = 0
    hinged: int = 0
    spinning: int = 0

    @property
    def total(self) -> int:
        """Number of zero modes found."""
        return self.basis.shape[1]


def loosely_held(network: Network) -> np.ndarray:
    """Shape (n,) bool: spheres that are peeled off, or belong to a cluster without a wall."""
    i, j = network.particle_i, network.particle_j
    n = network.n_particles
    held = ~in_loose_cluster(network)
    while True:
        alive = held[i] & ((j < 0) | held[j])
        ends = np.concatenate([i[alive], j[alive & (j >= 0)]])
        remaining = held & (np.bincount(ends, minlength=n) >= HELD_BY)
        if np.array_equal(remaining, held):
            return ~held
        held = remaining


def in_loose_cluster(network: Network) -> np.ndarray:
    """Shape (n,) bool: spheres whose connected cluster touches no wall."""
    i, j = network.particle_i, network.particle_j
    n, pair = network.n_particles, network.particle_j >= 0
    touching = sp.coo_matrix((np.ones(pair.sum()), (i[pair], j[pair])), shape=(n, n))
    count, cluster = connected_components(touching, directed=False)
    anchored = np.zeros(count, bool)
    anchored[cluster[i[~pair]]] = True
    return ~anchored[cluster]


def floppy_modes(network: Network, scaled: sp.csr_matrix, dof: int) -> FloppyModes:
    """Zero modes of the loose parts of `scaled` = M^-1/2 K M^-1/2 with `dof` rows a particle."""
    loose = loosely_held(network)
    unanchored = in_loose_cluster(network)
    spheres = np.flatnonzero(loose)
    place = np.full(network.n_particles, -1)
    place[spheres] = np.arange(len(spheres))
    i, j = network.particle_i, network.particle_j
    both = (j >= 0) & loose[i] & loose[j]
    graph = sp.coo_matrix(
        (np.ones(both.sum()), (place[i[both]], place[j[both]])), shape=(len(spheres),) * 2
    )
    parts = connected_components(graph, directed=False)[1] if len(spheres) else np.empty(0, int)
    order = np.argsort(parts, kind="stable")
    ends = np.cumsum(np.bincount(parts)) if len(spheres) else np.empty(0, int)
    touched = np.zeros(network.n_particles, bool)
    touched[i] = True
    touched[j[j >= 0]] = True
    kinds = {"free_particles": 0, "loose_clusters": 0, "hinged": 0}
    rows, columns, values, total = [], [], [], 0
    in_part = np.zeros(scaled.shape[0], bool)
    for members in np.split(spheres[order], ends[:-1]) if len(spheres) else []:
        if len(members) > LARGEST_PART:
            continue
        index = (members[:, None] * dof + np.arange(dof)).ravel()
        in_part[index] = True
        null = _null_space(scaled[index][:, index].toarray())
        count = null.shape[1]
        kind = "loose_clusters" if unanchored[members[0]] else "hinged"
        kinds[kind if touched[members].any() else "free_particles"] += count
        rows.append(np.repeat(index, count))
        columns.append(np.tile(np.arange(total, total + count), len(index)))
        values.append(null.ravel())
        total += count
    # An empty row elsewhere: a sphere without tangential springs turns freely.
    spins = np.flatnonzero((scaled.diagonal() == 0) & ~in_part)
    rows.append(spins)
    columns.append(np.arange(total, total + len(spins)))
    values.append(np.ones(len(spins)))
    shape = (scaled.shape[0], total + len(spins))
    entries = (np.concatenate(rows).astype(int), np.concatenate(columns).astype(int))
    basis = sp.coo_matrix((np.concatenate(values), entries), shape=shape).tocsc()
    return FloppyModes(basis, **kinds, spinning=len(spins))


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span the null space of a small positive semidefinite matrix."""
    square, vector = eigh(matrix, check_finite=False)
    return vector[:, square <= NULL * max(square[-1], np.finfo(float).tiny)]
