"""MercuryDPM's packings: species, walls, periods, spheres and interactions of one restart file.

A network has one flat wall at low z and one at high z. Others may stand in the file as long as no
sphere touches them; where contacts are listed, these tell it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.law import SI, ProgramLaw, Units
from modal.exchange.mercury_restart import (
    WHOLE,
    Restart,
    Wall,
    cell_of,
    laws_of,
    read_restart,
    walls_of,
)
from modal.exchange.particles_and_contacts import WALLS, Cell, Contacts, Packing, ends_of
from modal.exchange.programs import lammps
from modal.exchange.registry import File
from modal.exchange.rows import fault, significant_digits

NAME = "MercuryDPM"
OPTIONS = {"scales": lammps.OPTIONS["scales"]}
OTHER = "which is not flat at low or high z"
"""What a network has no wall for, in words."""
ALONE = "a network knows these two walls alone"


def sniff(file: File) -> bool:
    """A restart file of today, or an old one, which is refused by name."""
    return file.head.startswith((b"MercuryDPM", b"restart_version"))


def read(path: Path, scales: Sequence[float] | None = None) -> ImportResult:
    """A packing of MercuryDPM."""
    file, units = read_restart(path), Units.typed(scales) or SI
    laws, walls = laws_of(file, units), walls_of(file, units)
    inner = _innermost(walls)
    codes = {number: WALLS[side] for side, number in inner.items()}
    low, high = (
        walls[inner[side]].place * float(walls[inner[side]].normal[2]) if side in inner else np.nan
        for side in (0, 1)
    )
    packing = _packing(file, units, cell_of(file, units, (low, high)))
    listed = bool(file.sections["Interactions"])
    _refuse_other_walls(packing, walls, inner, listed=listed)
    contacts = _contacts(file, packing, codes, units) if listed else None

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a = walls[inner[WALLS.index(a)]].species
        law = laws.get((min(a, b), max(a, b)))
        if law is None:
            fault(path, f"no species for {a} with {b}", WHOLE)
        return law

    return network_of(packing, contacts, law_of)


def _packing(file: Restart, units: Units, cell: Cell) -> Packing:
    names = (("id", 1), ("position", 3), ("radius", 1), ("invMass", 1), ("indSpecies", 1))
    number, position, *each = file.numbers("Particles", *names)
    radius, lightness, kind = (column[:, 0] for column in each)
    texts = [line.behind("position", 3) for line in file.sections["Particles"]]
    digits = significant_digits([word for place in texts for word in place])
    columns = (number[:, 0], position, radius, 1 / lightness)
    rows = file.rows("Particles")
    return Packing.of(rows, cell, units, columns, digits, kind=kind.astype(int))


def _contacts(file: Restart, packing: Packing, codes: dict[int, int], units: Units) -> Contacts:
    """The interactions: force on the first sphere, along and across the line of centres."""
    lines, rows = file.sections["Interactions"], file.rows("Interactions")
    ends = np.empty((len(lines), 2))
    for row, line in enumerate(lines):
        wall = "particleWallIds" in line
        ends[row] = line.numbers("particleWallIds" if wall else "particleIds", 2)
        if wall and ends[row, 1] not in codes:
            line.refuse(f"a contact with wall {ends[row, 1]:.0f}, {OTHER}", ALONE)
        if wall:
            ends[row, 1] = codes[int(ends[row, 1])]
    i, j = ends_of(rows, packing.number, ends.T, ("particleIds",) * 2, walls=True)
    (force,) = file.numbers("Interactions", ("force", 3))
    push, shear = packing.pushes(i, j, units.force * force)
    return Contacts(i, j, push, shear, listed=rows)


def _innermost(walls: dict[int, Wall]) -> dict[int, int]:
    """The number of the wall that counts at low z (0) and at high z (1): the innermost one."""
    inner: dict[int, int] = {}
    for number, wall in walls.items():
        side = wall.side
        if side is not None and (side not in inner or wall.place < walls[inner[side]].place):
            inner[side] = number
    return inner


def _refuse_other_walls(
    packing: Packing, walls: dict[int, Wall], inner: dict[int, int], *, listed: bool
) -> None:
    """InputError where a sphere overlaps another wall than the inner ones beyond the last digit.

    Where contacts are `listed`, they tell it of walls that are not flat at low and high z.
    """
    for number, wall in walls.items():
        what, do = f"{OTHER}", ALONE
        if wall.side is not None:
            if number == inner[wall.side]:
                continue
            what = f"beside wall {inner[wall.side]}, both at {('low', 'high')[wall.side]} z"
            do = "a network knows one there"
        elif listed:
            continue
        elif wall.kind != "InfiniteWall":
            what = f"contacts with wall {number}, {wall.kind}, do not follow from positions"
            fault(packing.name, what, "write the file with its interactions, after a step")
        overlap = packing.radius + packing.position @ wall.normal - wall.place
        packing.refuse(overlap > packing.step, f"has a contact with wall {number}, {what}", do)
