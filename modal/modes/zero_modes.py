"""Find the zero modes of loose parts from the structure of the contacts and small null spaces.

A sphere with fewer than three contacts can turn or swing freely: six motions without a contact,
three about a single contact point, one about the line through two. Removing such spheres with their
contacts leaves others with fewer than three, so that loose parts are peeled off layer by layer.
With the remaining spheres fixed, each connected loose part has a small stiffness matrix. Its null
space, padded with zeros, belongs to the null space of K: K has no negative direction, so that a
motion without energy stretches no contact. A cluster that no wall holds also moves as a whole. The
exact count of `modal.modes.collective` shows whether the remaining spheres are really rigid.

Held bodies are walls: they hold the clusters that touch them. If only some motions of a body are
held, its other motions remain degrees of freedom.
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
from modal.system.assembly import stiffness_blocks
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Bools, Floats, Ints

MIN_NEW_SHARE = 1e-8
"""Least share of the squared norm of a motion that is orthogonal to the known modes; a motion with
a smaller share is a combination of these modes."""
CONTACTS_OF_HELD_SPHERE = 3
"""Number of contacts that hold a sphere in all six directions."""


@dataclass(frozen=True)
class FloppyModes:
    """The zero modes and unstable modes of a packing, which lists of elastic modes leave out.

    Attributes
    ----------
    basis : sparse matrix (size, z)
        Orthonormal in the mass-scaled degrees of freedom; its last columns are the unstable modes,
        which release energy.
    kinds : dict
        Numbers of zero modes: `free_particles`, of particles without contacts; `loose_clusters`, of
        clusters that no wall holds, or that slide along a wall without tangential springs;
        `hinged`, of loosely held parts of clusters that touch a wall; `spinning`, rotations of
        particles without tangential springs; `collective`, motions of many spheres together, which
        an exact count has shown.
    counted : bool
        Whether an exact count was made; without it there may be more than `total`.
    whole : bool
        Whether no loose part was too large to be analysed as a whole.
    unstable : int
        Number of unstable modes.
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
        """Number of zero and unstable modes, excluded from lists of modes."""
        return int(self.basis.shape[1])


def by_structure(system: LinearSystem) -> FloppyModes:
    """Return the zero modes that the structure of the contacts shows; kept with the network.

    If some motion may release energy, negative and positive stiffnesses may cancel, and only the
    motions that no contact resists are returned. `modal.modes.collective` counts the others.
    """
    return system.cached("floppy modes", lambda: _find_by_structure(system))


def _find_by_structure(system: LinearSystem) -> FloppyModes:
    """Find the zero modes as `by_structure` does; only contacts of loose spheres are assembled."""
    network = system.network
    dof = system.dof
    semidefinite = system.semidefinite
    touching = _adjacency(network)
    n_clusters, cluster = connected_components(touching, directed=False)
    anchored = np.zeros(n_clusters, bool)
    last_end = np.where(network.with_wall, network.particle_i, network.partner)
    for end in (network.particle_i, last_end):
        anchored[cluster[end[network.with_held]]] = True
    moves = network.free_motions[:, :dof].any(axis=1)
    touched = np.isin(np.arange(len(cluster)), [network.particle_i, network.particle_j]) & moves
    loose = touched & ~keeping_contacts(network, CONTACTS_OF_HELD_SPHERE) & semidefinite
    is_free = network.free_motions[:, :dof].ravel()
    untouched_rows = _rows(np.flatnonzero(~touched), dof)
    untouched_rows = untouched_rows[is_free[untouched_rows]]
    kinds = {"free_particles": len(untouched_rows), "loose_clusters": 0, "hinged": 0}
    rows = [untouched_rows]
    null_spaces = [sp.identity(len(untouched_rows))]
    in_rigid_part = np.repeat(touched, dof) & is_free
    loose_spheres = np.flatnonzero(loose)
    local_index = np.full(network.n_particles, -1)
    local_index[loose_spheres] = np.arange(len(loose_spheres))
    local_stiffness = _stiffness_among(system, loose_spheres)
    loose_parts = _loose_parts(touching, loose)
    for spheres in _pieces(loose_parts, system.limits.piece):
        piece_rows = _rows(spheres, dof)
        local_rows = _rows(local_index[spheres], dof)[is_free[piece_rows]]
        piece_rows = piece_rows[is_free[piece_rows]]
        in_rigid_part[piece_rows] = False
        stiffness = local_stiffness[local_rows][:, local_rows].toarray()
        square, vector = eigh(stiffness, check_finite=False)
        null_space = vector[:, square <= system.zero_threshold]
        kind = "hinged" if anchored[cluster[spheres[0]]] else "loose_clusters"
        kinds[kind] += null_space.shape[1]
        rows.append(piece_rows)
        null_spaces.append(null_space)
    # An empty row in the rigid part: a sphere without tangential springs turns freely.
    if semidefinite:
        largest_entry = system.diagonal
    else:
        matrix = system.assemble_dynamical_matrix()
        largest_entry = abs(matrix).max(axis=1).toarray().ravel()
    spins = np.flatnonzero((largest_entry <= system.zero_threshold) & in_rigid_part)
    blocks = sp.block_diag([*null_spaces, sp.identity(len(spins))], format="coo")
    entries = (np.concatenate([*rows, spins])[blocks.row], blocks.col)
    basis = sp.csc_matrix((blocks.data, entries), shape=(system.size, blocks.shape[1]))
    if semidefinite:
        # Clusters at a wall are tried too: without tangential springs they slide along it.
        for number in np.unique(cluster[touched & ~loose]):
            rigid = _rigid_motions(system, touching, cluster == number)
            rigid = rigid - basis @ (basis.T @ rigid)
            square, vector = eigh(rigid.T @ rigid)
            is_new = square > MIN_NEW_SHARE
            new = rigid @ vector[:, is_new] / np.sqrt(square[is_new])
            kinds["loose_clusters"] += new.shape[1]
            basis = sp.hstack([basis, sp.csc_matrix(new)], format="csc")
    whole = semidefinite and all(len(part) <= system.limits.piece for part in loose_parts)
    return FloppyModes(basis, kinds | {"spinning": len(spins), "collective": 0}, whole=whole)


