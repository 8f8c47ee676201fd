"""Recognise gravity in the net forces of contacts: parallel, and in proportion to the masses.

In a packing at rest in a box under gravity the net force of its contacts on each sphere carries its
weight. Direction and size of gravity follow from these forces, and so does the part of them that
is not balanced.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.state import contacts_per_particle, net_forces, sizes_of_loads
from modal.tools.arrays import Floats

MAX_UNEXPLAINED_SHARE = 0.1
"""Largest part of the net forces, root mean square, that the weight may leave unexplained. Net
forces of spheres in motion point in all directions: a weight explains a tenth of those of 100
spheres."""
MIN_SPHERES = 4
"""Least number of spheres with contacts; the net force of a single sphere always equals some
weight."""
MIN_WEIGHT_IN_MEAN_FORCES = 1e-6
"""Least weight, divided by the mean contact force, that is not round-off of the forces."""


def gravity_of(network: Network) -> Floats | None:
    """Return the acceleration (3,), m/s^2, that explains the net forces as weight, or None.

    This is a least-squares fit over the spheres with contacts. UnavailableError if contact forces
    are absent.
    """
    return network.cached("gravity", lambda: _gravity_of(network))


def _gravity_of(network: Network) -> Floats | None:
    """Fit the acceleration as `gravity_of` does, without the cache."""
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
    """Return the mass (n, 3), kg, that is free to move along x, y and z."""
    return network.mass[:, None] * network.free_motions[:, :3]


def unbalanced_forces(network: Network) -> Floats:
    """Return the net force and torque of each sphere (n,) divided by the mean normal force.

    A recognised weight is taken off; a sphere without contacts counts as balanced.
    UnavailableError if contact forces are absent.
    """
    load = net_forces(network)
    acceleration = gravity_of(network)
    if acceleration is not None:
        has_contacts = contacts_per_particle(network) > 0
        load[has_contacts, :3] += _free_masses(network)[has_contacts] * acceleration
    mean_force = abs(network.require("force_normal", "balance")).mean()
    return sizes_of_loads(load, network.radius) / mean_force
