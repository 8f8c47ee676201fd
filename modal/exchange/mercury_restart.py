"""MercuryDPM's restart files: a word for what each line is, a name before each number.

Files of `restart_version 2`, which list numbers in a fixed order, are refused by name.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import Cell
from modal.exchange.rows import Rows, fault, read_lines
from modal.exchange.words import Words
from modal.tools.arrays import Floats

SPHERES = ("BaseParticle", "SphericalParticle", "ThermalParticle")
SECTIONS = ("Species", "Walls", "Boundaries", "Particles", "Interactions")
COUNTED = {"Walls": "id", "Particles": "radius", "Interactions": "contactPoint"}
"""Sections that have as many lines as they announce, and a word that each of these has."""
WHOLE = "write the restart file whole"
REFUSED = {
    "Plastic": "is hysteretic: its stiffness depends on the way there",
    "Adhesive": "is cohesive",
    "LiquidBridge": "is cohesive",
    "LiquidMigration": "is cohesive",
    "Bonded": "is bonded",
    "Sinter": "sinters",
    "Melt": "melts",
}
"""Parts of a species' name that no spring of this project stands for."""
NORMAL = "LinearViscoelastic", "HertzianViscoelastic"
FRICTION = "", "SlidingFriction", "Friction", "Mindlin", "MindlinRollingTorsion"
"""What else a species' name may be made of."""
STRAIGHT = 1e-6
"""Largest component of an axis' unit vector along the others."""


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
    sections: dict[str, list[Words]]
    starts: dict[str, int]

    def rows(self, section: str) -> Rows:
        """Where the lines of a section stand, for messages."""
        count = len(self.sections[section])
        return Rows(self.path, (), 0, self.starts.get(section, 0) + 1, count)

    def numbers(self, section: str, *names: tuple[str, int]) -> list[Floats]:
        """Shape (n, k) of each name: the k numbers behind it in each line of a section."""
        lines = self.sections[section]
        return [np.array([line.numbers(*name) for line in lines]) for name in names]


def read_restart(path: Path) -> Restart:
    """The sections of a restart file, whole, of spheres that move in space; else InputError."""
    texts = read_lines(path)
    if texts and texts[0].startswith("restart_version"):
        do = "write it anew with a MercuryDPM of today, whose files begin with its name"
        fault(path, f"{texts[0].strip()} is an old format that is not read", do, 1)
    section, announced = "", dict[str, float]()
    file = Restart(path, {name: [] for name in ("", *SECTIONS)}, {})
    for number, text in enumerate(texts, 1):
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
            fault(path, what, "write it whole", len(texts))
    for line in file.sections["Particles"]:
        if line.left[0] not in SPHERES:
            line.refuse(f"{line.left[0]} is no sphere", "only single spheres are known")
        if not line.number("invMass") > 0:
            line.refuse("a fixed particle (invMass 0)", "make it a wall, or free")
    return file


def laws_of(file: Restart, units: Units) -> dict[tuple[int, int], ProgramLaw]:
    """The law of two species, by their numbers in rising order."""
    lines = [line for line in file.sections["Species"] if line.left[0].endswith("Species")]
    return dict(_law(line, units) for line in lines)


def _law(line: Words, units: Units) -> tuple[tuple[int, int], ProgramLaw]:
    """The law of a species, or of two (`...MixedSpecies`)."""
    said = line.left[0]
    mixed = said.endswith("MixedSpecies")
    name = said.removesuffix("Species").removesuffix("Mixed")
    for part, why in REFUSED.items():
        if part in name:
            line.refuse(f"{said} {why}", "only elastic contacts with friction are known")
    normal_law = next((each for each in NORMAL if name.startswith(each)), "")
    friction_law = name.removeprefix(normal_law)
    if not normal_law or friction_law not in FRICTION:
        do = f"{' and '.join(NORMAL)} with {', '.join(FRICTION[1:])} or nothing behind are"
        line.refuse(f"{said} is not known", do)
    hertz, mindlin = normal_law == "HertzianViscoelastic", friction_law.startswith("Mindlin")
    for resisting in ("rolling", "torsion"):
        # Mindlin's own stiffness resists there, whatever the file says of another one.
        stiff, limit = f"{resisting}Stiffness", f"{resisting}FrictionCoefficient"
        if line.first(limit) > 0 and (mindlin or line.first(stiff) > 0):
            what = f"{resisting} friction is resisted by no spring here"
            line.refuse(what, f"set its {limit} to 0")
    names = ("effectiveElasticModulus", "elasticModulus") if hertz else ("stiffness",)
    normal = line.first(*names) * (4 / 3 if hertz else 1)
    if not normal > 0:
        line.refuse(f"{said} has no stiffness")
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
    return (int(min(ids)), int(max(ids))), law


def walls_of(file: Restart, units: Units) -> dict[int, Wall]:
    """The walls by their numbers."""
    return {int(line.number("id")): _wall(line, units) for line in file.sections["Walls"]}


def _wall(line: Words, units: Units) -> Wall:
    normal = np.array([1.0, 0.0, 0.0])
    if line.left[0] == "InfiniteWall":
        if "orientation" in line:
            a, b, c, d = line.numbers("orientation", 4)
            # The x axis turned by the quaternion (a, b, c, d).
            turned = [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
            normal = np.array(turned)
        else:
            normal = np.array(line.numbers("normal", 3))
        if not normal.any():
            line.refuse("a wall without a direction")
        normal /= np.linalg.norm(normal)
    place = units.length * float(normal @ np.array(line.numbers("position", 3)))
    return Wall(normal, place, int(line.number("indSpecies")), line.left[0])


def cell_of(file: Restart, units: Units, planes: tuple[float, float]) -> Cell:
    """The cell of the bounds, and of the periods along x, y and z; walls at these `planes`, m."""
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
                line.refuse("the period is angled", "only periods along x, y, z are known")
            periodic[axis] = True
            bounds[axis] = line.number("distanceLeft"), line.number("distanceRight")
        elif "Periodic" in kind or "LeesEdwards" in kind:
            do = "only periods along x, y, z are known"
            line.refuse(f"{kind}: the period is angled or moves", do)
    low, high = units.length * bounds.T
    return Cell(low, high, periodic, planes)
