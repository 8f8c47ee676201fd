"""Collect the motions of a packing that cost little or no energy, for an iterative solver."""

import numpy as np
import scipy.sparse as sp

from modal.modes.zero_modes import by_structure
from modal.solvers.factor import SoftMotions
from modal.system.linear_system import LinearSystem
from modal.tools.arrays import Floats
from modal.tools.errors import InputError


def soft_motions(system: LinearSystem) -> SoftMotions:
    """Return the rigid motions of a packing, and its motions without energy.

    Motions without energy are those that the structure of the contacts shows
    (`modal.modes.zero_modes`), and held motions, whose rows of K are empty. Raises InputError for a
    system of translations alone, whose blocks have three rows.
    """
    if system.dof != 6:
        raise InputError(
            "translations_only",
            "solver multigrid",
            "it takes displacements and rotations together",
            "take another",
        )
    held = system.held_motions
    rigid = _rigid_motions(system)
    rigid -= held @ (held.T @ rigid)
    free = sp.hstack([by_structure(system).basis, held], format="csc")
    return SoftMotions(rigid, free)


def _rigid_motions(system: LinearSystem) -> Floats:
    """Return mass-scaled translations and rotations of all bodies together, (size, 6).

    The largest entry of each is 1, or 0 if all bodies are held. Bodies that touch across a period
    do not move together.
    """
    network = system.network
    position = network.position - network.position.mean(axis=0)
    motions = np.zeros((network.n_particles, 6, 6))
    for axis, unit in enumerate(np.eye(3)):
        motions[:, axis, axis] = 1
        motions[:, :3, 3 + axis] = np.cross(unit, position)
        motions[:, 3 + axis, 3 + axis] = 1
    scaled = system.sqrt_mass.times(motions.reshape(-1, 6))
    largest = abs(scaled).max(axis=0)
    largest[largest == 0] = 1
    return scaled / largest
