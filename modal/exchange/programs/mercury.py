"""MercuryDPM's packings: species, walls, periods, spheres and interactions of one restart file.

Each line has a word for what it is, and a name before each number. A network has one flat wall at
low z and one at high z. Others may stand in the file as long as no sphere touches them; where
contacts are listed, these tell it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.law import DISPLACEMENT, SI, ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Cell, Contacts, Packing, ends_of
from modal.exchange.programs import lammps
from modal.exchange.text import Rows, Words, fault, significant_digits, text_lines
from modal.tools.arrays import Floats

NAME = "MercuryDPM"
OPTIONS = {"scales": lammps.OPTIONS["scales"]}
SPHERES = ("BaseParticle", "SphericalParticle", "ThermalParticle")
SECTIONS = ("Species", "Walls", "Boundaries", "Particles", "Interactions")
COUNTED = {"Walls": "id", "Particles": "radius", "Interactions": "contactPoint"}
"""Sections that have as many lines as they announce, and a word that each of these has."""
WHOLE = "write the restart file whole"
NORMAL = "LinearViscoelastic", "HertzianViscoelastic"
FRICTION = "", "SlidingFriction", "Friction", "Mindlin", "MindlinRollingTorsion"
"""What the name of a species may be made of: elastic contacts with friction."""
DIAMETER_SQUARED = 4.0
"""Of an effective diameter, over that of the effective radius R*."""
TORSION = (
    "torsion is resisted by the spring that MercuryDPM's documents describe; its code adds the "
    "spring to itself at every step, so that its contacts twist at their limit"
)
STRAIGHT = 1e-6
"""Largest component of an axis' unit vector along the others."""
PERIODS = "only periods along x, y, z are known"
ALONE = "a network knows one flat wall at low z and one at high z alone"


class Wall(NamedTuple):
    """A wall: its outward normal (3,), its place along that, m, its species, its kind."""

    normal: Floats
    place: float
    species: int
    kind: str

    @property
    def side(self) -> int | None:
        """0 where it is flat at low z, 1 at high z, else None."""
        flat = self.kind == "InfiniteWall" and abs(abs(self.normal[2]) - 1) <= STRAIGHT
        return int(self.normal[2] > 0) if flat else None


@dataclass(frozen=True)
class Restart:
    """The lines of each section of a file, those before the first in "", and where it starts."""

    path: Path
    units: Units
    sections: dict[str, list[Words]]
    starts: dict[str, int]

    def rows(self, section: str) -> Rows:
        """Where the lines of a section stand, for messages."""
        texts = [" ".join(line.left) for line in self.sections[section]]
        return Rows(self.path, (), texts, self.starts.get(section, 0) + 1)

    def numbers(self, section: str, name: str, count: int = 3) -> Floats:
        """Shape (n, count): the numbers behind a name in each line of a section."""
        rows = [line.numbers(name, count) for line in self.sections[section]]
        return np.array(rows).reshape(-1, count)


def sniff(path: Path, head: bytes) -> bool:
    """A restart file, which begins with the program's name."""
    return head.startswith(b"MercuryDPM")


def read(path: Path, scales: Sequence[float] | None = None) -> ImportResult:
    """A packing of MercuryDPM."""
    file = read_restart(path, Units.typed(scales) or SI)
    lines = [line for line in file.sections["Species"] if line.left[0].endswith("Species")]
    laws = dict(_law(line, file.units) for line in lines)
    walls = {int(line.number("id")): _wall(line, file.units) for line in file.sections["Walls"]}
    inner: dict[int, int] = {}  # the walls that count at low (0) and high z (1) are the innermost
    for number, wall in sorted(walls.items(), key=lambda each: -each[1].place):
        if wall.side is not None:
            inner[wall.side] = number
    low, high = (
        walls[inner[side]].place * float(walls[inner[side]].normal[2]) if side in inner else np.nan
        for side in (0, 1)
    )
    packing = _packing(file, _cell(file, (low, high)))
    contacts = None
    if file.sections["Interactions"]:
        codes = {number: WALLS[side] for side, number in inner.items()}
        contacts = _contacts(file, packing, codes)
    else:
        _refuse_other_walls(packing, walls, tuple(inner.values()))

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a = walls[inner[WALLS.index(a)]].species
        law = laws.get((min(a, b), max(a, b)))
        if law is None:
            fault(path, f"no species for {a} with {b}", WHOLE)
        return law

    result = network_of(packing, contacts, law_of)
    if any(law.twisting_arc or law.twisting_share for law in laws.values()):
        result.remarks.append(TORSION)
    return result


