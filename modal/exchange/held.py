"""Find which motions a LAMMPS or LIGGGHTS script takes from spheres at the step of a dump.

A script holds spheres in two ways: by fixes (setforce, freeze, move, ...), and by integrating only
some of the spheres (`fix ID GROUP nve/sphere`), or by not integrating rotations (`fix nve`). Held
motions go to the column `fixed` of a network. Fixes that do more than hold, such as springs to
fixed places, cannot be stored in a network and are refused.

Only the run that wrote the dump matters: the fixes of this run hold the spheres. The integrated
spheres are read from the last run, up to this one, that integrates any: scripts often remove the
integrating fix and end with `run 0`, which moves nothing and does not show which spheres are
integrated. Nor is it shown by a script that only reads a state and dumps it, or by a `run 0` with
rigid bodies alone.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from modal.exchange.groups import Groups
from modal.exchange.refusals import refuse
from modal.tools.arrays import Bools, Ints

ACCELERATED = re.compile("/(omp|kk|kk/host|kk/device|intel|opt|gpu)$")
"""Endings of styles with the same effect as the styles without these endings."""
INTEGRATING = re.compile(r"(nve|nvt|npt|nph|nvk|brownian)(/.*)?")
"""Fixes that move atoms by the forces on them."""
TURNING = {"sphere", "asphere", "body", "superquadric", "nonspherical"}
"""Parts of the names of integrating fixes that also turn atoms by the torques on them."""
NOT_FREE = ("nve/noforce", "nve/manifold/rattle")
"""Fixes that are named like an integrating fix but do not move atoms freely."""
UNKNOWN_MEMBERS = "which spheres of the dump are in it is not known from the log"
MAKE_GROUPS_BY_NUMBER = (
    "make its groups by type or id, and dump these; or type --pair and --wall in place of --log, "
    "which takes all spheres as free"
)
NO_PLACE = "a network has nothing for it"
UNFIX = "unfix it and dump again"


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
        """Tell whether the run included a step, as far as its printed steps show."""
        if not self.steps:
            return False
        return self.steps[0] <= step and (step <= self.steps[-1] or not self.is_over)

    @property
    def shows_integration(self) -> bool:
        """Tell whether the run shows which atoms the script integrates."""
        if any(fix.integrates for fix in self.fixes.values()):
            return True
        return self.length > 0 and any(fix.is_rigid for fix in self.fixes.values())


ALL_MOTIONS = np.ones(6, bool)
TURNS = np.array([False, False, False, True, True, True])
IN_PLANE = np.array([False, False, True, True, True, False])
"""Motions that are held in a plane across z: along z, and turns about x and y."""

MotionsOf = Callable[[Sequence[str]], Bools | None]
"""Function of the words of a fix that returns the motions (6,) that it holds: along x, y, z, and
turns about them. None for words with which the fix does more than to hold."""


def _components_of_zero(words: Sequence[str]) -> Bools | None:
    """Return the motions that `setforce` holds: components of zero; those that are NULL are free.

    A component other than zero moves spheres or is unknown: it holds nothing. Torques are not set.
    """
    held = np.zeros(6, bool)
    for axis, word in enumerate(words[:3]):
        if word.upper() == "NULL":
            continue
        try:
            held[axis] = float(word) == 0
        except ValueError:
            return None
        if not held[axis]:
            return None
    return held


def _moved(words: Sequence[str]) -> Bools | None:
    """Return the motions that `move` prescribes; components that are NULL are not known.

    Only `rotate` and `transrot` set the turns, too.
    """
    if "NULL" in words:
        return None
    if words[:1] in (["rotate"], ["transrot"]):
        return ALL_MOTIONS
    return ~TURNS


def _along_axis(words: Sequence[str]) -> Bools | None:
    """Return the motion along a coordinate axis that the first three numbers give, if they do."""
    try:
        direction = np.array(words[:3], float)
    except ValueError:
        return None
    if np.count_nonzero(direction) != 1:
        return None
    return np.concatenate([direction != 0, np.zeros(3, bool)])


def _across_axis(words: Sequence[str]) -> Bools | None:
    """Return the motions across the axis given by the first three numbers."""
    along = _along_axis(words)
    if along is None:
        return None
    return ~along & ~TURNS


class Hold(NamedTuple):
    """How a fix holds spheres: a description, and the motions held; None if these are unknown."""

    description: str
    motions: MotionsOf = lambda words: None


HOLDING: Mapping[str, Hold] = {
    "freeze": Hold("frozen spheres", lambda words: ALL_MOTIONS),
    "setforce": Hold("spheres whose forces it sets", _components_of_zero),
    "aveforce": Hold("spheres that it gives one force"),
    "move": Hold("spheres that it moves itself", _moved),
    "spring": Hold("spheres that it ties to a point or to others"),
    "spring/self": Hold("spheres that it ties to their places"),
    "spring/rg": Hold("spheres that it ties to others"),
    "smd": Hold("spheres that it ties to a point or to others"),
    "drag": Hold("spheres that it pulls to a point"),
    "enforce2d": Hold("spheres that it keeps in a plane", lambda words: IN_PLANE),
    "planeforce": Hold("spheres that it keeps in a plane", _along_axis),
    "lineforce": Hold("spheres that it keeps on a line", _across_axis),
    "manifoldforce": Hold("spheres that it keeps on a surface"),
    "nve/manifold/rattle": Hold("spheres that it keeps on a surface"),
    "shake": Hold("spheres whose distances it keeps"),
    "rattle": Hold("spheres whose distances it keeps"),
}
"""Fixes that hold atoms, by their styles."""
BY_COMPONENT = ("setforce", "aveforce")
"""Fixes that leave components free which are NULL."""


def hold_of(fix: Fix) -> Hold | None:
    """Return how a fix holds spheres; None if it holds none."""
    if fix.style in HOLDING:
        is_idle = all(word.upper() == "NULL" for word in fix.words[:3])
        if fix.style in BY_COMPONENT and is_idle:
            return None
        return HOLDING[fix.style]
    if fix.integrates and "disc" in fix.words:
        return Hold("discs")
    if fix.is_rigid and "off" in fix.words:
        return Hold("bodies that it holds (off)")
    return None


def find_runs_of_dump(runs: Sequence[Run], step: int) -> list[int]:
    """Return the indices of the runs that may have written a step; the last run if none is known.

    The last step of one run is the first step of the next. Of two such runs the first one with a
    dump wrote the step; if the log shows no dump, the later run did. Several runs remain if
    `reset_timestep` restarts the count of steps.
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


