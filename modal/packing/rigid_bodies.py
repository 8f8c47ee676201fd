"""Spheres that move as one: clumps, as DEM programs have them, in place of their members.

A clump has the mass and the tensor of inertia of its members, each where it is, unless the program
tells others; its contacts are those of its members, with levers from its centre of mass.
"""

from dataclasses import dataclass, replace

import numpy as np

from modal.packing.checks import refuse
from modal.packing.network import Network
from modal.tools.arrays import Floats, Ints

LONGEST = 0.45
"""Of a period: how far a member may lie from the first one, or its image is not known."""


@dataclass(frozen=True)
class Bodies:
    """k rigid bodies in rising order of their numbers (k,).

    mass (k,), kg; centre of mass (k, 3), m; tensor of inertia (k, 3, 3), kg m^2, about it.
    """

    number: Ints
    mass: Floats
    centre: Floats
    tensor: Floats


def joined(network: Network, body: Ints, told: Bodies | None = None) -> Network:
    """A network of spheres with those of one `body` (n,) joined.

    Spheres whose number is below 1 stay as they are. Bodies are in the order of their first
    sphere; their radius is that of the sphere of their members' volume. What is `told` of bodies
    stands in place of what follows from the members. Contacts inside a body are left out.
    """
    n = network.n_particles
    own = np.where(body > 0, body, -1 - np.arange(n))
    _, first, index = np.unique(own, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    index, first = rank[index], np.sort(first)
    total = len(first)
    period = np.where(network.cell_periodic, network.cell_size, np.inf)
    offset = network.position - network.position[first[index]]
    turns = -np.round(offset / period).astype(int)
    # Members where they are as one piece, beside the first of them.
    whole = np.where(network.cell_periodic, network.cell_size, 0.0)
    shift = whole * turns
    offset += shift
    fault = "lies half a period away from the first of its body; take a wider cell"
    refuse([("sphere", (abs(offset) > LONGEST * period).any(axis=1), fault)])
    place = network.position + shift
    mass: Floats = _sums(index, network.mass, total)
    lever = _sums(index, network.mass[:, None] * offset, total) / mass[:, None]
    centre = network.position[first] + lever
    tensor = _sums(index, _moments(network.mass, place - centre[index]), total)
    tensor += np.bincount(index, network.inertia, total)[:, None, None] * np.eye(3)
    if told is not None:
        number = own[first]
        at = np.searchsorted(told.number, number[number > 0])
        joint = np.flatnonzero(number > 0)
        lacks = told.number[np.minimum(at, len(told.number) - 1)] != number[joint]
        refuse([("", lacks, "some bodies have no mass and tensor; give those of all of them")])
        apart = told.centre[at] - centre[joint]
        apart -= np.round(apart / period) * whole
        reach = np.zeros(total)
        np.maximum.at(reach, index, np.linalg.norm(offset, axis=1) + network.radius)
        fault = "a body's centre of mass lies outside its spheres; give both of one step"
        refuse([("", np.linalg.norm(apart, axis=1) > reach[joint], fault)])
        centre[joint] += apart
        mass[joint], tensor[joint] = told.mass[at], told.tensor[at]
    arm = place - centre[index]
    i, j, wall = network.particle_i, network.partner, network.with_wall
    ends = index[i], np.where(wall, network.particle_j, index[j])
    shifts = network.require("cell_shift", "joining of spheres").copy()
    shifts[~wall] += (turns[i] - turns[j])[~wall]
    kept = (ends[0] != ends[1]) | shifts.any(axis=1)
    return replace(
        network.with_contacts(kept),
        position=centre,
        radius=np.cbrt(np.bincount(index, network.radius**3, total)),
        mass=mass,
        inertia=np.trace(tensor, axis1=1, axis2=2) / 3,
        inertia_tensor=tensor,
        particle_i=ends[0][kept],
        particle_j=ends[1][kept],
        lever_i=(network.lever_i + arm[i])[kept],
        lever_j=np.where(wall[:, None], 0.0, network.lever_j + arm[j])[kept],
        cell_shift=shifts[kept],
    )


def _sums(index: Ints, values: Floats, count: int) -> Floats:
    """Sums over the rows of each index, shape (count, ...)."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, index, values)
    return total


def _moments(mass: Floats, arm: Floats) -> Floats:
    """Shape (n, 3, 3), kg m^2: of points of mass (n,) at the ends of arms (n, 3)."""
    square = (arm**2).sum(axis=1)[:, None, None] * np.eye(3)
    return mass[:, None, None] * (square - arm[:, :, None] * arm[:, None, :])
