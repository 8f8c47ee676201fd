"""Read MercuryDPM's restart files: species, walls, periods, spheres and interactions.

Each line begins with a keyword for its kind, and has a name before each number. A network has one
flat wall at low z and one at high z. Other walls may be in the file as long as no sphere touches
them; the list of interactions, if there is one, shows whether a sphere does. Files of old versions
are translated first (`modal.exchange.old_mercury`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from modal.exchange import old_mercury
from modal.exchange.digits import count_significant_digits
from modal.exchange.import_result import ImportResult, build_network
from modal.exchange.law import DISPLACEMENT, SI, ProgramLaw, Units
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
from modal.exchange.refusals import refuse
from modal.exchange.registry import read_beginning
from modal.exchange.rows import Rows
from modal.exchange.words import Words
from modal.packing.contact_law import sphere_volume
from modal.packing.weight import with_gravity
from modal.tools.arrays import Bools, Floats, Ints

NAME = "MercuryDPM"
OPTIONS = {"scales": lammps.OPTIONS["scales"]}
SPHERES = ("BaseParticle", "SphericalParticle", "ThermalParticle")
"""First words of lines of spheres."""
SECTIONS = ("Species", "Walls", "Boundaries", "Particles", "Interactions")
"""First words of the lines that begin a section."""
COUNTED = {"Walls": "id", "Particles": "radius", "Interactions": "force"}
"""Sections that state their number of lines, and a word that each of these lines contains."""
WRITE_WHOLE = "write the restart file whole"
NORMAL = ("LinearViscoelastic", "HertzianViscoelastic")
"""Normal laws that are known; the name of a species begins with one of them."""
FRICTION = ("", "SlidingFriction", "Friction", "Mindlin", "MindlinRollingTorsion")
"""Friction laws that are known; they follow the normal law in the name of a species."""
DIAMETER_SQUARED = 4.0
"""Square of the effective diameter divided by that of the effective radius R*."""
TORSION_REMARK = (
    "torsion is resisted by the spring that MercuryDPM's documents describe; its code adds the "
    "spring to itself at every step, so that its contacts twist at their limit"
)
MAX_TILT = 1e-6
"""Largest component of an axis' unit vector along the other axes."""
GIVE_STRAIGHT_PERIODS = "only periods along x, y, z are known"
CONTROLLED_PERIODS = "StressStrainControlBoundary"
"""Boundary that makes periods at the bounds of the domain and moves them until a stress is reached;
with shear it makes those of Lees and Edwards."""
PASSIVE_BOUNDARIES = ("Insertion", "Deletion", "Flux", "Heater")
"""Parts of the names of boundaries that add, remove, count or heat spheres: no contact depends on
them."""
TWO_WALLS_ALONE = "a network knows one flat wall at low z and one at high z alone"

Side = Literal[0, 1]
"""End of the packing along z: 0 for low, 1 for high z."""


class Wall(NamedTuple):
    """A wall: outward normal (3,), position along the normal, m, species, and its kind."""

    normal: Floats
    place: float
    species: int
    kind: str

    @property
    def side(self) -> Side | None:
        """Return the end along z at which the wall is flat; None for any other wall."""
        if self.kind != "InfiniteWall" or abs(abs(self.normal[2]) - 1) > MAX_TILT:
            return None
        return 1 if self.normal[2] > 0 else 0


@dataclass(frozen=True)
class Restart:
    """The lines of a restart file by sections.

    Attributes
    ----------
    path : Path
        The file.
    units : Units
        Units of the file.
    sections : dict
        Lines of each section; those before the first section are in "".
    starts : dict
        Number of the line that begins each section.
    """

    path: Path
    units: Units
    sections: dict[str, list[Words]]
    starts: dict[str, int]

    def rows(self, section: str) -> Rows:
        """Return the lines of a section, for messages."""
        texts = [" ".join(line.remaining) for line in self.sections[section]]
        return Rows(self.path, (), texts, self.starts.get(section, 0) + 1)

    def numbers(self, section: str, name: str, count: int = 3) -> Floats:
        """Return the numbers (n, count) after a name in each line of a section."""
        rows = [line.numbers_after(name, count) for line in self.sections[section]]
        return np.array(rows).reshape(-1, count)


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is a restart file, by the program's name or, if old, by a version."""
    return head.startswith((b"MercuryDPM", old_mercury.BEGINNING))


