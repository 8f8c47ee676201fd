"""The tangent of another program's law, with what it does otherwise than springs do.

Signs as in `modal.stiffness.pre_stress`: n from i to j, w = u_j - u_i, d = -n.w the growth of the
overlap, dn = (w - n (n.w)) / l at a pair and 0 at a wall, F = -N n + s the force on i with the
shear force s. The terms, each by its name:

- "normal force": N turns with the contact, dF = -N dn.
- "shear force": s turns with the contact, dF = -n (s.dn), and its torque with it.
- "growing circle": a contact that keeps a shear displacement has s proportional to the radius of
  its circle, ds = s d / (2 overlap). Not symmetric.
- "lever arms": motion and torque with arms as long as the radii, where this program takes them.
- "twist" of the two spheres, which turns s in YADE's law, is in none of these programs.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from modal.exchange.found import Found
from modal.exchange.program_law import DISPLACEMENT, MIDDLE, ONE_SIDED
from modal.formats.arrays import Floats
from modal.stiffness.matrices import assembled
from modal.stiffness.pre_stress import centre_distance
from modal.stiffness.springs import contact_springs, cross_matrix

TERMS = ("normal force", "shear force", "growing circle", "lever arms")


WEIGHED = 50_000
"""Contacts on which the terms of a law are weighed."""


def law_tangent(found: Found, terms: tuple[str, ...] = TERMS) -> Floats:
    """Shape (m, 12, 12), N/m, N, N m: minus the forces per motion (u_i, theta_i, u_j, theta_j).

    Zero in a wall's rows and columns. `terms` are some of `TERMS`; without shear forces those that
    need them are left out.
    """
    network, n = found.network, found.network.normal
    m, pair = network.n_contacts, ~network.with_wall
    shear = network.force_tangential
    s = np.zeros((m, 3)) if shear is None else shear
    moves, turns = _arms(found, "lever arms" in terms)
    w = np.zeros((m, 3, 12))
    w[:, :, 0:3] = -np.eye(3)
    w[pair, :, 6:9] = np.eye(3)
    slip = w.copy()
    for end, at in ((0, 3), (1, 9)):
        # Of i: -theta x (arm n); of j, whose arm points back, theta x (-arm n).
        slip[:, :, at : at + 3] = cross_matrix(moves[:, end, None] * n)
    slip[~pair, :, 9:12] = 0
    dn = (w - n[:, :, None] * np.einsum("ci,cij->cj", n, w)[:, None, :]) / centre_distance(network)[
        :, None, None
    ]
    deeper = -np.einsum("ci,cij->cj", n, w)
    force = contact_springs(network) @ slip
    if "shear force" in terms:
        force -= n[:, :, None] * np.einsum("ci,cij->cj", s, dn)[:, None, :]
    if "growing circle" in terms:
        grows = np.array(
            [law.grows and law.keeps in (DISPLACEMENT, ONE_SIDED) for law in found.laws]
        )
        share = np.where(grows[found.law], 0.5 / network.known("overlap", "tangent"), 0.0)
        force += (share[:, None] * s)[:, :, None] * deeper[:, None, :]
    K = np.zeros((m, 12, 12))
    for end, at in ((0, 3), (1, 9)):
        torque = turns[:, end, None, None] * (cross_matrix(n) @ force)
        if "shear force" in terms:
            torque -= turns[:, end, None, None] * (cross_matrix(s) @ dn)
            middle = np.array([law.turns == MIDDLE for law in found.laws])[found.law]
            shorter = np.where(middle | ("lever arms" not in terms), 0.5, 0.0)
            push = np.cross(n, s) * shorter[:, None]
            torque -= push[:, :, None] * deeper[:, None, :]
        K[:, at : at + 3] = -torque
    # The normal force goes through both centres: it has no torque, whichever way it turns.
    if "normal force" in terms:
        force -= network.known("force_normal", "tangent")[:, None, None] * dn
    K[:, 0:3] = -force
    K[:, 6:9] = force
    K[~pair, 6:12] = 0
    return K


def law_matrix(found: Found, terms: tuple[str, ...] = TERMS) -> sp.csr_matrix:
    """Sparse K, (6n, 6n), of `law_tangent`; as of `modal.stiffness.matrices`."""
    return assembled(found.network, law_tangent(found, terms))


def worth(found: Found) -> dict[str, float]:
    """What each of the law's terms adds to K, relative: root mean square over all entries.

    Rotations count as arcs of the mean radius. Terms that this law does not have are left out. Of
    more than `WEIGHED` contacts evenly spaced ones are taken, whose matrices fill half a gigabyte.
    """
    m = found.network.n_contacts
    if m > WEIGHED:
        rows = np.arange(0, m, -(-m // WEIGHED))
        found = Found(found.network.with_contacts(rows), found.laws, found.law[rows])
    arc = np.array([1.0] * 3 + [1 / float(found.network.radius.mean())] * 3)
    scale = np.tile(arc, 2)
    springs = law_tangent(found, ()) * scale[:, None] * scale
    size = float(np.linalg.norm(springs))
    added = {}
    for term in TERMS:
        change = law_tangent(found, (term,)) * scale[:, None] * scale - springs
        added[term] = float(np.linalg.norm(change)) / size
    return {term: share for term, share in added.items() if share > 0}


def _arms(found: Found, own: bool) -> tuple[Floats, Floats]:
    """Arms (m, 2), m, of motion and of torque at both ends; to the middle unless `own`."""
    network = found.network
    i, partner = network.particle_i, network.partner
    radius = np.column_stack([network.radius[i], network.radius[partner]])
    middle = radius - network.known("overlap", "lever arms")[:, None] / 2
    if not own:
        return middle, middle
    kinds = ([law.moves for law in found.laws], [law.turns for law in found.laws])
    moves, turns = (
        np.where(
            np.array([kind == MIDDLE for kind in kinds_of])[found.law][:, None], middle, radius
        )
        for kinds_of in kinds
    )
    return moves, turns
