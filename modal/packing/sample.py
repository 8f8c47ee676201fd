"""The compact form of a sample of spheres, from which its contact network is rebuilt.

This module is the one definition of the format "granular-sample", versions 1 to 3. Overlaps,
normals and stiffnesses follow from the positions; only shear forces, which depend on history, are
kept, as two components in a frame that follows from the normal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from modal.formats.hdf5 import named
from modal.formats.product import Column, Product
from modal.packing.checks import density_of
from modal.packing.columns import columns_of, stored
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, RADIUS, YOUNG, Elasticity, Material
from modal.packing.contact_models import ContactLaw, laws_of
from modal.packing.neighbours import ContactList, canonical, tangents, touching
from modal.packing.network import Network
from modal.packing.sphere_network import constants, network_of
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

SCHEMA = "granular-sample"
VERSION = 1, 2, 3
"""Between walls; periodic along z, and of another contact model than Hertz and Mindlin's, which
earlier readers would not notice."""
SPIN = "rad/s"
UNEQUAL = 1e-9
"""Relative: a density so far from the material's is the sphere's own, not round-off."""
ANOTHER = 1e-6
"""Of the mean stiffness: a contact so far from the law's is another law's."""


@dataclass
class Sample:
    """Spheres between flat walls at rest, or, with velocities, on their way; SI units.

    position (n, 3), x and y inside the cell; side (2,) of the lateral cell; walls (2,) z of source
    and receiver wall; shear (m, 2) shear force on i of each contact in canonical order along
    `neighbours.tangents`, or None where there is none; velocity, angular_velocity (n, 3) and
    strain_rate (3,), 1/s, of a sample in motion, or None. friction is the coefficient mu of its
    contacts; `study` and `provenance` are free attributes. `radius` is that of all spheres, m, or,
    of spheres of several sizes, the mean of `radii` (n,). `densities` (n,), kg/m^3, stand in place
    of the material's; the walls are of `wall_material`, where it is None of that of the spheres.
    Where it is `periodic_z` there are no walls: `walls` are the ends of a period along z. Where its
    sides are not periodic, `periodic_sides` (x, y), it ends there, and no file has it.
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
        """Its materials, as a network's `study` notes them."""
        return constants(self.material, self.densities, self.wall_material)

    @property
    def masses(self) -> tuple[Floats, Floats]:
        """Mass, kg, and moment of inertia, kg m^2, of each sphere (n,)."""
        each = np.full(len(self.position), self.sizes)
        mass, inertia = self.material.sphere(each, self.densities)
        return mass, inertia

    @property
    def periods(self) -> Floats:
        """Shape (2,), m: of the sides; of those that end, so far that no image is ever near."""
        beyond = np.ptp(self.position[:, :2], axis=0) + 6 * np.max(self.sizes)
        return np.where(self.periodic_sides, self.side, beyond)

    def contacts(self) -> ContactList:
        """All contacts, in canonical order; their overlaps follow from the positions."""
        if not self.periodic_z:
            return touching(self.position, self.periods, self.walls, self.sizes)
        low, high = self.walls
        lengths = np.array([*self.periods, high - low])
        return touching(self.position - [0, 0, low], lengths, None, self.sizes)

    def network(self) -> Network:
        """The contact network: springs of the contact model at the present overlaps.

        Relative error of an overlap: eps times diameter over overlap, 1e-12 at 100 kPa.
        """
        contact = self.contacts()
        tangential = None
        if self.shear is not None:
            if len(self.shear) != len(contact.particle_i):
                raise InputError(
                    f"sample: {len(self.shear)} shear forces for {len(contact.particle_i)} "
                    "contacts; it was written by another program or is damaged, make it again"
                )
            first, second = tangents(contact.normal)
            tangential = self.shear[:, :1] * first + self.shear[:, 1:] * second
        n, wall = len(self.position), contact.particle_j < 0
        length = float(self.walls[1] - self.walls[0])
        study = {
            "void_ratio": void_ratio(n, self.sizes, self.side, length),
            "coordination_number": float((2 * (~wall).sum() + wall.sum()) / n),
        }
        return network_of(
            contact,
            self.sizes,
            self.material,
            densities=self.densities,
            walls=self.wall_material,
            tangential=tangential,
            friction=self.friction,
            study=self.study | study,
            position=self.position,
            cell_size=np.array([*self.side, length]),
            cell_periodic=np.array([*self.periodic_sides, self.periodic_z]),
            wall_position=np.asarray(self.walls, float),
            provenance=self.provenance,
        )


