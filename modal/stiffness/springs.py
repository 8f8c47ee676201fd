"""The 12x12 stiffness matrix of each contact (Otsubo et al. 2017, section 3).

The relative displacement at the contact point, of j against i, is linear in the twelve motions
(u_i, theta_i, u_j, theta_j):  d = u_j + theta_j x l_j - u_i - theta_i x l_i = B q.  A normal and
two equal tangential springs, k = kn n n^T + kt (1 - n n^T), give the energy d^T k d / 2 and
hence the matrix B^T k B. A wall does not move: only the six columns of i remain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError
from modal.packing.network import Network

SLIDING = ("elastic", "slip")
"""Contacts at the friction limit have the springs of the others, or their normal springs alone."""


def cross_matrix(vector: Floats) -> Floats:
    """Shape (m, 3, 3): [a]x with [a]x b = a x b, for `vector` of shape (m, 3)."""
    matrix = np.zeros((len(vector), 3, 3))
    x, y, z = vector.T
    matrix[:, 0, 1], matrix[:, 0, 2], matrix[:, 1, 2] = -z, y, -x
    matrix[:, 1, 0], matrix[:, 2, 0], matrix[:, 2, 1] = z, -y, x
    return matrix


def contact_springs(network: Network) -> Floats:
    """Shape (m, 3, 3), N/m: kn n n^T + kt (1 - n n^T) of each contact."""
    n = network.normal
    kn, kt = network.stiffness_normal, network.stiffness_tangential
    springs = (kn - kt)[:, None, None] * n[:, :, None] * n[:, None, :]
    springs += kt[:, None, None] * np.eye(3)
    return springs


def contact_kinematics(network: Network) -> Floats:
    """Shape (m, 3, 12): B, from (u_i, theta_i, u_j, theta_j) to the relative displacement, m."""
    B = np.zeros((network.n_contacts, 3, 12))
    B[:, :, 0:3] = -np.eye(3)
    B[:, :, 3:6] = cross_matrix(network.lever_i)
    pair = ~network.with_wall
    B[pair, :, 6:9] = np.eye(3)
    B[pair, :, 9:12] = -cross_matrix(network.lever_j[pair])
    return B


def contact_stiffness(network: Network) -> Floats:
    """Shape (m, 12, 12), N/m, N and N m: B^T k B, zero in the wall's rows and columns."""
    B = contact_kinematics(network)
    return B.transpose(0, 2, 1) @ (contact_springs(network) @ B)


def with_sliding(network: Network, sliding: str) -> Network:
    """The network with contacts at the friction limit as one of `SLIDING` holds them."""
    if sliding not in SLIDING:
        raise InputError(f"sliding {sliding!r}: choose one of {', '.join(SLIDING)}")
    return network if sliding == "elastic" else network.once("slipping", lambda: _slipping(network))


def _slipping(network: Network) -> Network:
    sliding = network.known("sliding", "knowing which contacts slip")
    tangential = np.where(sliding, 0.0, network.stiffness_tangential)
    return replace(network, stiffness_tangential=tangential)