def read(path: Path, scales: Sequence[float] | None = None) -> ImportResult:
    """Return the packing of a restart file."""
    file = read_restart(path, Units.from_scales(scales) or SI)
    laws = dict(_read_law(line, file.units) for line in _species_lines(file))
    walls: dict[int, Wall] = {}
    for line in file.sections["Walls"]:
        walls[int(line.number_after("id"))] = _read_wall(line, file.units)
    inner = _find_inner_walls(walls)
    planes = (_plane_height(walls, inner, 0), _plane_height(walls, inner, 1))
    packing = _read_spheres(file, _read_cell(file, planes))
    contacts = None
    if file.sections["Interactions"]:
        codes = {number: WALLS[side] for side, number in inner.items()}
        contacts = _read_contacts(file, packing, codes)
    else:
        _refuse_other_walls(packing, walls, tuple(inner.values()))

    def find_law(first: int, second: int) -> ProgramLaw:
        if first < 0:
            first = walls[inner[_side_of(first)]].species
        law = laws.get((min(first, second), max(first, second)))
        if law is None:
            problem = f"no species for {first} with {second}"
            refuse(path, "no_law", problem, remedy=WRITE_WHOLE)
        if not law.normal > 0:
            problem = f"species {first} with {second} have no stiffness, and touch"
            refuse(path, "no_stiffness", problem, remedy="give them one, and write the file again")
        return law

    result = build_network(packing, contacts, find_law)
    gravity = _read_gravity(file)
    if gravity is not None:
        result.network = with_gravity(result.network, gravity)
    if any(law.twisting_arc or law.twisting_share for law in laws.values()):
        result.remarks.append(TORSION_REMARK)
    return result


def _read_gravity(file: Restart) -> Floats | None:
    """Return the acceleration by gravity (3,), m/s^2; None if it is zero or absent."""
    for line in file.sections[""]:
        if "gravity" in line:
            units = file.units
            gravity = np.array(line.numbers_after("gravity", 3)) * units.length / units.time**2
            return gravity if gravity.any() else None
    return None


def _species_lines(file: Restart) -> list[Words]:
    """Return the lines of species."""
    return [line for line in file.sections["Species"] if line.remaining[0].endswith("Species")]


def _side_of(code: int) -> Side:
    """Return the end along z of a wall's code."""
    return 0 if code == WALLS[0] else 1


def _find_inner_walls(walls: dict[int, Wall]) -> dict[Side, int]:
    """Return the number of the innermost flat wall at each end along z."""
    inner: dict[Side, int] = {}
    for number, wall in sorted(walls.items(), key=lambda item: -item[1].place):
        if wall.side is not None:
            inner[wall.side] = number
    return inner


def _plane_height(walls: dict[int, Wall], inner: dict[Side, int], side: Side) -> float:
    """Return z of the inner wall at one end, m; NaN if there is none."""
    if side not in inner:
        return float("nan")
    wall = walls[inner[side]]
    return wall.place * float(wall.normal[2])


def read_restart(path: Path, units: Units) -> Restart:
    """Return the sections of a restart file.

    Raises InputError for a file that ends early, and for particles that are not spheres.
    """
    section = ""
    announced: dict[str, float] = {}
    file = Restart(path, units, {name: [] for name in ("", *SECTIONS)}, {})
    lines: Iterator[tuple[int, str]] = Lines(path)
    if old_mercury.is_old(read_beginning(path)):
        lines = old_mercury.new_lines(path)
    for number, text in lines:
        line = Words(text.split(), f"{path}, line {number}", WRITE_WHOLE)
        kind = line.remaining[0] if line.remaining else ""
        if kind in SECTIONS:
            section = kind
            file.starts[kind] = number
            announced[kind] = line.number_after(kind)
        elif kind and COUNTED.get(section, kind) in line:
            file.sections[section].append(line)
        if kind == "systemDimensions":
            _refuse_other_dimensions(line)
    for name in COUNTED:
        count = len(file.sections[name])
        if count < announced.get(name, 0):
            problem = f"{count} {name} of {announced[name]:.0f}"
            refuse(path, "cut_off", problem, "the file ends early", "write it whole", line=number)
    for line in file.sections["Particles"]:
        _refuse_other_particles(line)
    return file


