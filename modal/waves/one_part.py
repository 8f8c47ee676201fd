"""One of the equal parts of a packing in the place of all of it.

Of a packing that repeats itself sideways (`modal.packing.repeats`) one part is enough where the
source moves all parts alike. That is exact for parts that are equal. Parts that differ by round-off
are replaced by equal ones, which changes a wave little: with C the contacts' strains times the
roots of their stiffnesses, in mass-scaled motions, A = C^T C, and y = (C v, v') follows
(C v)' = C v', v'' = -C^T (C v) + the push. Both right-hand sides conserve |y|, the root of twice
the energy, so that after a time t the two waves differ by |C - C'| t of the largest |y| at most;
and |C - C'| <= `Repeats.difference` omega_bound, whose square bounds all omega^2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.packing.network import Network
from modal.packing.repeats import lateral_repeats
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Ints


@dataclass(frozen=True)
class Part:
    """A part of a packing, or all of it, and how the whole is read from it.

    `first` (k,): the body of the whole that each of its k bodies is; `member` (n,): the body of the
    part that moves as each of the whole does; `count` such parts; the motion differs from that of
    the whole by `difference` of the largest at most.
    """

    system: LinearSystem
    first: Ints
    member: Ints
    count: int = 1
    difference: float = 0.0


def one_part(system: LinearSystem, duration: float, tolerance: float) -> Part:
    """The smallest part that will do for the time `duration`, s, within the relative `tolerance`.

    All of it where contacts have dashpots.
    """
    every: Ints = np.arange(system.network.n_particles)
    whole = Part(system, every, every)
    if system.dashpots is not None:
        return whole
    found = lateral_repeats(system.network, pre_stress=system.pre_stress != "none")
    difference = found.difference * bound_of_omega(found.part) * duration
    if found.count == 1 or difference > tolerance:
        return whole
    small = replace(system, network=found.part)
    return Part(small, found.first, found.member, found.count, difference)


def bound_of_omega(network: Network) -> float:
    """A bound of all omega of the springs, 1/s; two to three times the highest.

    A contact stores at most twice what it would for the motion of either sphere alone; and what a
    sphere's contacts store is at most the sum over its six unit motions, of mass-scaled length 1.
    """
    kn, kt = network.stiffness_normal, network.stiffness_tangential
    share = np.zeros(network.n_particles)
    for end, lever, chosen in (
        (network.particle_i, network.lever_i, slice(None)),
        (network.particle_j, network.lever_j, ~network.with_wall),
    ):
        at, across = end[chosen], np.cross(lever, network.normal)[chosen]
        turning = 2 * kt[chosen] * (lever[chosen] ** 2).sum(axis=1)
        turning += (kn - kt)[chosen] * (across**2).sum(axis=1)
        pushing = (kn + 2 * kt)[chosen]
        own = pushing / network.mass[at] + turning / network.inertia[at]
        share += np.bincount(at, own, len(share))
    return float(np.sqrt(2 * share.max()))
