"""Which walls of a restart file of MercuryDPM a network can have, and which spheres forbid others.

A network has one flat wall at low z and one at high z. Others may stand in the file as long as no
sphere touches them; where contacts are listed, these tell it.
"""

from __future__ import annotations

import numpy as np

from modal.exchange.bodies import Spheres
from modal.exchange.mercury_restart import STRAIGHT, Restart
from modal.exchange.program_law import Units
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

OTHER = "which is not flat at low or high z"
"""What a network has no wall for, in words."""
ALONE = "a network knows these two walls alone"


def planes_of(
    file: Restart, spheres: Spheres, units: Units
) -> tuple[tuple[float, float], dict[int, int]]:
    """z of the lower and the upper wall, m, or NaN, and the codes of these walls' numbers.

    Of several walls at one end the innermost one counts; a sphere that touches another is refused.
    """
    inner: dict[int, int] = {}
    for number, (normal, place, _, kind) in file.walls.items():
        if kind == "InfiniteWall" and abs(abs(normal[2]) - 1) <= STRAIGHT:
            side = int(normal[2] > 0)
            if side not in inner or place < file.walls[inner[side]][1]:
                inner[side] = number
    for number, (normal, _, _, kind) in file.walls.items():
        side = int(normal[2] > 0)
        if kind == "InfiniteWall" and abs(abs(normal[2]) - 1) <= STRAIGHT:
            if number != inner[side]:
                what = f"beside wall {inner[side]}, both at {('low', 'high')[side]} z"
                _refuse_touched(file, spheres, units, number, what, "a network knows one there")
        elif not file.touching:
            if kind != "InfiniteWall":
                what = f"contacts with wall {number}, {kind}, do not follow from positions"
                fault(file.path, what, "write the file with its interactions, after a step")
            _refuse_touched(file, spheres, units, number, OTHER, ALONE)
    planes = [np.nan, np.nan]
    for side, number in inner.items():
        normal, place, _, _ = file.walls[number]
        planes[side] = units.length * place * normal[2]
    codes = {number: (SOURCE_WALL, RECEIVER_WALL)[side] for side, number in inner.items()}
    return (planes[0], planes[1]), codes


def _refuse_touched(
    file: Restart, spheres: Spheres, units: Units, number: int, what: str, do: str
) -> None:
    """InputError where a sphere overlaps an infinite wall by more than the last digit."""
    normal, place, _, _ = file.walls[number]
    overlap = spheres.radius + spheres.position @ normal - units.length * place
    if (overlap > spheres.step).any():
        which = spheres.number[int(np.argmax(overlap))]
        fault(file.path, f"particle {which}: a contact with wall {number}, {what}", do)
