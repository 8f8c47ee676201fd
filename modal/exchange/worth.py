"""How much each term of another program's law is worth in the stiffness matrix of a packing."""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.system.contacts import GROWTH, SHEAR, TANGENTS, Contacts

NEEDS_SHEAR = SHEAR, GROWTH
"""Terms that are not known where shear forces are not told."""
ROUND_OFF = 1e-14
"""A share below which a term is none."""
WEIGHED = 50_000
"""Contacts on which the terms of a law are weighed."""


def worth(network: Network) -> dict[str, float]:
    """What each of the law's terms adds to K, relative: root mean square over all entries.

    Rotations count as arcs of the mean radius. Terms that this law does not have, or whose forces
    are not told, are left out. Of more than `WEIGHED` contacts evenly spaced ones are taken, whose
    matrices fill half a gigabyte.
    """
    m = network.n_contacts
    if m > WEIGHED:
        network = network.some(np.arange(0, m, -(-m // WEIGHED)))
    arc = np.array([1.0] * 3 + [1 / float(network.radius.mean())] * 3)
    scale = np.array([*arc, *arc[3:]])
    springs = Contacts.of(network).tangent() * scale[:, None] * scale
    size = float(np.linalg.norm(springs))
    added = {}
    for term in TANGENTS["law"]:
        if network.force_tangential is None and term in NEEDS_SHEAR:
            continue
        change = Contacts.of(network, (term,)).tangent() * scale[:, None] * scale - springs
        added[term] = float(np.linalg.norm(change)) / size
    return {term: share for term, share in added.items() if share > ROUND_OFF}
