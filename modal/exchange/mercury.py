"""MercuryDPM's restart files: species, walls, periods, spheres and interactions in one text.

Today's files name every number; those of `restart_version 2` list them in a fixed order and keep
shear springs with the spheres, so that contacts follow from the positions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from modal.exchange.bodies import Cell, Contacts, Spheres
from modal.exchange.found import Found, network_of
from modal.exchange.program_law import FORCE, ProgramLaw, Units
from modal.exchange.rows import fault, last_step, read_lines, significant_digits
from modal.formats.arrays import Floats
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

SPHERES = ("BaseParticle", "SphericalParticle", "ThermalParticle")
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
STRAIGHT = 1e-6
"""Largest component of an axis' unit vector along the others."""


@dataclass
class _Restart:
    """What a file says, in its own units."""

    path: Path
    low: Floats = field(default_factory=lambda: np.zeros(3))
    high: Floats = field(default_factory=lambda: np.zeros(3))
    periodic: np.ndarray = field(default_factory=lambda: np.zeros(3, bool))
    laws: dict[tuple[int, int], ProgramLaw] = field(default_factory=dict)
    walls: dict[int, tuple[Floats, float, int, str]] = field(default_factory=dict)
    rows: list[tuple[int, int, list[str], float, float]] = field(default_factory=list)
    touching: list[tuple[int, int, bool, list[float], int]] = field(default_factory=list)

    def blame(self, line: int, what: str, do: str) -> NoReturn:
        fault(self.path, what, do, line)


def import_mercury(path: str | Path, units: Units) -> Found:
    """A packing of MercuryDPM; `units` what the file's units are in SI."""
    lines = read_lines(path)
    file = _Restart(Path(path))
    if lines and lines[0].startswith("restart_version"):
        if lines[0].split()[1:2] != ["2"]:
            file.blame(1, f"{lines[0].strip()}", "only version 2 and today's files are known")
        _read_old(file, lines)
    else:
        _read(file, lines)
    if not file.rows:
        fault(path, "no particles", "write the restart file of a packing")
    return _found(file, units)


def _read(file: _Restart, lines: list[str]) -> None:
    """Today's format: a word for what each line is, and a name before each number."""
    section = ""
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        if words[0] in ("Species", "Walls", "Boundaries", "Particles", "Interactions"):
            section = words[0]
        elif words[0] == "xMin":
            for axis, name in enumerate("xyz"):
                file.low[axis] = _named(file, words, f"{name}Min", number)[0]
                file.high[axis] = _named(file, words, f"{name}Max", number)[0]
        elif section == "Species" and words[0].endswith("Species"):
            _species(file, words, number)
        elif section == "Walls" and "id" in words:
            _wall(file, words, number)
        elif section == "Boundaries" and words[0].endswith("Boundary"):
            _boundary(file, words, number)
        elif section == "Particles" and "radius" in words:
            if words[0] not in SPHERES:
                file.blame(number, f"{words[0]} is no sphere", "only single spheres are known")
            at = words.index("position") + 1
            heavy = _named(file, words, "invMass", number)[0]
            if not heavy > 0:
                file.blame(number, "a fixed particle (invMass 0)", "make it a wall, or free")
            row = (int(_named(file, words, "id", number)[0]),)
            kind = int(_named(file, words, "indSpecies", number)[0])
            radius = _named(file, words, "radius", number)[0]
            file.rows.append((*row, kind, words[at : at + 3], radius, 1 / heavy))
        elif section == "Interactions" and "contactPoint" in words:
            wall = "particleWallIds" in words
            i, j = _named(file, words, "particleWallIds" if wall else "particleIds", number, 2)
            force = _named(file, words, "force", number, 3)
            file.touching.append((int(i), int(j), wall, force, number))


def _named(file: _Restart, words: list[str], name: str, line: int, count: int = 1) -> list[float]:
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
    return numbers


