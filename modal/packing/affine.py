"""Stiffness of a packing along z if every sphere followed the mean strain and none turned.

An upper bound, exact for crystals whose spheres are all centres of symmetry. It says how fast a
wave can be before anything is solved.
"""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Floats


def affine_stiffness(network: Network) -> Floats:
    """Shape (p,), J: what each contact between spheres adds to P-wave modulus times volume.

    (kn n_z^4 + kt (n_z^2 - n_z^4)) l^2 with the branch's length l; contacts with walls are left
    out.
    """
    pair = ~network.with_wall
    branch = network.branch[pair]
    nz2 = network.normal[pair, 2] ** 2
    kn, kt = network.stiffness_normal[pair], network.stiffness_tangential[pair]
    stiffness: Floats = (kn * nz2**2 + kt * (nz2 - nz2**2)) * (branch**2).sum(axis=1)
    return stiffness


def affine_velocity(network: Network) -> float:
    """P-wave velocity, m/s, of all contacts over the mass of all spheres, rattlers included.

    For times to be reckoned with in packings of any size. The ends count: n layers have n - 1
    distances, so a crystal's is sqrt(1 - 1/n) of that of its bulk.
    """
    return float(np.sqrt(affine_stiffness(network).sum() / network.mass.sum()))
