"""Zero-energy motions of parts that nothing holds: found by structure, proved by small null spaces.

A sphere with fewer than three contacts can turn or swing freely: six motions without a contact,
three about a single contact point, one about the line through two. Taking such spheres away with
their contacts leaves others with fewer than three, so the loose parts are peeled off, one layer
after the other. Held by the rest, which is taken as fixed, each connected loose part is a small
matrix; its null space, padded with zeros, is a null space of K, since K has no negative direction
and no energy means no stretched contact. A cluster that no wall holds also moves as a whole.
Whether the rest really is rigid is for the exact count of `modal.inertia` to say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.csgraph import breadth_first_order, connected_components

from modal.network import Network

NULL = 1e-10
"""An eigenvalue is zero below this share of its part's largest one: far above round-off, and
below it only parts whose stiffnesses differ by 1e10."""
EMPTY = 1e-15
"""A diagonal entry below this share of the largest one is what round-off leaves of zero."""
HELD_BY = 3
"""Contacts that hold a sphere in all six directions."""
LARGEST_PART = 1500
"""Spheres of a part whose null space is still computed dense; larger ones count as held."""


@dataclass
class FloppyModes:
    """Zero modes: `basis` (size, z) orthonormal in the mass-scaled degrees of freedom, sparse.

    How many each kind gives: free_particles, loose_clusters (no wall, or one without friction,
    holds them), hinged (loose parts that touch the rest), spinning (without tangential springs).
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

    def by_kind(self) -> dict[str, int]:
        """Number of zero modes of each kind."""
        kinds = ("free_particles", "loose_clusters", "hinged", "spinning")
        return {kind: getattr(self, kind) for kind in kinds}


def loosely_held(network: Network) -> np.ndarray:
    """Shape (n,) bool: spheres that have fewer than three contacts once others are peeled off."""
    i, j = network.particle_i, network.particle_j
    held = np.ones(network.n_particles, bool)
    while True:
        alive = held[i] & ((j < 0) | held[j])
        ends = np.concatenate([i[alive], j[alive & (j >= 0)]])
        remaining = held & (np.bincount(ends, minlength=len(held)) >= HELD_BY)
        if np.array_equal(remaining, held):
            return ~held
        held = remaining


def clusters(network: Network) -> tuple[np.ndarray, np.ndarray]:
    """Connected cluster of each sphere (n,), and whether each cluster touches a wall (c,)."""
    i, j = network.particle_i, network.particle_j
    n, pair = network.n_particles, network.particle_j >= 0
    touching = sp.coo_matrix((np.ones(pair.sum()), (i[pair], j[pair])), shape=(n, n))
    count, cluster = connected_components(touching, directed=False)
    anchored = np.zeros(count, bool)
    anchored[cluster[i[~pair]]] = True
    return cluster, anchored


def floppy_modes(network: Network, scaled: sp.csr_matrix, mass: np.ndarray) -> FloppyModes:
    """Zero modes of `scaled` = M^-1/2 K M^-1/2, (size, size), with M's diagonal `mass` (size,)."""
    dof = scaled.shape[0] // network.n_particles
    loose = loosely_held(network)
    cluster, anchored = clusters(network)
    touched = np.zeros(network.n_particles, bool)
    for ends in (network.particle_i, network.particle_j[network.particle_j >= 0]):
        touched[ends] = True
    kinds = {"free_particles": 0, "loose_clusters": 0, "hinged": 0}
    parts = []
    in_part = np.zeros(scaled.shape[0], bool)
    for members in _loose_parts(network, loose):
        if len(members) > LARGEST_PART:
            continue
        index = (members[:, None] * dof + np.arange(dof)).ravel()
        in_part[index] = True
        null = _null_space(scaled[index][:, index].toarray())
        kind = "hinged" if anchored[cluster[members[0]]] else "loose_clusters"
        kinds[kind if touched[members].any() else "free_particles"] += null.shape[1]
        rows, columns = np.meshgrid(index, np.arange(null.shape[1]), indexing="ij")
        shape = (scaled.shape[0], null.shape[1])
        parts.append(sp.coo_matrix((null.ravel(), (rows.ravel(), columns.ravel())), shape=shape))
    diagonal = scaled.diagonal()
    # An empty row elsewhere: a sphere without tangential springs turns freely.
    spins = np.flatnonzero((diagonal <= EMPTY * diagonal.max(initial=0.0)) & ~in_part)
    shape = (scaled.shape[0], len(spins))
    parts.append(sp.coo_matrix((np.ones(len(spins)), (spins, np.arange(len(spins)))), shape=shape))
    basis = sp.hstack(parts, format="csc")
    # Clusters at a wall are tried too: without tangential springs they slide along it.
    for which in np.unique(cluster[~loose]):
        rigid = _rigid_motions(network, scaled, mass, cluster == which)
        rigid = rigid - basis @ (basis.T @ rigid)
        size, vector = eigh(rigid.T @ rigid)
        new = rigid @ vector[:, size > 1e-8] / np.sqrt(size[size > 1e-8])
        kinds["loose_clusters"] += new.shape[1]
        basis = sp.hstack([basis, sp.csc_matrix(new)], format="csc")
    return FloppyModes(basis, **kinds, spinning=len(spins))