ELASTIC = ("young", "poisson")
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


def void_ratio(n: int, radius: float | Floats, side: Floats, length: float) -> float:
    """Volume of voids over volume of n spheres, wall to wall; `radius` of all or of each (n,)."""
    cube = float(np.mean(radius**3))
    return float(side[0] * side[1] * length / (n * 4 / 3 * np.pi * cube) - 1)


def sample_of_network(network: Network, friction: float) -> Sample:
    """The compact form of a network of spheres, in canonical order then.

    Moduli and contact model are those that its `study` notes, or those of glass. InputError for
    other networks: stiffnesses of another law or of other moduli, or other contacts.
    """
    radius, density = network.radius, density_of(network)
    noted = {name: network.study.get(name, own) for name, own in vars(GLASS).items()}
    material = Material(**{name: type(own)(noted[name]) for name, own in vars(GLASS).items()})
    mixed = abs(density / material.density - 1).max() > UNEQUAL
    sample = Sample(
        position=network.position.copy(),
        side=network.cell_size[:2].copy(),
        walls=network.wall_position.copy(),
        friction=friction,
        radius=float(radius[0] if (radius == radius[0]).all() else radius.mean()),
        radii=None if (radius == radius[0]).all() else radius.copy(),
        material=material,
        densities=density if mixed else None,
        wall_material=_wall_material(network.study),
        periodic_z=bool(network.cell_periodic[2]),
        periodic_sides=(bool(network.cell_periodic[0]), bool(network.cell_periodic[1])),
        study=network.study,
        provenance=network.provenance,
    )
    shear, rows = shear_along(network, sample.contacts())
    sample.shear = shear if shear.any() else None
    rebuilt = sample.network()
    for name in ("stiffness_normal", "stiffness_tangential"):
        theirs = getattr(network, name)[rows]
        if abs(getattr(rebuilt, name) - theirs).max(initial=0.0) > ANOTHER * theirs.mean():
            raise InputError(
                f"the network's {name} is not that of {material.contact_model} contacts of E "
                f"{material.young:g} Pa and nu {material.poisson:g}; note young, poisson, "
                "contact_model and, of other walls, wall_young and wall_poisson in its group "
                "study, or take the linear wave, which knows any law"
            )
    return sample


def shear_along(network: Network, contact: ContactList) -> tuple[Floats, Ints]:
    """Shear forces (m, 2), N, as a sample keeps them, in canonical order, and whose rows (m,).

    InputError where `contact`, those of spheres that overlap, are not the network's.
    """
    periods = network.require("cell_shift", "sample with its contacts in order")
    rows, i, j, shift, turned = canonical(network.particle_i, network.particle_j, periods)
    force = network.require("force_tangential", "sample with its history")[rows]
    force[turned] *= -1
    theirs = contact.particle_i, contact.particle_j, contact.cell_shift
    if not all(map(np.array_equal, (i, j, shift), theirs)):
        raise InputError(
            "the network's contacts are not those of spheres that overlap in a lateral cell: by "
            "round-off, or from another program; take the network itself"
        )
    del i, j, shift, theirs
    shear = [(force * along).sum(axis=1) for along in tangents(contact.normal)]
    return np.column_stack(shear), rows


