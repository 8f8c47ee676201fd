"""Join spheres that move together into rigid bodies, such as the clumps of DEM programs.

A clump has the mass and the tensor of inertia of its members, each at its own place, unless the
program gives other values; its contacts are those of its members, with levers from its centre of
mass.
"""

from dataclasses import dataclass, replace

import numpy as np

from modal.packing.faults import Fault, refuse_first
from modal.packing.network import Network
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

MAX_OFFSET_IN_PERIODS = 0.45
"""Largest distance of a member from the body's first member, divided by the period: farther away it
would be unclear which image of the member is meant."""


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies in ascending order of their numbers.

    Attributes
    ----------
    number : ndarray (k,)
        Numbers of the bodies, from 1 on.
    mass : ndarray (k,)
        Masses, kg.
    centre : ndarray (k, 3)
        Centres of mass, m.
    tensor : ndarray (k, 3, 3)
        Tensors of inertia about the centres, kg m^2.
    """

    number: Ints
    mass: Floats
    centre: Floats
    tensor: Floats


def joined(network: Network, body: Ints, properties: Bodies | None = None) -> Network:
    """Return the network with the spheres of each body joined.

    Bodies are in the order of their first sphere; their radius is that of a sphere of their
    members' volume. Contacts inside a body are left out.

    Parameters
    ----------
    network : Network
        Network of spheres.
    body : ndarray (n,)
        Number of each sphere's body; below 1 for spheres that remain as they are.
    properties : Bodies, optional
        Masses, centres and tensors of all bodies; by default they follow from the members.
    """
    n = network.n_particles
    number = np.where(body > 0, body, -1 - np.arange(n))
    _, first, index = np.unique(number, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    index = rank[index]
    first = np.sort(first)
    count = len(first)
    periods = network.period_vectors
    # Move members beside the first one of their body, so that the body is in one piece.
    offset = network.position - network.position[first[index]]
    turns = -np.round(network.in_periods(offset)).astype(int)
    shift = turns @ periods
    offset += shift
    too_far = (abs(network.in_periods(offset)) > MAX_OFFSET_IN_PERIODS).any(axis=1)
    refuse_first(
        [
            Fault(
                "sphere",
                too_far,
                "body_too_wide",
                "lies half a period away from the first of its body",
                remedy="take a wider cell",
            )
        ]
    )
    position = network.position + shift
    mass: Floats = _sum_rows(index, network.mass, count)
    lever = _sum_rows(index, network.mass[:, None] * offset, count) / mass[:, None]
    centre = network.position[first] + lever
    tensor = _sum_rows(index, _point_tensors(network.mass, position - centre[index]), count)
    tensor += np.bincount(index, network.inertia, count)[:, None, None] * np.eye(3)
    if properties is not None:
        joint = np.flatnonzero(number[first] > 0)
        joint_number = number[first][joint]
        rows = np.searchsorted(properties.number, joint_number)
        missing = properties.number[np.minimum(rows, len(properties.number) - 1)] != joint_number
        if missing.any():
            raise InputError(
                "incomplete_bodies",
                "some bodies have no mass and tensor",
                remedy="give those of all of them",
            )
        centre_offset = properties.centre[rows] - centre[joint]
        centre_offset -= np.round(network.in_periods(centre_offset)) @ periods
        reach = np.zeros(count)
        np.maximum.at(reach, index, np.linalg.norm(offset, axis=1) + network.radius)
        outside = np.linalg.norm(centre_offset, axis=1) > reach[joint]
        if outside.any():
            raise InputError(
                "centre_of_mass",
                "a body's centre of mass lies outside its spheres",
                remedy="give both of one step",
            )
        centre[joint] += centre_offset
        mass[joint] = properties.mass[rows]
        tensor[joint] = properties.tensor[rows]
    fixed = _fixed_of_bodies(network, index, count)
    arm = position - centre[index]
    i = network.particle_i
    j = network.partner
    wall = network.with_wall
    body_i = index[i]
    body_j = np.where(wall, network.particle_j, index[j])
    cell_shift = network.require("cell_shift", "joining of spheres").copy()
    cell_shift[~wall] += (turns[i] - turns[j])[~wall]
    outer = (body_i != body_j) | cell_shift.any(axis=1)
    lever_i = network.lever_i + arm[i]
    lever_j = np.where(wall[:, None], 0.0, network.lever_j + arm[j])
    cubed_radius = np.bincount(index, network.radius**3, count)
    return replace(
        network.with_contacts(outer),
        position=centre,
        radius=np.cbrt(cubed_radius),
        mass=mass,
        inertia=np.trace(tensor, axis1=1, axis2=2) / 3,
        inertia_tensor=tensor,
        particle_i=body_i[outer],
        particle_j=body_j[outer],
        lever_i=lever_i[outer],
        lever_j=lever_j[outer],
        cell_shift=cell_shift[outer],
        fixed=fixed,
    )


def _fixed_of_bodies(network: Network, index: Ints, count: int) -> Bools | None:
    """Return the held motions (count, 6) of bodies; `index` (n,) is the body of each sphere.

    Raises InputError if members of a body are held differently or only partly: a rotation of a
    sphere about its own centre is not a rotation of the body.
    """
    if network.fixed is None:
        return None
    members = np.bincount(index, minlength=count)
    fixed_members = np.column_stack([np.bincount(index, held, count) for held in network.fixed.T])
    some = (fixed_members > 0) & (fixed_members < members[:, None])
    in_part = fixed_members.any(axis=1) & ~fixed_members.all(axis=1) & (members > 1)
    if some.any() or in_part.any():
        raise InputError(
            "held_bodies",
            "a body of several spheres is held in a part of its spheres or motions",
            remedy="hold all of its spheres, or none",
        )
    return fixed_members > 0


def _sum_rows(index: Ints, values: Floats, count: int) -> Floats:
    """Return the sums (count, ...) of the rows of each index."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, index, values)
    return total


def _point_tensors(mass: Floats, arm: Floats) -> Floats:
    """Return the tensors of inertia (n, 3, 3), kg m^2, of points at the ends of arms (n, 3), m."""
    square = (arm**2).sum(axis=1)[:, None, None] * np.eye(3)
    return mass[:, None, None] * (square - arm[:, :, None] * arm[:, None, :])
