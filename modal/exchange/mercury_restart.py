"""MercuryDPM's restart files: a word for what each line is, a name before each number.

Files of `restart_version 2`, which list numbers in a fixed order, are refused by name.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from modal.exchange.law import DISPLACEMENT, ProgramLaw
from modal.exchange.rows import Rows, fault, read_lines
from modal.tools.arrays import Bools, Floats

SPHERES = ("BaseParticle", "SphericalParticle", "ThermalParticle")
COUNTED = "Walls", "Particles", "Interactions"
"""Sections that have as many lines as they announce."""
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
    """A wall: its outward normal (3,), its place along that, its species, its kind."""

    normal: Floats
    place: float
    species: int
    kind: str

    @property
    def side(self) -> int | None:
        """0 where it is flat at low z, 1 at high z, else None."""
        flat = self.kind == "InfiniteWall" and abs(abs(self.normal[2]) - 1) <= STRAIGHT
        return int(self.normal[2] > 0) if flat else None


class Interaction(NamedTuple):
    """A contact: a particle, another one or a wall, the force on the first, its line."""

    first: float
    second: float
    wall: bool
    force: list[float]
    line: Line


@dataclass
class Restart:
    """What a file says, in its own units; `starts` are the lines of its sections.

    Each row of `particles` has number, species, radius and mass; `positions` as they are written.
    """

    path: Path
    low: Floats = field(default_factory=lambda: np.zeros(3))
    high: Floats = field(default_factory=lambda: np.zeros(3))
    periodic: Bools = field(default_factory=lambda: np.zeros(3, bool))
    laws: dict[tuple[int, int], ProgramLaw] = field(default_factory=dict)
    walls: dict[int, Wall] = field(default_factory=dict)
    particles: list[list[float]] = field(default_factory=list)
    positions: list[list[str]] = field(default_factory=list)
    interactions: list[Interaction] = field(default_factory=list)
    starts: dict[str, int] = field(default_factory=dict)

    def rows(self, section: str) -> Rows:
        """Where the lines of a section stand, for messages."""
        count = len(getattr(self, section.lower()))
        return Rows(self.path, (), 0, self.starts.get(section, 0) + 1, count)


class Line(NamedTuple):
    """A line of a file: its number, from 1, and its words."""

    path: Path
    at: int
    words: list[str]

    def blame(self, what: str, do: str) -> NoReturn:
        """InputError for this line."""
        fault(self.path, what, do, self.at)

    def numbers(self, name: str, count: int) -> list[float]:
        """The numbers behind a name."""
        if name not in self.words:
            self.blame(f"no {name} in it", "write the restart file whole")
        words = self.texts(name, count)
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            self.blame(f"{name} {' '.join(words)} is no number", "mend the file")
        if len(numbers) < count:
            self.blame(f"{name} lacks numbers", "write the restart file whole")
        if not np.isfinite(numbers).all():
            self.blame(f"{name} is no finite number", "write the file anew")
        return numbers

    def texts(self, name: str, count: int) -> list[str]:
        """The same as they are written."""
        at = self.words.index(name) + 1
        return self.words[at : at + count]

    def number(self, name: str) -> float:
        """The number behind a name."""
        return self.numbers(name, 1)[0]

    def first(self, *names: str) -> float:
        """The number behind the first of these names that is there, or 0."""
        found = [name for name in names if name in self.words]
        return self.number(found[0]) if found else 0.0


def read_restart(path: Path) -> Restart:
    """What a restart file says; InputError, with its line, for what no network has."""
    file, lines = Restart(path), read_lines(path)
    if lines and lines[0].startswith("restart_version"):
        do = "write it anew with a MercuryDPM of today, whose files begin with its name"
        fault(path, f"{lines[0].strip()} is an old format that is not read", do, 1)
    section, said, there = "", dict[str, int](), Counter[str]()
    for number, text in enumerate(lines, 1):
        line = Line(path, number, text.split())
        if not line.words:
            continue
        there[section] += 1
        kind = line.words[0]
        if kind in ("Species", "Walls", "Boundaries", "Particles", "Interactions"):
            section, file.starts[kind], said[kind] = kind, number, int(line.number(kind))
        elif kind == "xMin":
            file.low[:] = [line.number(f"{axis}Min") for axis in "xyz"]
            file.high[:] = [line.number(f"{axis}Max") for axis in "xyz"]
        elif kind == "systemDimensions":
            for name in (kind, "particleDimensions"):
                if (dimensions := line.number(name)) != 3:
                    what = f"{name} {dimensions:g}: discs, or motion in a plane"
                    line.blame(what, "a network has spheres that move in space (3)")
        elif section == "Species" and kind.endswith("Species"):
            _species(file, line)
        elif section == "Walls" and "id" in line.words:
            _wall(file, line)
        elif section == "Boundaries" and kind.endswith("Boundary"):
            _boundary(file, line)
        elif section == "Particles" and "radius" in line.words:
            _particle(file, line)
        elif section == "Interactions" and "contactPoint" in line.words:
            wall = "particleWallIds" in line.words
            i, j = line.numbers("particleWallIds" if wall else "particleIds", 2)
            file.interactions.append(Interaction(i, j, wall, line.numbers("force", 3), line))
    for name in COUNTED:
        if there[name] < said.get(name, 0):
            what = f"{there[name]} {name} of {said[name]}: the file ends early"
            fault(path, what, "write it whole", len(lines))
    if not file.particles:
        fault(path, "no particles", "write the restart file of a packing")
    return file


def _particle(file: Restart, line: Line) -> None:
    if line.words[0] not in SPHERES:
        line.blame(f"{line.words[0]} is no sphere", "only single spheres are known")
    row = [line.number(name) for name in ("id", "indSpecies", "radius", "invMass")]
    if not row[3] > 0:
        line.blame("a fixed particle (invMass 0)", "make it a wall, or free")
    line.numbers("position", 3)
    file.particles.append([*row[:3], 1 / row[3]])
    file.positions.append(line.texts("position", 3))


def _species(file: Restart, line: Line) -> None:
    """The law of a species, or of two (`...MixedSpecies`)."""
    said = line.words[0]
    mixed = said.endswith("MixedSpecies")
    name = said.removesuffix("Species").removesuffix("Mixed")
    for part, why in REFUSED.items():
        if part in name:
            line.blame(f"{said} {why}", "only elastic contacts with friction are known")
    normal_law = next((each for each in NORMAL if name.startswith(each)), "")
    friction_law = name.removeprefix(normal_law)
    if not normal_law or friction_law not in FRICTION:
        do = f"{' and '.join(NORMAL)} with {', '.join(FRICTION[1:])} or nothing behind are"
        line.blame(f"{said} is not known", do)
    hertz, mindlin = normal_law == "HertzianViscoelastic", friction_law.startswith("Mindlin")
    for resisting in ("rolling", "torsion"):
        # Mindlin's own stiffness resists there, whatever the file says of another one.
        stiff, limit = f"{resisting}Stiffness", f"{resisting}FrictionCoefficient"
        if line.first(limit) > 0 and (mindlin or line.first(stiff) > 0):
            line.blame(
                f"{resisting} friction is resisted by no spring here", f"set its {limit} to 0"
            )
    names = ("effectiveElasticModulus", "elasticModulus") if hertz else ("stiffness",)
    normal = line.first(*names) * (4 / 3 if hertz else 1)
    if not normal > 0:
        line.blame(f"{said} has no stiffness", "write the restart file whole")
    friction = line.first("slidingFrictionCoefficient")
    if mindlin:
        # Ft = 2/3 (8 G a) s, the displacement s kept, with the circle's radius a of the moment.
        tangential = 2 / 3 * 8 * line.first("effectiveShearModulus", "shearModulus")
    else:
        tangential = line.first("slidingStiffness")
        if friction > 0:  # else there is no shear at all; contacts stick up to the static one
            friction = line.first("slidingFrictionCoefficientStatic", "slidingFrictionCoefficient")
    if mixed and "idA" in line.words:
        ids = [line.number(key) for key in ("idA", "idB")]
    else:
        ids = line.numbers("idMixed" if "idMixed" in line.words else "id", 2 if mixed else 1)
    pair = int(min(ids)), int(max(ids))
    file.laws[pair] = ProgramLaw(normal, hertz, tangential, mindlin, friction, DISPLACEMENT)


def _wall(file: Restart, line: Line) -> None:
    """An infinite wall: its outward normal, its place along that, its species, its kind."""
    normal = np.array([1.0, 0.0, 0.0])
    if line.words[0] == "InfiniteWall":
        if "orientation" in line.words:
            a, b, c, d = line.numbers("orientation", 4)
            # The x axis turned by the quaternion (a, b, c, d).
            turned = [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
            normal = np.array(turned)
        else:
            normal = np.array(line.numbers("normal", 3))
        if not normal.any():
            line.blame("a wall without a direction", "write the restart file whole")
        normal /= np.linalg.norm(normal)
    place = float(normal @ np.array(line.numbers("position", 3)))
    species = int(line.number("indSpecies"))
    file.walls[int(line.number("id"))] = Wall(normal, place, species, line.words[0])


def _boundary(file: Restart, line: Line) -> None:
    if line.words[0] == "PeriodicBoundary":
        normal, shift = (np.array(line.numbers(name, 3)) for name in ("normal", "shift"))
        if not (normal.any() and shift.any()):
            line.blame("a period without a direction", "write the restart file whole")
        axis = int(np.argmax(abs(normal)))
        along = np.delete(np.vstack([normal, shift / np.linalg.norm(shift)]), axis, axis=1)
        if abs(along).max() > STRAIGHT:
            line.blame("the period is angled", "only periods along x, y, z are known")
        file.periodic[axis] = True
        file.low[axis], file.high[axis] = line.number("distanceLeft"), line.number("distanceRight")
    elif "Periodic" in line.words[0] or "LeesEdwards" in line.words[0]:
        do = "only periods along x, y, z are known"
        line.blame(f"{line.words[0]}: the period is angled or moves", do)
