"""Which spheres a script of LAMMPS or LIGGGHTS does not let move freely at the step of a dump.

A network has spheres that move and turn freely. A script tells otherwise in two ways: by fixes that
hold (setforce, freeze, move, ...), and by integrating a part of the spheres alone (`fix ID GROUP
nve/sphere`), or all without their rotations (`fix nve`).

What counts is the run that wrote the dump. Its holding fixes count as they are. Who is integrated
is asked of the last run, up to there, that integrates anybody: scripts often end with the fix taken
away and `run 0`, which moves nobody and says nothing, as does a script that only reads a state and
dumps it. Nor does a `run 0` with rigid bodies alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from modal.exchange.groups import Groups
from modal.tools.arrays import Ints
from modal.tools.errors import InputError

ACCELERATED = re.compile("/(omp|kk|kk/host|kk/device|intel|opt|gpu)$")
"""Ends of styles that do the same as those without."""
INTEGRATING = re.compile(r"(nve|nvt|npt|nph|nvk|brownian)(/.*)?")
"""Fixes that move atoms by the forces on them; `TURNING` ones turn them, too."""
TURNING = {"sphere", "asphere", "body", "superquadric", "nonspherical"}
NOT_FREE = ("nve/noforce", "nve/manifold/rattle")
"""Fixes named like those, which do not move atoms freely."""
REMEDY = (
    "only packings whose spheres all move freely are known: let fix ID all nve/sphere move them, "
    "unfix what holds some, and dump again, or type --pair and --wall in place of --log, which "
    "takes all as free"
)


class Fix(NamedTuple):
    """A fix: its group, its style without an accelerated variant, its words, its place in a log."""

    group: str
    style: str
    words: tuple[str, ...]
    where: str

    @property
    def rigid(self) -> bool:
        """Whether it moves rigid bodies."""
        return self.style.split("/")[0] == "rigid"

    @property
    def integrates(self) -> bool:
        """Whether it moves single atoms by their forces."""
        return INTEGRATING.fullmatch(self.style) is not None and self.style not in NOT_FREE

    @property
    def turns(self) -> bool:
        """Whether it turns what it moves."""
        return self.rigid or not TURNING.isdisjoint(self.style.split("/"))


@dataclass
class Run:
    """One run: the fixes while it went on, its steps that were printed, whether it could dump.

    `length` is its number of steps, as far as that is said; `over` whether it came to its end.
    """

    fixes: Mapping[str, Fix]
    dumps: bool
    length: int
    steps: list[int] = field(default_factory=list)
    over: bool = False

    def has(self, step: int) -> bool:
        """Whether it went through a step, as far as steps were printed."""
        if not self.steps:
            return False
        return self.steps[0] <= step and (step <= self.steps[-1] or not self.over)

    @property
    def informs(self) -> bool:
        """Whether it tells who is integrated."""
        if any(fix.integrates for fix in self.fixes.values()):
            return True
        return self.length > 0 and any(fix.rigid for fix in self.fixes.values())


def _some_component(words: Sequence[str]) -> bool:
    return any(word.upper() != "NULL" for word in words[:3])


def _always(words: Sequence[str]) -> bool:
    return True


HOLDING: Mapping[str, tuple[str, Callable[[Sequence[str]], bool]]] = {
    "freeze": ("frozen spheres", _always),
    "setforce": ("spheres whose forces it sets", _some_component),
    "aveforce": ("spheres that it gives one force", _some_component),
    "move": ("spheres that it moves itself", _always),
    "spring": ("spheres that it ties to a point or to others", _always),
    "spring/self": ("spheres that it ties to their places", _always),
    "spring/rg": ("spheres that it ties to others", _always),
    "smd": ("spheres that it ties to a point or to others", _always),
    "drag": ("spheres that it pulls to a point", _always),
    "enforce2d": ("spheres that it keeps in a plane", _always),
    "planeforce": ("spheres that it keeps in a plane", _always),
    "lineforce": ("spheres that it keeps on a line", _always),
    "manifoldforce": ("spheres that it keeps on a surface", _always),
    "nve/manifold/rattle": ("spheres that it keeps on a surface", _always),
    "shake": ("spheres whose distances it keeps", _always),
    "rattle": ("spheres whose distances it keeps", _always),
}
"""Fixes that hold atoms: whom, and whether they do with these words."""


def _holds(fix: Fix) -> str:
    """Return whom a fix holds, or nothing."""
    if fix.style in HOLDING:
        whom, acts = HOLDING[fix.style]
        return whom if acts(fix.words) else ""
    if fix.integrates and "disc" in fix.words:
        return "discs"
    if fix.rigid and "off" in fix.words:
        return "bodies that it holds (off)"
    return ""


def run_of_dump(runs: Sequence[Run], step: int) -> int:
    """Return the index of the run that wrote a step, the last one where none is known to.

    The last step of one run is the first of the next: the first that could dump has written it,
    or, where the log shows no dump, the later one.
    """
    candidates = [k for k, run in enumerate(runs) if run.has(step)]
    dumping = [k for k in candidates if runs[k].dumps]
    if dumping:
        return dumping[0]
    return candidates[-1] if candidates else len(runs) - 1


class Motion(NamedTuple):
    """What a script says of the motion of its spheres: texts why some do not move, or turn, freely.

    Empty where they do.
    """

    held: str = ""
    unturned: str = ""

    def refuse(self, *, turning_counts: bool) -> None:
        """Raise InputError where spheres do not move freely, or, if that counts, do not turn."""
        why = self.held
        if turning_counts:
            why = why or self.unturned
        if why:
            raise InputError("held_bodies", why)


def motion_of(
    runs: Sequence[Run],
    history: Sequence[Sequence[str]],
    step: int,
    columns: Mapping[str, Ints],
    count: int,
) -> Motion:
    """Return how the spheres of a dump move, by the runs and the groups of a log.

    `columns` (n,) are those of the dump that groups ask for: id, type, mol; `count` its spheres.
    """
    if not runs:
        return Motion()
    written = run_of_dump(runs, step)
    informing = [run for run in runs[: written + 1] if run.informs]
    holding = {name: fix for name, fix in runs[written].fixes.items() if _holds(fix)}
    movers: dict[str, Fix] = {}
    if informing:
        fixes = informing[-1].fixes.items()
        movers = {name: fix for name, fix in fixes if fix.integrates or fix.rigid}
    names = {fix.group for fix in (*holding.values(), *movers.values())} - {"all"}
    groups = Groups.of_history(history, columns, count, names)
    for name in names:
        groups.of(name)
    for name, fix in holding.items():
        if groups.inhabited(groups.of(fix.group)):
            what = f"fix {fix.style}: {_holds(fix)} (fix {name}, group {fix.group})"
            return Motion(f"{fix.where}: {what}; {REMEDY}")
    if not movers:
        return Motion()
    return _coverage(groups, movers)


def _coverage(groups: Groups, movers: Mapping[str, Fix]) -> Motion:
    """Return whether fixes that move atoms move, and turn, all of them."""
    moved = np.zeros_like(groups.possible)
    turned = np.zeros_like(groups.possible)
    for fix in movers.values():
        moved = moved | groups.of(fix.group)
        if fix.turns:
            turned = turned | groups.of(fix.group)
    where = next(iter(movers.values())).where
    listed = ", ".join(f"fix {name} {each.group} {each.style}" for name, each in movers.items())
    if groups.inhabited(~moved):
        return Motion(f"{where}: {listed} does not move all spheres (as far as is told); {REMEDY}")
    if groups.inhabited(~turned):
        return Motion("", f"{where}: {listed} does not turn all spheres; {REMEDY}")
    return Motion()
