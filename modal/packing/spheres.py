"""Spheres between two walls, or through a period, and the network of their contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from modal.packing.columns import frozen, stored
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, Elasticity, Material
from modal.packing.contact_models import ContactLaw, law_of_each, laws_of
from modal.packing.neighbours import ContactList, between, touching
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError

SPIN = "rad/s"
ELASTIC = ("young", "poisson")


@dataclass
class Sample:
    """Spheres between flat walls at rest, or, with velocities, on their way; SI units.

    Parameters
    ----------
    position : ndarray (n, 3)
        m, x and y inside the cell.
    side, walls : ndarray (2,)
        m: of the lateral cell, and z of source and receiver wall.
    friction : float
        Coefficient mu of its contacts.
    shear : ndarray (m, 2), optional
        Shear force on i of each contact in canonical order along `neighbours.tangents`, N.
    velocity, angular_velocity, strain_rate : ndarray (n, 3), (n, 3), (3,), optional
        m/s, rad/s, 1/s, of a sample in motion.
    radius, radii : float, default 1.27e-3, and ndarray (n,), optional
        m, of all spheres; of spheres of several sizes the mean, and that of each.
    material, densities : Material, default glass, and ndarray (n,) kg/m^3, optional
        Of the spheres; densities in place of the material's.
    wall_material : Elasticity, optional
        Of the walls; that of the spheres where it is None.
    periodic_z : bool, default False
        There are no walls: `walls` are the ends of a period along z.
    periodic_sides : tuple of 2 bool, default (True, True)
        Whether x and y are periodic; where not, the packing ends there, and no file has it.
    study, provenance : dict, optional
        Free attributes.

    Examples
    --------
    >>> import numpy as np
    >>> at = np.array([[1e-3, 1e-3, 1e-3]])
    >>> Sample(at, np.array([4e-3, 4e-3]), np.array([0.0, 2e-3]), 0.1, radius=1e-3 + 1e-7).network()
    <Network: 1 particles, 2 contacts>
    """

    position: Annotated[Floats, stored("particles", "f", "n", 3, unit="m")]
    side: Annotated[Floats, stored("cell", "f", 2, unit="m")]
    walls: Annotated[Floats, stored("walls", "f", 2, unit="m", name="position")]
    friction: float
    shear: Annotated[Floats | None, stored("contacts", "f", "m", 2, unit="N")] = None
    velocity: Annotated[Floats | None, stored("particles", "f", "n", 3, unit="m/s")] = None
    angular_velocity: Annotated[Floats | None, stored("particles", "f", "n", 3, unit=SPIN)] = None
    strain_rate: Annotated[Floats | None, stored("cell", "f", 3, unit="1/s")] = None
    radius: float = RADIUS
    radii: Annotated[Floats | None, stored("particles", "f", "n", unit="m", name="radius")] = None
    material: Material = GLASS
    densities: Annotated[
        Floats | None, stored("particles", "f", "n", unit="kg/m^3", name="density")
    ] = None
    wall_material: Elasticity | None = None
    periodic_z: bool = False
    periodic_sides: tuple[bool, bool] = (True, True)
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def sizes(self) -> float | Floats:
        """The radius of all spheres, or that of each (n,), m."""
        return self.radius if self.radii is None else self.radii

    @property
    def laws(self) -> tuple[ContactLaw, ContactLaw]:
        """The contact law between spheres, and with a wall."""
        return laws_of(self.material, self.wall_material)

    @property
    def constants(self) -> dict[str, Any]:
        """Its materials, as a network's `study` notes them; no density if the spheres' differ."""
        own = vars(self.material)
        kept = [*ELASTIC]
        kept += ["contact_model"] * (self.material.contact_model != HERTZ_MINDLIN)
        kept += ["density"] * (self.densities is None)
        return {name: own[name] for name in kept} | self.wall_constants

    @property
    def wall_constants(self) -> dict[str, float]:
        """The walls' own moduli by name, if they are not the spheres'."""
        walls = self.wall_material
        return {} if walls is None else {f"wall_{name}": getattr(walls, name) for name in ELASTIC}

    @property
    def masses(self) -> tuple[Floats, Floats]:
        """Mass, kg, and moment of inertia, kg m^2, of each sphere (n,)."""
        each = np.full(len(self.position), self.sizes)
        mass, inertia = self.material.sphere(each, self.densities)
        return mass, inertia

    @property
    def length(self) -> float:
        """Between the walls, or of the period along z, m."""
        return float(self.walls[1] - self.walls[0])

    @property
    def periods(self) -> Floats:
        """Shape (2,), m: of the sides; of those that end, so far that no image is ever near."""
        beyond = np.ptp(self.position[:, :2], axis=0) + 6 * np.max(self.sizes)
        return np.where(self.periodic_sides, self.side, beyond)

    @property
    def lengths(self) -> Floats:
        """Shape (3,), m: the `periods` and the `length`."""
        return np.array([*self.periods, self.length])

    def contacts(self, ends: tuple[Ints, ...] | None = None) -> ContactList:
        """All contacts, in canonical order, or those whose `ends`, i, j and periods, are known.

        Their overlaps follow from the positions.
        """
        lengths, position = self.periods, self.position
        if self.periodic_z:
            lengths, position = self.lengths, position - [0, 0, self.walls[0]]
        walls = None if self.periodic_z else self.walls
        if ends is None:
            return touching(position, lengths, walls, self.sizes)
        each = np.broadcast_to(self.sizes, len(position))
        return between(ends, position, lengths, walls, each)

    def network(self, contact: ContactList | None = None) -> Network:
        """The contact network: springs of the contact model at the present overlaps.

        Its contacts are found, unless they are known. The contact point lies in the middle of the
        overlap, also at a wall.

        Relative error of an overlap: eps times diameter over overlap, 1e-12 at 100 kPa.
        """
        contact = self.contacts() if contact is None else contact
        n, m, wall = len(self.position), len(contact.overlap), contact.particle_j < 0
        solid = {
            "void_ratio": void_ratio(n, self.sizes, self.side, self.length),
            "coordination_number": float((2 * m - wall.sum()) / n),
        }
        mass, inertia = self.masses
        return Network(
            position=self.position,
            cell_size=np.array([*self.side, self.length]),
            cell_periodic=np.array([*self.periodic_sides, self.periodic_z]),
            wall_position=np.asarray(self.walls, float),
            study=self.study | solid | self.constants,
            provenance=self.provenance,
            **frozen(radius=np.full(n, self.sizes), mass=mass, inertia=inertia),
            **frozen(**vars(contact), **self._springs(contact)),
        )

    def _springs(self, contact: ContactList) -> dict[str, Array]:
        """Levers, stiffnesses and forces of contacts, as columns of a network."""
        m, overlap, wall = len(contact.overlap), contact.overlap, contact.particle_j < 0
        each = np.broadcast_to(self.sizes, len(self.position))
        first, second = each[contact.particle_i], each[np.maximum(contact.particle_j, 0)]
        effective = np.where(wall, first, first * (second / (first + second)))
        law = law_of_each(self.laws, wall)
        force, tangential = law.normal_force(overlap, effective), np.zeros((m, 3))
        if self.shear is not None:
            if len(self.shear) != m:
                raise InputError(
                    f"sample: {len(self.shear)} shear forces for {m} contacts; it was written by "
                    "another program or is damaged, make it again"
                )
            for part, along, across in contact.frames():
                shear = self.shear[part]
                tangential[part] = shear[:, :1] * along + shear[:, 1:] * across
        backwards = (overlap / 2 - second)[:, None] * contact.normal
        backwards[wall] = 0
        return {
            "lever_i": (first - overlap / 2)[:, None] * contact.normal,
            "lever_j": backwards,
            "stiffness_normal": law.stiffness_normal(overlap, effective),
            "stiffness_tangential": law.stiffness_tangential(overlap, effective),
            "force_normal": force,
            "force_tangential": tangential,
            "sliding": np.linalg.norm(tangential, axis=1) >= self.friction * force * (1 - 1e-9),
        }


def void_ratio(n: int, radius: float | Floats, side: Floats, length: float) -> float:
    """Volume of voids over volume of n spheres, wall to wall; `radius` of all or of each (n,)."""
    cube = float(np.mean(radius**3))
    return float(side[0] * side[1] * length / (n * 4 / 3 * np.pi * cube) - 1)
