"""Find which spheres a LAMMPS or LIGGGHTS script does not let move freely at the step of a dump.

The spheres of a network move and turn freely. A script may differ from that in two ways: by fixes
that hold spheres (setforce, freeze, move, ...), and by integrating only some of the spheres (`fix
ID GROUP nve/sphere`), or all without their rotations (`fix nve`).

The run that wrote the dump decides. The fixes that hold spheres are those during this run. Which
spheres are integrated is read from the last run, up to this one, that integrates any: scripts often
end with the integrating fix removed and with `run 0`, which moves nothing. Such a run does not show
which spheres are integrated; nor does a script that only reads a state and dumps it, nor a `run 0`
with rigid bodies alone.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from modal.exchange.groups import Groups
from modal.exchange.text import Refusal
from modal.tools.arrays import Ints

ACCELERATED = re.compile("/(omp|kk|kk/host|kk/device|intel|opt|gpu)$")
"""Endings of styles with the same effect as the styles without these endings."""
INTEGRATING = re.compile(r"(nve|nvt|npt|nph|nvk|brownian)(/.*)?")
"""Fixes that move atoms by the forces on them."""
TURNING = {"sphere", "asphere", "body", "superquadric", "nonspherical"}
"""Parts of the names of integrating fixes that also turn atoms by the torques on them."""
NOT_FREE = ("nve/noforce", "nve/manifold/rattle")
"""Fixes that are named like an integrating fix but do not move atoms freely."""
REASON = "only packings whose spheres all move freely are known"
REMEDY = (
    "let fix ID all nve/sphere move them, unfix what holds some, and dump again, or type --pair "
    "and --wall in place of --log, which takes all as free"
)


class Fix(NamedTuple):
    """A fix of a script.

    group: its group. style: its style without an accelerated variant. words: its words after the
    style. place: file and line, for messages.
    """

    group: str
    style: str
    words: tuple[str, ...]
    place: str

    @property
    def is_rigid(self) -> bool:
        """Tell whether the fix moves rigid bodies."""
        return self.style.split("/")[0] == "rigid"

    @property
    def integrates(self) -> bool:
        """Tell whether the fix moves single atoms by the forces on them."""
        return INTEGRATING.fullmatch(self.style) is not None and self.style not in NOT_FREE

    @property
    def turns(self) -> bool:
        """Tell whether the fix also turns the atoms that it moves."""
        return self.is_rigid or not TURNING.isdisjoint(self.style.split("/"))


@dataclass
class Run:
    """One run of a script.

    Attributes
    ----------
    fixes : mapping
        The fixes during the run, by their IDs.
    dumps : bool
        Whether the script could write a dump during the run.
    length : int
        Number of steps, 0 if it is not known.
    steps : list of int
        Steps that were printed.
    atoms : dict
        Numbers of atoms that were printed, by step.
    is_over : bool
        Whether the run came to its end.
    """

    fixes: Mapping[str, Fix]
    dumps: bool
    length: int
    steps: list[int] = field(default_factory=list)
    atoms: dict[int, int] = field(default_factory=dict)
    is_over: bool = False

    def includes(self, step: int) -> bool:
        """Tell whether the run went through a step, as far as steps were printed."""
        if not self.steps:
            return False
        return self.steps[0] <= step and (step <= self.steps[-1] or not self.is_over)

    @property
    def shows_integration(self) -> bool:
        """Tell whether the run shows which atoms the script integrates."""
        if any(fix.integrates for fix in self.fixes.values()):
            return True
        return self.length > 0 and any(fix.is_rigid for fix in self.fixes.values())


class Hold(NamedTuple):
    """How a fix holds spheres: a description, and whether components that are NULL stay free."""

    description: str
    by_component: bool = False


HOLDING: Mapping[str, Hold] = {
    "freeze": Hold("frozen spheres"),
    "setforce": Hold("spheres whose forces it sets", by_component=True),
    "aveforce": Hold("spheres that it gives one force", by_component=True),
    "move": Hold("spheres that it moves itself"),
    "spring": Hold("spheres that it ties to a point or to others"),
    "spring/self": Hold("spheres that it ties to their places"),
    "spring/rg": Hold("spheres that it ties to others"),
    "smd": Hold("spheres that it ties to a point or to others"),
    "drag": Hold("spheres that it pulls to a point"),
    "enforce2d": Hold("spheres that it keeps in a plane"),
    "planeforce": Hold("spheres that it keeps in a plane"),
    "lineforce": Hold("spheres that it keeps on a line"),
    "manifoldforce": Hold("spheres that it keeps on a surface"),
    "nve/manifold/rattle": Hold("spheres that it keeps on a surface"),
    "shake": Hold("spheres whose distances it keeps"),
    "rattle": Hold("spheres whose distances it keeps"),
}
"""Fixes that hold atoms, by their styles."""


def describe_held_spheres(fix: Fix) -> str:
    """Return a description of the spheres that a fix holds; empty if it holds none."""
    if fix.style in HOLDING:
        hold = HOLDING[fix.style]
        components = fix.words[:3]
        if hold.by_component and all(word.upper() == "NULL" for word in components):
            return ""
        return hold.description
    if fix.integrates and "disc" in fix.words:
        return "discs"
    if fix.is_rigid and "off" in fix.words:
        return "bodies that it holds (off)"
    return ""


def find_runs_of_dump(runs: Sequence[Run], step: int) -> list[int]:
    """Return the indices of the runs that may have written a step; the last run if none is known.

    The last step of one run is the first step of the next. Of two such runs the first one that
    could dump has written the step; if the log shows no dump, the later run has. Several runs are
    left where `reset_timestep` lets steps be counted again.
    """
    candidates = [k for k, run in enumerate(runs) if run.includes(step)]
    dumping = [k for k in candidates if runs[k].dumps]
    if not candidates:
        return [len(runs) - 1]
    if dumping:
        return [k for k in dumping if k - 1 not in dumping or not _is_boundary(runs, k, step)]
    return [k for k in candidates if k + 1 not in candidates or not _is_boundary(runs, k + 1, step)]


def _is_boundary(runs: Sequence[Run], k: int, step: int) -> bool:
    """Tell whether a step is the last one of the run before run k, and the first one of run k."""
    return runs[k - 1].steps[-1] == step == runs[k].steps[0]


class Motion(NamedTuple):
    """Refusals if some spheres of a dump are held, or do not turn freely."""

    held: Refusal | None = None
    unturned: Refusal | None = None

    def refuse_held(self) -> None:
        """Raise InputError if some spheres do not move freely."""
        if self.held:
            self.held.raise_error()

    def refuse_unturned(self) -> None:
        """Raise InputError if some spheres do not turn freely."""
        if self.unturned:
            self.unturned.raise_error()


def find_motion(
    runs: Sequence[Run],
    history: Sequence[Sequence[str]],
    step: int,
    columns: Mapping[str, Ints],
    count: int,
) -> Motion:
    """Return how the spheres of a dump move, from the runs and the groups of a log.

    Parameters
    ----------
    runs : sequence of Run
        The runs of the log.
    history : sequence of words
        Lines of the log that define groups or create atoms.
    step : int
        Step of the dump.
    columns : mapping
        Columns (n,) of the dump that groups refer to: id, type, mol.
    count : int
        Number of spheres in the dump.
    """
    if not runs:
        return Motion()
    motions = [
        _find_motion_in_run(runs, index, history, columns, count)
        for index in find_runs_of_dump(runs, step)
    ]
    for motion in motions:
        if motion.held:
            return motion
    for motion in motions:
        if motion.unturned:
            return motion
    return Motion()


def _find_motion_in_run(
    runs: Sequence[Run],
    index: int,
    history: Sequence[Sequence[str]],
    columns: Mapping[str, Ints],
    count: int,
) -> Motion:
    """Return how the spheres of a dump move if this run wrote it; arguments as `find_motion`."""
    informing = [run for run in runs[: index + 1] if run.shows_integration]
    fixes_at_dump = runs[index].fixes
    holding = {name: fix for name, fix in fixes_at_dump.items() if describe_held_spheres(fix)}
    movers: dict[str, Fix] = {}
    if informing:
        for name, fix in informing[-1].fixes.items():
            if fix.integrates or fix.is_rigid:
                movers[name] = fix
    names = {fix.group for fix in (*holding.values(), *movers.values())} - {"all"}
    groups = Groups.from_history(history, columns, count, names)
    for name in names:
        groups.possible_members(name)
    for name, fix in holding.items():
        if groups.may_contain_atoms(groups.possible_members(fix.group)):
            held = f"{describe_held_spheres(fix)} (fix {name}, group {fix.group})"
            return Motion(held=_refusal(fix.place, f"fix {fix.style} has {held}"))
    if not movers:
        return Motion()
    return _check_coverage(groups, movers)


def _check_coverage(groups: Groups, movers: Mapping[str, Fix]) -> Motion:
    """Return whether fixes that move atoms move all of them, and turn all of them."""
    moved = np.zeros_like(groups.possible)
    turned = np.zeros_like(groups.possible)
    for fix in movers.values():
        members = groups.possible_members(fix.group)
        moved = moved | members
        if fix.turns:
            turned = turned | members
    place = next(iter(movers.values())).place
    listed = ", ".join(f"fix {name} {fix.group} {fix.style}" for name, fix in movers.items())
    if groups.may_contain_atoms(~moved):
        problem = f"{listed} does not move all spheres, as far as the log shows"
        return Motion(held=_refusal(place, problem))
    if groups.may_contain_atoms(~turned):
        return Motion(unturned=_refusal(place, f"{listed} does not turn all spheres"))
    return Motion()


def _refusal(place: str, problem: str) -> Refusal:
    """Return the refusal of spheres that are held."""
    return Refusal(place, "held_bodies", problem, REASON, REMEDY)
