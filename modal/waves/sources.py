"""Define sources of waves: the source wall, flat or of held spheres, a plane, or one sphere.

A source moves, or pushes, along the direction of the wave: x, y or z. In torsion it turns about the
line along z through the middle of the cell. Its motion in time is a `Motion`
(`modal.waves.motions`). To add a source, subclass `MovingSource`, of `PushingSource`, or of
`Source` (`modal.waves.discs`).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from modal.packing.ends import rough_wall
from modal.packing.network import SOURCE_WALL, Network
from modal.system.imposed import Imposed, PlaneOpens, WallMoves, end_moves
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError, UnavailableError
from modal.waves.signals import COMPONENT, TORSION, Direction

OTHER_SOURCES = (
    "take held spheres at the lower end (--rough-wall), a plane that opens (--plane Z), or a "
    "sphere that is pushed (--point K)"
)
"""Remedy for a packing without a source wall."""


class Source(ABC):
    """A source of waves: a place where a packing is moved or pushed from outside.

    `moves_parts_alike` is true if equal parts of a packing side by side are moved alike, so that
    one of them is enough; `moves_flat_wall` is true if the flat wall at the source end moves with
    the source.
    """

    moves_parts_alike: ClassVar[bool] = True
    moves_flat_wall: ClassVar[bool] = True

    @property
    @abstractmethod
    def pushes(self) -> bool:
        """Whether the motion in time is a force."""

    @property
    @abstractmethod
    def name(self) -> str:
        """The name of the source, as files of signals store it."""

    @property
    def own_direction(self) -> Direction | None:
        """The direction in which the source moves; None if it can move in any direction."""
        return None

    @abstractmethod
    def height_in(self, network: Network) -> Floats | None:
        """Return the height (1,), m, of the source inside the packing; None for a wall."""

    def position_in(self, network: Network) -> Floats | None:
        """Return the position (3,), m, of a disc or point source; None for other sources."""
        return None

    @abstractmethod
    def imposed(self, network: Network, direction: Direction) -> Imposed | None:
        """Return the unit motion that the source imposes on contacts; None for a force."""

    @abstractmethod
    def load(self, network: Network, direction: Direction) -> Floats:
        """Return the unit force, N, or torque, N m, on all spheres (6n,); zero for a motion."""

    @abstractmethod
    def carried(self, network: Network) -> Ints:
        """Return the indices (k,) of the spheres that move with the source."""

    def own_bodies(self, network: Network) -> Ints:
        """Return the indices (k,) of the source's own bodies; none by default."""
        return np.empty(0, int)


class MovingSource(Source):
    """A source with a prescribed motion, which it imposes on contacts."""

    @property
    def pushes(self) -> bool:
        """False: the motion in time is a displacement."""
        return False

    @abstractmethod
    def imposed(self, network: Network, direction: Direction) -> Imposed:
        """Return the unit motion that the source imposes on contacts."""

    def load(self, network: Network, direction: Direction) -> Floats:
        """Return no load (6n,): the source moves."""
        return np.zeros(6 * network.n_particles)


class PushingSource(Source):
    """A source with a prescribed force on spheres."""

    @property
    def pushes(self) -> bool:
        """True: the motion in time is a force."""
        return True

    def imposed(self, network: Network, direction: Direction) -> None:
        """Return None: a source of force imposes no motion."""
        return None

    def carried(self, network: Network) -> Ints:
        """Return no spheres: under a force spheres move freely."""
        return np.empty(0, int)


