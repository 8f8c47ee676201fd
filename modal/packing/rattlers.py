"""Find rattlers, the particles that bear force, and those that are firmly held."""

import numpy as np

from modal.packing.network import Network
from modal.tools.arrays import Bools, Ints

MIN_FORCE_IN_MEAN_FORCES = 0.05
"""Least value of a particle's largest contact force, divided by the mean force, with which the
particle counts as firmly held. The other particles, a few in a thousand, move between their
neighbours by more than a wave moves them."""


def keeping_contacts(network: Network, least: int) -> Bools:
    """Return which particles (n,) remain when those with fewer than `least` contacts are removed.

    A particle's contacts are removed with it, so the removal is repeated until all remaining
    particles have at least `least` contacts with each other and with walls. Held bodies remain, as
    walls do.
    """
    return network.cached(f"keeping {least} contacts", lambda: _keeping_contacts(network, least))


def _keeping_contacts(network: Network, least: int) -> Bools:
    """Find the particles as `keeping_contacts` does, without the cache."""
    i = network.particle_i
    j = network.partner
    pair = ~network.with_wall
    held = network.held
    remaining = np.ones(network.n_particles, bool)
    while True:
        present = remaining[i] & (remaining[j] | ~pair)
        ends = np.concatenate([i[present], j[present & pair]])
        contacts = np.bincount(ends, minlength=len(remaining))
        fewer = remaining & ((contacts >= least) | held)
        if np.array_equal(fewer, remaining):
            return remaining
        remaining = fewer


def contacts_that_move(network: Network) -> Bools:
    """Return which contacts (m,) have at least one end that is neither a wall nor a held body."""
    held = network.held
    return ~held[network.particle_i] | ~(network.with_wall | held[network.partner])


def force_bearing(network: Network) -> Bools:
    """Return which particles (n,) bear force: they have two contacts with other such particles.

    A particle with a single contact cannot be in balance under a force; it is a rattler. All
    particles of a cluster that touches no wall and is not the largest are rattlers, too. A cluster
    with a contact through a period counts as spanning the cell. Held bodies are walls: they support
    others, and are not among the particles that bear force.
    """
    return network.cached("force-bearing", lambda: _force_bearing(network))


def _force_bearing(network: Network) -> Bools:
    """Find the particles as `force_bearing` does, without the cache."""
    held = network.held
    remaining = keeping_contacts(network, 2)
    i = network.particle_i
    j = network.partner
    with_held = network.with_held
    pair = remaining[i] & remaining[j] & ~with_held
    cluster = _find_clusters(len(remaining), i[pair], j[pair])
    size = np.bincount(cluster, remaining & ~held)
    is_supported = size == size.max(initial=0)
    through_period = pair & network.periods.any(axis=1)
    is_supported[cluster[i[with_held | through_period]]] = True
    is_supported[cluster[network.partner[with_held & ~network.with_wall]]] = True
    return remaining & is_supported[cluster] & ~held


def _find_clusters(n: int, i: Ints, j: Ints) -> Ints:
    """Return for each particle the lowest particle (n,) of its cluster; i and j (m,) touch.

    In each round the label of a cluster becomes the lowest label that its members touch.
    """
    label = np.arange(n)
    while True:
        label_i = label[i]
        label_j = label[j]
        lower = label.copy()
        np.minimum.at(lower, label_i, label_j)
        np.minimum.at(lower, label_j, label_i)
        lower = lower[lower]
        if np.array_equal(lower, label):
            return label
        label = lower


def firmly_held(network: Network) -> Bools:
    """Return which particles (n,) bear force and have at least one contact force above a limit.

    The limit is `MIN_FORCE_IN_MEAN_FORCES`. If the forces are not known, all force-bearing
    particles count as firmly held.
    """
    if network.force_normal is None or network.n_contacts == 0:
        return force_bearing(network)
    force = abs(network.force_normal)
    strong = force >= MIN_FORCE_IN_MEAN_FORCES * force.mean()
    has_strong_contact = np.zeros(network.n_particles, bool)
    has_strong_contact[network.particle_i[strong]] = True
    has_strong_contact[network.particle_j[strong & ~network.with_wall]] = True
    return force_bearing(network) & has_strong_contact
