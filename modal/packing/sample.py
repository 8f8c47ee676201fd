"""Store a sample of spheres compactly: its contact network is rebuilt from positions.

This module is the one definition of the format "granular-sample", versions 1 to 5. What is stored
are the fields of `modal.packing.sphere_sample.Sample`.
"""

from pathlib import Path

import numpy as np

from modal.formats.column import Column, columns_of
from modal.formats.hdf5 import named
from modal.formats.product import Product
from modal.packing.contact_law import GLASS, HERTZ_MINDLIN, YOUNG_RANGE_PA, Material
from modal.packing.faults import Fault, Faults, refuse_first
from modal.packing.noted_laws import ELASTIC, WALL_ELASTIC, wall_material
from modal.packing.sample_of_network import sample_of_network as sample_of_network
from modal.packing.sphere_sample import MAKE_AGAIN
from modal.packing.sphere_sample import Sample as Sample
from modal.tools.errors import InputError

SCHEMA = "granular-sample"
VERSION = 1, 2, 3, 4, 5
"""Versions of the file format. 1: between walls. 2: periodic along z. 3: another contact model than
that of Hertz and Mindlin. 4: held spheres. 5: moments of contacts that resist turning; clumps.
Earlier readers would not notice the last four."""
EDGE_SLACK_IN_RADII = 1e-9
"""Largest distance, in radii, of a centre outside of the cell that round-off explains."""


_NUMBERS = ("friction", "rolling", "twisting", "radius", *ELASTIC, "density", *WALL_ELASTIC)
COLUMNS = columns_of(Sample)
FORMAT = Product(
    SCHEMA,
    COLUMNS | {"period": Column("cell/period", "f", (1,), "m", optional=True, since=2)},
    attributes=dict.fromkeys(_NUMBERS, float) | {"contact_model": str},
    # The file of a sample with several sizes may lack the mean radius, that of a sample whose walls
    # are of the material of its spheres lacks their constants.
    defaults={
        "radius": np.nan,
        "wall_young": None,
        "wall_poisson": None,
        "contact_model": HERTZ_MINDLIN,
        "rolling": 0.0,
        "twisting": 0.0,
    },
    since={"contact_model": 3, "rolling": 5, "twisting": 5},
    groups=("study", "provenance"),
    versions=VERSION,
)


def write_sample(path: str | Path, sample: Sample) -> None:
    """Write the sample atomically.

    Parameters
    ----------
    path : str or Path
        `*.sample.h5`, replaced if it exists.
    sample : Sample
        Spheres, their contact model, and the shear forces of their contacts.

    Raises
    ------
    InputError
        If the sample has no periods along x and y, or the file cannot be written.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "mine.sample.h5")
    >>> position = np.array([[1e-3, 1e-3, 1e-3]])
    >>> side = np.array([4e-3, 4e-3])
    >>> walls = np.array([0.0, 2e-3])
    >>> write_sample(path, Sample(position, side, walls, friction=0.1, radius=1.0001e-3))
    >>> modal.read(path).n_contacts
    2
    """
    if not all(sample.periodic_sides):
        raise InputError(
            "no_periods",
            "a sample without periods sideways has no file",
            remedy="write its network",
        )
    period = np.diff(sample.walls) if sample.periodic_z else None
    values = vars(sample) | vars(sample.material) | sample.wall_constants
    FORMAT.write(path, values | {"period": period})


def read_sample(path: str | Path) -> Sample:
    """Read and validate a sample; raise InputError for any fault."""
    values = FORMAT.read(path)
    wall_constants = {name: values.pop(name) for name in WALL_ELASTIC}
    with named(path):
        walls = wall_material(wall_constants)
    material = Material(**{name: values.pop(name) for name in vars(GLASS)})
    if values["radii"] is not None:
        values["radius"] = float(values["radii"].mean())
    periodic_z = values.pop("period") is not None
    sample = Sample(**values, periodic_z=periodic_z, material=material, wall_material=walls)
    validate(sample, str(path))
    return sample


def validate(sample: Sample, name: str = "sample") -> None:
    """Raise InputError for an impossible sample; the message begins with `name`."""
    with named(name):
        refuse_first(_check_sample(sample))
        _ = sample.laws  # refuses an unknown contact model


def _check_sample(sample: Sample) -> Faults:
    """Check numbers, material and cell; then the positions, whose check takes longest."""
    for column in COLUMNS:
        data = getattr(sample, column)
        if data is not None:
            yield Fault(
                "",
                not np.isfinite(data).all(),
                "not_finite",
                f"{column} is not finite",
                remedy="the run failed, make it again",
            )
    yield from _check_constants(sample)
    low, high = sample.walls
    has_cell = low < high and min(sample.side) >= sample.radius
    yield Fault(
        "",
        len(sample.position) == 0 or not has_cell,
        "no_cell",
        "a sample needs spheres, a cell at least one radius wide and two walls",
        remedy=MAKE_AGAIN,
    )
    yield from _check_positions(sample)


def _check_constants(sample: Sample) -> Faults:
    """Check the radii, the friction and the constants of both materials."""
    material = sample.material
    wall = sample.wall_material or material
    density = material.density
    if sample.densities is not None:
        density = float(sample.densities.min())
    radius = float(np.min(sample.sizes))
    are_positive = 0 < density < np.inf and 0 < radius < np.inf
    for coefficient in (sample.friction, sample.rolling, sample.twisting):
        are_positive = are_positive and 0 <= coefficient < np.inf
    are_poisson = -1 < material.poisson < 0.5 and -1 < wall.poisson < 0.5
    yield Fault(
        "",
        not (are_positive and are_poisson),
        "constants",
        "radius, friction and the material's constants must be positive, Poisson's ratio from -1 "
        "to 0.5",
        remedy=MAKE_AGAIN,
    )
    low, high = YOUNG_RANGE_PA
    for young in (material.young, wall.young):
        yield Fault(
            "",
            not low <= young <= high,
            "young",
            f"Young's modulus {young:g} Pa is none of a solid ({low:g} to {high:g})",
            remedy="give it in Pa",
        )


def _check_positions(sample: Sample) -> Faults:
    """Check that the spheres lie inside the cell, and that no two have the same centre."""
    low, high = sample.walls
    lateral = sample.position[:, :2]
    z = sample.position[:, 2]
    # On the cell's edge a centre may lie on either side of it by round-off.
    slack = EDGE_SLACK_IN_RADII * sample.radius
    outside = ((lateral < -slack) | (lateral > sample.side + slack)).any(axis=1)
    outside |= (z < low) | (z > high)
    yield Fault(
        "sphere", outside, "outside_cell", "lies outside the cell or the walls", remedy=MAKE_AGAIN
    )
    ordered = sample.position[np.lexsort(sample.position.T)]
    repeated = ~np.diff(ordered, axis=0).any(axis=1)
    yield Fault("", repeated, "same_place", "two spheres lie in one place", remedy=MAKE_AGAIN)