def _wall_material(notes: dict[str, Any]) -> Elasticity | None:
    """The walls' own material, as notes or a file's attributes tell it; None without."""
    if notes.get("wall_young") is None:
        return None
    return Elasticity(float(notes["wall_young"]), float(notes["wall_poisson"]))


def write_sample(path: str | Path, sample: Sample) -> None:
    """Write the sample atomically; InputError for one that ends sideways."""
    if not all(sample.periodic_sides):
        raise InputError("a sample without periods sideways has no file; write its network")
    walls = sample.wall_material
    own = {} if walls is None else {f"wall_{name}": getattr(walls, name) for name in ELASTIC}
    own["period"] = np.diff(sample.walls) if sample.periodic_z else None
    FORMAT.write(path, vars(sample) | vars(sample.material) | own)


def read_sample(path: str | Path) -> Sample:
    """Read and validate a sample; raises InputError with one line for anything wrong."""
    said = FORMAT.read(path)
    walls = _wall_material(said)
    material = Material(**{name: said.pop(name) for name in vars(GLASS)})
    if said["radii"] is not None:
        said["radius"] = float(said["radii"].mean())
    for name in ELASTIC:
        del said[f"wall_{name}"]
    periodic = said.pop("period") is not None
    sample = Sample(**said, periodic_z=periodic, material=material, wall_material=walls)
    validate(sample, str(path))
    return sample


def validate(sample: Sample, name: str = "sample") -> None:
    """Refuse what no packing of spheres can be; InputError with one line."""
    for column in COLUMNS:
        data = getattr(sample, column)
        if data is not None and not np.isfinite(data).all():
            raise InputError(f"{name}: {column} is not finite; the run failed, make it again")
    material, radius = sample.material, sample.radius
    wall = sample.wall_material or material
    dense = material.density if sample.densities is None else float(sample.densities.min())
    positive = (material.young, wall.young, dense, float(np.min(sample.sizes)))
    sound = all(0 < number < np.inf for number in positive)
    sound &= -1 < min(material.poisson, wall.poisson) <= max(material.poisson, wall.poisson) < 0.5
    if not (sound and 0 <= sample.friction < np.inf):
        raise InputError(
            f"{name}: radius, friction and the material's constants must be positive, Poisson's "
            "ratio from -1 to 0.5; make the sample again"
        )
    for young in (material.young, wall.young):
        if not YOUNG[0] <= young <= YOUNG[1]:
            raise InputError(
                f"{name}: Young's modulus {young:g} Pa is none of a solid ({YOUNG[0]:g} to "
                f"{YOUNG[1]:g}); give it in Pa"
            )
    with named(name):
        _ = sample.laws  # after its moduli, which it divides by
    n, (low, high) = len(sample.position), sample.walls
    if n == 0 or low >= high or min(sample.side) < radius:
        raise InputError(
            f"{name}: a sample needs spheres, a cell at least one radius wide and two walls; "
            "make it again"
        )
    lateral, z = sample.position[:, :2], sample.position[:, 2]
    # On the cell's edge a centre may lie on either side of it by round-off.
    slack = 1e-9 * radius
    outside = ((lateral < -slack) | (lateral > sample.side + slack)).any(axis=1)
    outside |= (z < low) | (z > high)
    if outside.any():
        raise InputError(
            f"{name}: sphere {int(np.argmax(outside))} lies outside the cell or the walls; "
            "make the sample again"
        )
    if _repeated(sample.position):
        raise InputError(f"{name}: two spheres lie in one place; make the sample again")


def _repeated(position: Floats) -> bool:
    """Whether two rows of (n, 3) are equal; millions are sorted by one number each."""
    bits = np.ascontiguousarray(position + 0.0).view(np.uint64)  # -0.0 is 0.0
    number = bits @ np.array([1, 0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], np.uint64)
    order = np.argsort(number)
    alike = np.flatnonzero(np.diff(number[order]) == 0)
    rows = np.union1d(order[alike], order[alike + 1])
    return len(np.unique(position[rows], axis=0)) < len(rows)
