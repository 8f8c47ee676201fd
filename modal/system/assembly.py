"""Global stiffness matrix K (sparse) and mass matrix M (diagonal); walls are fixed bodies."""

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.contacts import contact_tangent, terms_of
from modal.tools.arrays import Floats, Ints

ENDS = (np.array([0, 1, 2, 3, 4, 5]), -1.0), (np.array([0, 1, 2, 6, 7, 8]), 1.0)
"""Of the bodies i and j: which parts of a contact's motion (w, theta_i, theta_j) are theirs, and
the sign with which their displacement enters w."""


def mass_diagonal(network: Network, dof: int = 6) -> Floats:
    """Shape (dof n,): m, m, m, I, I, I of each particle, kg and kg m^2; of 3 its masses alone."""
    return np.column_stack([network.mass] * 3 + [network.inertia] * (dof - 3)).ravel()


def stiffness_matrix(network: Network, dof: int = 6, pre_stress: str = "none") -> sp.csr_matrix:
    """Sparse K, (dof n, dof n); N/m, N, N m. Six rows a particle, u then theta, or three, u alone.

    `pre_stress` as in `modal.system.contacts`: with "full" and "law" K is not symmetric. A
    particle that touches itself through a period has both sides of the contact on one block;
    repeated pairs add up.
    """
    return assembled(network, contact_tangent(network, terms_of(pre_stress)), dof)


def block(tangent: Floats, row: int, column: int, size: int = 6) -> Floats:
    """Shape (m, size, size): what end `column` of each contact does to end `row`; 0 is i, 1 is j.

    `tangent` (m, 9, 9) as of `contact_tangent`; `size` of 3 keeps the translations alone.
    """
    (a, sign_a), (b, sign_b) = ENDS[row], ENDS[column]
    signs = np.ones((2, 6))
    signs[0, :3], signs[1, :3] = sign_a, sign_b
    part = tangent[:, a[:size, None], b[:size]]
    part *= signs[0, :size, None] * signs[1, :size]
    return part


def assembled(network: Network, tangent: Floats, size: int = 6) -> sp.csr_matrix:
    """Sparse (size n, size n) matrix from the tangent (m, 9, 9) of each contact.

    `size` of 3 keeps the translations alone.
    """
    n = network.n_particles
    pair = network.particle_j >= 0
    ends = network.particle_i, network.particle_j
    blocks, rows, columns = list[Floats](), list[Ints](), list[Ints]()
    for a, b in ((0, 0), (1, 1), (0, 1), (1, 0)):
        on = slice(None) if a == b == 0 else pair
        blocks.append(block(tangent[on], a, b, size))
        rows.append(ends[a][on])
        columns.append(ends[b][on])
    whole, row, column = np.concatenate(blocks), np.concatenate(rows), np.concatenate(columns)
    # Whole blocks are sorted and added up, a thirty-sixth of the indices that entries would take.
    order = np.lexsort((column, row))
    row, column = row[order], column[order]
    first = np.flatnonzero(np.diff(row, prepend=-1) | np.diff(column, prepend=-1))
    summed = np.add.reduceat(whole[order], first, axis=0) if len(first) else whole
    start = np.searchsorted(row[first], np.arange(n + 1))
    shape = size * n, size * n
    return sp.bsr_matrix((summed, column[first], start), shape).tocsr()


def own_blocks(network: Network, pre_stress: str = "none") -> Floats:
    """Shape (n, 6, 6): K's block of each particle with itself, part by part of the contacts."""
    blocks = np.zeros((network.n_particles, 6, 6))
    for part in network.parts():
        tangent = contact_tangent(part, terms_of(pre_stress))
        i, j = part.particle_i, part.particle_j
        # Both sides of a contact with an own image are on one block, with what couples them.
        own = np.where(i == j, i, -1)
        for at, row, column in ((i, 0, 0), (j, 1, 1), (own, 0, 1), (own, 1, 0)):
            bodies, gather = gathered(at)
            local = gather @ block(tangent, row, column).reshape(-1, 36)
            blocks[bodies] += local.reshape(-1, 6, 6)
    return blocks


def gathered(*ends: Ints) -> tuple[Ints, sp.csr_matrix]:
    """The bodies (k,) at ends (m,) of contacts, ascending, and (k, m) which of them each has."""
    every = np.concatenate(ends)
    on = np.flatnonzero(every >= 0)
    bodies, row = np.unique(every[on], return_inverse=True)
    return bodies, sp.csr_matrix((np.ones(len(on)), (row, on)), (len(bodies), len(every)))
