"""Motions that are put on a packing from outside: of walls, of a plane that opens, of a strain.

Each is a motion of the contacts alone, e (s, m, 9) in the terms of `modal.system.contacts`, on
top of which the bodies move freely. What a wall, an opening plane or a uniform strain does to a
packing, and what they feel of its motion, then follows from the contacts' tangents k in one way:

    push = -sum e_c . k      forces and torques on the bodies per unit of the motion,
    pull = -sum k . e_c      whose product with the bodies' motion is what resists it, turned round,
    held =  sum e_a . k e_b  what holds the motion with all bodies at rest.

Push and pull are the same where the tangent is symmetric. To what a turning wall feels, the shear
forces that it carries add their torque about arms that go with the spheres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from modal.packing.network import Network
from modal.system.assembly import ENDS, gathered
from modal.system.contacts import SHEAR, contact_tangent
from modal.tools.arrays import Bools, Floats, Ints

TURN = 5
"""In the place of an axis: the one of a body's six motions that turns it about z."""


class Imposed(Protocol):
    """A motion put on the contacts from outside, or several at once, s of them."""

    def touches(self, network: Network) -> Bools:
        """Shape (m,) bool: contacts that it moves."""

    def on(self, network: Network) -> Floats:
        """Shape (s, m, 9): the motion of these contacts, m and rad per unit."""


@dataclass(frozen=True)
class WallMoves:
    """A wall, by its code in particle_j, that moves by one metre along an axis, 0, 1 or 2.

    Or, with `TURN` for the axis, turns by one radian about the line along z through the middle of
    the cell.
    """

    wall: int
    axis: int = 2

    def touches(self, network: Network) -> Bools:
        """Contacts at that wall."""
        return network.particle_j == self.wall

    def on(self, network: Network) -> Floats:
        """Shape (1, m, 9)."""
        at = network.position[network.particle_i] + network.lever_i
        motion = _moved(network, np.ones(network.n_contacts), at, self.axis)
        motion[0, :, 8] = self.axis == TURN
        return motion


@dataclass(frozen=True)
class PlaneOpens:
    """All contacts that cross a horizontal plane at `height`, m, grow by one metre along an axis.

    As by a wedge between their ends: what lies above is pushed one way, what lies below the other.
    With `TURN` for the axis what lies above turns by one radian against what lies below; the forces
    that it carries turn with it, so that its other contacts, and those with the receiver wall, turn
    as well. Of a cell without walls these stay.
    """

    height: float
    axis: int = 2

    def touches(self, network: Network) -> Bools:
        """Contacts that cross the plane, or an image of it, and those that turn with it."""
        below_i, below_j = self._below(network)
        crossing = below_i != below_j
        turns = self.axis == TURN and crossing.any()
        return crossing | (below_i + below_j != 0) if turns else crossing

    def on(self, network: Network) -> Floats:
        """Shape (1, m, 9)."""
        (below_i, below_j), place = self._below(network), network.position[network.particle_i]
        motion = _moved(network, below_j, place + network.branch, self.axis)
        motion -= _moved(network, below_i, place, self.axis)
        if self.axis == TURN:
            motion[0, :, 5], motion[0, :, 8] = below_i, below_j
        return motion

    def _below(self, network: Network) -> Ints:
        """Shape (2, m): how far ends i and j of contacts move, minus the planes below them.

        In a cell without walls, of the plane and its images, minus those between the two ends.
        """
        start = network.position[network.particle_i, 2] - self.height
        ends = np.array([start, start + network.branch[:, 2]])
        if not network.cell_periodic[2]:
            return -(ends >= 0).astype(int)
        planes = np.floor(ends / network.cell_size[2]).astype(int)
        return planes.min(axis=0) - planes


def _moved(network: Network, size: Floats | Ints, place: Floats, axis: int) -> Floats:
    """Shape (1, m, 9): by `size` (m,) along an axis, or as places (m, 3), m, move in a turn."""
    motion = np.zeros((1, network.n_contacts, 9))
    if axis == TURN:
        x, y = (place[:, :2] - network.cell_size[:2] / 2).T
        motion[0, :, 0], motion[0, :, 1] = -size * y, size * x
    else:
        motion[0, :, axis] = size
    return motion


@dataclass(frozen=True)
class Gradients:
    """All bodies follow displacement gradients du_k / dx_l, `gradient` (s, 3, 3), and turn."""

    gradient: Floats

    def touches(self, network: Network) -> Bools:
        """Every contact."""
        return np.ones(network.n_contacts, bool)

    def on(self, network: Network) -> Floats:
        """Shape (s, m, 9)."""
        motion = np.zeros((len(self.gradient), network.n_contacts, 9))
        motion[:, :, :3] = network.branch @ self.gradient.transpose(0, 2, 1)
        # The rotation vector of a displacement gradient.
        twice = self.gradient - self.gradient.transpose(0, 2, 1)
        turn = twice[:, [2, 0, 1], [1, 2, 0]] / 2
        motion[:, :, 3:6] = motion[:, :, 6:] = turn[:, None]
        return motion


@dataclass(frozen=True)
class Coupling:
    """How s motions from outside and the bodies act on each other: push, pull (6n, s), held (s, s).

    N, N m per metre or radian. `terms` (6n, s): the root of the sum of squares of what was summed
    up to a push, which says how well round-off lets it vanish. Sparse: most motions touch few.
    """

    push: sp.csc_matrix
    pull: sp.csc_matrix
    held: Floats
    terms: sp.csc_matrix


def put_on(network: Network, terms: tuple[str, ...], imposed: Imposed) -> Coupling:
    """The coupling of an imposed motion with the bodies; `terms` of the contacts' tangent.

    Part by part of the contacts that it moves, whose tangents then take little memory.
    """
    touched = network.some(imposed.touches(network))
    s = len(imposed.on(touched.some(slice(0))))
    held, bodies = np.zeros((s, s)), gathered(touched.particle_i, touched.particle_j)[0]
    push, pull, squares = np.zeros((3, len(bodies), 6, s))
    for part in touched.parts():
        e, k = imposed.on(part), contact_tangent(part, terms)
        pushed = np.einsum("cab,scb->cas", k, e)
        felt = np.einsum("cba,scb->cas", k, e)
        if SHEAR in terms:
            # A wall's force acts where the sphere is: going by u_i it adds the torque -u_i x t.
            x, y, _ = part.require("force_tangential", "torque on a wall").T * part.with_wall
            felt[:, 0] -= (e[:, :, 8] * y).T
            felt[:, 1] += (e[:, :, 8] * x).T
        held += np.einsum("sca,cat->st", e, pushed)
        for (components, sign), ends in zip(ENDS, (part.particle_i, part.particle_j), strict=True):
            own, gather = gathered(ends)
            at, way = np.searchsorted(bodies, own), np.repeat([-sign, -1.0], 3)[:, None]
            for total, forces in ((push, pushed), (pull, felt), (squares, pushed**2)):
                mine = gather @ forces[:, components].reshape(len(ends), -1)
                total[at] += mine.reshape(-1, 6, s) * (1.0 if total is squares else way)
    place, start = (6 * bodies[:, None] + np.arange(6)).ravel(), np.arange(s + 1) * 6 * len(bodies)

    def whole(values: Floats) -> sp.csc_matrix:
        columns = values.reshape(-1, s).T.ravel(), np.tile(place, s), start
        return sp.csc_matrix(columns, (6 * network.n_particles, s))

    return Coupling(whole(push), whole(pull), held, whole(np.sqrt(squares)))