class HeldMotions(NamedTuple):
    """The motions that a script takes from the spheres of a dump.

    fixed (n, 6): motions that each sphere cannot make, in the order of the dump's rows; None if all
    are free. groups: names of the groups whose spheres are all held in all motions.
    """

    fixed: Bools | None = None
    groups: frozenset[str] = frozenset()

    def fixed_motions(self, count: int) -> Bools:
        """Return which motions (count, 6) of `count` spheres are held."""
        if self.fixed is None:
            return np.zeros((count, 6), bool)
        return self.fixed


class _History(NamedTuple):
    """The part of a log that defines groups, with columns of the dump and requested groups.

    The fields are the arguments of `find_held_motions`.
    """

    lines: Sequence[Sequence[str]]
    columns: Mapping[str, Ints]
    n_spheres: int
    other_groups: tuple[str, ...]


def find_held_motions(
    runs: Sequence[Run],
    history: Sequence[Sequence[str]],
    step: int,
    columns: Mapping[str, Ints],
    count: int,
    other_groups: Iterable[str] = (),
) -> HeldMotions:
    """Return the held motions of the spheres of a dump, from the runs and the groups of a log.

    Raises InputError if a fix does more than hold spheres, if the log does not show which spheres a
    fix acts on, or if all spheres are held.

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
    other_groups : iterable of str
        Further groups to examine: are all of their spheres held?
    """
    if not runs:
        return HeldMotions()
    parts = _History(history, columns, count, tuple(other_groups))
    first, *others = [_find_in_run(runs, index, parts) for index in find_runs_of_dump(runs, step)]
    for other in others:
        if not np.array_equal(first.fixed_motions(count), other.fixed_motions(count)):
            refuse(
                "the log",
                "held_bodies",
                f"two runs have a step {step}, and hold different spheres",
                "which of them wrote the dump is not known",
                "give the part of the log that belongs to the dump",
            )
        first = first._replace(groups=first.groups & other.groups)
    return first


