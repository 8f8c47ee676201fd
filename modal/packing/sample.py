"""The compact form of a sample of spheres, from which its contact network is rebuilt.

This module is the one definition of the format "granular-sample", versions 1 to 3. Overlaps,
normals and stiffnesses follow from the positions; only shear forces, which depend on history, are
kept, as two components in a frame that follows from the normal.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.hdf5 import named
from modal.formats.product import Column, Product
from modal.packing.checks import Faults, density_of, refuse
from modal.packing.columns import columns_of
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, YOUNG, Elasticity, Material
from modal.packing.neighbours import canonical
from modal.packing.network import Network
from modal.packing.spheres import ELASTIC as ELASTIC
from modal.packing.spheres import Sample as Sample
from modal.packing.spheres import void_ratio as void_ratio
from modal.tools.errors import InputError

SCHEMA = "granular-sample"
VERSION = 1, 2, 3
"""Between walls; periodic along z, and of another contact model than Hertz and Mindlin's, which
earlier readers would not notice."""
UNEQUAL = 1e-9
"""Relative: a density so far from the material's is the sphere's own, not round-off."""
ANOTHER = 1e-6
"""Of the mean stiffness: a contact so far from the law's is another law's."""


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
    own = {name: type(usual)(noted.get(name, usual)) for name, usual in vars(GLASS).items()}
    material = Material(**own)
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
        wall_material=_wall_material(noted),
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
            "the network's contacts are not those of spheres that overlap in a lateral cell: by "
            "round-off, or from another program; take the network itself"
        )
    shear = contact.along(force[rows] * np.where(turned, -1, 1)[:, None])
    sample.shear = shear if shear.any() else None
    rebuilt = sample.network(contact)
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


def _wall_material(notes: dict[str, Any]) -> Elasticity | None:
    """The walls' own material, as notes or a file's attributes tell it; None without."""
    if notes.get("wall_young") is None:
        return None
    return Elasticity(float(notes["wall_young"]), float(notes["wall_poisson"]))


def write_sample(path: str | Path, sample: Sample) -> None:
    """Write the sample atomically.

    Parameters
    ----------
    path
        `*.sample.h5`, replaced if it is there.
    sample
        Spheres with their contact model, and the shear forces of their contacts.

    Raises
    ------
    InputError
        For a sample without periods along x and y; where the file cannot be written.
    """
    if not all(sample.periodic_sides):
        raise InputError("a sample without periods sideways has no file; write its network")
    period = np.diff(sample.walls) if sample.periodic_z else None
    values = vars(sample) | vars(sample.material) | sample.wall_constants
    FORMAT.write(path, values | {"period": period})


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
    positive = (material.young, wall.young, dense, float(np.min(sample.sizes)))
    sound = all(0 < number < np.inf for number in positive)
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
