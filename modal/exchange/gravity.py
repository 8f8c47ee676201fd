"""Read the gravity of a script of LAMMPS or LIGGGHTS: `fix ID GROUP gravity`."""

from collections.abc import Sequence

import numpy as np

from modal.exchange.held import Fix, Run, find_runs_of_dump
from modal.exchange.law import Units
from modal.tools.arrays import Floats

STYLE = "gravity"


def find_gravity(runs: Sequence[Run], step: int, units: Units) -> tuple[Floats | None, list[str]]:
    """Return the acceleration (3,), m/s^2, in the run that wrote a dump, and remarks on it.

    The acceleration is None if there is no such fix, or if it cannot be read: the fix uses a
    variable or a direction that is not known here, or two runs differ.
    """
    if not runs:
        return None, []
    totals = []
    remarks = []
    for index in find_runs_of_dump(runs, step):
        fixes = [fix for fix in runs[index].fixes.values() if fix.style == STYLE]
        accelerations = [acceleration_of(fix.words) for fix in fixes]
        known = [acceleration for acceleration in accelerations if acceleration is not None]
        if not fixes:
            totals.append(np.zeros(3))
        elif len(known) == len(fixes):
            totals.append(np.sum(known, axis=0))
        remarks += [_remark(fix) for fix in fixes if fix.group != "all"]
        if len(known) < len(fixes):
            remarks.append("the gravity of the log is not known; give it with --gravity")
    if not totals or not np.array_equal(totals[0], totals[-1]) or not totals[0].any():
        return None, remarks
    return totals[0] * units.length / units.time**2, remarks


def _remark(fix: Fix) -> str:
    """Return the remark on a gravity that acts on a group of the spheres."""
    return f"gravity of the group {fix.group} ({fix.place}) is taken as that of all free spheres"


def acceleration_of(words: Sequence[str]) -> Floats | None:
    """Return the acceleration (3,) in units of the script; None if it cannot be read.

    >>> acceleration_of(["9.81", "vector", "0", "0", "-2"])
    array([ 0.  ,  0.  , -9.81])
    """
    try:
        size = float(words[0])
        numbers = np.array(words[2:5], float)
    except (ValueError, IndexError):
        return None
    direction = np.zeros(3)
    match words[1], len(numbers):
        case "vector", 3:
            direction = numbers
        case "chute", 1:
            # An incline: the angle from -z towards +x.
            angle = np.radians(numbers[0])
            direction = np.array([np.sin(angle), 0.0, -np.cos(angle)])
        case "spherical", 2:
            azimuth, polar = np.radians(numbers)
            direction = np.array(
                [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
            )
    length = float(np.linalg.norm(direction))
    if not length > 0:
        return None
    acceleration: Floats = size * direction / length
    return acceleration
