"""Model transducers of a laboratory by discs of spheres, as sources and as receivers.

A disc is perpendicular to z, and consists of the spheres near its plane: a bender element or a
piezo disc, one layer of grains thick, inside the packing or at a wall. As a source its spheres move
together without turning (plate), or an equal share of a force acts on each of them. A receiver
reads the mean displacement of its spheres, which move freely.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from modal.packing.network import Network
from modal.packing.rattlers import firmly_held
from modal.system.imposed import BodiesMove
from modal.tools.arguments import refuse_other_kinds
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError, UnavailableError, refuse_unknown
from modal.waves.signals import COMPONENT, DIRECTIONS, Direction
from modal.waves.sources import Source

Drive = Literal["plate", "force"]
"""How a disc sends a wave: its spheres move as one rigid plate, or a force pushes them."""
DRIVES: tuple[Drive, ...] = get_args(Drive)
HALF_THICKNESS_IN_RADII = float(np.sqrt(1 / 2))
"""Largest distance of a sphere's centre from the plane of a disc, in its radii: half the distance
of two layers of an FCC crystal along [001], so that a disc there is one layer."""


@dataclass(frozen=True)
class Disc(Source):
    """A disc perpendicular to z that is moved or pushed along x, y or z, or that records a motion.

    The disc consists of the spheres that bear force and whose centres are within its radius, and
    within `HALF_THICKNESS_IN_RADII` of its plane. The plane is at z of the disc's centre or, near a
    wall, at the height of the spheres that touch the wall. Distances are those to the nearest
    images. Propagating a wave raises InputError if there is no such sphere.

    Parameters
    ----------
    centre : sequence of 3 numbers
        Coordinates x, y and z, m; for a disc at a wall, z of the wall.
    radius : float
        Radius, m.
    direction : str, default "z"
        x, y or z: direction of the motion or the force, and of the recorded motion.
    drive : str, default "plate"
        "plate": the spheres move together by the motion in time, m, and do not turn. "force": the
        motion in time is a force, N, shared equally by the spheres. A receiver ignores this
        argument.

    Raises
    ------
    InputError
        If a number is not finite, the radius is not positive, or a word is unknown.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(2, 2, 40))
    >>> source = Disc((0, 0, crystal.length / 4), 0.003, "x")
    >>> receiver = Disc((0, 0, crystal.length / 2), 0.003, "x")
    >>> wave = modal.propagate(crystal, 5e-5, source=source, receivers=[receiver]).signals
    >>> wave.disc_displacement.shape == (len(wave.time), 1)
    True
    """

    centre: Sequence[float]
    radius: float
    direction: Direction = "z"
    drive: Drive = "plate"
    moves_parts_alike = False
    moves_flat_wall = False

    def __post_init__(self) -> None:
        refuse_other_kinds(Disc, "Disc", vars(self))
        refuse_unknown("direction", self.direction, DIRECTIONS)
        refuse_unknown("drive", self.drive, DRIVES)
        centre = np.asarray(self.centre, float)
        if centre.shape != (3,) or not np.isfinite(centre).all() or not 0 < self.radius < np.inf:
            raise InputError(
                "disc",
                f"a disc of radius {self.radius:g} m at {tuple(self.centre)}",
                "needs a positive radius, and x, y and z of its centre",
                "give them in m",
            )
        object.__setattr__(self, "centre", tuple(centre.tolist()))

    @property
    def pushes(self) -> bool:
        """Whether the motion in time is a force."""
        return self.drive == "force"

    @property
    def name(self) -> str:
        """The disc in words, such as "disc of 0.003 m at 0 0 0.02 m"."""
        place = " ".join(f"{coordinate:g}" for coordinate in self.centre)
        return f"disc of {self.radius:g} m at {place} m"

    @property
    def own_direction(self) -> Direction:
        """The direction of the disc's motion, force or record."""
        return self.direction

    def spheres(self, network: Network) -> Ints:
        """Return the indices of the spheres of the disc, in ascending order.

        Raises InputError if the disc is below or above the packing, UnavailableError if no spheres
        are in it.
        """
        away = self._from_centre(network)
        is_near = abs(away[:, 2]) <= HALF_THICKNESS_IN_RADII * network.radius
        is_inside = np.hypot(away[:, 0], away[:, 1]) <= self.radius
        spheres = np.flatnonzero(is_near & is_inside & firmly_held(network))
        if not len(spheres):
            raise UnavailableError(
                "no_spheres_in_disc",
                f"{self.name}: no sphere that bears force is in it",
                remedy="give a larger radius, or a place where spheres are",
            )
        return spheres

    def position_in(self, network: Network) -> Floats:
        """Return the mean centre (3,), m, of the disc's spheres: the tip of the transducer."""
        away = self._from_centre(network)[self.spheres(network)]
        return self._centre_in(network) + away.mean(axis=0)

    def height_in(self, network: Network) -> Floats:
        """Return the mean height of the disc's spheres (1,), m."""
        return self.position_in(network)[2:]

    def own_bodies(self, network: Network) -> Ints:
        """Return the spheres of a plate; none for a force, under which spheres move freely."""
        if self.pushes:
            return np.empty(0, int)
        return self.spheres(network)

    def imposed(self, network: Network, direction: Direction) -> BodiesMove | None:
        """Return the unit motion of a plate; None if the spheres are pushed."""
        if self.pushes:
            return None
        bodies = np.zeros(network.n_particles, bool)
        bodies[self.spheres(network)] = True
        return BodiesMove(bodies, COMPONENT[direction], walls_move=False)

    def load(self, network: Network, direction: Direction) -> Floats:
        """Return the load (6n,) of a unit force that the disc's spheres share; zero for a plate."""
        load = np.zeros((network.n_particles, 6))
        if self.pushes:
            spheres = self.spheres(network)
            load[spheres, COMPONENT[direction]] = 1 / len(spheres)
        return load.ravel()

    def carried(self, network: Network) -> Ints:
        """Return the spheres of a plate; none for a force."""
        return self.own_bodies(network)

    def _from_centre(self, network: Network) -> Floats:
        """Return the vectors (n, 3), m, from the centre to the nearest images of the spheres."""
        away = network.position - self._centre_in(network)
        return away - np.round(network.in_periods(away)) @ network.period_vectors

    def _centre_in(self, network: Network) -> Floats:
        """Return the centre (3,), m; at a wall, with the z of the spheres that touch the wall."""
        x, y, z = self.centre
        if not network.cell_periodic[2]:
            radius = float(network.radius.mean())
            bottom, top = network.wall_position
            if not bottom - radius <= z <= top + radius:
                raise InputError(
                    "disc_outside_cell",
                    f"{self.name} lies outside the packing",
                    f"it reaches from {bottom:g} to {top:g} m",
                    "give a height in between",
                )
            z = float(np.clip(z, bottom + radius, top - radius))
        return np.array([x, y, z])