@dataclass(frozen=True)
class Wall(MovingSource):
    """The source wall, at the lower end of the packing, which is moved as a whole.

    Propagating a wave raises InputError if the packing is periodic along z, without walls.

    Examples
    --------
    >>> import modal
    >>> modal.propagate(modal.fcc(cells=(1, 1, 20)), 2e-5, source=Wall()).signals.source
    'wall'
    """

    @property
    def name(self) -> str:
        """The name of the source, "wall"."""
        return "wall"

    def height_in(self, network: Network) -> None:
        """Return None: the wall is at the end of the packing."""
        return None

    def imposed(self, network: Network, direction: Direction) -> WallMoves:
        """Return the unit motion of the wall.

        Raises InputError if the packing has no such wall, or if no sphere touches the wall.
        """
        if network.cell_periodic[2]:
            raise InputError(
                "no_source_wall",
                "the packing is periodic along z",
                "no wall sends a wave",
                OTHER_SOURCES,
            )
        _refuse_torsion_of_periods(network, direction)
        if SOURCE_WALL not in network.particle_j:
            raise InputError(
                "no_source_wall",
                "no sphere touches the source wall, so that it sends no wave",
                remedy=OTHER_SOURCES,
            )
        return WallMoves(SOURCE_WALL, COMPONENT[direction])

    def carried(self, network: Network) -> Ints:
        """Return no spheres: the flat wall moves alone."""
        return np.empty(0, int)


@dataclass(frozen=True)
class RoughWall(MovingSource):
    """The wall of held spheres at the lower end of the packing, which is moved as a whole.

    Propagating a wave raises InputError if there is no such wall (`modal.packing.ends`).

    Examples
    --------
    >>> import dataclasses, modal, numpy
    >>> crystal = modal.fcc(cells=(1, 1, 20))
    >>> lowest_layer = crystal.position[:, 2] < 1.1 * crystal.position[:, 2].min()
    >>> held = numpy.repeat(lowest_layer[:, None], 6, axis=1)
    >>> rough = dataclasses.replace(crystal, fixed=held)
    >>> modal.propagate(rough, 2e-5, source=RoughWall()).signals.source
    'rough wall'
    """

    @property
    def name(self) -> str:
        """The name of the source, "rough wall"."""
        return "rough wall"

    def height_in(self, network: Network) -> None:
        """Return None: the wall is at the end of the packing."""
        return None

    def imposed(self, network: Network, direction: Direction) -> Imposed:
        """Return the unit motion of the held spheres.

        Raises InputError if the packing has no such wall, or if spheres that move touch the flat
        source wall beside it.
        """
        if not len(rough_wall(network, "source")):
            raise InputError(
                "no_rough_wall",
                "no held spheres are at the lower end of the packing",
                remedy="take the flat source wall, a plane that opens or a sphere that is pushed",
            )
        _refuse_torsion_of_periods(network, direction)
        at_flat_wall = network.particle_i[network.particle_j == SOURCE_WALL]
        if not network.held[at_flat_wall].all():
            raise InputError(
                "two_source_walls",
                "spheres that move touch the flat source wall beside the held spheres",
                remedy="take the flat wall as the source (the default)",
            )
        return end_moves(network, "source", COMPONENT[direction])

    def carried(self, network: Network) -> Ints:
        """Return the indices (k,) of the held spheres of the wall."""
        return self.own_bodies(network)

    def own_bodies(self, network: Network) -> Ints:
        """Return the indices (k,) of the held spheres of the wall."""
        return rough_wall(network, "source")