def _loose_parts(network: Network, loose: np.ndarray) -> list[np.ndarray]:
    """Connected parts of the loose spheres, as arrays of particle indices."""
    spheres = np.flatnonzero(loose)
    place = np.full(network.n_particles, -1)
    place[spheres] = np.arange(len(spheres))
    i, j = network.particle_i, network.particle_j
    both = (j >= 0) & loose[i] & loose[j]
    ends = (place[i[both]], place[j[both]])
    graph = sp.coo_matrix((np.ones(both.sum()), ends), shape=(len(spheres),) * 2)
    if len(spheres) == 0:
        return []
    part = connected_components(graph, directed=False)[1]
    order = np.argsort(part, kind="stable")
    return np.split(spheres[order], np.cumsum(np.bincount(part))[:-1])


def _rigid_motions(
    network: Network, scaled: sp.csr_matrix, mass: np.ndarray, members: np.ndarray
) -> np.ndarray:
    """Shape (size, up to 6): unit mass-scaled rigid motions of one cluster that cost no energy.

    Rotations are about the cluster as its contacts join it, across periods; those that a cluster
    connected to its own image does not allow are found by their energy and left out.
    """
    dof = scaled.shape[0] // network.n_particles
    position = _unwrapped(network, members)
    position[members] -= position[members].mean(axis=0)
    motion = np.zeros((6, network.n_particles, dof))
    for axis in range(3):
        motion[axis, members, axis] = 1
        if dof == 6:
            motion[3 + axis, members, :3] = np.cross(np.eye(3)[axis], position[members])
            motion[3 + axis, members, 3 + axis] = 1
    vector = motion[: 6 if dof == 6 else 3].reshape(-1, scaled.shape[0]).T
    vector *= np.sqrt(mass)[:, None]
    vector /= np.linalg.norm(vector, axis=0)
    scale = scaled.diagonal().max()
    return vector[:, abs(scaled @ vector).max(axis=0) <= NULL * scale]


def _unwrapped(network: Network, members: np.ndarray) -> np.ndarray:
    """Shape (n, 3), m: places of a cluster's spheres, followed from contact to contact."""
    pair = ~network.with_wall
    i, j = network.particle_i[pair], network.particle_j[pair]
    branch = (network.lever_i - network.lever_j)[pair]
    n = network.n_particles
    touching = sp.coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    first = int(np.flatnonzero(members)[0])
    order, before = breadth_first_order(touching, first, directed=False)
    join = {}
    for k, ends in enumerate(zip(i.tolist(), j.tolist(), strict=True)):
        join[ends] = branch[k]
        join[ends[::-1]] = -branch[k]
    place = np.zeros((n, 3))
    for here in order[1:].tolist():
        place[here] = place[before[here]] + join[(int(before[here]), here)]
    return place


def _null_space(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span the null space of a small positive semidefinite matrix."""
    square, vector = eigh(matrix, check_finite=False)
    return vector[:, square <= NULL * max(square[-1], np.finfo(float).tiny)]
