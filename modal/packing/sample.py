"""The compact form of a sample of spheres, from which its contact network is rebuilt.

This module is the one definition of the format "granular-sample", versions 1 to 3. Overlaps,
normals and stiffnesses follow from the positions; only shear forces, which depend on history, are
kept, as two components in a frame that follows from the normal.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from modal.formats.attributes import number_noted
from modal.formats.hdf5 import named
from modal.formats.product import Column, Product, columns_of, stored
from modal.packing.checks import Faults, density_of, refuse
from modal.packing.columns import frozen
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, YOUNG, Elasticity, Material
from modal.packing.contact_models import ContactLaw, law_of_each, laws_of
from modal.packing.neighbours import ContactList, canonical, touching
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError

SCHEMA = "granular-sample"
VERSION = 1, 2, 3
"""Between walls; periodic along z, and of another contact model than Hertz and Mindlin's, which
earlier readers would not notice."""
UNEQUAL = 1e-9
"""Relative: a density so far from the material's is the sphere's own, not round-off."""
ANOTHER = 1e-6
"""Of the mean stiffness: a contact so far from the law's is another law's."""
SPIN = "rad/s"
ELASTIC = ("young", "poisson")
OF_WALLS = ("wall_young", "wall_poisson")
"""The same of walls, as attributes and notes."""


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

    def contacts(self) -> ContactList:
        """All contacts, in canonical order; their overlaps follow from the positions."""
        periodic = np.array([*self.periodic_sides, self.periodic_z])
        low = np.where(periodic, [0.0, 0.0, self.walls[0]], 0.0)
        return touching(self.position, low, periodic * self.lengths, self.walls, self.sizes)

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
                    "input",
                    "sample",
                    f"{len(self.shear)} shear forces for {m} contacts",
                    "it was written by another program or is damaged, make it again",
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


_NUMBERS = "friction", "radius", *ELASTIC, "density", *(f"wall_{name}" for name in ELASTIC)
COLUMNS = columns_of(Sample)
FORMAT = Product(
    SCHEMA,
    COLUMNS | {"period": Column("cell/period", "f", (1,), "m", optional=True, since=2)},
    attributes=dict.fromkeys(_NUMBERS, float) | {"contact_model": str},
    # A sample of several sizes may lack the mean of them, one whose walls are its spheres' theirs.
    defaults={"radius": np.nan, "wall_young": None, "wall_poisson": None}
    | {"contact_model": HERTZ_MINDLIN},
    since={"contact_model": 3},
    groups=("study", "provenance"),
    versions=VERSION,
)


def sample_of_network(network: Network, friction: float) -> Sample:
    """The compact form of a network of spheres, in canonical order then.

    Moduli and contact model are those that its `study` notes, or those of glass. InputError for
    other networks: stiffnesses of another law or of other moduli, or other contacts.
    """
    radius, density = network.radius, density_of(network)
    alike, noted = bool((radius == radius[0]).all()), network.study
    own = {name: number_noted(noted, name) for name in (*ELASTIC, "density")}
    known = {name: number for name, number in own.items() if number is not None}
    model = str(noted.get("contact_model", HERTZ_MINDLIN))
    material = replace(GLASS, contact_model=model, **known)
    mixed = abs(density / material.density - 1).max() > UNEQUAL
    sample = Sample(
        position=network.position.copy(),
        side=network.cell_size[:2].copy(),
        walls=network.wall_position.copy(),
        friction=friction,
        radius=float(radius[0] if alike else radius.mean()),
        radii=None if alike else radius.copy(),
        material=material,
        densities=density if mixed else None,
        wall_material=_wall_material({name: number_noted(noted, name) for name in OF_WALLS}),
        periodic_z=bool(network.cell_periodic[2]),
        periodic_sides=(bool(network.cell_periodic[0]), bool(network.cell_periodic[1])),
        study=noted,
        provenance=network.provenance,
    )
    contact = sample.contacts()
    periods = network.require("cell_shift", "sample with its contacts in order")
    force = network.require("force_tangential", "sample with its history")
    rows, i, j, shift, turned = canonical(network.particle_i, network.particle_j, periods)
    theirs = contact.particle_i, contact.particle_j, contact.cell_shift
    if not all(map(np.array_equal, (i, j, shift), theirs)):
        raise InputError(
            "input",
            "the network's contacts are not those of spheres that overlap in a lateral cell",
            "by round-off, or from another program",
            "take the network itself",
        )
    shear = contact.along(force[rows] * np.where(turned, -1, 1)[:, None])
    sample.shear = shear if shear.any() else None
    rebuilt = sample.network(contact)
    for name in ("stiffness_normal", "stiffness_tangential"):
        theirs = getattr(network, name)[rows]
        if abs(getattr(rebuilt, name) - theirs).max(initial=0.0) > ANOTHER * theirs.mean():
            raise InputError(
                "input",
                f"the network's {name} is not that of {material.contact_model} contacts of E "
                f"{material.young:g} Pa and nu {material.poisson:g}",
                remedy=(
                    "note young, poisson, "
                    "contact_model and, of other walls, wall_young and wall_poisson in its group "
                    "study, or take the linear wave, which knows any law"
                ),
            )
    return sample


def _wall_material(notes: Mapping[str, float | None]) -> Elasticity | None:
    """The walls' own material, as notes or a file's attributes tell it; None without."""
    young, poisson = (notes.get(f"wall_{name}") for name in ELASTIC)
    if young is None and poisson is None:
        return None
    if young is None or poisson is None:
        problem = "one of wall_young and wall_poisson lacks"
        raise InputError("incomplete", problem, remedy="give both, or none")
    return Elasticity(young, poisson)


def write_sample(path: str | Path, sample: Sample) -> None:
    """Write the sample atomically.

    Parameters
    ----------
    path : str or Path
        `*.sample.h5`, replaced if it is there.
    sample : Sample
        Spheres with their contact model, and the shear forces of their contacts.

    Raises
    ------
    InputError
        For a sample without periods along x and y; where the file cannot be written.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "mine.sample.h5")
    >>> at, walls = np.array([[1e-3, 1e-3, 1e-3]]), np.array([0.0, 2e-3])
    >>> write_sample(path, Sample(at, np.array([4e-3, 4e-3]), walls, 0.1, radius=1.0001e-3))
    >>> modal.read(path).n_contacts
    2
    """
    if not all(sample.periodic_sides):
        raise InputError(
            "input", "a sample without periods sideways has no file", remedy="write its network"
        )
    period = np.diff(sample.walls) if sample.periodic_z else None
    values = vars(sample) | vars(sample.material) | sample.wall_constants
    FORMAT.write(path, values | {"period": period})


def read_sample(path: str | Path) -> Sample:
    """Read and validate a sample; raises InputError with one line for anything wrong."""
    said = FORMAT.read(path)
    with named(path):
        walls = _wall_material({name: said.pop(name) for name in OF_WALLS})
    material = Material(**{name: said.pop(name) for name in vars(GLASS)})
    if said["radii"] is not None:
        said["radius"] = float(said["radii"].mean())
    periodic = said.pop("period") is not None
    sample = Sample(**said, periodic_z=periodic, material=material, wall_material=walls)
    validate(sample, str(path))
    return sample


def validate(sample: Sample, name: str = "sample") -> None:
    """Refuse what no packing of spheres can be; InputError with one line."""
    with named(name):
        refuse(_faults(sample))
        _ = sample.laws


def _faults(sample: Sample) -> Faults:
    """One after the other: the positions last, as they take longest."""
    for column in COLUMNS:
        data = getattr(sample, column)
        wrong = data is not None and not np.isfinite(data).all()
        yield "", wrong, f"{column} is not finite; the run failed, make it again"
    material, radius = sample.material, sample.radius
    wall = sample.wall_material or material
    dense = material.density if sample.densities is None else float(sample.densities.min())
    sound = all(0 < number < np.inf for number in (dense, float(np.min(sample.sizes))))
    sound &= -1 < min(material.poisson, wall.poisson) <= max(material.poisson, wall.poisson) < 0.5
    fault = (
        "radius, friction and the material's constants must be positive, Poisson's ratio from -1 "
        "to 0.5; make the sample again"
    )
    yield "", not (sound and 0 <= sample.friction < np.inf), fault
    for young in (material.young, wall.young):
        fault = f"Young's modulus {young:g} Pa is none of a solid ({YOUNG[0]:g} to {YOUNG[1]:g})"
        yield "", not YOUNG[0] <= young <= YOUNG[1], f"{fault}; give it in Pa"
    n, (low, high) = len(sample.position), sample.walls
    fault = "a sample needs spheres, a cell at least one radius wide and two walls; make it again"
    yield "", n == 0 or low >= high or min(sample.side) < radius, fault
    lateral, z = sample.position[:, :2], sample.position[:, 2]
    # On the cell's edge a centre may lie on either side of it by round-off.
    slack = 1e-9 * radius
    outside = ((lateral < -slack) | (lateral > sample.side + slack)).any(axis=1)
    outside |= (z < low) | (z > high)
    yield "sphere", outside, "lies outside the cell or the walls; make the sample again"
    ordered = sample.position[np.lexsort(sample.position.T)]
    repeated = ~np.diff(ordered, axis=0).any(axis=1)
    yield "", repeated, "two spheres lie in one place; make the sample again"