@dataclass(frozen=True)
class Plane(MovingSource):
    """A plane that opens: it pushes the spheres above it one way, and those below the other way.

    The net force is zero, and two equal waves leave the plane, up and down. Propagating a wave
    raises InputError if the plane is outside the cell.

    Parameters
    ----------
    height
        Height z of the plane, m.

    Examples
    --------
    >>> import modal
    >>> cell = modal.fcc(cells=(1, 1, 20), periodic_z=True)
    >>> modal.propagate(cell, 2e-5, source=Plane(0.02)).signals.source
    'plane at 0.02 m'
    """

    height: float

    @property
    def name(self) -> str:
        """The name of the source, such as "plane at 0.02 m"."""
        return f"plane at {self.height:g} m"

    def height_in(self, network: Network) -> Floats:
        """Return the height of the plane (1,), m."""
        return np.array([self.height])

    def imposed(self, network: Network, direction: Direction) -> PlaneOpens:
        """Return the unit opening of the plane.

        Raises InputError if the plane is outside the cell, or has spheres on one side only.
        """
        bottom, top = network.wall_position
        if not bottom <= self.height <= top:
            raise InputError(
                "plane_outside_cell",
                f"a source at {self.height:g} m lies outside the cell, which reaches from "
                f"{bottom:g} to {top:g} m",
            )
        if network.period_vectors[:2, 2].any():
            raise UnavailableError(
                "triclinic_cell",
                "the periods along x or y rise along z",
                "no plane across z repeats itself",
                "turn the packing until they are horizontal, or push a sphere",
            )
        z = network.position[:, 2]
        if not network.cell_periodic[2] and not z.min() < self.height < z.max():
            raise InputError(
                "plane_beside_spheres",
                f"a source at {self.height:g} m has no spheres on one side",
                remedy=f"give a height between {z.min():g} and {z.max():g} m",
            )
        _refuse_torsion_of_periods(network, direction)
        return PlaneOpens(self.height, COMPONENT[direction])

    def carried(self, network: Network) -> Ints:
        """Return the indices of all spheres below the plane."""
        return np.flatnonzero(network.position[:, 2] < self.height)


@dataclass(frozen=True)
class Point(PushingSource):
    """One sphere, given by its index, on which a force or a torque about z acts.

    The motion in time is this force, N, or torque, N m. Propagating a wave raises InputError if the
    packing has no such sphere.

    Parameters
    ----------
    particle
        Index of the sphere, from 0.

    Examples
    --------
    >>> import modal
    >>> cell = modal.fcc(cells=(1, 1, 20), periodic_z=True)
    >>> modal.propagate(cell, 2e-5, source=Point(7)).signals.source
    'sphere 7'
    """

    particle: int
    moves_parts_alike = False

    @property
    def name(self) -> str:
        """The name of the source, such as "sphere 7"."""
        return f"sphere {self.particle}"

    def height_in(self, network: Network) -> Floats:
        """Return the height of the sphere (1,), m."""
        return network.position[[int(self.particle)], 2]

    def position_in(self, network: Network) -> Floats:
        """Return the centre of the sphere (3,), m."""
        return network.position[int(self.particle)]

    def load(self, network: Network, direction: Direction) -> Floats:
        """Return the load (6n,) of a unit force or torque on the sphere.

        Raises InputError if the packing has no such sphere.
        """
        if self.particle not in range(network.n_particles):
            raise InputError(
                "no_such_sphere",
                f"sphere {self.particle}",
                f"the packing has 0 to {network.n_particles - 1}",
            )
        load = np.zeros(6 * network.n_particles)
        load[6 * int(self.particle) + COMPONENT[direction]] = 1
        return load


def default_source(network: Network) -> Source:
    """Return the source wall: flat, or made of held spheres if no sphere touches a flat wall."""
    if SOURCE_WALL not in network.particle_j and len(rough_wall(network, "source")):
        return RoughWall()
    return Wall()


def _refuse_torsion_of_periods(network: Network, direction: Direction) -> None:
    """Raise InputError for torsion of a packing that is periodic along x or y."""
    if direction == TORSION and network.cell_periodic[:2].any():
        raise InputError(
            "torsion_of_periods",
            "a packing that is periodic sideways cannot be twisted",
            remedy="take one with free sides, or a sphere as the source",
        )


def hold_own_bodies(network: Network, source: Source) -> Network:
    """Return the network with the source's own bodies held."""
    bodies = source.own_bodies(network)
    if network.held[bodies].all():
        return network
    fixed = ~network.free_motions
    fixed[bodies] = True
    return network.unchecked(fixed=fixed)


def direction_of(source: Source, direction: Direction | None) -> Direction:
    """Return the direction in which a source moves: its own, else the given one, else z.

    Raises InputError if a `direction` is given that is not the source's own.
    """
    own = source.own_direction
    if own is None:
        return direction or "z"
    if direction not in (None, own):
        raise InputError(
            "direction",
            f"direction {direction!r}",
            f"the source, a {source.name}, moves along {own}",
            "leave the direction out, or give it to the source",
        )
    return own
