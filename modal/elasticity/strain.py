"""Six strains of a cell, and what each does to the contacts while no sphere leaves the mean field.

A uniform displacement gradient G moves the centre at x by G x, and what is periodic or touches a
wall with it. The spheres turn with the rotation w in G. The ends of a contact then part by d = G b
- w x (l_i - l_j), b the branch from centre to centre, or to the plane of a wall, which is E b
between spheres, E the symmetric part of G. Shears with z slide horizontal planes over each other,
as walls can; which rotation is in G makes no difference to a packing that is free to turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.stiffness.springs import contact_springs

STRAINS = ("xx", "yy", "zz", "yz", "zx", "xy")
"""Names of the strains, in the order of Voigt."""
AXES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Of each: the direction that moves, and that along which the displacement grows."""


def gradients() -> Floats:
    """Shape (6, 3, 3): displacement gradients of unit strains; shear strains are angles."""
    gradient = np.zeros((6, 3, 3))
    for strain, (moving, along) in enumerate(AXES):
        gradient[strain, moving, along] = 1
    return gradient


def voigt(tensor: Floats) -> Floats:
    """Shape (6,) from a symmetric stress (3, 3): xx, yy, zz, yz, zx, xy."""
    return np.array([tensor[a, b] for a, b in AXES])


def turn(gradient: Floats) -> Floats:
    """Shape (3,): the rotation vector of a displacement gradient (3, 3)."""
    twice = gradient - gradient.T
    return np.array([twice[2, 1], twice[0, 2], twice[1, 0]]) / 2


def has_walls(network: Network) -> bool:
    """Whether the packing stands between two walls along z, and is periodic sideways.

    False where it is periodic in all directions. InputError where it is neither, since there is no
    way to strain it.
    """
    for axis in (0, 1):
        if not network.cell_periodic[axis]:
            raise InputError(
                f"no strain {STRAINS[axis]} can be put on this packing: it is not periodic along "
                f"{'xy'[axis]}; moduli need periods along x and y, and periods or walls along z"
            )
    if network.cell_periodic[2]:
        return False
    touched = np.unique(network.particle_j)
    if not (SOURCE_WALL in touched and RECEIVER_WALL in touched):
        raise InputError(
            "no strain zz can be put on this packing: it is not periodic along z and does not "
            "touch two walls there"
        )
    return True


@dataclass(frozen=True)
class StrainedContacts:
    """The contacts under six unit strains that all spheres follow.

    branch (m, 3), m; springs (m, 3, 3), N/m; stretch (6, m, 3), m, by which the ends of a contact
    part; pull (6, m, 3), N, with which its springs resist, on i.
    """

    branch: Floats
    springs: Floats
    stretch: Floats
    pull: Floats

    @classmethod
    def of(cls, network: Network) -> StrainedContacts:
        """Those of a network."""
        branch, springs = network.branch, contact_springs(network)
        arms = network.lever_i - network.lever_j
        stretch = np.stack([branch @ G.T - np.cross(turn(G), arms) for G in gradients()])
        return cls(branch, springs, stretch, np.einsum("cij,scj->sci", springs, stretch))

    def energy(self) -> Floats:
        """Shape (6, 6), J: the work of each strain against the pull of each; affine C times V."""
        return np.einsum("aci,bci->ab", self.stretch, self.pull)
