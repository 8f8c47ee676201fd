"""Read extended XYZ: spheres alone, in the cell of `Lattice`, `Origin` and `pbc`.

The line before the rows of a frame names the columns: `Properties=species:S:1:pos:R:3:radius:R:1`.
OVITO, ASE and this project's `export` write the format. An XYZ file without radii is refused.
"""

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

import numpy as np

from modal.exchange.import_result import ImportResult
from modal.exchange.lines import Lines
from modal.exchange.particles_and_contacts import Cell
from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.exchange.sphere_table import NAMES, read_heading
from modal.exchange.spheres import OPTIONS as SPHERE_OPTIONS
from modal.exchange.spheres import SphereKeywords, SphereOptions, Spheres
from modal.exchange.spheres_to_contacts import import_spheres

NAME = "extended XYZ"
OPTIONS = SPHERE_OPTIONS
POSITION = ("pos", "position", "positions")
"""Names of the three columns of the centres, in small letters."""
TRUE = ("T", "TRUE", "1")
"""Words for a periodic axis, in capital letters."""


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file begins with a number of rows and a line of properties."""
    return re.match(rb"\s*\d+\s*\n[^\n]*Properties=\S+:\w:\d", head) is not None


def read(
    path: Path, scales: Sequence[float] | None = None, **sphere_options: Unpack[SphereKeywords]
) -> ImportResult:
    """Return the packing of a file with one frame; `SphereOptions` describes `sphere_options`."""
    options = SphereOptions(scales=scales, **sphere_options)
    lines = Lines(path)
    count = int(next(lines)[1])
    number, comment = next(lines)
    keys = _read_keys(comment)
    columns = _read_columns(keys["Properties"])
    rows = Rows(path, tuple(columns), lines.take_rows(count), number + 1)
    if len(rows.texts) < count:
        problem = f"{len(rows.texts)} rows of {count}"
        remedy = "let the program finish writing it"
        refuse(path, "cut_off", problem, remedy=remedy, line=number + 1 + len(rows.texts))
    if next(lines, None):
        remedy = "cut one of them out"
        refuse(path, "several_times", "it has several frames", remedy=remedy)
    centre = ("pos_1", "pos_2", "pos_3")
    size = "diameter" if "diameter" in columns and "radius" not in columns else "radius"
    rows.require((*centre, size), "write positions and radii (Properties=...:radius:R:1)")
    table = rows.read(*centre, size)
    further = {}
    for name in ("id", "mass", "density"):
        if name in columns:
            further[name] = rows.read(name)[:, 0]
    spheres = Spheres(
        position=table[:, :3],
        radius=table[:, 3] * (0.5 if size == "diameter" else 1.0),
        number=further.get("id"),
        mass=further.get("mass"),
        density=further.get("density"),
        cell=_read_cell(path, keys, options),
        digits=rows.count_digits(*centre),
    )
    return import_spheres(path, spheres, options, rows)


def _read_keys(comment: str) -> dict[str, str]:
    """Return the values of a line of keys: Lattice="..." pbc="T T F"."""
    keys = {}
    for word in shlex.split(comment):
        key, equals, value = word.partition("=")
        if equals:
            keys[key] = value
    return keys


def _read_columns(properties: str) -> list[str]:
    """Return the names of columns; those of several numbers end in _1, _2 and so on."""
    columns = []
    words = properties.split(":")
    for name, kind, width in zip(words[::3], words[1::3], words[2::3], strict=False):
        known = read_heading(name).name or name
        if name.lower() in POSITION:
            known = "pos"
        if kind == "S" and known in NAMES:
            known = f"text {name}"
        if int(width) == 1:
            columns.append(known)
        else:
            columns += [f"{known}_{k + 1}" for k in range(int(width))]
    return columns


def _read_cell(path: Path, keys: dict[str, str], options: SphereOptions) -> Cell | None:
    """Return the cell, in m; None if there is no `Lattice`."""
    if "Lattice" not in keys:
        return None
    length = options.units.length
    lattice = np.array(keys["Lattice"].split(), float).reshape(3, 3)
    if (lattice != np.diag(np.diag(lattice))).any():
        problem = "the cell is triclinic (its periods are at angles)"
        refuse(path, "triclinic_cell", problem, remedy="give a rectangular one", line=2)
    low = np.zeros(3)
    if "Origin" in keys:
        low = np.array(keys["Origin"].split(), float)
    periodic = np.ones(3, bool)
    if "pbc" in keys:
        periodic = np.array([word.upper() in TRUE for word in keys["pbc"].split()])
    if options.periodic is not None:
        periodic = np.array([axis in options.periodic.lower() for axis in "xyz"])
    if options.wall is not None:
        periodic[2] = False
    return Cell(length * low, length * (low + np.diag(lattice)), periodic)
