"""Spheres as a sample: positions and history, from which contacts, springs and network follow.

Overlaps, normals and stiffnesses follow from the positions and the contact model; only what depends
on history is stored in separate fields: shear forces, as two components in a frame that follows
from the normal, and moments.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from modal.formats.column import stored
from modal.packing.clumps import Clumps
from modal.packing.columns import frozen
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, Elasticity, Material
from modal.packing.contact_models import (
    ContactLaw,
    acts_across_gaps,
    friction_force,
    law_of_each,
    laws_of,
    resists_turning,
    rupture_distance,
    turning_stiffnesses,
)
from modal.packing.neighbours import ContactList, touching
from modal.packing.network import Network
from modal.packing.noted_laws import ELASTIC
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.arrays import Array, Bools, Floats, Ints
from modal.tools.errors import InputError, UnavailableError

MIN_FRICTION_USED = 1 - 1e-9
"""Least share of the friction limit at which a contact counts as sliding; 1 up to round-off."""
TURNING = ("rolling", "twisting")
"""Names of the coefficients against turns, in files and in the notes of networks."""
UNSTABLE_CONTACTS = "contacts_of_negative_stiffness"
"""Note of a network: the number of its contacts whose normal stiffness is negative."""
MAKE_AGAIN = "make the sample again"
"""Text of the remedy for a sample that no program of this project writes."""
SPIN = "rad/s"


@dataclass
class Sample:
    """Spheres between flat walls, at rest or, with velocities, in motion; SI units.

    Parameters
    ----------
    position : ndarray (n, 3)
        Centres, m; x and y lie inside the cell.
    side, walls : ndarray (2,)
        Sides of the lateral cell, and z of source and receiver wall, m.
    friction : float
        Friction coefficient mu of the contacts.
    shear : ndarray (m, 2), optional
        Shear force on i of each contact in canonical order along `neighbours.tangents`, N.
    acting : ndarray of bool (p,), optional
        Which of the `pairs_in_reach` are contacts; by default those that overlap. Needed only for
        contact models whose contacts still act across a gap.
    rolling, twisting : float, default 0
        Coefficients of rolling and twisting friction. Times the effective radius and the force that
        bounds friction they are the largest moments across and along the normal of a contact. The
        stiffnesses are those of `modal.packing.contact_models.turning_stiffnesses`. If both are 0,
        only contact models that resist turning have moments.
    moment : ndarray (m, 3), optional
        Moment on i of each contact in canonical order, N m.
    velocity, angular_velocity, strain_rate : ndarray (n, 3), (n, 3), (3,), optional
        Velocities, m/s and rad/s, and strain rate of the cell, 1/s; only for a sample in motion.
    radius, radii : float, default 1.27e-3, and ndarray (n,), optional
        Radius of all spheres, m, or, if they differ, the mean radius and that of each sphere.
    material, densities : Material, default glass, and ndarray (n,) kg/m^3, optional
        Material of the spheres; `densities` replace its density.
    wall_material : Elasticity, optional
        Elastic constants of the walls; by default those of the spheres.
    periodic_z : bool, default False
        Whether z is periodic without walls; `walls` are then the ends of the period.
    periodic_sides : tuple of 2 bool, default (True, True)
        Whether x and y are periodic. A sample with free sides cannot be written to a file.
    fixed : ndarray of bool (n, 6), optional
        Motions that a sphere cannot make, as in a network; by default all spheres move freely.
    body, arm, body_mass, body_tensor : optional
        Clumps to which all spheres belong, as in `modal.packing.clumps.Clumps`.
    study, provenance : dict, optional
        Free attributes.

    Examples
    --------
    >>> import numpy as np
    >>> position = np.array([[1e-3, 1e-3, 1e-3]])
    >>> side = np.array([4e-3, 4e-3])
    >>> walls = np.array([0.0, 2e-3])
    >>> Sample(position, side, walls, friction=0.1, radius=1e-3 + 1e-7).network()
    <Network: 1 particles, 2 contacts>
    """

    position: Annotated[Floats, stored("particles", "f", "n", 3, unit="m")]
    side: Annotated[Floats, stored("cell", "f", 2, unit="m")]
    walls: Annotated[Floats, stored("walls", "f", 2, unit="m", name="position")]
    friction: float
    shear: Annotated[Floats | None, stored("contacts", "f", "m", 2, unit="N")] = None
    acting: Annotated[Bools | None, stored("contacts", "b", "p")] = None
    rolling: float = 0.0
    twisting: float = 0.0
    moment: Annotated[Floats | None, stored("contacts", "f", "m", 3, unit="N m", since=5)] = None
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
    fixed: Annotated[Bools | None, stored("particles", "b", "n", 6, since=4)] = None
    body: Annotated[Ints | None, stored("particles", "i", "n", since=5)] = None
    arm: Annotated[Floats | None, stored("particles", "f", "n", 3, unit="m", since=5)] = None
    body_mass: Annotated[
        Floats | None, stored("bodies", "f", "k", unit="kg", name="mass", since=5)
    ] = None
    body_tensor: Annotated[
        Floats | None,
        stored("bodies", "f", "k", 3, 3, unit="kg m^2", name="inertia_tensor", since=5),
    ] = None
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def sizes(self) -> float | Floats:
        """Radius of all spheres, or of each sphere (n,), m."""
        return self.radius if self.radii is None else self.radii

    @property
    def laws(self) -> tuple[ContactLaw, ContactLaw]:
        """Contact law between two spheres, and that between a sphere and a wall."""
        return laws_of(self.material, self.wall_material)

    @property
    def resists_turning(self) -> bool:
        """Whether contacts have moments, by coefficients or by their model."""
        return self.rolling > 0 or self.twisting > 0 or resists_turning(self.laws[0])

    @property
    def constants(self) -> dict[str, Any]:
        """Constants of the materials and contacts by name, as in the `study` of a network.

        The density is left out if spheres differ in density, and so are the default contact model
        and coefficients that are 0.
        """
        names = list(ELASTIC)
        if self.material.contact_model != HERTZ_MINDLIN:
            names.append("contact_model")
        if self.densities is None:
            names.append("density")
        constants = {name: getattr(self.material, name) for name in names}
        for name in TURNING:
            if getattr(self, name) > 0:
                constants[name] = getattr(self, name)
        return constants | self.wall_constants

    @property
    def wall_constants(self) -> dict[str, float]:
        """Elastic constants of the walls by name; empty if equal to those of the spheres."""
        walls = self.wall_material
        if walls is None:
            return {}
        return {f"wall_{name}": getattr(walls, name) for name in ELASTIC}

    @property
    def masses(self) -> tuple[Floats, Floats]:
        """Mass, kg, and moment of inertia, kg m^2, of each sphere (n,)."""
        radius = np.full(len(self.position), self.sizes)
        mass, inertia = self.material.sphere(radius, self.densities)
        return mass, inertia

    @property
    def clumps(self) -> Clumps | None:
        """The clumps of the spheres; None if each moves by itself."""
        if self.body is None or self.arm is None:
            return None
        if self.body_mass is None or self.body_tensor is None:
            raise InputError(
                "incomplete_bodies", "the clumps lack mass or tensor", remedy=MAKE_AGAIN
            )
        return Clumps(self.body, self.arm, self.body_mass, self.body_tensor)

    def refuse_clumps(self, purpose: str) -> None:
        """Raise UnavailableError for a sample of clumps, which `purpose` does not support."""
        if self.body is not None:
            raise UnavailableError(
                "clumps",
                f"{purpose} of clumps",
                "its spheres would move by themselves",
                "take the linear wave or the modes of the sample, whose network has the clumps",
            )

    @property
    def grains(self) -> int:
        """Number of grains: clumps, or single spheres."""
        return len(self.position) if self.body_mass is None else len(self.body_mass)

    @property
    def void_ratio(self) -> float:
        """Volume of the voids divided by that of the grains, from wall to wall."""
        if self.body_mass is None:
            return void_ratio(len(self.position), self.sizes, self.side, self.length)
        solid = float(self.body_mass.sum()) / self.material.density
        return float(self.side[0] * self.side[1] * self.length / solid - 1)

    @property
    def length(self) -> float:
        """Distance of the walls, or period along z, m."""
        return float(self.walls[1] - self.walls[0])

    @property
    def periods(self) -> Floats:
        """Periods (2,) along x and y, m; for a free side, a length too large for contacts."""
        beyond = np.ptp(self.position[:, :2], axis=0) + 6 * np.max(self.sizes)
        return np.where(self.periodic_sides, self.side, beyond)

    @property
    def lengths(self) -> Floats:
        """The `periods` and the `length` (3,), m."""
        return np.array([*self.periods, self.length])

    @property
    def rupture_distances(self) -> tuple[float, float]:
        """Largest gap, m, of a contact between two spheres, and of one with a wall."""
        largest = float(np.max(self.sizes))
        pair_law, wall_law = self.laws
        pair_gap = rupture_distance(pair_law, largest / 2)
        return float(pair_gap), float(rupture_distance(wall_law, largest))

    def contacts(self) -> ContactList:
        """Return all contacts in canonical order; their overlaps follow from the positions.

        InputError if `acting` does not belong to the positions.
        """
        pairs = self.pairs_in_reach()
        if self.acting is None:
            if not acts_across_gaps(self.laws[0]):
                return pairs
            return pairs.some(pairs.overlap > 0)
        if len(self.acting) != len(pairs.overlap):
            raise InputError(
                "acting_pairs",
                "sample",
                f"{len(self.acting)} pairs are said to act or not, {len(pairs.overlap)} are in "
                "reach",
                "it was written by another program or is damaged, make it again",
            )
        return pairs.some(self.acting)

    def pairs_in_reach(self) -> ContactList:
        """Return the pairs, in canonical order, that overlap or may have a contact across a gap."""
        periodic = np.array([*self.periodic_sides, self.periodic_z])
        low = np.where(periodic, [0.0, 0.0, self.walls[0]], 0.0)
        periods = periodic * self.lengths
        largest_gap = max(self.rupture_distances)
        pairs = touching(self.position, low, periods, self.walls, self.sizes, largest_gap)
        if self.body is not None:
            partner = np.maximum(pairs.particle_j, 0)
            is_inner = self.body[pairs.particle_i] == self.body[partner]
            pairs = pairs.some(~is_inner | (pairs.particle_j < 0))
        if not largest_gap:
            return pairs
        wall = pairs.particle_j < 0
        law = law_of_each(self.laws, wall)
        return pairs.some(pairs.overlap > -rupture_distance(law, self._effective_radius(pairs)))

    def _effective_radius(self, contact: ContactList) -> Floats:
        """Return R1 R2 / (R1 + R2) of each contact (m,), m; at a wall the radius R."""
        radius = np.broadcast_to(self.sizes, len(self.position))
        radius_i = radius[contact.particle_i]
        radius_j = radius[np.maximum(contact.particle_j, 0)]
        effective: Floats = radius_i * (radius_j / (radius_i + radius_j))
        return np.where(contact.particle_j < 0, radius_i, effective)

    def network(self) -> Network:
        """Return the contact network of the grains: clumps, or spheres (`sphere_network`)."""
        network = self.sphere_network()
        clumps = self.clumps
        if clumps is None:
            return network
        first = clumps.first_members
        bodies = Bodies(
            np.arange(1, len(first) + 1),
            clumps.mass,
            self.position[first] - clumps.arm[first],
            clumps.tensor,
        )
        whole = joined(network, clumps.body + 1, bodies)
        # The radius of a body is that of a sphere of its volume, of which overlaps are no part.
        radius = np.cbrt(whole.mass / self.material.density / (4 / 3 * np.pi))
        return replace(whole, radius=radius)

    def sphere_network(self, contact: ContactList | None = None) -> Network:
        """Return the contact network of the spheres: springs of the model at the present overlaps.

        The contacts are found from the positions unless `contact` gives them. A contact point lies
        in the middle of the overlap, also at a wall. The relative error of an overlap is eps times
        diameter divided by overlap, 1e-12 at 100 kPa. A contact beyond its largest tension, or with
        a liquid bridge across a gap, has a negative normal stiffness: the network has 0 instead,
        and the number of these contacts in its notes. Raises InputError if there are not as many
        shear forces as contacts.
        """
        if contact is None:
            contact = self.contacts()
        n = len(self.position)
        ends = 2 * len(contact.overlap) - (contact.particle_j < 0).sum()
        densities = {
            "void_ratio": self.void_ratio,
            "coordination_number": float(ends / self.grains),
        }
        mass, inertia = self.masses
        springs = self._compute_springs(contact)
        unstable = springs["stiffness_normal"] < 0
        notes: dict[str, Any] = {}
        if unstable.any():
            notes[UNSTABLE_CONTACTS] = int(unstable.sum())
            springs["stiffness_normal"] = np.where(unstable, 0.0, springs["stiffness_normal"])
        return Network(
            position=self.position,
            cell_size=np.array([*self.side, self.length]),
            cell_periodic=np.array([*self.periodic_sides, self.periodic_z]),
            wall_position=np.asarray(self.walls, float),
            study=self.study | densities | self.constants | notes,
            provenance=self.provenance,
            fixed=self.fixed,
            **frozen(radius=np.full(n, self.sizes), mass=mass, inertia=inertia),
            **frozen(**vars(contact), **springs),
        )

    def _compute_springs(self, contact: ContactList) -> dict[str, Array]:
        """Return levers, stiffnesses and forces of contacts as columns of a network."""
        overlap = contact.overlap
        wall = contact.particle_j < 0
        radius = np.broadcast_to(self.sizes, len(self.position))
        radius_i = radius[contact.particle_i]
        radius_j = radius[np.maximum(contact.particle_j, 0)]
        effective = self._effective_radius(contact)
        law = law_of_each(self.laws, wall)
        force = law.normal_force(overlap, effective)
        tangential = self._compute_shear(contact)
        lever_j = (overlap / 2 - radius_j)[:, None] * contact.normal
        lever_j[wall] = 0
        limit = self.friction * friction_force(law, overlap, effective) * MIN_FRICTION_USED
        turning: dict[str, Array] = {}
        if self.resists_turning:
            turning = self._compute_turning(contact, law, effective)
        return turning | {
            "lever_i": (radius_i - overlap / 2)[:, None] * contact.normal,
            "lever_j": lever_j,
            "stiffness_normal": law.stiffness_normal(overlap, effective),
            "stiffness_tangential": law.stiffness_tangential(overlap, effective),
            "force_normal": force,
            "force_tangential": tangential,
            "sliding": np.linalg.norm(tangential, axis=1) >= limit,
        }

    def _compute_turning(
        self, contact: ContactList, law: ContactLaw, effective: Floats
    ) -> dict[str, Array]:
        """Return the stiffnesses against rolling and twisting, and the moments, as columns."""
        rolling, twisting = turning_stiffnesses(
            law, contact.overlap, effective, self.rolling, self.twisting
        )
        moment = np.zeros((len(contact.overlap), 3))
        if self.moment is not None:
            if self.moment.shape != moment.shape:
                raise InputError(
                    "moments",
                    "sample",
                    f"{len(self.moment)} moments for {len(moment)} contacts",
                    "it was written by another program or is damaged, make it again",
                )
            moment = self.moment.copy()
        return {"stiffness_rolling": rolling, "stiffness_twisting": twisting, "moment": moment}

    def _compute_shear(self, contact: ContactList) -> Floats:
        """Return the tangential forces (m, 3), N, from their components along both tangents."""
        m = len(contact.overlap)
        tangential = np.zeros((m, 3))
        if self.shear is None:
            return tangential
        if len(self.shear) != m:
            raise InputError(
                "shear_forces",
                "sample",
                f"{len(self.shear)} shear forces for {m} contacts",
                "it was written by another program or is damaged, make it again",
            )
        for part, first_tangent, second_tangent in contact.frames():
            shear = self.shear[part]
            tangential[part] = shear[:, :1] * first_tangent + shear[:, 1:] * second_tangent
        return tangential


def void_ratio(n: int, radius: float | Floats, side: Floats, length: float) -> float:
    """Return the volume of voids divided by that of n spheres, from wall to wall.

    `radius` is that of all spheres or of each (n,), m; `side` (2,) and `length` of the cell, m.
    """
    mean_cube = float(np.mean(radius**3))
    return float(side[0] * side[1] * length / (n * 4 / 3 * np.pi * mean_cube) - 1)