def _species(file: _Restart, words: list[str], line: int) -> None:
    """The law of a species, or of two (`...MixedSpecies`)."""
    name = words[0].removesuffix("Species").removesuffix("Mixed")
    for part, why in REFUSED.items():
        if part in name:
            file.blame(line, f"{words[0]} {why}", "only elastic contacts with friction are known")

    def value(*names: str) -> float:
        found = next((each for each in names if each in words), None)
        return _named(file, words, found, line)[0] if found else 0.0

    for resisting in ("rolling", "torsion"):
        if value(f"{resisting}Stiffness") * value(f"{resisting}FrictionCoefficient") > 0:
            what = f"{resisting} friction is resisted by no spring here"
            file.blame(line, what, f"set its {resisting}Stiffness to 0")
    hertz = name.startswith("Hertzian")
    if not hertz and not name.startswith("LinearViscoelastic"):
        do = "LinearViscoelastic..., HertzianViscoelastic... are"
        file.blame(line, f"{words[0]} is not known", do)
    normal = value("effectiveElasticModulus", "elasticModulus") if hertz else value("stiffness")
    if not normal > 0:
        file.blame(line, f"{words[0]} has no stiffness", "write the restart file whole")
    mindlin = "Mindlin" in name
    tangential = value("slidingStiffness")
    if mindlin:
        tangential = 8 * value("effectiveShearModulus", "shearModulus")
    law = ProgramLaw(
        normal * (4 / 3 if hertz else 1),
        hertz,
        tangential,
        mindlin,
        value("slidingFrictionCoefficient"),
        FORCE,
    )
    key = "idMixed" if "idMixed" in words else "id"
    mixed = "Mixed" in words[0]
    ids = [int(number) for number in _named(file, words, key, line, 2 if mixed else 1)]
    file.laws[min(ids), max(ids)] = law


def _wall(file: _Restart, words: list[str], line: int) -> None:
    """An infinite wall: its outward normal, its place along that, its species, its kind."""
    number, species = (int(_named(file, words, name, line)[0]) for name in ("id", "indSpecies"))
    normal = np.array([1.0, 0.0, 0.0])
    if words[0] == "InfiniteWall":
        if "orientation" in words:
            a, b, c, d = _named(file, words, "orientation", line, 4)
            # The x axis turned by the quaternion (a, b, c, d).
            normal = np.array(
                [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)]
            )
        else:
            normal = np.array(_named(file, words, "normal", line, 3))
        normal /= np.linalg.norm(normal)
    place = float(normal @ np.array(_named(file, words, "position", line, 3)))
    file.walls[number] = (normal, place, species, words[0])


def _boundary(file: _Restart, words: list[str], line: int) -> None:
    if words[0] == "PeriodicBoundary":
        left = _named(file, words, "distanceLeft", line)[0]
        right = _named(file, words, "distanceRight", line)[0]
        normal = np.array(_named(file, words, "normal", line, 3))
        shift = np.array(_named(file, words, "shift", line, 3))
        _period(file, normal, left, right, shift, line)
    elif "Periodic" in words[0] or "LeesEdwards" in words[0]:
        do = "only periods along x, y, z are known"
        file.blame(line, f"{words[0]}: the period is angled or moves", do)


def _period(
    file: _Restart, normal: Floats, left: float, right: float, shift: Floats, line: int
) -> None:
    axis = int(np.argmax(abs(normal)))
    along = np.delete(np.vstack([normal, shift / np.linalg.norm(shift)]), axis, axis=1)
    if abs(along).max() > STRAIGHT:
        file.blame(line, "the period is angled", "only periods along x, y, z are known")
    file.periodic[axis] = True
    file.low[axis], file.high[axis] = left, right


def _read_old(file: _Restart, lines: list[str]) -> None:
    """`restart_version 2`: numbers in a fixed order; springs stand behind their sphere."""
    section, left = "", 0
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        if words[0] in ("Species", "Walls", "WallsPeriodic", "Particles"):
            section, left = words[0], int(words[1])
        elif words[0] == "xmin":
            for axis, name in enumerate("xyz"):
                file.low[axis] = _named(file, words, f"{name}min", number)[0]
                file.high[axis] = _named(file, words, f"{name}max", number)[0]
        elif left > 0:
            left -= 1
            _old_line(file, section, words, number)


def _old_line(file: _Restart, section: str, words: list[str], line: int) -> None:
    if section == "Species":
        friction = _named(file, words, "mu", line)[0] if "mu" in words else 0.0
        tangential = _named(file, words, "kt", line)[0] if "kt" in words else 0.0
        stiffness = _named(file, words, "k", line)[0]
        kind = len(file.laws)
        file.laws[kind, kind] = ProgramLaw(stiffness, False, tangential, False, friction, FORCE)
    elif section == "Walls":
        count = int(_named(file, words, "numFiniteWalls", line)[0])
        if count:
            file.blame(line, "a finite wall", "only infinite walls at low and high z are known")
        normal = np.array(_named(file, words, "normal", line, 3))
        place = _named(file, words, "position", line)[0]
        file.walls[len(file.walls)] = (normal, place, 0, "InfiniteWall")
    elif section == "WallsPeriodic":
        normal, shift = (
            np.array(_named(file, words, name, line, 3)) for name in ("normal", "shift")
        )
        left = _named(file, words, "pos_left", line)[0]
        right = _named(file, words, "pos_right", line)[0]
        _period(file, normal, left, right, shift, line)
    elif section == "Particles":
        try:
            numbers = [float(word) for word in words]
            # Position, velocity, radius, angle, angular velocity, 1 / mass, 1 / inertia.
            radius, heavy = numbers[6], numbers[13]
        except (ValueError, IndexError):
            file.blame(line, "no sphere of restart_version 2", "write the file anew")
        if not heavy > 0:
            file.blame(line, "a fixed particle", "make it a wall, or free")
        file.rows.append((len(file.rows), 0, words[:3], radius, 1 / heavy))