def _refuse_other_dimensions(line: Words) -> None:
    """Raise InputError for discs, and for motion in a plane."""
    for name in ("systemDimensions", "particleDimensions"):
        dimensions = line.number_after(name)
        if dimensions != 3:
            line.refuse(
                "two_dimensions",
                f"{name} {dimensions:g}",
                "discs, or motion in a plane",
                "a network has spheres that move in space (3)",
            )


def _refuse_other_particles(line: Words) -> None:
    """Raise InputError for a particle that is not a sphere."""
    kind = line.remaining[0]
    if kind not in SPHERES:
        remedy = "only single spheres are known"
        line.refuse("no_spheres", f"{kind} is no sphere", remedy=remedy)


class SpeciesName(NamedTuple):
    """The parts of a species' name: its laws, and whether it is one of two species."""

    normal: str
    friction: str
    is_mixed: bool


def _parse_species_name(line: Words) -> SpeciesName:
    """Return the parts of the name of a species; raise InputError for an unknown name."""
    full_name = line.remaining[0]
    name = full_name.removesuffix("Species")
    is_mixed = name.endswith("Mixed")
    name = name.removesuffix("Mixed")
    normal = ""
    for law in NORMAL:
        if name.startswith(law):
            normal = law
    friction = name.removeprefix(normal)
    if not normal or friction not in FRICTION:
        known = f"{' and '.join(NORMAL)} with {', '.join(FRICTION[1:])} or nothing behind are"
        line.refuse("unknown_law", f"{full_name} is not known", remedy=known)
    return SpeciesName(normal, friction, is_mixed)


def _read_law(line: Words, units: Units) -> tuple[tuple[int, int], ProgramLaw]:
    """Return two species, in rising order, and the law between them.

    A line has the law of one species with itself, or that of two (`...MixedSpecies`).
    """
    name = _parse_species_name(line)
    is_hertz = name.normal == "HertzianViscoelastic"
    is_mindlin = name.friction.startswith("Mindlin")
    if is_hertz:
        normal = 4 / 3 * line.optional_number_after("effectiveElasticModulus", "elasticModulus")
    else:
        normal = line.optional_number_after("stiffness")
    friction = line.optional_number_after("slidingFrictionCoefficient")
    if is_mindlin:
        # Ft = 2/3 (8 G a) s, with the displacement s kept, and a of the present overlap.
        shear_modulus = line.optional_number_after("effectiveShearModulus", "shearModulus")
        tangential = 2 / 3 * 8 * shear_modulus
    else:
        tangential = line.optional_number_after("slidingStiffness")
        if friction > 0:  # else there is no shear at all; contacts stick up to the static limit
            friction = line.optional_number_after(
                "slidingFrictionCoefficientStatic", "slidingFrictionCoefficient"
            )
    normal *= units.pressure if is_hertz else units.stiffness
    tangential *= units.pressure if is_mindlin else units.stiffness
    law = ProgramLaw(normal, is_hertz, tangential, is_mindlin, friction, DISPLACEMENT)
    return _read_species_numbers(line, name), _add_turning(law, line, units)


def _read_species_numbers(line: Words, name: SpeciesName) -> tuple[int, int]:
    """Return the numbers of the two species of a line, in rising order."""
    if name.is_mixed and "idA" in line:
        numbers = [line.number_after("idA"), line.number_after("idB")]
    else:
        key = "idMixed" if "idMixed" in line else "id"
        numbers = line.numbers_after(key, 2 if name.is_mixed else 1)
    return int(min(numbers)), int(max(numbers))


def _add_turning(law: ProgramLaw, line: Words, units: Units) -> ProgramLaw:
    """Return the law with the springs of its species against rolling and torsion.

    The torque is D^2 k times the relative rotation across (rolling) or along (torsion) the normal,
    with D = 2 R*. The stiffness k is given by the species; with Mindlin's law it is 8 G a, which is
    3/2 of the tangential stiffness.
    """
    rolls = _resists(line, "rolling")
    twists = _resists(line, "torsion")
    if law.grows:
        share = DIAMETER_SQUARED * 3 / 2
        return replace(law, rolling_share=share * rolls, twisting_share=share * twists)
    unit = DIAMETER_SQUARED * units.stiffness
    return replace(
        law,
        rolling=unit * line.optional_number_after("rollingStiffness") * rolls,
        twisting_arc=unit * line.optional_number_after("torsionStiffness") * twists,
    )


