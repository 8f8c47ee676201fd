"""A packing as one or two tables with named columns (CSV), as any program can write them.

Three lines that begin with # above the spheres describe the cell: `# cell XLO XHI YLO YHI ZLO ZHI`,
`# periodic x y` and `# walls ZLOW ZHIGH`, in small or capital letters, with or without a colon;
other lines that begin with # are comments. The table of contacts has their stiffnesses, so that no
law is needed, and each row counts as a contact, whatever its force and overlap. The second sphere
is -1 for the wall at low z, and -2 for the wall at high z. An unknown column is refused, because it
may change the answer.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np

from modal.exchange import spheres
from modal.exchange.import_result import ImportResult, build_network
from modal.exchange.law import SI, Units
from modal.exchange.lines import Lines
from modal.exchange.particles_and_contacts import (
    WALLS,
    Cell,
    Contacts,
    Packing,
    SphereColumns,
    find_ends,
)
from modal.exchange.programs import lammps
from modal.exchange.refusals import quote, refuse
from modal.exchange.row_texts import RowTexts
from modal.exchange.rows import Rows
from modal.exchange.sphere_table import (
    SphereTable,
    has_spheres,
    read_sphere_table,
    separator_of,
)
from modal.exchange.spheres import SphereKeywords, SphereOptions, Spheres
from modal.exchange.spheres_to_contacts import import_spheres
from modal.exchange.words import Words
from modal.formats.hdf5 import named
from modal.packing.contact_checks import check_force_ratio
from modal.tools.arrays import Ints

NAME = "tables (*.csv)"
OPTIONS = {"contacts": lammps.OPTIONS["contacts"], **spheres.OPTIONS}
SPHERES = ("id", "x", "y", "z", "radius", "mass")
"""Columns of the spheres, SI units by default."""
CONTACTS = ("i", "j", "kn", "kt")
"""Columns that contacts must have: ends, and stiffnesses, N/m."""
FORCE = ("fn",)
"""Optional column of normal forces, N, compression positive."""
SHEAR = ("ftx", "fty", "ftz")
"""Optional columns of shear forces on i, N."""
TURNING = ("kr", "kw")
"""Optional columns of stiffnesses against rolling and twisting, N m/rad."""
SLIDING = ("sliding",)
"""Optional column: 1 for a contact at its friction limit, else 0."""
FROM_POSITIONS = ("nx", "ny", "nz", "overlap", "shift_x", "shift_y", "shift_z")
"""Columns that `export` writes for other programs; here they follow from the positions."""
KEYS = {
    "cell": "# cell XLO XHI YLO YHI ZLO ZHI",
    "periodic": "# periodic x y, with the axes that are, or leave the line out for none",
    "walls": "# walls ZLOW ZHIGH, or NULL for none",
}
"""First words of the lines after # that describe the cell, and how each line is written."""
KeyLines = dict[str, Words]
"""The words of the lines after # that describe the cell, by the first word of each line."""


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is a table, by its name or by the names of its columns."""
    if ".csv" in path.name:
        return True
    for line in head.decode("utf-8", "replace").splitlines():
        if has_spheres(_without_comment_sign(line)):
            return True
        if line.strip() and not line.startswith("#"):
            return False
    return False


def _without_comment_sign(line: str) -> str:
    """Return the names in a line that begins with # (as numpy writes) or #format (as YADE does)."""
    if line.startswith("#format "):
        return line.removeprefix("#format ").replace("_", " ")
    return line.lstrip("# ")


def read(
    path: Path,
    contacts: str | Path | None = None,
    scales: Sequence[float] | None = None,
    **sphere_options: Unpack[SphereKeywords],
) -> ImportResult:
    """Return a packing of two tables, or of spheres alone.

    `sphere_options` are described at `SphereOptions`; they are allowed only without a table of
    contacts.
    """
    if contacts is None:
        return _read_spheres_alone(path, SphereOptions(scales=scales, **sphere_options))
    for name in sphere_options:
        remedy = "leave one of the two out"
        refuse(path, "unknown_option", f"--{name} beside a table of contacts", remedy=remedy)
    units = Units.from_scales(scales) or SI
    rows, key_lines = _read_table(path, SPHERES)
    table = rows.read(*SPHERES)
    rows.refuse(
        table[:, 0] < 0,
        "negative_id",
        lambda row: f"id {table[row, 0]:g} is negative",
        remedy="number spheres from 0 or 1; -1 and -2 are the walls",
        column="id",
    )
    columns = SphereColumns(
        number=table[:, 0], position=table[:, 1:4], radius=table[:, 4], mass=table[:, 5]
    )
    cell = _read_cell(path, key_lines, units)
    digits = rows.count_digits(*SPHERES[1:4])
    packing = Packing.from_columns(rows, cell, units, columns, digits)
    result = build_network(packing, _read_contacts(contacts, packing, units), None)
    if result.told["overlap_over_error_of_digits"] > 1:
        with named(contacts):
            check_force_ratio(result.network)
    return result


