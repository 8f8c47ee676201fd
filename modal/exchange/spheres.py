"""Centres and radii of a file that holds spheres alone, with their cell, masses and options.

What makes contacts of them is in `modal.exchange.spheres_to_contacts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np

from modal.exchange import dump
from modal.exchange.law import SI, Units
from modal.exchange.particles_and_contacts import WALLS, Cell, Packing, SphereColumns
from modal.exchange.refusals import refuse
from modal.exchange.registry import Option
from modal.exchange.rows import Rows
from modal.packing.contact_law import GLASS, sphere_volume
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

MAX_PLAUSIBLE_RADIUS_M = 0.25
"""Largest median radius, m, of spheres whose unit of length is not stated: a larger one is likely
to be in mm."""
FULL_DIGITS = 17
"""Significant digits of numbers in double precision."""
OPTIONS = {
    "pair": Option("the contact law as it stands behind pair_style", "LINE"),
    "wall": Option("the walls as they stand behind fix ... wall/gran", "LINE"),
    "stress": Option("of spheres without overlaps: their mean stress", "PA", float),
    "tolerance": Option("of spheres without overlaps: largest gap of a contact, m", "GAP", float),
    "density": Option("of spheres without masses, kg/m^3", "RHO", float),
    "cell": Option(
        "bounds of spheres without a cell in their file, m",
        ("XLO", "XHI", "YLO", "YHI", "ZLO", "ZHI"),
        float,
    ),
    "periodic": Option("axes of --cell with a period: xyz, xy, z ...", "AXES"),
    "tilt": Option(
        "of --cell: how far its period along y leans along x, that along z along x, and y, m",
        ("XY", "XZ", "YZ"),
        float,
    ),
    "scales": Option("the file's units of length, mass and time in SI", ("M", "KG", "S"), float),
}
"""Options of files that hold spheres alone."""


class SphereKeywords(TypedDict, total=False):
    """Keyword arguments of readers of spheres alone, except the scales of the units."""

    pair: str | None
    wall: str | None
    stress: float | None
    tolerance: float | None
    density: float | None
    cell: Sequence[float] | None
    periodic: str | None
    tilt: Sequence[float] | None


class SphereOptions(NamedTuple):
    """Options that were given for spheres alone, by the names of `OPTIONS`."""

    pair: str | None = None
    wall: str | None = None
    stress: float | None = None
    tolerance: float | None = None
    density: float | None = None
    cell: Sequence[float] | None = None
    periodic: str | None = None
    tilt: Sequence[float] | None = None
    scales: Sequence[float] | None = None

    @property
    def units(self) -> Units:
        """Units of the file: those typed, or SI."""
        return Units.from_scales(self.scales) or SI


@dataclass(frozen=True)
class Spheres:
    """The n spheres of a file, in its order and units.

    Attributes
    ----------
    position, radius : ndarray (n, 3), (n,)
        Centres and radii.
    number : ndarray (n,) or None
        Numbers that the program gave the spheres; None counts from 0.
    mass, density : ndarray (n,) or None
        Masses or densities; if both are None, the density of the options.
    kind : ndarray (n,) or None
        Types that choose the law; None if all spheres are of one type.
    cell : Cell or None
        The cell in m; None if the file has none.
    digits : int
        Significant digits of positions and radii.
    """

    position: Floats
    radius: Floats
    number: Floats | None = None
    mass: Floats | None = None
    density: Floats | None = None
    kind: Ints | None = None
    cell: Cell | None = None
    digits: int = FULL_DIGITS


def packing_of(
    path: str | Path,
    spheres: Spheres,
    options: SphereOptions,
    walls: dump.Walls,
    remarks: list[str],
    rows: Rows | None = None,
) -> Packing:
    """Return spheres with their cell, masses, numbers and types; add `remarks`."""
    units = options.units
    cell = _choose_cell(spheres, options, walls, units)
    if options.scales is None:
        _refuse_large_radii(path, spheres.radius)
    mass = _choose_masses(spheres, options, units, remarks)
    count = len(spheres.position)
    number = np.arange(count, dtype=float) if spheres.number is None else spheres.number
    kind = np.full(count, dump.ONLY_TYPE) if spheres.kind is None else spheres.kind
    columns = SphereColumns(number, spheres.position, spheres.radius, mass, kind)
    named_rows = rows or Rows(Path(path), (), (), 0)
    return Packing.from_columns(named_rows, cell, units, columns, spheres.digits)


def _refuse_large_radii(path: str | Path, radius: Floats) -> None:
    """Raise InputError for radii that are likely to be in mm."""
    median = float(np.median(radius)) if len(radius) else 0.0
    if median > MAX_PLAUSIBLE_RADIUS_M:
        refuse(
            path,
            "unit_of_length",
            f"the median radius is {median:.3g} m if no unit is told",
            "which looks like mm",
            "name the unit in the header, as `x (mm)`, or give --scales 1e-3 1 1 (of metres 1 1 1)",
        )


def _choose_cell(spheres: Spheres, options: SphereOptions, walls: dump.Walls, units: Units) -> Cell:
    """Return the cell of the options, else the cell of the file, with the given walls.

    If neither has a cell, the bounds are the walls or the surfaces of the outermost spheres.
    """
    cell = spheres.cell
    if options.cell is not None:
        axes = (options.periodic or "").lower()
        if not set(axes) <= set("xyz, "):
            problem = f"--periodic {options.periodic}"
            raise InputError("unknown_axis", problem, remedy="give axes, as xyz, xy or z")
        bounds = np.reshape(options.cell, (3, 2))
        periodic = np.array([axis in axes for axis in "xyz"])
        tilt = np.zeros(3) if options.tilt is None else np.array(options.tilt, float)
        cell = Cell(bounds[:, 0], bounds[:, 1], periodic, tilt=tilt)
    elif options.periodic is not None and cell is None:
        remedy = "give its bounds, too (--cell XLO XHI YLO YHI ZLO ZHI)"
        raise InputError("no_cell", "--periodic without a cell", remedy=remedy)
    if cell is None:
        cell = enclosing_cell(spheres, units)
    if not walls:
        return replace(cell, walls=(np.nan, np.nan))
    if cell.periodic[2]:
        remedy = "leave one of the two out"
        raise InputError("wall_in_period", "a wall beside a period along z", remedy=remedy)
    low = cell.low.copy()
    high = cell.high.copy()
    if WALLS[0] in walls:
        low[2] = walls[WALLS[0]].z
    if WALLS[1] in walls:
        high[2] = walls[WALLS[1]].z
    low_plane, high_plane = (walls[code].z if code in walls else np.nan for code in WALLS)
    return replace(cell, low=low, high=high, walls=(low_plane, high_plane))


def wall_line_of(cell: Cell | None, units: Units) -> str | None:
    """Return the text of walls without a law of their own; None if a cell has no walls."""
    if cell is None or np.isnan(cell.walls).all():
        return None
    words = ["NULL" if np.isnan(z) else repr(float(z) / units.length) for z in cell.walls]
    return f"zplane {' '.join(words)}"


def enclosing_cell(spheres: Spheres, units: Units) -> Cell:
    """Return the smallest cell without periods that encloses all spheres."""
    radius = spheres.radius[:, None]
    low = (spheres.position - radius).min(axis=0, initial=np.inf)
    high = (spheres.position + radius).max(axis=0, initial=-np.inf)
    return Cell(units.length * low, units.length * high, np.zeros(3, bool))


def _choose_masses(
    spheres: Spheres, options: SphereOptions, units: Units, remarks: list[str]
) -> Floats:
    """Return the masses (n,) of spheres in the units of the file.

    If no density is given, that of glass is used, and a remark says so.
    """
    if spheres.mass is not None and options.density is None:
        return spheres.mass
    volume = sphere_volume(spheres.radius)
    if spheres.density is not None and options.density is None:
        return spheres.density * volume
    density = options.density
    if density is None:
        density = GLASS.density
        remarks.append(f"no density is told: {density:g} kg/m^3 is taken (else --density)")
    if not 0 < density < np.inf:
        raise InputError("density", f"density {density:g}", "must be positive", "give kg/m^3")
    return density * units.length**3 / units.mass * volume
