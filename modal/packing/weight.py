"""Weight, where the forces of contacts show it: net forces of one direction, in proportion to mass.

A packing in a box under gravity rests, though its contacts do not balance: what they leave on each
sphere carries its weight. That says the direction and size of gravity, and what is not balanced.
"""

import numpy as np

from modal.packing.network import Network
from modal.packing.state import contacts_per_particle, net_forces, sizes_of_loads
from modal.tools.arrays import Floats

UNEXPLAINED = 0.1
"""Largest part of the net forces, root mean square, that weight leaves where it is recognised. What
motion leaves points anywhere: among 100 spheres weight then explains a tenth of it."""
FEWEST_SPHERES = 4
"""With contacts: the net force of one sphere is always that of some weight."""
LEAST_WEIGHT = 1e-6
"""Over the mean contact force: less is round-off of the forces."""


def gravity_of(network: Network) -> Floats | None:
    """Return the acceleration (3,), m/s^2, that explains the net forces; None where none does.

    By least squares over spheres with contacts. InputError where contact forces are absent.
    """
    return network.cached("gravity", lambda: _gravity_of(network))


def _gravity_of(network: Network) -> Floats | None:
    held = contacts_per_particle(network) > 0
    force = net_forces(network)[held, :3]
    mass = network.mass[held]
    if held.sum() < FEWEST_SPHERES:
        return None
    acceleration = -(mass @ force) / (mass @ mass)
    unexplained = force + mass[:, None] * acceleration
    if np.linalg.norm(unexplained) > UNEXPLAINED * np.linalg.norm(force):
        return None
    mean_force = float(abs(network.require("force_normal", "weight")).mean())
    weight = float(mass.mean() * np.linalg.norm(acceleration))
    return acceleration if weight > LEAST_WEIGHT * mean_force else None


def unbalanced_forces(network: Network) -> Floats:
    """Return each sphere's net force and torque (n,) over the mean normal force of a contact.

    Without its weight where that is recognised; nothing is wrong with a sphere without contacts.
    """
    load = net_forces(network)
    acceleration = gravity_of(network)
    if acceleration is not None:
        held = contacts_per_particle(network) > 0
        load[held, :3] += network.mass[held, None] * acceleration
    mean_force = abs(network.require("force_normal", "balance")).mean()
    return sizes_of_loads(load, network.radius) / mean_force
