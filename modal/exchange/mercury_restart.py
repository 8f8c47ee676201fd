"""What a restart file of MercuryDPM says, whatever its age."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from modal.exchange.program_law import ProgramLaw
from modal.exchange.rows import fault
from modal.tools.arrays import Floats

STRAIGHT = 1e-6
"""Largest component of an axis' unit vector along the others."""


@dataclass
class Restart:
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
        """InputError for a line."""
        fault(self.path, what, do, line)

    def refuse_flat(self, name: str, dimensions: float, line: int) -> None:
        """InputError for discs, and for spheres that move in a plane alone."""
        if dimensions != 3:
            do = "a network has spheres that move in space (3)"
            self.blame(line, f"{name} {dimensions:g}: discs, or motion in a plane", do)


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
    return numbers


def add_period(
    file: Restart, normal: Floats, left: float, right: float, shift: Floats, line: int
) -> None:
    """Note a period between two planes; `shift` (3,) leads from one to the other."""
    if not (normal.any() and shift.any()):
        file.blame(line, "a period without a direction", "write the restart file whole")
    axis = int(np.argmax(abs(normal)))
    along = np.delete(np.vstack([normal, shift / np.linalg.norm(shift)]), axis, axis=1)
    if abs(along).max() > STRAIGHT:
        file.blame(line, "the period is angled", "only periods along x, y, z are known")
    file.periodic[axis] = True
    file.low[axis], file.high[axis] = left, right