def _found(file: _Restart, units: Units) -> Found:
    numbers = np.array([row[0] for row in file.rows])
    order = np.argsort(numbers, kind="stable")
    if (np.diff(numbers[order]) == 0).any():
        fault(file.path, "two particles of one id", "write each once, without ghosts")
    texts = [word for row in file.rows for word in row[2]]
    try:
        position = np.array(texts, float).reshape(-1, 3)[order]
    except ValueError:
        fault(file.path, "a position that is no number", "write the file anew")
    digits = significant_digits(texts)
    spheres = Spheres(
        number=numbers[order],
        position=units.length * position,
        radius=units.length * np.array([row[3] for row in file.rows])[order],
        mass=units.mass * np.array([row[4] for row in file.rows])[order],
        kind=np.array([row[1] for row in file.rows])[order],
        digits=digits,
        step=units.length * last_step(position, digits),
    )
    planes, codes = _planes(file, units)
    cell = Cell(units.length * file.low, units.length * file.high, file.periodic, planes)
    contacts = _contacts(file, spheres, codes, units) if file.touching else None

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a = next(wall[2] for number, wall in file.walls.items() if codes.get(number) == a)
        law = file.laws.get((min(a, b), max(a, b)))
        if law is None:
            fault(file.path, f"no species for {a} with {b}", "write the restart file whole")
        stiff = units.pressure if law.hertz else units.stiffness
        across = units.pressure if law.grows else units.stiffness
        return ProgramLaw(
            stiff * law.normal,
            law.hertz,
            across * law.tangential,
            law.grows,
            law.friction,
            law.keeps,
        )

    return network_of(spheres, cell, contacts, law_of, str(file.path))


def _planes(file: _Restart, units: Units) -> tuple[tuple[float, float], dict[int, int]]:
    """z of the lower and the upper wall, or NaN, and the code of each wall's number."""
    planes, codes = [np.nan, np.nan], dict[int, int]()
    for number, (normal, place, _, kind) in file.walls.items():
        if kind != "InfiniteWall" or abs(abs(normal[2]) - 1) > STRAIGHT:
            continue
        side = int(normal[2] > 0)
        planes[side] = units.length * place * normal[2]
        codes[number] = (SOURCE_WALL, RECEIVER_WALL)[side]
    return (planes[0], planes[1]), codes


def _contacts(file: _Restart, spheres: Spheres, codes: dict[int, int], units: Units) -> Contacts:
    """The interactions: force on the first sphere, along and across the line of centres."""
    i, j = np.empty((2, len(file.touching)), np.int32)
    seen: dict[tuple[int, int], int] = {}
    for row, (first, second, wall, _, line) in enumerate(file.touching):
        if wall:
            if second not in codes:
                what = f"a contact with wall {second}, which is not flat at low or high z"
                file.blame(line, what, "a network knows these two walls alone")
            j[row] = codes[second]
        for number in (first,) if wall else (first, second):
            place = int(np.searchsorted(spheres.number, number))
            if place == len(spheres.number) or spheres.number[place] != number:
                file.blame(line, f"particle {number} is not in the file", "write the file anew")
            if number == first:
                i[row] = place
            else:
                j[row] = place
        key = (int(min(i[row], j[row])), int(max(i[row], j[row])))
        if key in seen:
            file.blame(line, f"the contact of line {seen[key]} again", "list each contact once")
        seen[key] = line
    force = units.force * np.array([touch[3] for touch in file.touching])
    normal = _normals(file, spheres, i, j, units)
    push = -(force * normal).sum(axis=1)
    return Contacts(i, j, push, force + push[:, None] * normal)


def _normals(
    file: _Restart, spheres: Spheres, i: np.ndarray, j: np.ndarray, units: Units
) -> Floats:
    size = np.where(file.periodic, units.length * (file.high - file.low), np.inf)
    wall = j < 0
    branch = spheres.position[np.where(wall, 0, j)] - spheres.position[i]
    branch -= np.round(branch / size) * np.where(np.isfinite(size), size, 0)
    branch[wall] = np.where(j[wall] == SOURCE_WALL, -1.0, 1.0)[:, None] * (0.0, 0.0, 1.0)
    normal: Floats = branch / np.linalg.norm(branch, axis=1)[:, None]
    return normal
