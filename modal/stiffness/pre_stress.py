"""The exact tangent of the DEM's Hertz-Mindlin law at a state that already carries forces.

The springs of `modal.stiffness.springs` are the law's stiffness where all forces vanish. At the
exported state the forces turn with the contacts, which adds a little. With n from i to j, l the
distance of the centres, w = u_j - u_i, N the normal force and s the shear force, F = -(N n + s)
acting on i, the law moves the normal by dn = (w - n (n.w)) / l, the overlap by d = -n.w, and turns
s with n and with the mean twist t = n.(theta_i + theta_j) / 2 of the two bodies. Beyond the springs
then

    dF = -N dn + n (s.dn) + t s x n,
    dT = r (s x dn + t s) + d/2 n x s        on both bodies, r the lever of each,

since the lever keeps to the middle of the overlap. A wall does not turn the normal: dn = 0. The
term in N is symmetric, those in s are not: the law is path-dependent and has no energy.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError
from modal.packing.network import Network
from modal.stiffness.springs import contact_stiffness, cross_matrix

PRE_STRESS = ("none", "normal", "full")
"""Springs alone; with the normal force's term (symmetric); with the shear force's terms too."""
TANGENTS = (*PRE_STRESS, "law")
"""And, of imported packings, the tangent of their own program's law (`.law_tangent`)."""
SYMMETRIC = ("none", "normal")
"""Those whose stiffness is symmetric."""


def centre_distance(network: Network) -> Floats:
    """Shape (m,), m: between the centres of a contact; infinite at a wall (its normal is fixed)."""
    distance = np.linalg.norm(network.branch, axis=1)
    return np.where(network.with_wall, np.inf, distance)


def forces_of(network: Network, pre_stress: str) -> tuple[Floats | None, Floats | None]:
    """Normal (m,) and tangential forces (m, 3) that `pre_stress` asks for, N, or None."""
    purpose = f"pre-stress {pre_stress!r} (there is 'none')"
    normal = None if pre_stress == "none" else network.known("force_normal", purpose)
    shear = network.known("force_tangential", purpose) if pre_stress == "full" else None
    return normal, shear


def contact_tangent(network: Network, pre_stress: str = "none") -> Floats:
    """Shape (m, 12, 12), N/m, N and N m: minus the forces per motion (u_i, theta_i, u_j, theta_j).

    Zero in a wall's rows and columns. `pre_stress` is one of `PRE_STRESS`.
    """
    if pre_stress not in PRE_STRESS:
        raise InputError(f"pre-stress {pre_stress!r}: choose one of {', '.join(PRE_STRESS)}")
    K = contact_stiffness(network)
    pressed, sheared = forces_of(network, pre_stress)
    if pressed is None:
        return K
    m, n, pair = network.n_contacts, network.normal, ~network.with_wall
    w = np.zeros((m, 3, 12))
    w[:, :, 0:3] = -np.eye(3)
    w[pair, :, 6:9] = np.eye(3)
    across = np.eye(3) - n[:, :, None] * n[:, None, :]
    dn = across @ w / centre_distance(network)[:, None, None]
    force = -pressed[:, None, None] * dn
    if sheared is not None:
        s = -sheared
        twist = np.zeros((m, 12))
        twist[:, 3:6] = n / 2
        twist[pair, 9:12] = n[pair] / 2
        force += n[:, :, None] * np.einsum("ci,cij->cj", s, dn)[:, None, :]
        force += np.cross(s, n)[:, :, None] * twist[:, None, :]
        overlap = -np.einsum("ci,cij->cj", n, w)
        turning = cross_matrix(s) @ dn + s[:, :, None] * twist[:, None, :]
        common = np.cross(n, s)[:, :, None] * (overlap / 2)[:, None, :]
        for rows, lever in ((slice(3, 6), network.lever_i), (slice(9, 12), -network.lever_j)):
            arm = np.einsum("ci,ci->c", n, lever)
            K[:, rows] -= arm[:, None, None] * turning + common
    K[:, 0:3] -= force
    K[:, 6:9] += force
    K[~pair, 6:12] = 0
    return K


def asymmetry(matrix: sp.csr_matrix) -> float:
    """Frobenius norm of a matrix's antisymmetric part over its own: 0 where it is symmetric."""
    difference = (matrix - matrix.T) / 2
    return float(np.sqrt((difference.data**2).sum() / (matrix.data**2).sum()))
