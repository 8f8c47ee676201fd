"""Zero-energy motions of parts that nothing holds: found by structure, proved by small null spaces.

A sphere with fewer than three contacts can turn or swing freely: six motions without a contact,
three about a single contact point, one about the line through two. Taking such spheres away with
their contacts leaves others with fewer than three, so the loose parts are peeled off, one layer
after the other. Held by the rest, which is taken as fixed, each connected loose part is a small
matrix; its null space, padded with zeros, is a null space of K, since K has no negative direction
and no energy means no stretched contact. A cluster that no wall holds also moves as a whole.
Whether the rest really is rigid is for the exact count of `modal.modes.collective` to say.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    reverse_cuthill_mckee,
)

from modal.packing.network import Network
from modal.packing.rattlers import keeping_contacts
from modal.solvers.spectrum import dot, norm
from modal.system.assembly import stiffness_matrix
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats, Ints

NEW = 1e-8
"""A motion of which the modes known before leave less, of its square, is one of them."""
HELD_BY = 3
"""Contacts that hold a sphere in all six directions."""


@dataclass(frozen=True)
class FloppyModes:
    """Zero modes; `basis` (size, z), sparse, orthonormal in the mass-scaled degrees of freedom.

    Its last columns are the `unstable` modes, which release energy. `kinds`: numbers of zero modes
    by kind. `free_particles`: of particles without contacts. `loose_clusters`: of clusters that no
    wall holds, or that slide along a wall without tangential springs. `hinged`: of loosely held
    parts of clusters that touch a wall. `spinning`: rotations of particles without tangential
    springs. `collective`: those of many spheres together, which an exact count has shown.
    `counted`: whether it was made; without it there may be more than `total`. `whole`: whether no
    loose part was too large to be looked at as a whole.
    """

    basis: sp.csc_matrix
    kinds: dict[str, int]
    counted: bool = False
    whole: bool = True
    unstable: int = 0

    @property
    def total(self) -> int:
        """Number of zero modes."""
        return self.held - self.unstable

    @property
    def held(self) -> int:
        """Number of all modes that are no elastic ones, and are held out of lists of these."""
        return int(self.basis.shape[1])


def by_structure(system: LinearSystem) -> FloppyModes:
    """The zero modes that the structure of the contacts explains; looked for once for a network.

    Where motions may release energy, springs may balance others, and none is shown but motions
    that no contact meets. How many there are beside these: `modal.modes.collective`.
    """
    return system.cached("floppy modes", lambda: _by_structure(system))


def _by_structure(system: LinearSystem) -> FloppyModes:
    """As `by_structure`. Only the contacts of loosely held particles are assembled as a matrix."""
    network, size, dof, zero = system.network, system.size, system.dof, system.zero_threshold
    sure, touching = system.semidefinite, _touching(network)
    n_clusters, cluster = connected_components(touching, directed=False)
    anchored = np.zeros(n_clusters, bool)
    anchored[cluster[network.particle_i[network.with_wall]]] = True
    touched = np.isin(np.arange(len(cluster)), [network.particle_i, network.particle_j])
    loose = touched & ~keeping_contacts(network, HELD_BY) & sure
    kinds = {"free_particles": dof * int((~touched).sum()), "loose_clusters": 0, "hinged": 0}
    free = _rows(np.flatnonzero(~touched), dof)
    rows, nulls, met = [free], [sp.identity(len(free))], np.repeat(touched, dof)
    members = np.flatnonzero(loose)
    place = np.full(network.n_particles, -1)
    place[members] = np.arange(len(members))
    local = _stiffness_among(system, members)
    loose_parts, most = _loose_parts(touching, loose), system.limits.piece
    for part in (p for whole in loose_parts for p in np.array_split(whole, -(-len(whole) // most))):
        inside, index = _rows(place[part], dof), _rows(part, dof)
        met[index] = False
        square, vector = eigh(local[inside][:, inside].toarray(), check_finite=False)
        null = vector[:, square <= zero]
        kinds["hinged" if anchored[cluster[part[0]]] else "loose_clusters"] += null.shape[1]
        rows.append(index)
        nulls.append(null)
    # An empty row elsewhere: a sphere without tangential springs turns freely.
    largest = (
        system.diagonal
        if sure
        else abs(system.assemble_dynamical_matrix()).max(axis=1).toarray().ravel()
    )
    spins = np.flatnonzero((largest <= zero) & met)
    blocks = sp.block_diag([*nulls, sp.identity(len(spins))], format="coo")
    at = np.concatenate([*rows, spins])[blocks.row], blocks.col
    basis = sp.csc_matrix((blocks.data, at), shape=(size, blocks.shape[1]))
    # Clusters at a wall are tried too: without tangential springs they slide along it.
    for which in np.unique(cluster[touched & ~loose]) if sure else ():
        rigid = _rigid_motions(system, touching, cluster == which)
        rigid = rigid - basis @ (basis.T @ rigid)
        square, vector = eigh(rigid.T @ rigid)
        new = rigid @ vector[:, square > NEW] / np.sqrt(square[square > NEW])
        kinds["loose_clusters"] += new.shape[1]
        basis = sp.hstack([basis, sp.csc_matrix(new)], format="csc")
    whole = sure and all(len(part) <= most for part in loose_parts)
    return FloppyModes(basis, kinds | {"spinning": len(spins), "collective": 0}, whole=whole)


def _touching(network: Network) -> sp.csr_matrix:
    """Shape (n, n): an entry at i, j for each contact of two spheres."""
    pair, n = ~network.with_wall, network.n_particles
    ends = network.particle_i[pair], network.particle_j[pair]
    return sp.coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()


def _rows(spheres: Ints, dof: int) -> Ints:
    """Shape (dof k,): the rows of k spheres."""
    return (spheres[:, None] * dof + np.arange(dof)).ravel()


def _stiffness_among(system: LinearSystem, spheres: Ints) -> sp.csr_matrix:
    """M^-1/2 K M^-1/2 in the rows and columns of some spheres, all others held fast."""
    network, dof = system.network, system.dof
    chosen = np.zeros(network.n_particles, bool)
    chosen[spheres] = True
    near = chosen[network.particle_i] | (~network.with_wall & chosen[network.partner])
    rows = _rows(spheres, dof)
    K = stiffness_matrix(network.some(near), dof)[rows][:, rows]
    return system.sqrt_mass.some(spheres, dof).around(K)


def _loose_parts(touching: sp.csr_matrix, loose: Bools) -> list[Ints]:
    """Connected parts of the loose spheres, as arrays of particle indices, neighbours together."""
    spheres = np.flatnonzero(loose)
    if len(spheres) == 0:
        return []
    graph = touching[spheres][:, spheres]
    part = connected_components(graph, directed=False)[1]
    place = np.empty(len(spheres), int)
    place[reverse_cuthill_mckee(graph)] = np.arange(len(spheres))
    order = np.lexsort((place, part))
    return np.split(spheres[order], np.cumsum(np.bincount(part))[:-1])


def _rigid_motions(system: LinearSystem, touching: sp.csr_matrix, members: Bools) -> Floats:
    """Shape (size, up to 6): unit mass-scaled rigid motions of one cluster that cost no energy.

    Rotations are about the cluster as its contacts join it, across periods; those that a cluster
    connected to its own image does not allow are found by their energy, an omega^2 above `zero`,
    and left out.
    """
    network, dof = system.network, system.dof
    position = _unwrapped(network, touching, members)
    position[members] -= position[members].mean(axis=0)
    # To load the compiled loops takes longer than all else that is asked of a small packing.
    product = system.dynamical_matrix if system.size <= system.limits.dense else system.operator
    found = []
    # One motion after the other: of millions of spheres six fill the memory.
    for k in range(dof):
        motion = np.zeros((network.n_particles, dof))
        motion[members, k] = 1
        if k >= 3:
            motion[members, :3] = np.cross(np.eye(3)[k - 3], position[members])
        vector = system.sqrt_mass.times(motion.ravel())
        vector /= norm(vector)
        if dot(vector, product @ vector) <= system.zero_threshold:
            found.append(vector)
    return np.column_stack(found) if found else np.empty((system.size, 0))


def _unwrapped(network: Network, touching: sp.csr_matrix, members: Bools) -> Floats:
    """Shape (n, 3), m: places of a cluster's spheres, followed from contact to contact."""
    pair = ~network.with_wall
    i, j = network.particle_i[pair], network.particle_j[pair]
    branch = (network.lever_i - network.lever_j)[pair]
    first, n = int(np.flatnonzero(members)[0]), network.n_particles
    order, before = breadth_first_order(touching, first, directed=False)
    place, back = np.zeros((n, 3)), np.arange(n)
    back[order[1:]] = before[order[1:]]
    for near, far, step in ((i, j, branch), (j, i, -branch)):
        joins = back[far] == near
        place[far[joins]] = step[joins]
    place[first] = 0
    # Each place is now relative to the sphere before; go on from there, twice as far every time.
    while (back[order] != first).any():
        place += place[back]
        back = back[back]
    return place
