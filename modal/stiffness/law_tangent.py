"""The tangent of another program's law of contact, with what it does otherwise than springs do.

Signs as in `modal.stiffness.pre_stress`: n from i to j, w = u_j - u_i, d = -n.w the growth of the
overlap, dn = (w - n (n.w)) / l at a pair and 0 at a wall, F = -N n + s the force on i with the
shear force s. The terms, each by its name:

- "normal force": N turns with the contact, dF = -N dn.
- "shear force": s turns with the contact, dF = -n (s.dn), and its torque with it.
- "growing circle": a contact that keeps a shear displacement has s proportional to the radius of
  its circle, ds = s d / (2 overlap) of Hertz. Not symmetric. `shear_growth` of the network.
- "lever arms": the program's own, R - share * overlap, for motion and for torque
  (`motion_shortening`, `torque_shortening`); else to the middle of the overlap. Not symmetric where
  the two differ.
- "twist" of the two spheres, which turns s in YADE's law, is in none of these programs.
"""

from __future__ import annotations

import numpy as np

from modal.formats.arrays import Floats
from modal.packing.network import Network
from modal.stiffness.pre_stress import centre_distance
from modal.stiffness.springs import contact_springs, cross_matrix

TERMS = ("normal force", "shear force", "growing circle", "lever arms")
PURPOSE = "pre-stress 'law' (of imported packings; there is 'full')"


def law_tangent(network: Network, terms: tuple[str, ...] = TERMS) -> Floats:
    """Shape (m, 12, 12), N/m, N, N m: minus the forces per motion (u_i, theta_i, u_j, theta_j).

    Zero in a wall's rows and columns. `terms` are some of `TERMS`. InputError where the network
    does not know the forces, or what its law does.
    """
    n, m, pair = network.normal, network.n_contacts, ~network.with_wall
    moves, turns, shortening = _arms(network, "lever arms" in terms)
    w = np.zeros((m, 3, 12))
    w[:, :, 0:3] = -np.eye(3)
    w[pair, :, 6:9] = np.eye(3)
    slip = w.copy()
    for end, at in ((0, 3), (1, 9)):
        # Of i: -theta x (arm n); of j, whose arm points back, theta x (-arm n).
        slip[:, :, at : at + 3] = cross_matrix(moves[:, end, None] * n)
    slip[~pair, :, 9:12] = 0
    across = w - n[:, :, None] * np.einsum("ci,cij->cj", n, w)[:, None, :]
    dn = across / centre_distance(network)[:, None, None]
    deeper = -np.einsum("ci,cij->cj", n, w)
    force = contact_springs(network) @ slip
    if "growing circle" in terms:
        grown = _shear(network) * network.known("shear_growth", PURPOSE)[:, None]
        force += grown[:, :, None] * deeper[:, None, :]
    if "shear force" in terms:
        s = _shear(network)
        force -= n[:, :, None] * np.einsum("ci,cij->cj", s, dn)[:, None, :]
    K = np.zeros((m, 12, 12))
    for end, at in ((0, 3), (1, 9)):
        torque = turns[:, end, None, None] * (cross_matrix(n) @ force)
        if "shear force" in terms:
            torque -= turns[:, end, None, None] * (cross_matrix(s) @ dn)
            push = np.cross(n, s) * shortening[:, None]
            torque -= push[:, :, None] * deeper[:, None, :]
        K[:, at : at + 3] = -torque
    # The normal force goes through both centres: it has no torque, whichever way it turns.
    if "normal force" in terms:
        force -= network.known("force_normal", PURPOSE)[:, None, None] * dn
    K[:, 0:3] = -force
    K[:, 6:9] = force
    K[~pair, 6:12] = 0
    return K


def _shear(network: Network) -> Floats:
    return network.known("force_tangential", PURPOSE)


def _arms(network: Network, own: bool) -> tuple[Floats, Floats, Floats]:
    """Arms (m, 2), m, of motion and of torque at both ends, and how the latter shorten (m,)."""
    radius = np.column_stack([network.radius[network.particle_i], network.radius[network.partner]])
    overlap = network.known("overlap", PURPOSE)
    if not own:
        middle = radius - overlap[:, None] / 2
        return middle, middle, np.full(len(overlap), 0.5)
    shares = [network.known(f"{what}_shortening", PURPOSE) for what in ("motion", "torque")]
    moves, turns = (radius - (share * overlap)[:, None] for share in shares)
    return moves, turns, shares[1]
