"""Assemble the global stiffness matrix K (sparse) and mass matrix M (diagonal); walls are fixed."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.contacts import PreStress, contact_tangent, terms_of
from modal.tools.arrays import Floats, Ints


class ContactEnd(NamedTuple):
    """One end of a contact.

    `components` are the components of the contact's motion (w, theta_i, theta_j) that depend on the
    body at this end; its displacement enters w with the sign `sign`.
    """

    components: Ints
    sign: float


ENDS = (
    ContactEnd(np.array([0, 1, 2, 3, 4, 5]), -1.0),
    ContactEnd(np.array([0, 1, 2, 6, 7, 8]), 1.0),
)
"""The two ends of a contact, at bodies i and j: the components of the motion, and the sign."""


def mass_diagonal(network: Network, dof: int = 6) -> Floats:
    """Return m, m, m, I, I, I of each particle, (dof n,): masses, kg, moments of inertia, kg m^2.

    With a `dof` of 3 only the masses are returned.
    """
    return np.column_stack([network.mass] * 3 + [network.inertia] * (dof - 3)).ravel()


def stiffness_matrix(
    network: Network, dof: int = 6, pre_stress: PreStress = "none"
) -> sp.csr_matrix:
    """Assemble K, sparse (dof n, dof n); N/m, N, N m.

    A particle has six rows, u then theta, or three, u alone. K is not symmetric if `pre_stress`
    (`modal.system.contacts`) is "full" or "law". If a particle touches itself through a period, its
    diagonal block contains both sides of the contact; contacts of the same pair add up.
    """
    return stiffness_blocks(network, dof, pre_stress).tocsr()


def stiffness_blocks(
    network: Network, dof: int = 6, pre_stress: PreStress = "none"
) -> sp.bsr_matrix:
    """Assemble K as `stiffness_matrix` does, in blocks (dof, dof) of particles.

    Each particle has a block with itself, which may be zero.
    """
    return assembled(network, terms_of(pre_stress), dof)


def block(tangent: Floats, row: int, column: int, size: int = 6) -> Floats:
    """Return the stiffness of end `row` of each contact against the motion of end `column`.

    The shape is (m, size, size); 0 is the end at i, 1 that at j. `tangent` (m, 9, 9) comes from
    `contact_tangent`; with a `size` of 3 only translations are returned.
    """
    row_end = ENDS[row]
    column_end = ENDS[column]
    row_signs = np.ones(6)
    row_signs[:3] = row_end.sign
    column_signs = np.ones(6)
    column_signs[:3] = column_end.sign
    blocks = tangent[:, row_end.components[:size, None], column_end.components[:size]]
    blocks *= row_signs[:size, None] * column_signs[:size]
    return blocks


def assembled(network: Network, terms: tuple[str, ...], size: int = 6) -> sp.bsr_matrix:
    """Assemble a matrix of blocks (size, size) from tangents of the contacts with some terms.

    With a `size` of 3 only translations are assembled. Contacts are taken part by part, so that
    their tangents take little memory.
    """
    n = network.n_particles
    all_places = _places_of_blocks(network)
    blocks = np.zeros((len(all_places), size, size))
    for contacts in network.parts():
        tangent = contact_tangent(contacts, terms)
        bodies = (contacts.particle_i.astype(np.int64), contacts.particle_j.astype(np.int64))
        for row, column in ((0, 0), (1, 1), (0, 1), (1, 0)):
            with_wall = (bodies[row] < 0) | (bodies[column] < 0)
            index = np.searchsorted(all_places, bodies[row] * n + bodies[column])
            indices, gather = gathered(np.where(with_wall, -1, index))
            sums = gather @ block(tangent, row, column, size).reshape(-1, size**2)
            blocks[indices] += sums.reshape(-1, size, size)
    start = np.searchsorted(all_places, np.arange(n + 1) * n)
    return sp.bsr_matrix((blocks, all_places % n, start), (size * n, size * n))


def _places_of_blocks(network: Network) -> Ints:
    """Return the places n i + j of all blocks, ascending: of touching bodies i, j and of i, i."""
    n = network.n_particles
    is_pair = network.particle_j >= 0
    i = network.particle_i[is_pair].astype(np.int64)
    j = network.particle_j[is_pair].astype(np.int64)
    own = np.arange(n) * (n + 1)
    return np.unique(np.concatenate([own, i * n + j, j * n + i]))


def diagonal_blocks(network: Network, pre_stress: PreStress = "none") -> Floats:
    """Compute K's block of each particle with itself, shape (n, 6, 6).

    Contacts are taken part by part, so that their tangents take little memory.
    """
    blocks = np.zeros((network.n_particles, 6, 6))
    for contacts in network.parts():
        tangent = contact_tangent(contacts, terms_of(pre_stress))
        i = contacts.particle_i
        j = contacts.particle_j
        # If a sphere touches its own image, the block holds both ends and what couples them.
        self_contact = np.where(i == j, i, -1)
        for bodies, row_end, column_end in (
            (i, 0, 0),
            (j, 1, 1),
            (self_contact, 0, 1),
            (self_contact, 1, 0),
        ):
            indices, gather = gathered(bodies)
            sums = gather @ block(tangent, row_end, column_end).reshape(-1, 36)
            blocks[indices] += sums.reshape(-1, 6, 6)
    return blocks


def gathered(*ends: Ints) -> tuple[Ints, sp.csr_matrix]:
    """Return the sorted bodies (k,) at contact ends (m,), and a sparse matrix (k, m).

    The matrix sums values of the ends for each body. Walls, which are negative, are left out.
    """
    all_ends = np.concatenate(ends)
    at_body = np.flatnonzero(all_ends >= 0)
    bodies, row = np.unique(all_ends[at_body], return_inverse=True)
    shape = (len(bodies), len(all_ends))
    return bodies, sp.csr_matrix((np.ones(len(at_body)), (row, at_body)), shape)
