"""MercuryDPM's restart files of today: a word for what each line is, a name before each number."""

from __future__ import annotations

from collections import Counter

import numpy as np

from modal.exchange.mercury_restart import Restart, add_period, named
from modal.exchange.program_law import DISPLACEMENT, ProgramLaw

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


def read_names(file: Restart, lines: list[str]) -> None:
    """Today's format: a word for what each line is, and a name before each number."""
    section, said, there = "", dict[str, int](), Counter[str]()
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        there[section] += 1
        if words[0] in ("Species", "Walls", "Boundaries", "Particles", "Interactions"):
            section = words[0]
            said[section] = int(named(file, words, section, number)[0])
        elif words[0] == "xMin":
            for axis, name in enumerate("xyz"):
                file.low[axis] = named(file, words, f"{name}Min", number)[0]
                file.high[axis] = named(file, words, f"{name}Max", number)[0]
        elif words[0] == "systemDimensions":
            for name in ("systemDimensions", "particleDimensions"):
                file.refuse_flat(name, named(file, words, name, number)[0], number)
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
            heavy = named(file, words, "invMass", number)[0]
            if not heavy > 0:
                file.blame(number, "a fixed particle (invMass 0)", "make it a wall, or free")
            row = (int(named(file, words, "id", number)[0]),)
            kind = int(named(file, words, "indSpecies", number)[0])
            radius = named(file, words, "radius", number)[0]
            file.rows.append((*row, kind, words[at : at + 3], radius, 1 / heavy))
        elif section == "Interactions" and "contactPoint" in words:
            wall = "particleWallIds" in words
            i, j = named(file, words, "particleWallIds" if wall else "particleIds", number, 2)
            force = named(file, words, "force", number, 3)
            file.touching.append((int(i), int(j), wall, force, number))
    for name in COUNTED:
        if there[name] < said.get(name, 0):
            what = f"{there[name]} {name} of {said[name]}: the file ends early"
            file.blame(len(lines), what, "write it whole")


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
        normal /= np.linalg.norm(normal)
    place = float(normal @ np.array(named(file, words, "position", line, 3)))
    file.walls[number] = (normal, place, species, words[0])


def _boundary(file: Restart, words: list[str], line: int) -> None:
    if words[0] == "PeriodicBoundary":
        left = named(file, words, "distanceLeft", line)[0]
        right = named(file, words, "distanceRight", line)[0]
        normal = np.array(named(file, words, "normal", line, 3))
        shift = np.array(named(file, words, "shift", line, 3))
        add_period(file, normal, left, right, shift, line)
    elif "Periodic" in words[0] or "LeesEdwards" in words[0]:
        do = "only periods along x, y, z are known"
        file.blame(line, f"{words[0]}: the period is angled or moves", do)
