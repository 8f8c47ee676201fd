"""What a wave is computed with: the springs, the push of the source wall, and the receivers.

Of a packing that repeats itself sideways (`modal.packing.repeats`) one part is enough: the wall
pushes all parts alike, and the receivers read each sphere from the one of the part that moves as it
does. That is exact for parts that are equal. Parts that differ by round-off are replaced by equal
ones, which changes a wave little: with C the contacts' strains times the roots of their
stiffnesses, in mass-scaled motions, A = C^T C, and y = (C v, v') follows (C v)' = C v',
v'' = -C^T (C v) + the push. Both right-hand sides conserve |y|, the root of twice the energy, so
that after a time t the two waves differ by |C - C'| t of the largest |y| at most; and
|C - C'| <= `Repeats.difference` omega_bound, whose square bounds all omega^2.
"""

from __future__ import annotations

import numpy as np

from modal.packing.network import Network
from modal.packing.repeats import lateral_repeats
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.arrays import Floats, Ints
from modal.waves.receivers import Receivers


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


class Driven:
    """A network that its source wall moves, in terms of mass-scaled motions M^1/2 u.

    `operator` is A; `start()` the force (6n,) for a unit displacement of the wall; `receivers` read
    what is recorded from motions of the operator's spheres. All of the network is computed where
    `whole`, else one of its lateral repeats, `repeats` of them, if in the time `duration`, s, that
    changes the motion by at most `tolerance` of the largest: by `difference`, at most, which is 0
    for all of it. Other arguments as of `Receivers`.
    """

    def __init__(
        self,
        network: Network,
        duration: float,
        tolerance: float,
        *,
        pre_stress: str = "none",
        particles: bool = False,
        direction: str = "z",
        whole: bool = False,
    ) -> None:
        self.receivers = Receivers(
            network,
            pre_stress=pre_stress,
            particles=particles,
            direction=direction,
        )
        part, self.repeats, self.difference = network, 1, 0.0
        first: Ints | slice = slice(None)
        found = None if whole else lateral_repeats(network, pre_stress=pre_stress != "none")
        if found is not None and found.count > 1:
            difference = found.difference * bound_of_omega(found.part) * duration
            if difference <= tolerance:
                part, first, self.repeats = found.part, found.first, found.count
                self.difference = difference
                self.receivers.move_as(found.member)
        self.operator = ContactOperator(part, mass_scaled=True, pre_stress=pre_stress).renumbered()
        if self.operator.order is not None:
            number = np.empty_like(self.operator.order)
            number[self.operator.order] = np.arange(len(number))
            self.receivers.move_as(number)
        self._first, self._part = first, part

    def start(self) -> Floats:
        """The mass-scaled force of the wall (6n,) per metre of its motion, made anew each time."""
        push = self.receivers.source.reshape(-1, 6)[self._first].ravel()
        return self.operator.inward(RootMass.of(self._part).over(push))