def _find_in_run(runs: Sequence[Run], index: int, parts: _History) -> HeldMotions:
    """Return the held motions of the spheres of a dump that the run with this index wrote."""
    informing = [run for run in runs[: index + 1] if run.shows_integration]
    holding: dict[str, Fix] = {}
    for name, fix in runs[index].fixes.items():
        if hold_of(fix):
            holding[name] = fix
    movers: dict[str, Fix] = {}
    if informing:
        for name, fix in informing[-1].fixes.items():
            if fix.integrates or fix.is_rigid:
                movers[name] = fix
    names = {fix.group for fix in (*holding.values(), *movers.values())} - {"all"}
    names |= {*parts.other_groups}
    groups = Groups.from_history(parts.lines, parts.columns, parts.n_spheres, names)
    for name in names:
        groups.possible_members(name)  # new questions double all, so they come first
    fixed = _not_integrated(groups, movers)
    for name, fix in holding.items():
        fixed |= _held_by_fix(groups, name, fix)
    fixed_spheres = groups.of_dumped_atoms(fixed)
    if fixed_spheres is None:
        listed = [f"fix {name} {fix.group} {fix.style}" for name, fix in (holding | movers).items()]
        place = next(iter((holding | movers).values())).place
        refuse(
            place,
            "held_bodies",
            f"{', '.join(listed)} acts on a part of the spheres",
            UNKNOWN_MEMBERS,
            MAKE_GROUPS_BY_NUMBER,
        )
    if parts.n_spheres and fixed_spheres.all():
        place = next(iter((holding | movers).values())).place
        refuse(
            place,
            "held_bodies",
            "no sphere of the dump is let move",
            remedy="integrate some, or type --pair and --wall in place of --log",
        )
    free = ~fixed.all(axis=1)
    held_groups = [
        name
        for name in parts.other_groups
        if not groups.may_contain_atoms(groups.possible_members(name) & free)
    ]
    if not fixed_spheres.any():
        return HeldMotions(None, frozenset(held_groups))
    return HeldMotions(fixed_spheres, frozenset(held_groups))


def _not_integrated(groups: Groups, movers: Mapping[str, Fix]) -> Bools:
    """Return the motions (p, 6) of possible atoms that no fix integrates; none without `movers`."""
    fixed = np.zeros((len(groups.possible), 6), bool)
    if not movers:
        return fixed
    moved = np.zeros_like(groups.possible)
    turned = np.zeros_like(groups.possible)
    for fix in movers.values():
        members = groups.possible_members(fix.group)
        moved = moved | members
        if fix.turns:
            turned = turned | members
    fixed[~turned] = TURNS
    fixed[~moved] = ALL_MOTIONS
    return fixed


def _held_by_fix(groups: Groups, name: str, fix: Fix) -> Bools:
    """Return the motions (p, 6) of possible atoms that a fix holds.

    Raises InputError if the fix does more than hold spheres.
    """
    hold = hold_of(fix)
    members = groups.possible_members(fix.group)
    held = np.zeros((len(groups.possible), 6), bool)
    if hold is None or not groups.may_contain_atoms(members):
        return held
    motions = hold.motions(fix.words)
    if motions is None:
        refuse(
            fix.place,
            "held_bodies",
            f"fix {fix.style} has {hold.description} (fix {name}, group {fix.group})",
            NO_PLACE,
            UNFIX,
        )
    held[members] = motions
    return held
