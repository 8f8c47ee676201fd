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
    return assembled(network, contact_tangent(network, terms_of(pre_stress)), dof)


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


def assembled(network: Network, tangent: Floats, size: int = 6) -> sp.csr_matrix:
    """Assemble a sparse (size n, size n) matrix from the tangents (m, 9, 9) of the contacts.

    With a `size` of 3 only translations are assembled.
    """
    n = network.n_particles
    is_pair = network.particle_j >= 0
    all_contacts = slice(None)
    bodies = (network.particle_i, network.particle_j)
    block_list = list[Floats]()
    row_list = list[Ints]()
    column_list = list[Ints]()
    for row_end, column_end, contacts in (
        (0, 0, all_contacts),
        (1, 1, is_pair),
        (0, 1, is_pair),
        (1, 0, is_pair),
    ):
        block_list.append(block(tangent[contacts], row_end, column_end, size))
        row_list.append(bodies[row_end][contacts])
        column_list.append(bodies[column_end][contacts])
    blocks = np.concatenate(block_list)
    row = np.concatenate(row_list)
    column = np.concatenate(column_list)
    # Blocks are sorted and added up as a whole: entries would take 36 times as many indices.
    order = np.lexsort((column, row))
    row = row[order]
    column = column[order]
    first = np.flatnonzero(np.diff(row, prepend=-1) | np.diff(column, prepend=-1))
    sums = blocks
    if len(first):
        sums = np.add.reduceat(blocks[order], first, axis=0)
    start = np.searchsorted(row[first], np.arange(n + 1))
    return sp.bsr_matrix((sums, column[first], start), (size * n, size * n)).tocsr()


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