def _pieces(parts: list[Ints], max_size: int) -> list[Ints]:
    """Cut loose parts into pieces of at most `max_size` spheres."""
    pieces = []
    for part in parts:
        count = -(-len(part) // max_size)
        pieces.extend(np.array_split(part, count))
    return pieces


def _adjacency(network: Network) -> sp.csr_matrix:
    """Return a matrix (n, n) with an entry at i, j for each contact of two spheres.

    Contacts with walls and with held bodies are left out.
    """
    is_pair = ~network.with_held
    n = network.n_particles
    ends = (network.particle_i[is_pair], network.particle_j[is_pair])
    return sp.coo_matrix((np.ones(len(ends[0])), ends), shape=(n, n)).tocsr()


def _rows(spheres: Ints, dof: int) -> Ints:
    """Return the indices (dof k,) of the rows that belong to k spheres, `dof` for each."""
    return (spheres[:, None] * dof + np.arange(dof)).ravel()


def _stiffness_among(system: LinearSystem, spheres: Ints) -> sp.csr_matrix:
    """Return M^-1/2 K M^-1/2 in the rows and columns of some spheres, all other spheres fixed."""
    network = system.network
    chosen = np.zeros(network.n_particles, bool)
    chosen[spheres] = True
    near = chosen[network.particle_i] | (~network.with_wall & chosen[network.partner])
    rows = _rows(spheres, system.dof)
    matrix = system.sqrt_mass.around(stiffness_blocks(network.some(near), system.dof))
    return matrix.tocsr()[rows][:, rows]


def _loose_parts(touching: sp.csr_matrix, loose: Bools) -> list[Ints]:
    """Return the connected parts of the loose spheres, as indices with neighbours adjacent."""
    spheres = np.flatnonzero(loose)
    if len(spheres) == 0:
        return []
    graph = touching[spheres][:, spheres]
    _, part = connected_components(graph, directed=False)
    rank = np.empty(len(spheres), int)
    rank[reverse_cuthill_mckee(graph)] = np.arange(len(spheres))
    order = np.lexsort((rank, part))
    return np.split(spheres[order], np.cumsum(np.bincount(part))[:-1])


def _rigid_motions(system: LinearSystem, touching: sp.csr_matrix, members: Bools) -> Floats:
    """Return the unit, mass-scaled rigid motions of one cluster that cost no energy.

    The shape is (size, up to 6). For rotations, the cluster's spheres are placed as its contacts
    join them across periods. A cluster that is connected to its own image cannot rotate freely:
    such rotations have an omega^2 above `zero_threshold` and are left out.
    """
    network = system.network
    dof = system.dof
    position = _unwrap_positions(network, touching, members)
    position[members] -= position[members].mean(axis=0)
    # Loading the compiled loops takes longer than anything else in a small packing.
    product = system.dynamical_matrix if system.size <= system.limits.dense else system.operator
    free = []
    # One motion after the other: six motions of millions of spheres fill the memory.
    for k in range(dof):
        motion = np.zeros((network.n_particles, dof))
        motion[members, k] = 1
        if k >= 3:
            motion[members, :3] = np.cross(np.eye(3)[k - 3], position[members])
        vector = system.sqrt_mass.times(motion.ravel())
        length = norm(vector)
        if not length > 0:
            continue  # all bodies are held along this motion
        vector /= length
        if dot(vector, product @ vector) <= system.zero_threshold:
            free.append(vector)
    return np.column_stack(free) if free else np.empty((system.size, 0))


def _unwrap_positions(network: Network, touching: sp.csr_matrix, members: Bools) -> Floats:
    """Return positions (n, 3), m, of a cluster's spheres, joined across the periods.

    The positions are joined by following the contacts from sphere to sphere.
    """
    is_pair = ~network.with_held
    i = network.particle_i[is_pair]
    j = network.particle_j[is_pair]
    branch = (network.lever_i - network.lever_j)[is_pair]
    first = int(np.flatnonzero(members)[0])
    order, predecessor = breadth_first_order(touching, first, directed=False)
    position = np.zeros((network.n_particles, 3))
    previous = np.arange(network.n_particles)
    previous[order[1:]] = predecessor[order[1:]]
    for near, far, step in ((i, j, branch), (j, i, -branch)):
        joins = previous[far] == near
        position[far[joins]] = step[joins]
    position[first] = 0
    # Each position is now relative to the previous sphere; each round doubles the distance.
    while (previous[order] != first).any():
        position += position[previous]
        previous = previous[previous]
    return position
