"""Six strains of a cell, and what each does to the contacts while no sphere leaves the mean field.

A uniform displacement gradient G moves the centre at x by G x, and what is periodic or touches a
wall with it. The spheres turn with the rotation in G. What the strains do to the contacts is in
`modal.system.imposed`. Shears with z slide horizontal planes over each other,
as walls can; which rotation is in G makes no difference to a packing that is free to turn.
"""

from __future__ import annotations

import numpy as np

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.system.imposed import Gradients
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

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


STRAINED = Gradients(gradients())
"""All spheres follow the six strains."""


def voigt(tensor: Floats) -> Floats:
    """Shape (6,) from a symmetric stress (3, 3): xx, yy, zz, yz, zx, xy."""
    return np.array([tensor[a, b] for a, b in AXES])


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
