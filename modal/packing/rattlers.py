"""Who carries force and who rattles: particles that keep contacts enough, and are firmly held."""

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Bools, Ints

HELD = 0.05
"""Largest contact force, over the mean one, from which a particle counts as firmly held."""


def keeping_contacts(network: Network, least: int) -> Bools:
    """Shape (n,) bool: particles left when those with fewer than `least` contacts are removed.

    Removing a particle removes its contacts, so this repeats until all that are left have at least
    `least` contacts with each other and with walls.
    """
    return network.cached(f"keeping {least} contacts", lambda: _keeping(network, least))


def _keeping(network: Network, least: int) -> Bools:
    i, j, pair = network.particle_i, network.partner, ~network.with_wall
    kept = np.ones(network.n_particles, bool)
    while True:
        alive = kept[i] & (kept[j] | ~pair)
        ends = np.concatenate([i[alive], j[alive & pair]])
        remaining = kept & (np.bincount(ends, minlength=len(kept)) >= least)
        if np.array_equal(remaining, kept):
            return kept
        kept = remaining


def force_bearing(network: Network) -> Bools:
    """Shape (n,) bool: particles that keep two or more contacts once those with fewer are removed.

    A particle with a single contact cannot be in balance under a force; it is a rattler. So are all
    of a cluster that touches nothing else: no wall, and not the largest. One that lies across the
    end of a period is taken for one that touches itself through it.
    """
    return network.cached("force-bearing", lambda: _bearing(network))


def _bearing(network: Network) -> Bools:
    kept, i, j = keeping_contacts(network, 2), network.particle_i, network.partner
    pair, wall = kept[i] & kept[j] & ~network.with_wall, network.with_wall
    cluster = _clusters(len(kept), i[pair], j[pair])
    size = np.bincount(cluster, kept)
    held = size == size.max(initial=0)
    held[cluster[i[wall | (pair & network.periods.any(axis=1))]]] = True
    return kept & held[cluster]


def _clusters(n: int, i: Ints, j: Ints) -> Ints:
    """Shape (n,): the lowest particle of each one's cluster; i and j (m,) touch.

    Each round the lowest of a cluster falls to the lowest that its members touch, and so do they.
    """
    lowest = np.arange(n)
    while True:
        own, other = lowest[i], lowest[j]
        below = lowest.copy()
        np.minimum.at(below, own, other)
        np.minimum.at(below, other, own)
        below = below[below]
        if np.array_equal(below, lowest):
            return lowest
        lowest = below


def firmly_held(network: Network) -> Bools:
    """Shape (n,) bool: force-bearing particles with a contact force above `HELD` times the mean.

    The others, a few in a thousand, move about between their neighbours by more than a wave moves
    them. Where the forces are not known, all force-bearing particles count as firmly held.
    """
    if network.force_normal is None or network.n_contacts == 0:
        return force_bearing(network)
    force = abs(network.force_normal)
    strong = force >= HELD * force.mean()
    held = np.zeros(network.n_particles, bool)
    held[network.particle_i[strong]] = True
    held[network.particle_j[strong & ~network.with_wall]] = True
    return force_bearing(network) & held
