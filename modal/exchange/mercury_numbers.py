"""MercuryDPM's files of `restart_version 2`: numbers in a fixed order, springs behind their sphere.

Their shear springs are not read: contacts follow from the positions.
"""

from __future__ import annotations

import numpy as np

from modal.exchange.mercury_restart import Restart, add_period, named
from modal.exchange.program_law import FORCE, ProgramLaw


def read_numbers(file: Restart, lines: list[str]) -> None:
    """`restart_version 2`: numbers in a fixed order; springs stand behind their sphere."""
    section, left = "", 0
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words:
            continue
        if words[0] in ("Species", "Walls", "WallsPeriodic", "Particles"):
            section, left = words[0], int(named(file, words, words[0], number)[0])
        elif words[0] == "xmin":
            for axis, name in enumerate("xyz"):
                file.low[axis] = named(file, words, f"{name}min", number)[0]
                file.high[axis] = named(file, words, f"{name}max", number)[0]
        elif left > 0:
            left -= 1
            _old_line(file, section, words, number)
    if left > 0:
        what = f"{left} {section} fewer than announced: the file ends early"
        file.blame(len(lines), what, "write it whole")


def _old_line(file: Restart, section: str, words: list[str], line: int) -> None:
    if section == "Species":
        friction = named(file, words, "mu", line)[0] if "mu" in words else 0.0
        tangential = named(file, words, "kt", line)[0] if "kt" in words else 0.0
        stiffness = named(file, words, "k", line)[0]
        if "dim_particle" in words:
            file.refuse_flat("dim_particle", named(file, words, "dim_particle", line)[0], line)
        kind = len(file.laws)
        file.laws[kind, kind] = ProgramLaw(stiffness, False, tangential, False, friction, FORCE)
    elif section == "Walls":
        count = int(named(file, words, "numFiniteWalls", line)[0])
        if count:
            file.blame(line, "a finite wall", "only infinite walls at low and high z are known")
        normal = np.array(named(file, words, "normal", line, 3))
        if not normal.any():
            file.blame(line, "a wall without a direction", "write the restart file whole")
        normal /= np.linalg.norm(normal)
        place = named(file, words, "position", line)[0]
        file.walls[len(file.walls)] = (normal, place, 0, "InfiniteWall")
    elif section == "WallsPeriodic":
        normal, shift = (
            np.array(named(file, words, name, line, 3)) for name in ("normal", "shift")
        )
        left = named(file, words, "pos_left", line)[0]
        right = named(file, words, "pos_right", line)[0]
        add_period(file, normal, left, right, shift, line)
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
