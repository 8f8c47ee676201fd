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


class Particle(NamedTuple):
    """A sphere: its number, species, position as it is written, radius, mass."""

    number: float
    species: int
    position: list[str]
    radius: float
    mass: float


class Interaction(NamedTuple):
    """A contact: a particle, another one or a wall, the force on the first, its line."""

    first: float
    second: float
    wall: bool
    force: list[float]
    line: int


@dataclass
class Restart:
    """What a file says, in its own units; `starts` are the lines of its sections."""

    path: Path
    low: Floats = field(default_factory=lambda: np.zeros(3))
    high: Floats = field(default_factory=lambda: np.zeros(3))
    periodic: Bools = field(default_factory=lambda: np.zeros(3, bool))
    laws: dict[tuple[int, int], ProgramLaw] = field(default_factory=dict)
    walls: dict[int, Wall] = field(default_factory=dict)
    particles: list[Particle] = field(default_factory=list)
    interactions: list[Interaction] = field(default_factory=list)
    starts: dict[str, int] = field(default_factory=dict)

    def blame(self, line: int, what: str, do: str) -> NoReturn:
        """InputError for a line."""
        fault(self.path, what, do, line)

    def rows(self, section: str) -> Rows:
        """Where the lines of a section stand, for messages."""
        count = len(getattr(self, section.lower()))
        return Rows(self.path, (), 0, self.starts.get(section, 0) + 1, count)


def read_restart(path: Path) -> Restart:
    """What a restart file says; InputError, with its line, for what no network has."""
    file, lines = Restart(path), read_lines(path)
    if lines and lines[0].startswith("restart_version"):
        do = "write it anew with a MercuryDPM of today, whose files begin with its name"
        file.blame(1, f"{lines[0].strip()} is an old format that is not read", do)
    section, said, there = "", dict[str, int](), Counter[str]()
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        there[section] += 1
        if words[0] in ("Species", "Walls", "Boundaries", "Particles", "Interactions"):
            section = words[0]
            file.starts[section] = number
            said[section] = int(named(file, words, section, number)[0])
        elif words[0] == "xMin":
            for axis, name in enumerate("xyz"):
                file.low[axis] = named(file, words, f"{name}Min", number)[0]
                file.high[axis] = named(file, words, f"{name}Max", number)[0]
        elif words[0] == "systemDimensions":
            for name in ("systemDimensions", "particleDimensions"):
                dimensions = named(file, words, name, number)[0]
                if dimensions != 3:
                    do = "a network has spheres that move in space (3)"
                    what = f"{name} {dimensions:g}: discs, or motion in a plane"
                    file.blame(number, what, do)
        elif section == "Species" and words[0].endswith("Species"):
            _species(file, words, number)
        elif section == "Walls" and "id" in words:
            _wall(file, words, number)
        elif section == "Boundaries" and words[0].endswith("Boundary"):
            _boundary(file, words, number)
        elif section == "Particles" and "radius" in words:
            _particle(file, words, number)
        elif section == "Interactions" and "contactPoint" in words:
            wall = "particleWallIds" in words
            i, j = named(file, words, "particleWallIds" if wall else "particleIds", number, 2)
            force = named(file, words, "force", number, 3)
            file.interactions.append(Interaction(i, j, wall, force, number))
    for name in COUNTED:
        if there[name] < said.get(name, 0):
            what = f"{there[name]} {name} of {said[name]}: the file ends early"
            file.blame(len(lines), what, "write it whole")
    if not file.particles:
        fault(path, "no particles", "write the restart file of a packing")
    return file


def named(file: Restart, words: list[str], name: str, line: int, count: int = 1) -> list[float]:
    """The numbers behind a name in a line."""
    if name not in words:
        file.blame(line, f"no {name} in it", "write the restart file whole")
    at = words.index(name) + 1
    try:
        numbers = [float(word) for word in words[at : at + count]]
    except ValueError:
        file.blame(line, f"{name} {' '.join(words[at : at + count])} is no number", "mend the file")
    if len(numbers) < count:
        file.blame(line, f"{name} lacks numbers", "write the restart file whole")
    if not np.isfinite(numbers).all():
        file.blame(line, f"{name} is no finite number", "write the file anew")
    return numbers


def _particle(file: Restart, words: list[str], line: int) -> None:
    if words[0] not in SPHERES:
        file.blame(line, f"{words[0]} is no sphere", "only single spheres are known")
    number, species, radius, heavy = (
        named(file, words, name, line)[0] for name in ("id", "indSpecies", "radius", "invMass")
    )
    if not heavy > 0:
        file.blame(line, "a fixed particle (invMass 0)", "make it a wall, or free")
    named(file, words, "position", line, 3)
    at = words.index("position") + 1
    position = words[at : at + 3]
    file.particles.append(Particle(number, int(species), position, radius, 1 / heavy))