def read_restart(path: Path, units: Units) -> Restart:
    """The sections of a restart file, whole, of spheres that move in space; else InputError."""
    section, announced = "", dict[str, float]()
    file = Restart(path, units, {name: [] for name in ("", *SECTIONS)}, {})
    for number, text in text_lines(path):
        line = Words(text.split(), f"{path}, line {number}", WHOLE)
        kind = line.left[0] if line.left else ""
        if kind in SECTIONS:
            section, file.starts[kind], announced[kind] = kind, number, line.number(kind)
        elif kind and COUNTED.get(section, kind) in line:
            file.sections[section].append(line)
        for name in ("systemDimensions", "particleDimensions"):
            if kind == "systemDimensions" and (dimensions := line.number(name)) != 3:
                what = f"{name} {dimensions:g}: discs, or motion in a plane"
                line.refuse(what, "a network has spheres that move in space (3)")
    for name in COUNTED:
        there = len(file.sections[name])
        if there < announced.get(name, 0):
            what = f"{there} {name} of {announced[name]:.0f}: the file ends early"
            fault(path, what, "write it whole", number)
    for line in file.sections["Particles"]:
        if line.left[0] not in SPHERES:
            line.refuse(f"{line.left[0]} is no sphere", "only single spheres are known")
        if not line.number("invMass") > 0:
            what = f"particle {line.number('id'):.0f} is fixed (invMass 0)"
            do = "a network knows no held spheres yet: put an InfiniteWall in their place"
            line.refuse(what, do, code="held_bodies")
    return file


def _law(line: Words, units: Units) -> tuple[tuple[int, int], ProgramLaw]:
    """Two species, in rising order, and their law; of a species, or of two (`...MixedSpecies`)."""
    said = line.left[0].removesuffix("Species")
    name, mixed = said.removesuffix("Mixed"), said.endswith("Mixed")
    normal_law = next((each for each in NORMAL if name.startswith(each)), "")
    friction_law = name.removeprefix(normal_law)
    if not normal_law or friction_law not in FRICTION:
        do = f"{' and '.join(NORMAL)} with {', '.join(FRICTION[1:])} or nothing behind are"
        line.refuse(f"{line.left[0]} is not known", do)
    hertz, mindlin = normal_law == "HertzianViscoelastic", friction_law.startswith("Mindlin")
    names = ("effectiveElasticModulus", "elasticModulus") if hertz else ("stiffness",)
    normal = line.first(*names) * (4 / 3 if hertz else 1)
    if not normal > 0:
        line.refuse(f"{line.left[0]} has no stiffness")
    friction = line.first("slidingFrictionCoefficient")
    if mindlin:
        # Ft = 2/3 (8 G a) s, the displacement s kept, with the circle's radius a of the moment.
        tangential = 2 / 3 * 8 * line.first("effectiveShearModulus", "shearModulus")
    else:
        tangential = line.first("slidingStiffness")
        if friction > 0:  # else there is no shear at all; contacts stick up to the static one
            friction = line.first("slidingFrictionCoefficientStatic", "slidingFrictionCoefficient")
    if mixed and "idA" in line:
        ids = [line.number(key) for key in ("idA", "idB")]
    else:
        ids = line.numbers("idMixed" if "idMixed" in line else "id", 2 if mixed else 1)
    normal *= units.pressure if hertz else units.stiffness
    tangential *= units.pressure if mindlin else units.stiffness
    law = ProgramLaw(normal, hertz, tangential, mindlin, friction, DISPLACEMENT)
    return (int(min(ids)), int(max(ids))), _with_turning(law, line, units)


def _with_turning(law: ProgramLaw, line: Words, units: Units) -> ProgramLaw:
    """Return the law with the springs of its species against rolling and torsion.

    The torque is D^2 k times the difference of the turns, across (rolling) or along (torsion) the
    normal, with D = 2 R*; k is the species' own, or with Mindlin 8 G a, 3/2 of the tangential
    stiffness.
    """
    rolls = _resists(line, "rolling")
    twists = _resists(line, "torsion")
    if law.grows:
        share = DIAMETER_SQUARED * 3 / 2
        return replace(law, rolling_share=share * rolls, twisting_share=share * twists)
    unit = DIAMETER_SQUARED * units.stiffness
    return replace(
        law,
        rolling=unit * line.first("rollingStiffness") * rolls,
        twisting_arc=unit * line.first("torsionStiffness") * twists,
    )


def _resists(line: Words, motion: Literal["rolling", "torsion"]) -> bool:
    """Return whether a species resists a motion below its static limit, with a spring."""
    limit = f"{motion}FrictionCoefficient"
    return line.first(limit) > 0 and line.first(f"{limit}Static", limit) > 0


