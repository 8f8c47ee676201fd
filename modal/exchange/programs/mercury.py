"""MercuryDPM's packings: species, walls, periods, spheres and interactions of one restart file.

A network has one flat wall at low z and one at high z. Others may stand in the file as long as no
sphere touches them; where contacts are listed, these tell it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.law import SI, ProgramLaw, Units
from modal.exchange.mercury_restart import Restart, Wall, read_restart
from modal.exchange.particles_and_contacts import Cell, Contacts, Spheres, ends_of, in_order, pushes
from modal.exchange.programs import lammps
from modal.exchange.registry import File
from modal.exchange.rows import fault, last_step, significant_digits
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

NAME = "MercuryDPM"
OPTIONS = {"scales": lammps.OPTIONS["scales"]}
CODES = (SOURCE_WALL, RECEIVER_WALL)
OTHER = "which is not flat at low or high z"
"""What a network has no wall for, in words."""
ALONE = "a network knows these two walls alone"


def sniff(file: File) -> bool:
    """A restart file of today, or an old one, which is refused by name."""
    return file.head.startswith((b"MercuryDPM", b"restart_version"))


def read(path: Path, scales: Sequence[float] | None = None) -> ImportResult:
    """A packing of MercuryDPM."""
    file, units = read_restart(path), Units.typed(scales) or SI
    spheres = _spheres(file, units)
    planes, codes = _planes(file, spheres, units)
    low, high = units.length * file.low, units.length * file.high
    cell = Cell(low, high, file.periodic, planes)
    contacts = _contacts(file, spheres, cell, codes, units) if file.interactions else None

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a = next(wall.species for number, wall in file.walls.items() if codes.get(number) == a)
        law = file.laws.get((min(a, b), max(a, b)))
        if law is None:
            fault(file.path, f"no species for {a} with {b}", "write the restart file whole")
        stiff = units.pressure if law.hertz else units.stiffness
        across = units.pressure if law.grows else units.stiffness
        return replace(law, normal=stiff * law.normal, tangential=across * law.tangential)

    return network_of(spheres, cell, contacts, law_of, str(file.path))


def _spheres(file: Restart, units: Units) -> Spheres:
    """The particles, in the order of their numbers."""
    table = np.array(file.particles)
    number, order = in_order(file.rows("Particles"), table[:, 0])
    digits = significant_digits([word for place in file.positions for word in place])
    _, kind, radius, mass = table[order].T
    position = np.array(file.positions, float)[order]
    step = units.length * last_step(position, digits)
    lengths = units.length * position, units.length * radius
    return Spheres(number, *lengths, units.mass * mass, kind.astype(int), digits, step)


def _contacts(
    file: Restart, spheres: Spheres, cell: Cell, codes: dict[int, int], units: Units
) -> Contacts:
    """The interactions: force on the first sphere, along and across the line of centres."""
    second = np.empty(len(file.interactions))
    for row, touch in enumerate(file.interactions):
        if touch.wall and touch.second not in codes:
            touch.line.blame(f"a contact with wall {touch.second:.0f}, {OTHER}", ALONE)
        second[row] = codes[int(touch.second)] if touch.wall else touch.second
    rows = file.rows("Interactions")
    first = np.array([touch.first for touch in file.interactions])
    i, j = ends_of(rows, spheres.number, (first, second), ("particleIds",) * 2, CODES)
    force = units.force * np.array([touch.force for touch in file.interactions])
    push, shear = pushes(spheres, cell, i, j, force)
    return Contacts(i, j, push, shear, listed=rows)


def _planes(
    file: Restart, spheres: Spheres, units: Units
) -> tuple[tuple[float, float], dict[int, int]]:
    """z of the lower and the upper wall, m, or NaN, and the codes of these walls' numbers.

    Of several walls at one end the innermost one counts; a sphere that touches another is refused.
    """
    inner: dict[int, int] = {}
    for number, wall in file.walls.items():
        side = wall.side
        if side is not None and (side not in inner or wall.place < file.walls[inner[side]].place):
            inner[side] = number
    for number, wall in file.walls.items():
        if wall.side is not None:
            if number != inner[wall.side]:
                at = f"beside wall {inner[wall.side]}, both at {('low', 'high')[wall.side]} z"
                _refuse_touched(file, spheres, units, number, at, "a network knows one there")
        elif not file.interactions:
            if wall.kind != "InfiniteWall":
                what = f"contacts with wall {number}, {wall.kind}, do not follow from positions"
                fault(file.path, what, "write the file with its interactions, after a step")
            _refuse_touched(file, spheres, units, number, OTHER, ALONE)
    planes = [np.nan, np.nan]
    for side, number in inner.items():
        planes[side] = units.length * file.walls[number].place * file.walls[number].normal[2]
    return (planes[0], planes[1]), {number: CODES[side] for side, number in inner.items()}


def _refuse_touched(
    file: Restart, spheres: Spheres, units: Units, number: int, what: str, do: str
) -> None:
    """InputError where a sphere overlaps an infinite wall by more than the last digit."""
    wall: Wall = file.walls[number]
    overlap = spheres.radius + spheres.position @ wall.normal - units.length * wall.place
    if (overlap > spheres.step).any():
        which = spheres.number[int(np.argmax(overlap))]
        fault(file.path, f"particle {which}: a contact with wall {number}, {what}", do)
