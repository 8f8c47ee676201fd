"""What a wave starts from: the source wall, a plane inside the packing, or one sphere.

A source moves, or pushes, along the direction of the wave: x, y, z, or by turning about the line
along z through the middle of the cell, which sends torsion. How it moves in time is a `Motion`
(`modal.waves.motions`).
"""

from dataclasses import dataclass

import numpy as np

from modal.packing.network import SOURCE_WALL, Network
from modal.system.imposed import Imposed, PlaneOpens, WallMoves
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError
from modal.waves.signals import COMPONENT, TORSION


class Source:
    """Where a packing is moved, or pushed, from outside; `name` is it in words.

    A further one says in `imposed` which motion it puts on the contacts, or in `load` how it
    pushes. `alike`: whether equal parts of a packing side by side are moved alike; `pushes`:
    whether its motion is that of a force.
    """

    alike = True
    pushes = False

    @property
    def name(self) -> str:
        """In words: wall, plane at 0.01 m, sphere 12."""
        return type(self).__name__.lower()

    def height_in(self, network: Network) -> Floats | None:
        """Shape (1,), m: where it lies inside the packing; None of its wall."""
        return None

    def imposed(self, network: Network, direction: str) -> Imposed | None:
        """The motion that it puts on the contacts; None of a source that pushes."""
        return None

    def load(self, network: Network, direction: str) -> Floats:
        """Shape (6n,): the unit force, N, or torque, N m, of a source that pushes."""
        return np.zeros(6 * network.n_particles)

    def carried(self, position: Floats) -> Ints:
        """The spheres, by number, that go with the source wall: those that no contact opens to."""
        return np.empty(0, int)


@dataclass(frozen=True)
class Wall(Source):
    """The source wall, at the lower end of the packing, which is moved as a whole.

    A packing that is periodic along z has none, which is an InputError when a wave is sent.

    Examples
    --------
    >>> import modal
    >>> modal.propagate(modal.fcc(cells=(1, 1, 20)), 2e-5, source=Wall()).signals.source
    'wall'
    """

    def imposed(self, network: Network, direction: str) -> Imposed:
        """The wall's unit motion; InputError where there is no such wall."""
        if network.cell_periodic[2]:
            raise InputError(
                "input",
                "the packing is periodic along z",
                "no wall sends a wave",
                "take a plane that opens (--plane Z), or a sphere that is pushed (--point K)",
            )
        _refuse_torsion_of_periods(network, direction)
        if SOURCE_WALL not in network.particle_j:
            raise InputError(
                "no_source_wall",
                "no sphere touches the source wall, so that it sends no wave",
                remedy=(
                    "take a plane that opens (--plane Z), or a sphere that is pushed (--point K)"
                ),
            )
        return WallMoves(SOURCE_WALL, COMPONENT[direction])


@dataclass(frozen=True)
class Plane(Source):
    """All contacts across the plane at `height`, m, open: above it one way, below it the other.

    Nothing is pushed as a whole, and two equal waves leave the plane, up and down. A height outside
    the cell is an InputError when a wave is sent.

    Parameters
    ----------
    height
        z of the plane, m.

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
        """With its height."""
        return f"plane at {self.height:g} m"

    def height_in(self, network: Network) -> Floats:
        """Its height."""
        return np.array([self.height])

    def imposed(self, network: Network, direction: str) -> Imposed:
        """The unit opening; InputError for a plane outside the cell."""
        low, high = network.wall_position
        if not low <= self.height <= high:
            raise InputError(
                "input",
                f"a source at {self.height:g} m lies outside the cell, which reaches from {low:g} "
                f"to {high:g} m",
            )
        z = network.position[:, 2]
        if not network.cell_periodic[2] and not z.min() < self.height < z.max():
            raise InputError(
                "plane_beside_spheres",
                f"a source at {self.height:g} m has no spheres on one side",
                remedy=(f"give a height between {z.min():g} and {z.max():g} m"),
            )
        _refuse_torsion_of_periods(network, direction)
        return PlaneOpens(self.height, COMPONENT[direction])

    def carried(self, position: Floats) -> Ints:
        """All that lie below, of places (n, 3), m."""
        return np.flatnonzero(position[:, 2] < self.height)


@dataclass(frozen=True)
class Point(Source):
    """One sphere, by its index, that a force pushes, or a torque about z turns.

    Its motion in time is that force in N, or torque in N m. A sphere that the packing does not have
    is an InputError when a wave is sent.

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
    alike = False
    pushes = True

    @property
    def name(self) -> str:
        """With its index."""
        return f"sphere {self.particle}"

    def height_in(self, network: Network) -> Floats:
        """That of the sphere."""
        return network.position[[int(self.particle)], 2]

    def load(self, network: Network, direction: str) -> Floats:
        """Shape (6n,); InputError for a sphere that the packing does not have."""
        if self.particle not in range(network.n_particles):
            raise InputError(
                "input",
                f"sphere {self.particle}",
                f"the packing has 0 to {network.n_particles - 1}",
            )
        load = super().load(network, direction)
        load[6 * int(self.particle) + COMPONENT[direction]] = 1
        return load


def _refuse_torsion_of_periods(network: Network, direction: str) -> None:
    if direction == TORSION and network.cell_periodic[:2].any():
        raise InputError(
            "input",
            "a packing that is periodic sideways cannot be twisted",
            remedy=("take one with free sides, or a sphere as the source"),
        )
