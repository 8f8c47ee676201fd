"""Make a packing of spheres alone: their contacts and stiffnesses follow from a typed law.

With overlaps, as a simulation has them, contacts are the pairs that overlap, and the law gives
forces and stiffnesses. Without overlaps, as in a scan, contacts are the pairs whose gap is below a
tolerance, and stiffnesses follow from the mean stress (`modal.packing.scan`). Readers of files
without contacts call `import_spheres`; `from_spheres` takes arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from modal.exchange import dump, lammps, liggghts
from modal.exchange.contact_lines import ContactLines, contacts_of_lines
from modal.exchange.digits import are_rounded_to_single_precision
from modal.exchange.import_result import ImportResult, build_network
from modal.exchange.input_script import Script
from modal.exchange.law import SI, ProgramLaw, Units
from modal.exchange.particles_and_contacts import (
    WALLS,
    Cell,
    Contacts,
    Packing,
    PairLaw,
    SphereColumns,
)
from modal.exchange.refusals import refuse
from modal.exchange.registry import Option
from modal.exchange.rows import Rows
from modal.formats.hdf5 import named
from modal.packing.columns import frozen
from modal.packing.contact_law import GLASS, sphere_volume
from modal.packing.network import Network
from modal.packing.scan import ForceLaw, Scan, ScannedSpheres
from modal.tools.arguments import checked
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

GLASS_LAW = "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"
"""Law of glass beads: Young's modulus 60 GPa, Poisson's ratio 0.2, friction 0.3."""
MAX_PLAUSIBLE_RADIUS_M = 0.25
"""Largest median radius, m, of spheres whose unit of length is not stated: a larger one is likely
to be in mm."""
FULL_DIGITS = 17
"""Significant digits of numbers in double precision."""
SINGLE_DIGITS = 7
"""Significant digits of numbers in single precision."""
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


class TypedLaws(NamedTuple):
    """Contact laws from a line that the user typed.

    pair_law: function that returns the law between two types of sphere. walls: the walls with their
    own laws. notes: friction and, for hertz/material, Young's modulus and Poisson's ratio by name.
    """

    pair_law: PairLaw
    walls: dump.Walls
    remarks: list[str]
    notes: dict[str, float]

    def between(self, first: int, second: int) -> ProgramLaw:
        """Return the law between two types of sphere, or between a wall and a type."""
        if first < 0:
            return self.walls[first].law(second)
        return self.pair_law(first, second)


def read_typed_laws(pair: str, wall: str | None, units: Units) -> TypedLaws:
    """Return the laws of the lines --pair and --wall, in the words of LAMMPS or LIGGGHTS.

    A wall without a law of its own (only `zplane LOW HIGH`) has the law of the spheres.
    """
    typed = lammps.parse_typed_pair(pair)
    program = liggghts if typed.style[0] == "gran" else lammps
    words = [typed.style[0], *(typed.coefficients[2:] or typed.style[1:])]
    script = Script(style=typed.style, pair_coefficients=[typed.coefficients])
    if wall:
        wall_words = wall.split()
        if wall_words[0] == "zplane" and program is lammps:
            wall_words = [*words, *wall_words]
        script.walls = {dump.TYPED_WALL: tuple(wall_words)}
    pair_law = program.read_pair_law(script, units)
    read_wall_law = partial(program.read_wall_law, script=script, units=units, pair_law=pair_law)
    walls = dump.read_walls(script, units, read_wall_law, program.PLANES_PER_FIX)
    notes = {"mu_wave": pair_law(dump.ONLY_TYPE, dump.ONLY_TYPE).friction}
    is_material = words[1:2] == ["hertz/material"] and "tangential mindlin" in pair
    if is_material and words[words.index("tangential") + 2] == "NULL":
        notes |= {"young": units.pressure * float(words[2]), "poisson": float(words[4])}
    return TypedLaws(pair_law, walls, script.remarks, notes)


def import_spheres(
    path: str | Path,
    spheres: Spheres,
    options: SphereOptions,
    rows: Rows | None = None,
    contact_lines: ContactLines | None = None,
) -> ImportResult:
    """Return the packing of spheres alone.

    Parameters
    ----------
    path : str or Path
        The file, for messages.
    spheres : Spheres
        The spheres of the file.
    options : SphereOptions
        Options that were given with the file.
    rows : Rows, optional
        Rows of the file, for messages with a line number.
    contact_lines : ContactLines, optional
        Contacts as lines; if they have stiffnesses, no law is needed. Contacts with walls follow
        from the positions and the law.

    Raises
    ------
    InputError
        If a law is missing, or if the spheres are invalid.
    """
    if options.pair is None and contact_lines is not None and contact_lines.have_stiffnesses:
        return _import_with_stiffnesses(path, spheres, options, contact_lines)
    if options.pair is None:
        refuse(
            path,
            "no_law",
            "spheres alone have no stiffnesses",
            remedy=f"`import` them with a contact law ({lammps.EXAMPLE}), without overlaps also "
            "with --stress PA --tolerance GAP",
        )
    _refuse_incomplete_scan(options)
    units = options.units
    wall_line = options.wall
    if wall_line is None and options.cell is None:
        wall_line = _wall_line(spheres.cell, units)
    laws = read_typed_laws(options.pair, wall_line, units)
    remarks = list(laws.remarks)
    packing = _packing_of(path, spheres, options, laws.walls, remarks, rows)
    if options.stress is None:
        contacts = None
        if contact_lines is not None:
            contacts = _contacts_of(contact_lines, packing, units, remarks)
            # The typed law takes the place of stiffnesses.
            contacts = _with_walls(replace(contacts, columns={}), packing)
        result = build_network(packing, contacts, laws.between)
    else:
        scan = Scan(options.tolerance or 0.0, options.stress, _force_law(laws, packing))
        result = _build_scanned_network(packing, scan, laws)
    result.remarks += remarks
    return result


def _packing_of(
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


def _import_with_stiffnesses(
    path: str | Path, spheres: Spheres, options: SphereOptions, contact_lines: ContactLines
) -> ImportResult:
    """Return the packing of spheres whose contacts have stiffnesses, so that no law is needed."""
    for name in ("wall", "stress", "tolerance"):
        if getattr(options, name) is not None:
            refuse(
                contact_lines.path,
                "no_law",
                f"--{name} without a law",
                "the stiffnesses of the file are those of contacts between spheres alone",
                "give --pair, too",
            )
    remarks: list[str] = []
    packing = _packing_of(path, spheres, options, {}, remarks)
    contacts = _contacts_of(contact_lines, packing, options.units, remarks)
    result = build_network(packing, contacts, None)
    result.remarks += remarks
    return result


def _contacts_of(
    contact_lines: ContactLines, packing: Packing, units: Units, remarks: list[str]
) -> Contacts:
    """Return the contacts of lines; add a remark on omitted lines."""
    contacts, left_out = contacts_of_lines(contact_lines, packing, units)
    if left_out:
        remarks.append(
            f"{left_out} contacts end where no sphere is and are left out: those with walls follow "
            "from --wall, those through periods from --cell and --periodic"
        )
    return contacts


def _with_walls(contacts: Contacts, packing: Packing) -> Contacts:
    """Return contacts followed by those with walls, whose forces follow from the law."""
    touching = packing.touching()
    at_wall = touching.j < 0
    count = int(at_wall.sum())
    if not count:
        return contacts
    if contacts.force is None:
        contacts = replace(contacts, force=np.full(len(contacts.i), np.nan))
    unknown = np.full(count, np.nan)
    return contacts.with_walls(touching.i[at_wall], touching.j[at_wall], unknown, None)


def _refuse_incomplete_scan(options: SphereOptions) -> None:
    """Raise InputError for an invalid stress or tolerance, or for a tolerance without a stress."""
    stress = options.stress
    tolerance = options.tolerance or 0.0
    if stress is not None and not 0 < stress < np.inf:
        raise InputError("stress", f"stress {stress:g}", "must be positive", "give it in Pa")
    if not 0 <= tolerance < np.inf:
        raise InputError("tolerance", f"tolerance {tolerance:g}", "must not be negative")
    if tolerance and stress is None:
        raise InputError(
            "no_stress",
            "a tolerance of gaps without a stress",
            "across a gap no law gives a stiffness",
            "give the mean stress of the packing in Pa (--stress)",
        )


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
        cell = _enclosing_cell(spheres, units)
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


def _wall_line(cell: Cell | None, units: Units) -> str | None:
    """Return the text of walls without a law of their own; None if a cell has no walls."""
    if cell is None or np.isnan(cell.walls).all():
        return None
    words = ["NULL" if np.isnan(z) else repr(float(z) / units.length) for z in cell.walls]
    return f"zplane {' '.join(words)}"


def _enclosing_cell(spheres: Spheres, units: Units) -> Cell:
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


def _force_law(laws: TypedLaws, packing: Packing) -> ForceLaw:
    """Return how contact stiffness depends on the force, by the laws of spheres and walls.

    Raises InputError if spheres have several laws, or if a wall has a law of another kind.
    """
    kinds = sorted(set(packing.kind.tolist()))
    sphere_law = laws.pair_law(kinds[0], kinds[0])
    normal, normal_power, tangential, tangential_power = _by_force(sphere_law)
    wall_normal = normal
    wall_tangential = tangential
    for wall in laws.walls.values():
        wall_normal, *wall_powers, wall_tangential, last_power = _by_force(wall.law(kinds[0]))
        if (*wall_powers, last_power) != (normal_power, tangential_power):
            wall_problem = "the law of a wall is of another kind than that of the spheres"
            raise InputError("other_law", wall_problem, remedy="give both Hertz, or both hooke")
    return ForceLaw(
        normal, tangential, wall_normal, wall_tangential, normal_power, tangential_power
    )


def _by_force(law: ProgramLaw) -> tuple[float, float, float, float]:
    """Return coefficient and power of the normal, then of the tangential stiffness, by force.

    For Hertz' law f = N sqrt(R*) overlap^(3/2) the radius of the circle of contact is a = (R* f /
    N)^(1/3). The normal stiffness is 3/2 N a, and the tangential stiffness T a.
    """
    if law.hertz:
        power = 1 / 3
        coefficient = 1.5 * law.normal ** (2 / 3)
        radius_coefficient = law.normal ** (-1 / 3)
    else:
        power = 0.0
        coefficient = law.normal
        radius_coefficient = law.normal**-0.5
    if not law.grows:
        return coefficient, power, law.tangential, 0.0
    tangential_power = 1 / 3 if law.hertz else 0.5
    return coefficient, power, law.tangential * radius_coefficient, tangential_power


def _build_scanned_network(packing: Packing, scan: Scan, laws: TypedLaws) -> ImportResult:
    """Return the network of a packing with unknown overlaps, and the figures of its scan.

    The material and the friction of the law are noted, for a state at rest (`relax --stress`).
    """
    mass = packing.mass
    radius = packing.radius
    inertia = 0.4 * mass * radius**2
    bodies = frozen(position=packing.position, radius=radius, mass=mass, inertia=inertia)
    spheres = ScannedSpheres(
        bodies,
        cell_size=packing.cell.high - packing.cell.low,
        cell_periodic=packing.cell.periodic,
        wall_position=np.array(packing.cell.planes),
        has_wall=~np.isnan(packing.cell.walls),
    )
    with named(packing.name):
        network = spheres.network(scan, laws.notes)
    figures = {
        "gap_tolerance": scan.tolerance,
        "scan_stress": scan.stress,
        "coordination_number": network.coordination_number,
    }
    return ImportResult(network, told=figures, sought=True)


@checked
def from_spheres(
    position: ArrayLike,
    radius: ArrayLike,
    *,
    cell: ArrayLike | None = None,
    walls: ArrayLike | None = None,
    law: str = GLASS_LAW,
    stress: float | None = None,
    tolerance: float = 0.0,
    density: float = GLASS.density,
) -> Network:
    """Make a packing of the centres and radii of spheres.

    Spheres with overlaps, as a simulation has them, touch where they overlap, and the law gives
    forces and stiffnesses. Spheres without known overlaps, as a scan has them, touch where the gap
    is below `tolerance`, and stiffnesses follow from the mean stress: the mean force of a contact
    is 3 p V / sum(l), with the volume V and the branch lengths l (`modal.packing.scan`). The error
    of velocities and moduli of such a packing includes the change under smaller and larger
    tolerances.

    Parameters
    ----------
    position : ndarray (n, 3)
        Centres, m.
    radius : float or ndarray (n,)
        Radius of all spheres, or of each, m.
    cell : ndarray (3,) or (3, 2), optional
        Periods along x, y and z, m, with 0 for an axis that is not periodic; or bounds of a cell
        that is periodic along all axes except that of the walls. By default no axis is periodic.
    walls : sequence of 2 floats, optional
        Heights z of the flat walls, m; None or NaN for an absent wall.
    law : str
        The contact law, in the words that follow pair_style in LAMMPS; by default that of glass
        beads with friction 0.3. It also holds at the walls.
    stress : float, optional
        Mean stress, Pa, of spheres without known overlaps.
    tolerance : float, default 0
        Largest gap of a contact, m; needs `stress`.
    density : float, default 2230
        Density of the spheres, kg/m^3.

    Returns
    -------
    Network
        The packing.

    Raises
    ------
    InputError
        If no two spheres touch, or if the spheres are invalid.

    Examples
    --------
    >>> import modal
    >>> crystal = modal.fcc(cells=(3, 3, 4), periodic_z=True)
    >>> law = "hertz/material 60e9 0 0.2 tangential mindlin NULL 0 0.5"
    >>> same = modal.from_spheres(crystal.position, crystal.radius, cell=crystal.cell_size, law=law)
    >>> same.n_contacts == crystal.n_contacts
    True
    """
    centres = np.array(position, float)
    if centres.ndim != 2 or centres.shape[1] != 3:
        raise InputError("shape", f"position {centres.shape}", "it is (n, 3)", "give centres")
    if not np.isfinite(centres).all():
        raise InputError("not_finite", "a position is no finite number", remedy="leave it out")
    try:
        radii = np.broadcast_to(np.asarray(radius, float), len(centres)).copy()
    except ValueError as error:
        problem = f"radius {np.shape(radius)}"
        raise InputError("shape", problem, f"it is one number or ({len(centres)},)") from error
    planes = _read_planes(walls)
    digits = FULL_DIGITS
    if any(are_rounded_to_single_precision(numbers) for numbers in (centres.ravel(), radii)):
        digits = SINGLE_DIGITS
    bounds = _cell_of_sides(centres, radii, cell, planes)
    spheres = Spheres(centres, radii, cell=bounds, digits=digits)
    options = SphereOptions(
        pair=law,
        stress=stress,
        tolerance=tolerance,
        density=density,
        scales=(1.0, 1.0, 1.0),
    )
    return import_spheres("from_spheres", spheres, options).network


def _read_planes(walls: ArrayLike | None) -> Floats | None:
    """Return the heights of two walls, m, NaN for an absent wall; None without any wall."""
    if walls is None:
        return None
    planes = np.array(walls, float)  # None becomes NaN
    if planes.shape != (2,):
        raise InputError("shape", f"walls {planes.shape}", "they are two", "give (low, high)")
    if np.isnan(planes).all():
        return None
    return planes


def _cell_of_sides(
    position: Floats, radius: Floats, cell: ArrayLike | None, walls: Floats | None
) -> Cell:
    """Return the cell with these sides (3,) or bounds (3, 2), m, and with walls at these z, m.

    Sides begin at 0, or at the lowest centre if a cell from 0 does not contain all centres. Along
    an axis without a side the cell reaches to the surfaces of the spheres.
    """
    planes = (np.nan, np.nan)
    if walls is not None:
        planes = (float(walls[0]), float(walls[1]))
    surfaces = _enclosing_cell(Spheres(position, radius), SI)
    if cell is None:
        return replace(surfaces, walls=planes)
    size = np.array(cell, float)
    if size.shape == (3, 2):
        low, high = size.T
        return Cell(low, high, np.array([True, True, walls is None]), planes)
    if size.shape != (3,):
        raise InputError("shape", f"cell {size.shape}", "it is (3,)", "give the three periods")
    size = np.nan_to_num(size)
    periodic = size > 0
    if walls is not None:
        periodic[2] = False
    lowest = position.min(axis=0)
    fits_from_zero = (lowest >= 0) & (position.max(axis=0) <= size)
    low = np.where(periodic, np.where(fits_from_zero, 0.0, lowest), surfaces.low)
    high = np.where(periodic, low + size, surfaces.high)
    return Cell(low, high, periodic, planes)