def _resists(line: Words, motion: Literal["rolling", "torsion"]) -> bool:
    """Return whether a species resists a motion below its static limit, with a spring."""
    limit = f"{motion}FrictionCoefficient"
    static_limit = line.optional_number_after(f"{limit}Static", limit)
    return line.optional_number_after(limit) > 0 and static_limit > 0


def _read_wall(line: Words, units: Units) -> Wall:
    """Return the wall that a line describes; raise InputError for a wall without a direction."""
    normal = np.array([1.0, 0.0, 0.0])
    is_plane = line.remaining[0] == "InfiniteWall"
    if is_plane and "normal" in line:
        # Files of version 1.0 have an orientation, too, which is zero.
        normal = np.array(line.numbers_after("normal", 3))
    elif "orientation" in line:
        a, b, c, d = line.numbers_after("orientation", 4)
        # The x axis turned by the quaternion (a, b, c, d).
        turned = [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
        normal = np.array(turned)
    if not normal.any():
        if is_plane:
            line.refuse("no_direction", "a wall without a direction")
        normal = np.array([1.0, 0.0, 0.0])
    normal /= np.linalg.norm(normal)
    position = np.array(line.numbers_after("position", 3))
    place = units.length * float(normal @ position)
    return Wall(normal, place, int(line.number_after("indSpecies")), line.remaining[0])


def _read_cell(file: Restart, planes: tuple[float, float]) -> Cell:
    """Return the cell that the domain and the periods define, with walls at z of `planes`, m.

    In MercuryDPM the domain does not confine spheres: along an axis without a period the cell
    reaches to the surfaces of spheres that lie outside.
    """
    bounds = np.zeros((3, 2))
    periodic = np.zeros(3, bool)
    for line in file.sections[""]:
        if line.remaining[0] == "xMin":
            for k, axis in enumerate("xyz"):
                bounds[k] = line.number_after(f"{axis}Min"), line.number_after(f"{axis}Max")
    for line in file.sections["Boundaries"]:
        kind = line.remaining[0]
        if kind == "PeriodicBoundary":
            axis_index = _read_period_axis(line)
            periodic[axis_index] = True
            ends = line.number_after("distanceLeft"), line.number_after("distanceRight")
            bounds[axis_index] = ends
        elif "Periodic" in kind or "LeesEdwards" in kind:
            problem = f"{kind}: the period is angled or moves"
            line.refuse("angled_period", problem, remedy=GIVE_STRAIGHT_PERIODS)
        elif kind == CONTROLLED_PERIODS:
            _refuse_shear(line)
            periodic[:] = True
        elif not any(word in kind for word in PASSIVE_BOUNDARIES):
            line.refuse(
                "unknown_boundary",
                f"{kind} is not known",
                "spheres may touch through it",
                "use PeriodicBoundary, or leave it out",
            )
    low, high = _enclose_spheres(file, bounds, periodic)
    return Cell(file.units.length * low, file.units.length * high, periodic, planes)


def _refuse_shear(line: Words) -> None:
    """Raise InputError if the stress control shears the periods, which are then oblique."""
    for name in ("stressGoal", "strainRate"):
        row_of_x = line.numbers_after(name, 3)
        if row_of_x[1]:
            problem = f"{CONTROLLED_PERIODS} shears the cell"
            line.refuse("angled_period", problem, remedy=GIVE_STRAIGHT_PERIODS)


def _read_period_axis(line: Words) -> int:
    """Return the axis of a period; raise InputError for an oblique period."""
    normal = np.array(line.numbers_after("normal", 3))
    shift = np.array(line.numbers_after("shift", 3))
    if not (normal.any() and shift.any()):
        line.refuse("no_direction", "a period without a direction")
    axis = int(np.argmax(abs(normal)))
    directions = np.vstack([normal, shift / np.linalg.norm(shift)])
    tilts = np.delete(directions, axis, axis=1)
    if abs(tilts).max() > MAX_TILT:
        line.refuse("angled_period", "the period is angled", remedy=GIVE_STRAIGHT_PERIODS)
    return axis


def _enclose_spheres(file: Restart, bounds: Floats, periodic: Bools) -> tuple[Floats, Floats]:
    """Return low and high (3,) of the domain (3, 2), moved out to spheres that lie outside."""
    position = file.numbers("Particles", "position")
    radius = file.numbers("Particles", "radius", 1)
    low, high = bounds.T
    outside = ~periodic & (position.min(axis=0, initial=np.inf) < low)
    low = np.where(outside, (position - radius).min(axis=0, initial=np.inf), low)
    outside = ~periodic & (position.max(axis=0, initial=-np.inf) > high)
    high = np.where(outside, (position + radius).max(axis=0, initial=-np.inf), high)
    return low, high


def _read_spheres(file: Restart, cell: Cell) -> Packing:
    """Return the spheres of the file in a cell.

    MercuryDPM holds a particle in all motions by an infinite mass (invMass 0). Such a particle gets
    the mass of its species' density, which has no effect.
    """
    radius = file.numbers("Particles", "radius", 1)[:, 0]
    kind = file.numbers("Particles", "indSpecies", 1)[:, 0].astype(int)
    inverse_mass = file.numbers("Particles", "invMass", 1)[:, 0]
    is_fixed = ~(inverse_mass > 0)
    mass = sphere_volume(radius) * _densities(file, kind)
    mass[~is_fixed] = 1 / inverse_mass[~is_fixed]
    columns = SphereColumns(
        number=file.numbers("Particles", "id", 1)[:, 0],
        position=file.numbers("Particles", "position"),
        radius=radius,
        mass=mass,
        kind=kind,
        fixed=np.repeat(is_fixed[:, None], 6, axis=1) if is_fixed.any() else None,
    )
    words: list[str] = []
    for line in file.sections["Particles"]:
        words += line.words_after("position", 3)
    digits = count_significant_digits(words)
    return Packing.from_columns(file.rows("Particles"), cell, file.units, columns, digits)


def _densities(file: Restart, kind: Ints) -> Floats:
    """Return the density (n,) of the species of each particle, in the file's units."""
    density = {}
    for line in _species_lines(file):
        if "density" in line and "id" in line:
            density[int(line.number_after("id"))] = line.number_after("density")
    return np.array([density.get(number, np.nan) for number in kind.tolist()])


def _read_contacts(file: Restart, packing: Packing, codes: dict[int, int]) -> Contacts:
    """Return the contacts that the interactions of the file list.

    `codes` are the codes of the flat walls, by their numbers in the file.

    Forces on the first sphere are split along and across the line of centres.
    """
    lines = file.sections["Interactions"]
    rows = file.rows("Interactions")
    ids = np.empty((len(lines), 2))
    for row, line in enumerate(lines):
        if "particleWallIds" in line:
            sphere, wall = line.numbers_after("particleWallIds", 2)
            if wall not in codes:
                problem = f"a contact with wall {wall:.0f}"
                line.refuse("other_wall", problem, remedy=TWO_WALLS_ALONE)
            ids[row] = sphere, codes[int(wall)]
        else:
            ids[row] = line.numbers_after("particleIds", 2)
    columns = ("particleIds", "particleIds")
    i, j = find_ends(rows, packing.number, ids.T, columns, WALLS)
    force = file.units.force * file.numbers("Interactions", "force")
    normal_force, shear = packing.split_forces(i, j, force)
    return Contacts(i, j, normal_force, shear, listed=rows)


def _refuse_other_walls(packing: Packing, walls: dict[int, Wall], inner: tuple[int, ...]) -> None:
    """Raise InputError if a sphere overlaps a wall that is not one of the two `inner` walls.

    Overlaps up to the last digit of positions are allowed.

    Also raise InputError for a wall that is not an infinite plane: its contacts cannot be found
    from positions.
    """
    for number, wall in walls.items():
        if wall.kind != "InfiniteWall":
            refuse(
                packing.name,
                "other_wall",
                f"contacts with wall {number}, {wall.kind}, do not follow from positions",
                remedy="write the file with its interactions, after a step",
            )
        if number not in inner:
            overlap = packing.radius + packing.position @ wall.normal - wall.place
            problem = f"has a contact with wall {number}"
            packing.refuse(overlap > packing.step, "other_wall", problem, TWO_WALLS_ALONE)
