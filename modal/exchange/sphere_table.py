"""Read tables of spheres alone, with the column names and units that people and programs write.

The known columns are x, y, z and radius or diameter, in many spellings, and mass, density, id and
type. A unit of length may follow a name: `x (mm)`, `x [mm]`, `x_mm`, `x/mm`. Other columns are
ignored. Columns are separated by commas, semicolons, tabs or blanks.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.exchange.spheres import Spheres

NAMES: Mapping[str, Sequence[str]] = {
    "x": (
        "x",
        "px",
        "posx",
        "positionx",
        "centerx",
        "centrex",
        "centroidx",
        "points0",
        "position0",
    ),
    "y": (
        "y",
        "py",
        "posy",
        "positiony",
        "centery",
        "centrey",
        "centroidy",
        "points1",
        "position1",
    ),
    "z": (
        "z",
        "pz",
        "posz",
        "positionz",
        "centerz",
        "centrez",
        "centroidz",
        "points2",
        "position2",
    ),
    "radius": ("r", "radius", "rad", "radii", "particleradius"),
    "diameter": ("d", "diameter", "diameters", "dia", "diam", "particlediameter"),
    "mass": ("mass", "particlemass"),
    "density": ("density", "rho"),
    "id": ("id", "particleid", "number", "label"),
    "type": ("type",),
}
"""Names of each column in small letters, without signs and blanks."""
CLUMPS = ("clumpid", "clump", "mol", "molecule")
"""Names of columns that number the clumps or molecules that spheres belong to."""
CENTRE = ("x", "y", "z")
FURTHER = ("id", "mass", "density", "type")
"""Columns that a table may lack."""
LENGTHS = (*CENTRE, "radius", "diameter")
"""Columns that are lengths."""
UNITS_OF_LENGTH = {
    "m": 1.0,
    "dm": 1e-1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "µm": 1e-6,
    "μm": 1e-6,
    "micron": 1e-6,
    "microns": 1e-6,
    "nm": 1e-9,
}
"""Units of length in m. Both letters mu of Unicode are in use."""
SEPARATORS = (",", ";", "\t")
"""Characters that may separate columns, beside blanks."""


class Heading(NamedTuple):
    """The known name of a column, and the unit after it; the unit is empty if there is none."""

    name: str
    unit: str


def separator_of(header: str) -> str | None:
    """Return the separator of the names in the first line of a table; None for blanks."""
    for separator in SEPARATORS:
        if separator in header:
            return separator
    return None


def read_heading(text: str) -> Heading:
    """Return the known name of a column and its unit; an unknown name gives an empty one.

    >>> read_heading("Position X [mm]"), read_heading("d_um"), read_heading("velocity")
    (Heading(name='x', unit='mm'), Heading(name='diameter', unit='um'), Heading(name='', unit=''))
    """
    units = "|".join(map(re.escape, UNITS_OF_LENGTH))
    pattern = rf"(.*?)\s*(?:[(\[]\s*(.*?)\s*[)\]]|[_/ ]({units}))?"
    match = re.fullmatch(pattern, text.strip().strip("\"'").strip())
    if match is None:
        return Heading("", "")
    plain = plain_name(match[1])
    for name, spellings in NAMES.items():
        if plain in spellings:
            return Heading(name, match[2] or match[3] or "")
    return Heading("", "")


def plain_name(text: str) -> str:
    """Return the letters and digits of a name, in small letters."""
    return re.sub(r"[^a-z0-9]", "", text.lower())


def has_spheres(header: str) -> bool:
    """Return whether the first line of a table names centres and sizes of spheres."""
    names = {read_heading(text).name for text in header.split(separator_of(header))}
    return {"x", "y", "z"} <= names and bool({"radius", "diameter"} & names)


class SphereTable(NamedTuple):
    """The spheres of a table, and the unit of length in m, None if the header states none.

    With a unit in the header the lengths of the spheres are in m, otherwise in the unit of the
    options.
    """

    spheres: Spheres
    unit: float | None


def read_sphere_table(rows: Rows) -> SphereTable:
    """Return the spheres of the rows of a table, without a cell.

    Raises InputError if centres or sizes are missing, if a column occurs twice, or if a unit is
    unknown.
    """
    headings = [read_heading(name) for name in rows.columns]
    columns: dict[str, str] = {}
    for heading, column in zip(headings, rows.columns, strict=True):
        if heading.name in columns:
            problem = f"two columns of {heading.name}"
            remedy = "leave one of the two out"
            refuse(rows.path, "repeated_column", problem, remedy=remedy, line=rows.line - 1)
        if heading.name:
            columns[heading.name] = column
    for column in rows.columns:
        if plain_name(column) in CLUMPS:
            problem = "spheres may belong to clumps, which have no contacts inside"
            remedy = "write single spheres, without this column"
            refuse(
                rows.path,
                "unknown_bodies",
                problem,
                remedy=remedy,
                line=rows.line - 1,
                column=column,
            )
    size = "diameter" if "diameter" in columns and "radius" not in columns else "radius"
    needed = (*CENTRE, size)
    rows.require(needed, "name the columns in the first line: x,y,z,radius", [*columns])
    unit = _unit_of_length(rows, headings)
    further = [name for name in FURTHER if name in columns]
    numbers = rows.read(*(columns[name] for name in (*needed, *further)))
    table = numbers[:, : len(needed)]
    column_of = dict(zip(further, numbers[:, len(needed) :].T, strict=True))
    factor = unit or 1.0
    radius = factor * table[:, 3] * (0.5 if size == "diameter" else 1.0)
    kind = None
    if "type" in column_of:
        kind = rows.to_integers(column_of["type"], columns["type"])
    spheres = Spheres(
        position=factor * table[:, :3],
        radius=radius,
        number=column_of.get("id"),
        mass=column_of.get("mass"),
        density=column_of.get("density"),
        kind=kind,
        digits=rows.count_digits(*(columns[name] for name in CENTRE)),
    )
    return SphereTable(spheres, unit)


def _unit_of_length(rows: Rows, headings: Sequence[Heading]) -> float | None:
    """Return the unit of length, m, that the header states; None if it states no unit.

    Raises InputError for an unknown unit, and if columns have different units.
    """
    units = {heading.unit for heading in headings if heading.name in LENGTHS and heading.unit}
    if not units:
        return None
    for unit in units:
        if unit not in UNITS_OF_LENGTH:
            problem = f"the unit {unit!r} is not known"
            remedy = f"give one of {', '.join(UNITS_OF_LENGTH)}"
            refuse(rows.path, "unit_of_length", problem, remedy=remedy, line=rows.line - 1)
    if len(units) > 1:
        problem = f"lengths in different units, {' and '.join(sorted(units))}"
        refuse(rows.path, "unit_of_length", problem, remedy="use one", line=rows.line - 1)
    return UNITS_OF_LENGTH[units.pop()]