def _wall(line: Words, units: Units) -> Wall:
    normal = np.array([1.0, 0.0, 0.0])
    if "orientation" in line:
        a, b, c, d = line.numbers("orientation", 4)
        # The x axis turned by the quaternion (a, b, c, d).
        turned = [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
        normal = np.array(turned)
    elif line.left[0] == "InfiniteWall":
        normal = np.array(line.numbers("normal", 3))
    if not normal.any():
        line.refuse("a wall without a direction")
    normal /= np.linalg.norm(normal)
    place = units.length * float(normal @ np.array(line.numbers("position", 3)))
    return Wall(normal, place, int(line.number("indSpecies")), line.left[0])


def _cell(file: Restart, planes: tuple[float, float]) -> Cell:
    """Return the cell of the domain and of the periods, with walls at these `planes`, m.

    The domain bounds nothing: where no period is, the cell reaches to the surfaces of spheres that
    lie outside.
    """
    bounds, periodic = np.zeros((3, 2)), np.zeros(3, bool)
    for line in file.sections[""]:
        if line.left[0] == "xMin":
            bounds[:] = [[line.number(f"{axis}{end}") for end in ("Min", "Max")] for axis in "xyz"]
    for line in file.sections["Boundaries"]:
        kind = line.left[0]
        if kind == "PeriodicBoundary":
            normal, shift = (np.array(line.numbers(name, 3)) for name in ("normal", "shift"))
            if not (normal.any() and shift.any()):
                line.refuse("a period without a direction")
            axis = int(np.argmax(abs(normal)))
            along = np.delete(np.vstack([normal, shift / np.linalg.norm(shift)]), axis, axis=1)
            if abs(along).max() > STRAIGHT:
                line.refuse("the period is angled", PERIODS)
            periodic[axis] = True
            bounds[axis] = line.number("distanceLeft"), line.number("distanceRight")
        elif "Periodic" in kind or "LeesEdwards" in kind:
            line.refuse(f"{kind}: the period is angled or moves", PERIODS)
    position = file.numbers("Particles", "position")
    radius = file.numbers("Particles", "radius", 1)
    low, high = bounds.T
    outside = ~periodic & (position.min(axis=0, initial=np.inf) < low)
    low = np.where(outside, (position - radius).min(axis=0, initial=np.inf), low)
    outside = ~periodic & (position.max(axis=0, initial=-np.inf) > high)
    high = np.where(outside, (position + radius).max(axis=0, initial=-np.inf), high)
    return Cell(file.units.length * low, file.units.length * high, periodic, planes)


def _packing(file: Restart, cell: Cell) -> Packing:
    columns = {
        "number": file.numbers("Particles", "id", 1)[:, 0],
        "position": file.numbers("Particles", "position"),
        "radius": file.numbers("Particles", "radius", 1)[:, 0],
        "mass": 1 / file.numbers("Particles", "invMass", 1)[:, 0],
        "kind": file.numbers("Particles", "indSpecies", 1)[:, 0].astype(int),
    }
    places = [line.behind("position", 3) for line in file.sections["Particles"]]
    digits = significant_digits([word for place in places for word in place])
    return Packing.of(file.rows("Particles"), cell, file.units, columns, digits)


def _contacts(file: Restart, packing: Packing, codes: dict[int, int]) -> Contacts:
    """The interactions: force on the first sphere, along and across the line of centres."""
    lines, rows = file.sections["Interactions"], file.rows("Interactions")
    ends = np.empty((len(lines), 2))
    for row, line in enumerate(lines):
        wall = "particleWallIds" in line
        ends[row] = line.numbers("particleWallIds" if wall else "particleIds", 2)
        if wall and ends[row, 1] not in codes:
            line.refuse(f"a contact with wall {ends[row, 1]:.0f}", ALONE)
        if wall:
            ends[row, 1] = codes[int(ends[row, 1])]
    i, j = ends_of(rows, packing.number, ends.T, ("particleIds",) * 2, WALLS)
    push, shear = packing.pushes(i, j, file.units.force * file.numbers("Interactions", "force"))
    return Contacts(i, j, push, shear, listed=rows)


def _refuse_other_walls(packing: Packing, walls: dict[int, Wall], inner: tuple[int, ...]) -> None:
    """InputError where a sphere overlaps another wall than the inner ones beyond the last digit."""
    for number, wall in walls.items():
        if wall.kind != "InfiniteWall":
            what = f"contacts with wall {number}, {wall.kind}, do not follow from positions"
            fault(packing.name, what, "write the file with its interactions, after a step")
        overlap = packing.radius + packing.position @ wall.normal - wall.place
        wrong = (overlap > packing.step) & (number not in inner)
        packing.refuse(wrong, f"has a contact with wall {number}", ALONE)
