"""Read LAMMPS' data files (`write_data`) of atom_style sphere: spheres alone, in their box.

A data file has neither law nor walls, and does not say which axes are periodic.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Unpack

import numpy as np

from modal.exchange.dump import UNITS
from modal.exchange.import_result import ImportResult
from modal.exchange.law import SI, Units
from modal.exchange.lines import Lines
from modal.exchange.particles_and_contacts import Cell
from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.exchange.spheres import OPTIONS as SPHERE_OPTIONS
from modal.exchange.spheres import SphereKeywords, SphereOptions, Spheres
from modal.exchange.spheres_to_contacts import import_spheres
from modal.tools.arrays import Bools

NAME = "LAMMPS (data file)"
OPTIONS = SPHERE_OPTIONS
COLUMNS = ("id", "type", "diameter", "density", "x", "y", "z", "ix", "iy", "iz")
"""Columns of the section Atoms of atom_style sphere; image flags may be absent."""
COLUMNS_WITHOUT_FLAGS = 7
BOUNDS = (("xlo", "xhi"), ("ylo", "yhi"), ("zlo", "zhi"))
STYLE = "sphere"
GIVE_DATA = "write it with write_data, atom_style sphere"


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is a data file, by the number of atoms and the bounds in its header."""
    lines = [line.split("#")[0].split() for line in head.decode("utf-8", "replace").splitlines()]
    has_atoms = any(words[1:] == ["atoms"] for words in lines)
    return has_atoms and any(words[2:] == ["xlo", "xhi"] for words in lines)


def read(
    path: Path, scales: Sequence[float] | None = None, **sphere_options: Unpack[SphereKeywords]
) -> ImportResult:
    """Return the packing of a data file; `sphere_options` are described at `SphereOptions`."""
    options = SphereOptions(scales=scales, **sphere_options)
    lines = Lines(path)
    first_line = next(lines)[1]
    remarks: list[str] = []
    units = Units.from_scales(scales)
    if units is None:
        units = _units_of(first_line, path, remarks)
    count = 0
    bounds = np.full((3, 2), np.nan)
    tilt = np.zeros(3)
    for number, line in lines:
        text, _, comment = line.partition("#")
        words = text.split()
        if words[1:] == ["atoms"]:
            count = int(words[0])
        for axis, names in enumerate(BOUNDS):
            if words[2:] == [*names]:
                bounds[axis] = [float(word) for word in words[:2]]
        if words[3:] == ["xy", "xz", "yz"]:
            tilt = units.length * np.array([float(word) for word in words[:3]])
        if words == ["Atoms"]:
            title_line = number
            break
    else:
        refuse(path, "no_spheres", "no section Atoms", remedy=GIVE_DATA)
    style = comment.strip()
    if style and style != STYLE:
        problem = f"atoms of style {style} have no radius"
        refuse(path, "no_spheres", problem, remedy=GIVE_DATA, line=title_line)
    next(lines, None)  # an empty line
    texts = lines.take_rows(count)
    width = len(texts[0].split()) if texts else 0
    if width not in (COLUMNS_WITHOUT_FLAGS, len(COLUMNS)) or np.isnan(bounds).any():
        problem = f"rows of {width} numbers, which are no spheres in a box"
        refuse(path, "no_spheres", problem, remedy=GIVE_DATA, line=title_line + 2)
    rows = Rows(path, COLUMNS[:width], texts, title_line + 2)
    table = rows.read(*COLUMNS[:COLUMNS_WITHOUT_FLAGS])
    periodic = _choose_periods(options, remarks)
    low, high = units.length * bounds.T
    cell = Cell(low, high, periodic, tilt=tilt)
    spheres = Spheres(
        position=table[:, 4:7],
        radius=table[:, 2] / 2,
        number=table[:, 0],
        density=table[:, 3],
        kind=rows.to_integers(table[:, 1], "type"),
        cell=cell,
        digits=rows.count_digits("x", "y", "z"),
    )
    scaled_options = options._replace(scales=tuple(units))
    if options.cell is None:
        scaled_options = scaled_options._replace(periodic=None)  # they are in the cell
    result = import_spheres(path, spheres, scaled_options, rows)
    result.remarks += remarks
    return result


def _units_of(first_line: str, path: Path, remarks: list[str]) -> Units:
    """Return the units that the first line names (`units = si`); if none, SI with a remark.

    Raises InputError for units without SI values.
    """
    words = first_line.replace("=", " ").replace(",", " ").split()
    if "units" not in words[:-1]:
        remarks.append("no units are told: si are taken")
        return SI
    name = words[words.index("units") + 1]
    if name not in UNITS:
        remedy = "give those of length, mass and time with import --scales M KG S"
        refuse(path, "unknown_units", f"units {name} have no SI values here", remedy=remedy)
    return UNITS[name]


def _choose_periods(options: SphereOptions, remarks: list[str]) -> Bools:
    """Return the periodic axes (3,): those typed, or all except the axis of typed walls."""
    axes = options.periodic
    if axes is None:
        axes = "xy" if options.wall else "xyz"
        remarks.append(f"a data file does not tell the periods: {axes} are taken (else --periodic)")
    return np.array([axis in axes.lower() for axis in "xyz"])