def _read_spheres_alone(path: Path, options: SphereOptions) -> ImportResult:
    """Return the packing of a table of spheres, whose contacts follow from a typed law."""
    rows, table, key_lines = _read_sphere_rows(path)
    units = options.units
    if table.unit is not None:
        if options.scales is not None:
            remedy = "leave one of the two out"
            refuse(path, "other_units", "a unit in the header beside --scales", remedy=remedy)
        options = options._replace(scales=(1.0, 1.0, 1.0))
        units = Units(length=table.unit)
    cell = None
    if key_lines:
        cell = _read_cell(path, key_lines, units)
    return import_spheres(path, replace(table.spheres, cell=cell), options, rows)


def _read_sphere_rows(path: Path) -> tuple[Rows, SphereTable, KeyLines]:
    """Return the rows of a table of spheres alone, its numbers, and the lines for the cell."""
    rows, key_lines = _read_rows(path, SPHERES)
    table = read_sphere_table(rows)
    _refuse_long_rows(rows)
    return rows, table, key_lines


def read_numbers(path: Path) -> Spheres:
    """Return the spheres of a table in the units of the table, without a cell."""
    return _read_sphere_rows(path)[1].spheres


def _read_table(
    path: str | Path, needed: tuple[str, ...], optional: tuple[str, ...] = ()
) -> tuple[Rows, KeyLines]:
    """Return the rows of a table with these columns, and the lines after # for the cell.

    Raises InputError for columns that are missing or unknown, and for a table without rows.
    """
    rows, key_lines = _read_rows(path, needed)
    names = ",".join(needed)
    rows.require(needed, f"name the columns in a line of text in UTF-8, with commas: {names}")
    known = (*needed, *optional)
    for name in rows.columns:
        if name and name not in known:
            refuse(
                path,
                "unknown_column",
                "it is not known, and may change the answer",
                remedy=f"leave it out; known are {','.join(known)}",
                line=rows.line - 1,
                column=quote(name)[1:-1],
            )
        if name and rows.columns.count(name) > 1:
            refuse(
                path,
                "repeated_column",
                "it stands twice among the names",
                "which of the two is meant is not said",
                "leave one out",
                line=rows.line - 1,
                column=name,
            )
    _refuse_long_rows(rows)
    return rows, key_lines


def _refuse_long_rows(rows: Rows) -> None:
    """Raise InputError, with the line, for a row with more columns than the header names."""
    count = len(rows.columns)
    too_wide = np.ones(len(rows.texts), bool)
    if rows.separator is not None and isinstance(rows.texts, RowTexts):
        too_wide = rows.texts.with_separators(rows.separator, count)
    for row in np.flatnonzero(too_wide).tolist():
        words = rows.texts[row].rstrip(", \n").split(rows.separator)
        too_wide[row] = len(words) > count
    rows.refuse(
        too_wide,
        "long_row",
        f"more than the {count} columns that the header names",
        remedy="write numbers with a point, commas between them alone",
    )


def _read_rows(path: str | Path, needed: tuple[str, ...]) -> tuple[Rows, KeyLines]:
    """Return the rows of a table, and the lines after # for the cell.

    Raises InputError for a table without names or rows; `needed` are the names that the error
    message proposes.
    """
    key_lines: KeyLines = {}
    header = ""
    lines = Lines(path)
    for number, text in lines:
        if text.startswith("#"):
            _read_key_line(path, number, text.rstrip(", \n"), key_lines)
            if has_spheres(_without_comment_sign(text)):
                header = _without_comment_sign(text)
        elif text.strip():
            break
    else:
        remedy = f"begin with {','.join(needed)}"
        refuse(path, "no_column", "no line with the names of columns", remedy=remedy)
    first_line = number + 1
    if header:
        lines.step_back()
        first_line = number
    else:
        header = text
    texts = lines.take_rows().without_blank_end()
    separator = separator_of(header)
    columns = tuple(name.strip() for name in header.split(separator))
    rows = Rows(Path(path), columns, texts, first_line, separator)
    names = ",".join(needed)
    if not texts:
        problem = f"no rows below the names {names}"
        remedy = "write those of the packing"
        refuse(path, "no_rows", problem, remedy=remedy, line=number + 1)
    return rows, key_lines


