"""Particles that keep contacts enough once those with fewer have been taken away."""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network


def keeping_contacts(network: Network, least: int) -> np.ndarray:
    """Shape (n,) bool: the largest set of particles each of which has `least` contacts with walls
    and with others of the set."""
    i, j, pair = network.particle_i, network.partner, ~network.with_wall
    kept = np.ones(network.n_particles, bool)
    while True:
        alive = kept[i] & (kept[j] | ~pair)
        ends = np.concatenate([i[alive], j[alive & pair]])
        remaining = kept & (np.bincount(ends, minlength=len(kept)) >= least)
        if np.array_equal(remaining, kept):
            return kept
        kept = remaining
