"""MercuryDPM's restart files: species, walls, periods, spheres and interactions in one text.

Today's files name every number; those of `restart_version 2` list them in a fixed order and keep
shear springs with the spheres, so that contacts follow from the positions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modal.exchange.bodies import Cell, Contacts, Spheres
from modal.exchange.found import Found, network_of
from modal.exchange.mercury_names import read_names
from modal.exchange.mercury_numbers import read_numbers
from modal.exchange.mercury_restart import Restart
from modal.exchange.mercury_walls import ALONE, OTHER, planes_of
from modal.exchange.program_law import ProgramLaw, Units
from modal.exchange.rows import fault, last_step, read_lines, significant_digits
from modal.packing.network import SOURCE_WALL
from modal.tools.arrays import Floats


def import_mercury(path: str | Path, units: Units) -> Found:
    """A packing of MercuryDPM; `units` what the file's units are in SI."""
    lines = read_lines(path)
    file = Restart(Path(path))
    if lines and lines[0].startswith("restart_version"):
        if lines[0].split()[1:2] != ["2"]:
            file.blame(1, f"{lines[0].strip()}", "only version 2 and today's files are known")
        read_numbers(file, lines)
    else:
        read_names(file, lines)
    if not file.rows:
        fault(path, "no particles", "write the restart file of a packing")
    return _found(file, units)


def _found(file: Restart, units: Units) -> Found:
    numbers = np.array([row[0] for row in file.rows])
    order = np.argsort(numbers, kind="stable")
    if (np.diff(numbers[order]) == 0).any():
        fault(file.path, "two particles of one id", "write each once, without ghosts")
    texts = [word for row in file.rows for word in row[2]]
    try:
        position = np.array(texts, float).reshape(-1, 3)[order]
    except ValueError:
        fault(file.path, "a position that is no number", "write the file anew")
    if not np.isfinite(position).all():
        fault(file.path, "a position that is no finite number", "write the file anew")
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
    planes, codes = planes_of(file, spheres, units)
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


def _contacts(file: Restart, spheres: Spheres, codes: dict[int, int], units: Units) -> Contacts:
    """The interactions: force on the first sphere, along and across the line of centres."""
    i, j = np.empty((2, len(file.touching)), np.int32)
    seen: dict[tuple[int, int], int] = {}
    for row, (first, second, wall, _, line) in enumerate(file.touching):
        if wall:
            if second not in codes:
                file.blame(line, f"a contact with wall {second}, {OTHER}", ALONE)
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


def _normals(file: Restart, spheres: Spheres, i: np.ndarray, j: np.ndarray, units: Units) -> Floats:
    size = np.where(file.periodic, units.length * (file.high - file.low), np.inf)
    wall = j < 0
    branch = spheres.position[np.where(wall, 0, j)] - spheres.position[i]
    branch -= np.round(branch / size) * np.where(np.isfinite(size), size, 0)
    branch[wall] = np.where(j[wall] == SOURCE_WALL, -1.0, 1.0)[:, None] * (0.0, 0.0, 1.0)
    normal: Floats = branch / np.linalg.norm(branch, axis=1)[:, None]
    return normal