def _read_key_line(path: str | Path, number: int, text: str, key_lines: KeyLines) -> None:
    """Add a line that begins with # to `key_lines`, unless it is a comment."""
    words = re.findall(r"[^\s:=#]+", text)
    if not words:
        return
    key = words.pop(0).lower()
    if key not in KEYS:
        return
    line = Words(words, f"{path}, line {number}", f"write {KEYS[key]}")
    if key in key_lines:
        first_line = key_lines[key].place.removeprefix(f"{path}, ")
        problem = f"# {key} again ({first_line})"
        line.refuse("repeated_line", problem, remedy=f"{line.remedy}, once")
    key_lines[key] = line


def _read_cell(path: str | Path, key_lines: KeyLines, units: Units) -> Cell:
    """Return the cell that the lines after # describe.

    If no line states the walls, the bounds along z are walls.
    """
    if "cell" not in key_lines:
        remedy = f"write {KEYS['cell']} before the names"
        refuse(path, "no_cell", "no bounds of the cell", remedy=remedy)
    bounds = np.array(key_lines["cell"].take_only_numbers("# cell", 6)).reshape(3, 2)
    low, high = units.length * bounds.T
    axes: list[str] = []
    if "periodic" in key_lines:
        axes = [word.lower() for word in key_lines["periodic"].remaining]
    for word in axes:
        if word not in ("x", "y", "z"):
            key_lines["periodic"].refuse("unknown_axis", f"{quote(word)} is no axis")
    periodic = np.isin(["x", "y", "z"], axes)
    walls = [float(low[2]), float(high[2])]
    if periodic[2]:
        walls = [np.nan, np.nan]
    if "walls" in key_lines:
        heights = key_lines["walls"].take_only_numbers("# walls", 2, null=True)
        walls = [float(units.length * z) for z in heights]
        if periodic[2] and not np.isnan(walls).all():
            problem = "walls beside a period along z"
            key_lines["walls"].refuse("wall_in_period", problem, remedy="leave one of the two out")
    return Cell(low, high, periodic, (walls[0], walls[1]))


def _read_contacts(path: str | Path, packing: Packing, units: Units) -> Contacts:
    """Return the contacts of a table, with their stiffnesses."""
    optional = FORCE + SHEAR + TURNING + SLIDING + FROM_POSITIONS
    rows, _ = _read_table(path, CONTACTS, optional)
    for group in (SHEAR, TURNING):
        if any(map(rows.has, group)):
            rows.require(group, f"give all of {','.join(group)}, with zeros where one is none")
    groups = {"contacts": CONTACTS, "force": FORCE, "shear": SHEAR}
    values = rows.read_groups(groups | {"turning": TURNING, "sliding": SLIDING})
    table = values["contacts"]
    i, j = find_ends(rows, packing.number, table[:, :2].T, ("i", "j"), WALLS)
    _refuse_absent_walls(rows, packing, j)
    columns = {
        "stiffness_normal": units.stiffness * table[:, 2],
        "stiffness_tangential": units.stiffness * table[:, 3],
    }
    if "turning" in values:
        rolling, twisting = units.moment * values["turning"].T
        columns["stiffness_rolling"] = rolling.copy()
        columns["stiffness_twisting"] = twisting.copy()
    if "sliding" in values:
        columns["sliding"] = values["sliding"][:, 0] != 0
    force = None
    if "force" in values:
        force = units.force * values["force"][:, 0]
        rows.refuse(
            force < 0,
            "pulling_force",
            lambda row: f"{values['force'][row, 0]:g} pulls",
            remedy="write compression positive; cohesion is not known",
            column="fn",
        )
    shear = None
    if "shear" in values:
        shear = units.force * values["shear"]
    return Contacts(i, j, force, shear, columns=columns, listed=rows)


def _refuse_absent_walls(rows: Rows, packing: Packing, j: Ints) -> None:
    """Raise InputError, with the line, for a contact with a wall that the packing lacks."""
    if packing.cell.periodic[2]:
        reason = "the packing is periodic along z"
        remedy = "leave the contact out, or z out of # periodic"
    else:
        reason = "# walls says NULL"
        remedy = "leave the contact out, or give its z"
    for code, name, plane in zip(WALLS, ("lower", "upper"), packing.cell.walls, strict=True):
        wrong = (j == code) & np.isnan(plane)
        problem = f"a contact with the {name} wall"
        rows.refuse(wrong, "no_wall", problem, reason, remedy, "j")
