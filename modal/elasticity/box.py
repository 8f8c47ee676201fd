"""Take a box out of a packing: its state, and the contacts of the spheres inside it.

Means over the box are taken with a weight that falls to 0 softly towards its faces, so that single
layers at a face hardly matter, even in a crystal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.packing.contact_law import sphere_volume
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.state import contact_forces, contacts_per_particle, has_forces
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError, UnavailableError

FADE_IN_DIAMETERS = 2.0
"""Depth over which the weight of a window falls from 1 to 0, in mean diameters."""
MIN_SIDE_IN_DIAMETERS = 10.0
"""Least side of a box: half of the weight of the narrower window is then two diameters wide."""
MIN_SHARE_OF_CROSSINGS = 0.25
"""Least number of contacts per area that cross a face of the box, divided by the median of all
faces; a face with fewer is not inside the packing."""
POINTS_OF_BRANCH = 6
"""Number of points of a Gauss sum over a branch vector; the weight is even over a diameter."""


@dataclass(frozen=True)
class Window:
    """A box with soft ends: its weight falls from 1 to 0 over `fade`, m, inside its bounds (3,)."""

    low: Floats
    high: Floats
    fade: float

    @property
    def volume(self) -> float:
        """Return the integral of the weight, m^3."""
        return float((self.high - self.low - self.fade).prod())

    def weight(self, point: Floats) -> Floats:
        """Return the weights (k,) of points (k, 3), m."""
        rising = np.clip((point - self.low) / self.fade, 0, 1)
        falling = np.clip((self.high - point) / self.fade, 0, 1)
        weight: Floats = np.sin(np.pi / 2 * rising) ** 2 * np.sin(np.pi / 2 * falling) ** 2
        return weight.prod(axis=1)

    def mean_weight(self, start: Floats, branch: Floats) -> Floats:
        """Return the mean weights (m,) of straight lines from `start` (m, 3) along `branch`."""
        place, share = np.polynomial.legendre.leggauss(POINTS_OF_BRANCH)
        total = np.zeros(len(start))
        for along, part in zip((place + 1) / 2, share / 2, strict=True):
            total += part * self.weight(start + along * branch)
        return total


def checked_bounds(network: Network, bounds: ArrayLike) -> Floats:
    """Return the bounds of a box as an array (3, 2); raise InputError for a box without room."""
    box = np.array(bounds, float)
    if box.size == 6:
        box = box.reshape(3, 2)
    if box.shape != (3, 2) or not np.isfinite(box).all():
        problem = f"a box with bounds {np.array(bounds)}"
        raise InputError("box", problem, remedy="give XLO XHI YLO YHI ZLO ZHI, m")
    side = box[:, 1] - box[:, 0]
    least = MIN_SIDE_IN_DIAMETERS * 2 * float(network.radius.mean())
    if not (side >= least).all():
        raise InputError(
            "small_box",
            f"a box with sides of {side.min():.4g} m",
            "spheres at its faces follow the strain, and make all of it too stiff",
            f"give sides of ten mean diameters, {least:.4g} m, at least",
        )
    return box


def cut_out(network: Network, box: Floats) -> Network:
    """Return the packing with the contacts of the spheres inside the box, all others held.

    Raises UnavailableError if a wall, a period or a surface of the packing is in the box.
    """
    position = network.position
    inside = np.asarray(((position > box[:, 0]) & (position < box[:, 1])).all(axis=1))
    i = network.particle_i
    j = network.partner
    pair = ~network.with_wall
    if (inside[i] & ~pair).any():
        raise UnavailableError(
            "box_at_wall",
            "spheres inside the box touch a wall",
            "the box must have spheres around it",
            "leave a diameter between its faces and walls",
        )
    through_period = (network.periods != 0).any(axis=1)
    if (inside[i] & inside[j] & through_period).any():
        raise UnavailableError(
            "box_in_period",
            "spheres inside the box touch through a period",
            "the box must have spheres around it",
            "leave two diameters between its faces and the end of the period",
        )
    crossing = pair & (inside[i] != inside[j])
    _refuse_open_faces(network.some(crossing), inside, box)
    touching = pair & (inside[i] | inside[j])
    held = np.repeat(~inside[:, None], 6, axis=1)
    if network.fixed is not None:
        held |= network.fixed
    return replace(network.with_contacts(touching), fixed=held)


def _refuse_open_faces(crossing: Network, inside: Bools, box: Floats) -> None:
    """Raise UnavailableError if hardly a contact crosses one of the faces of the box."""
    begin = crossing.position[crossing.particle_i]
    end = begin + crossing.branch
    outer = np.where(inside[crossing.particle_i][:, None], end, begin)
    side = box[:, 1] - box[:, 0]
    area = side.prod() / side
    counts = np.array([(outer < box[:, 0]).sum(axis=0), (outer > box[:, 1]).sum(axis=0)]) / area
    if counts.min() > MIN_SHARE_OF_CROSSINGS * np.median(counts):
        return
    end_index, axis = np.unravel_index(int(counts.argmin()), counts.shape)
    name = "xyz"[axis]
    raise UnavailableError(
        "box_at_surface",
        f"hardly a contact crosses the face of the box at {name} = {box[axis, end_index]:.4g} m",
        "the box must have spheres around it",
        "give bounds inside the packing",
    )


class BoxState(NamedTuple):
    """What a packing is like in a box.

    stress: (3, 3) Pa, compression positive, or None if forces are unknown. void_ratio: volume of
    voids divided by that of spheres. coordination_number: mean number of contacts of a
    force-bearing sphere.
    """

    stress: Floats | None
    void_ratio: float
    coordination_number: float


def state_inside(network: Network, bounds: ArrayLike) -> BoxState:
    """Return the state in a box with these bounds, as `modal.elasticity.inside.moduli_inside`."""
    box = checked_bounds(network, bounds)
    cut = cut_out(network, box)
    fade = FADE_IN_DIAMETERS * 2 * float(network.radius.mean())
    window = Window(box[:, 0], box[:, 1], fade)
    stress = None
    if has_forces(network):
        share = window.mean_weight(cut.position[cut.particle_i], cut.branch)
        force_on_j = -contact_forces(cut, "stress")
        stress = (force_on_j * share[:, None]).T @ cut.branch / window.volume
    weight = window.weight(network.position)
    solid = float(sphere_volume(network.radius) @ weight)
    bearing = weight * force_bearing(network)
    return BoxState(
        stress=stress,
        void_ratio=window.volume / solid - 1,
        coordination_number=float(contacts_per_particle(network) @ bearing / bearing.sum()),
    )
