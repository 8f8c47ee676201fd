"""Find the gravity of a packing: from its notes, or from its contact forces.

In a packing at rest under gravity the net contact force on each sphere balances its weight: net
forces are parallel, and proportional to the masses. Direction and size of gravity follow from these
forces by a fit, and the residual is the unbalanced part. A noted gravity (`NOTE` in the group
`study`) is used without a fit.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from modal.packing.network import Network
from modal.packing.state import contacts_per_particle, net_forces, sizes_of_loads
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

NOTE = "gravity"
"""Name of the note that holds the acceleration by gravity, three numbers, m/s^2."""
MAX_UNEXPLAINED_SHARE = 0.1
"""Largest part of the net forces, root mean square, that the weight may leave unexplained. Net
forces of spheres in motion point in all directions: a weight explains a tenth of those of 100
spheres."""
MIN_SPHERES = 4
"""Least number of spheres with contacts; the net force of a single sphere always equals some
weight."""
MIN_WEIGHT_IN_MEAN_FORCES = 1e-6
"""Least weight, divided by the mean contact force, that is not round-off of the forces."""


def with_gravity(network: Network, acceleration: ArrayLike) -> Network:
    """Return a network in which the acceleration by gravity (3,), m/s^2, is noted.

    Raises InputError unless the acceleration is three finite numbers.

    >>> import modal
    >>> noted_gravity(with_gravity(modal.fcc(cells=(1, 1, 2)), (0, 0, -9.81)))
    array([ 0.  ,  0.  , -9.81])
    """
    components = np.asarray(acceleration, float)
    if components.shape != (3,) or not np.isfinite(components).all():
        raise InputError(
            "gravity", "gravity", remedy="give three components in m/s^2, as 0 0 -9.81"
        )
    return replace(network, study=network.study | {NOTE: components})


def noted_gravity(network: Network) -> Floats | None:
    """Return the noted acceleration (3,), m/s^2; None if it is absent or not a vector."""
    note = np.asarray(network.study.get(NOTE, ()))
    if note.shape != (3,) or note.dtype.kind not in "iuf" or not np.isfinite(note).all():
        return None
    return note.astype(float)


def gravity_of(network: Network) -> Floats | None:
    """Return the acceleration (3,), m/s^2, from the notes or the net forces; None without gravity.

    If it is not noted, it is fitted to the net forces on spheres with contacts by least squares.
    Raises UnavailableError if it is not noted and contact forces are absent.
    """
    noted = noted_gravity(network)
    if noted is not None:
        return noted if noted.any() else None
    return network.cached("gravity", lambda: _fit_gravity(network))


def _fit_gravity(network: Network) -> Floats | None:
    """Return the acceleration (3,), m/s^2, that explains the net forces as weight, or None."""
    has_contacts = contacts_per_particle(network) > 0
    force = net_forces(network)[has_contacts, :3]
    mass = _free_masses(network)[has_contacts]
    if has_contacts.sum() < MIN_SPHERES:
        return None
    squares = (mass**2).sum(axis=0)
    acceleration = -(mass * force).sum(axis=0) / np.where(squares > 0, squares, 1.0)
    unexplained = force + mass * acceleration
    if np.linalg.norm(unexplained) > MAX_UNEXPLAINED_SHARE * np.linalg.norm(force):
        return None
    mean_force = float(abs(network.require("force_normal", "weight")).mean())
    weight = float(network.mass[has_contacts].mean() * np.linalg.norm(acceleration))
    return acceleration if weight > MIN_WEIGHT_IN_MEAN_FORCES * mean_force else None


def _free_masses(network: Network) -> Floats:
    """Return the mass (n, 3), kg, of each body along x, y and z; 0 along held motions."""
    return network.mass[:, None] * network.free_motions[:, :3]


def unbalanced_forces(network: Network) -> Floats:
    """Return the net force and torque of each sphere (n,) divided by the mean normal force.

    The weight is subtracted first; a sphere without contacts counts as balanced. UnavailableError
    if contact forces are absent.
    """
    load = net_forces(network)
    acceleration = gravity_of(network)
    if acceleration is not None:
        has_contacts = contacts_per_particle(network) > 0
        load[has_contacts, :3] += _free_masses(network)[has_contacts] * acceleration
    mean_force = abs(network.require("force_normal", "balance")).mean()
    return sizes_of_loads(load, network.radius) / mean_force