def _species(file: Restart, words: list[str], line: int) -> None:
    """The law of a species, or of two (`...MixedSpecies`)."""
    mixed = words[0].endswith("MixedSpecies")
    name = words[0].removesuffix("Species").removesuffix("Mixed")
    for part, why in REFUSED.items():
        if part in name:
            file.blame(line, f"{words[0]} {why}", "only elastic contacts with friction are known")

    def value(*names: str) -> float:
        found = next((each for each in names if each in words), None)
        return named(file, words, found, line)[0] if found else 0.0

    normal_law = next((each for each in NORMAL if name.startswith(each)), "")
    friction_law = name.removeprefix(normal_law)
    if not normal_law or friction_law not in FRICTION:
        do = f"{' and '.join(NORMAL)} with {', '.join(FRICTION[1:])} or nothing behind are"
        file.blame(line, f"{words[0]} is not known", do)
    hertz, mindlin = normal_law == "HertzianViscoelastic", friction_law.startswith("Mindlin")
    for resisting in ("rolling", "torsion"):
        # Mindlin's own stiffness resists there, whatever the file says of another one.
        if value(f"{resisting}FrictionCoefficient") > 0 and (
            mindlin or value(f"{resisting}Stiffness") > 0
        ):
            what = f"{resisting} friction is resisted by no spring here"
            file.blame(line, what, f"set its {resisting}FrictionCoefficient to 0")
    normal = value("effectiveElasticModulus", "elasticModulus") if hertz else value("stiffness")
    if not normal > 0:
        file.blame(line, f"{words[0]} has no stiffness", "write the restart file whole")
    friction = value("slidingFrictionCoefficient")
    if mindlin:
        # Ft = 2/3 (8 G a) s, the displacement s kept, with the circle's radius a of the moment.
        tangential = 2 / 3 * 8 * value("effectiveShearModulus", "shearModulus")
    else:
        tangential = value("slidingStiffness")
        if friction > 0:  # else there is no shear at all; contacts stick up to the static one
            friction = value("slidingFrictionCoefficientStatic", "slidingFrictionCoefficient")
    normal *= 4 / 3 if hertz else 1
    law = ProgramLaw(normal, hertz, tangential, mindlin, friction, DISPLACEMENT)
    if mixed and "idA" in words:
        ids = [int(named(file, words, key, line)[0]) for key in ("idA", "idB")]
    else:
        key = "idMixed" if "idMixed" in words else "id"
        ids = [int(number) for number in named(file, words, key, line, 2 if mixed else 1)]
    file.laws[min(ids), max(ids)] = law


def _wall(file: Restart, words: list[str], line: int) -> None:
    """An infinite wall: its outward normal, its place along that, its species, its kind."""
    number, species = (int(named(file, words, name, line)[0]) for name in ("id", "indSpecies"))
    normal = np.array([1.0, 0.0, 0.0])
    if words[0] == "InfiniteWall":
        if "orientation" in words:
            a, b, c, d = named(file, words, "orientation", line, 4)
            # The x axis turned by the quaternion (a, b, c, d).
            normal = np.array(
                [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
            )
        else:
            normal = np.array(named(file, words, "normal", line, 3))
        if not normal.any():
            file.blame(line, "a wall without a direction", "write the restart file whole")
        normal /= np.linalg.norm(normal)
    place = float(normal @ np.array(named(file, words, "position", line, 3)))
    file.walls[number] = Wall(normal, place, species, words[0])


def _boundary(file: Restart, words: list[str], line: int) -> None:
    if words[0] == "PeriodicBoundary":
        left = named(file, words, "distanceLeft", line)[0]
        right = named(file, words, "distanceRight", line)[0]
        normal = np.array(named(file, words, "normal", line, 3))
        shift = np.array(named(file, words, "shift", line, 3))
        if not (normal.any() and shift.any()):
            file.blame(line, "a period without a direction", "write the restart file whole")
        axis = int(np.argmax(abs(normal)))
        along = np.delete(np.vstack([normal, shift / np.linalg.norm(shift)]), axis, axis=1)
        if abs(along).max() > STRAIGHT:
            file.blame(line, "the period is angled", "only periods along x, y, z are known")
        file.periodic[axis] = True
        file.low[axis], file.high[axis] = left, right
    elif "Periodic" in words[0] or "LeesEdwards" in words[0]:
        do = "only periods along x, y, z are known"
        file.blame(line, f"{words[0]}: the period is angled or moves", do)
