"""Find which atoms may be in the groups that a script of LAMMPS or LIGGGHTS defines.

A log shows how groups are defined by other groups, types and atom numbers, and how many atoms each
has, but not which atoms are in a region. So groups are sets of *possible atoms*. A possible atom is
one combination of answers to the questions that distinguish the groups: is the atom of type 2, is
it in the region `slab`, was it inserted later. Each new question doubles the possible atoms. The
dump answers questions about types and numbers, so that only the combinations that some atom has
remain; a printed count of none or of all atoms excludes more. A statement that is true of all
possible atoms is true of all atoms, whatever the regions contain: for example, a group and its
complement together contain all atoms.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Bools, Ints
from modal.tools.errors import InputError

MAX_QUESTIONS = 16
"""Largest number of questions about atoms: there are at most two to this power possible atoms."""
COLUMNS = {"type": "type", "id": "id", "molecule": "mol"}
"""Columns of a dump that decide whether an atom belongs to a group of these `group` styles."""
COMBINING_STYLES = ("union", "subtract", "intersect")
"""Styles of `group` whose arguments are names of other groups."""
CREATING = {"read_data", "read_restart", "create_atoms", "Created"}
"""First words of lines of a log that create atoms at once, or report it."""
COMPARISONS: Mapping[str, Callable[[Ints, int], Bools]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


class Answer(NamedTuple):
    """An answered question: possible atoms and atoms (n,) of the dump whose answer is yes."""

    of_possible_atoms: Bools
    of_atoms: Bools


class Groups:
    """The groups after the commands of a log, as sets of possible atoms.

    `columns` holds those of the columns id, type and mol (n,) that the dump has; `count` is its
    number of atoms.
    """

    def __init__(self, columns: Mapping[str, Ints], count: int) -> None:
        self.columns = columns
        self.count = count
        self.possible: Bools = np.ones(1, bool)
        self.members: dict[str, Bools] = {}
        self.answers: dict[str, Answer] = {}
        self.later: list[Bools] = []  # possible atoms that came by one command or fix each
        self.growing: set[str] = set()
        self.questions = 0

    @classmethod
    def from_history(
        cls,
        history: Sequence[Sequence[str]],
        columns: Mapping[str, Ints],
        count: int,
        names: Iterable[str],
    ) -> Groups:
        """Return the groups with these names after all lines of a history.

        Raises InputError if the groups depend on too many regions and types.
        """
        groups = cls(columns, count)
        relevant = _find_parts(history, names)
        for words in history:
            if words[0] != "group" or words[1] in relevant:
                groups._follow(words)
        creates_at_once = any(words[0] in CREATING for words in history)
        if groups.later and not creates_at_once:
            # All atoms were inserted.
            groups.possible &= np.logical_or.reduce(groups.later)
        return groups

    def possible_members(self, name: str) -> Bools:
        """Return the possible atoms in a group; any atom may be in a group without definition."""
        if name == "all":
            return np.ones(len(self.possible), bool)
        if name not in self.members:
            self.members[name] = self._add_question()
        return self.members[name]

    def may_contain_atoms(self, chosen: Bools) -> bool:
        """Tell whether any atom of the dump may be one of the `chosen` possible atoms."""
        key_of_likely, key_of_atom = self._keys(np.flatnonzero(chosen & self.possible))
        return bool(np.isin(key_of_likely, key_of_atom).any())

    def of_dumped_atoms(self, values: Bools) -> Bools | None:
        """Return values (n, k) for the atoms of the dump from values (p, k) for possible atoms.

        The result is None if, for some atom, the log leaves several different values possible.
        """
        likely = np.flatnonzero(self.possible)
        key_of_likely, key_of_atom = self._keys(likely)
        order = np.argsort(key_of_likely, kind="stable")
        first = np.searchsorted(key_of_likely[order], key_of_atom)
        last = np.searchsorted(key_of_likely[order], key_of_atom, side="right")
        # Sums of values up to each possible atom tell whether all between two have the same.
        sums = np.zeros((len(likely) + 1, values.shape[1]), int)
        np.cumsum(values[likely][order], axis=0, out=sums[1:])
        count = sums[last] - sums[first]
        total = (last - first)[:, None]
        if not ((count == 0) | (count == total)).all():
            return None
        return count > 0

    def _keys(self, likely: Ints) -> tuple[Ints, Ints]:
        """Return a number that encodes all answers, for each likely possible atom and each atom."""
        key_of_likely = np.zeros(len(likely), int)
        key_of_atom = np.zeros(self.count, int)
        for k, answer in enumerate(self.answers.values()):
            key_of_likely += answer.of_possible_atoms[likely].astype(int) << k
            key_of_atom += answer.of_atoms.astype(int) << k
        return key_of_likely, key_of_atom

    def _add_question(self) -> Bools:
        """Double the possible atoms by a new question; return those whose answer is yes."""
        if self.questions >= MAX_QUESTIONS:
            raise InputError(
                "held_bodies",
                f"the groups of the script depend on more than {MAX_QUESTIONS} regions and types",
                "which spheres it holds cannot be determined",
                "let it move all of them alike",
            )
        self.questions += 1
        size = len(self.possible)
        self.possible = _double(self.possible)
        self.members = {name: _double(flags) for name, flags in self.members.items()}
        self.later = [_double(flags) for flags in self.later]
        for name, answer in self.answers.items():
            doubled = _double(answer.of_possible_atoms)
            self.answers[name] = answer._replace(of_possible_atoms=doubled)
        return np.arange(2 * size) >= size

    def _follow(self, words: Sequence[str]) -> None:
        """Apply a command to the groups, or use a printed number of atoms."""
        match words:
            case ["group", name, style, *rest]:
                self._define(name, style, rest)
            case [number, "atoms", "in", "group", name] if number.isdigit():
                self._apply_count(name, int(number))
            case ["read_data" | "create_atoms" | "read_dump", *rest] if self.members:
                joined_groups = []
                if "group" in rest:
                    first = rest.index("group") + 1
                    joined_groups = rest[first : first + 1]
                self._add_atoms(joined_groups)
            case ["fix", name, group, *_]:
                self._add_atoms([group])
                self.growing.add(name)
            case ["unfix", name]:
                self.growing.discard(name)

    def _add_atoms(self, groups: Sequence[str]) -> None:
        """Add newly created atoms, which belong to these groups from the start."""
        for group in groups:
            self.possible_members(group)
        later = self._add_question()
        self.possible |= later
        for others in self.later:
            self.possible &= ~(later & others)
        for name in self.members:
            self.members[name] &= ~later
            if name in groups:
                self.members[name] |= later
        self.later.append(later)

    def _define(self, name: str, style: str, words: Sequence[str]) -> None:
        """Apply a `group` command of the given style."""
        match style:
            case "delete":
                self.members.pop(name, None)
                self.answers.pop(name, None)
            case "clear":
                self.answers.pop(name, None)
                self.members[name] = np.zeros(len(self.possible), bool)
            case "static":
                return
            case "empty":
                self._add_members(name, np.zeros(len(self.possible), bool))
            case "union" | "subtract" | "intersect":
                self._add_members(name, self._combine(style, words))
            case _:
                chosen = self._add_question()
                of_atoms = self._answer(style, words)
                if of_atoms is not None and name not in self.members:
                    self.answers[name] = Answer(chosen, of_atoms)
                self._add_members(name, chosen)

    def _add_members(self, name: str, chosen: Bools) -> None:
        """Add possible atoms to a group, which may be new."""
        if name in self.members:
            chosen = self.members[name] | chosen
        self.members[name] = chosen

    def _combine(self, style: str, names: Sequence[str]) -> Bools:
        """Return the union, the difference or the intersection of groups."""
        for name in names:
            self.possible_members(name)  # new questions double all, so they come first
        parts = [self.possible_members(name) for name in names]
        if style == "union":
            return np.logical_or.reduce(parts)
        if style == "intersect":
            return np.logical_and.reduce(parts)
        subtracted = np.logical_or.reduce([*parts[1:], ~parts[0]])
        return parts[0] & ~subtracted

    def _answer(self, style: str, words: Sequence[str]) -> Bools | None:
        """Return which atoms (n,) of the dump a `group` command by type or number selects, or None.

        While atoms are inserted, it is unknown which of them existed when the group was defined.
        """
        column = self.columns.get(COLUMNS.get(style, ""))
        if column is None or self.growing or not words:
            return None
        try:
            if words[0] in COMPARISONS:
                return COMPARISONS[words[0]](column, int(words[1]))
            if words[0] == "<>":
                return (column >= int(words[1])) & (column <= int(words[2]))
            chosen = np.zeros(len(column), bool)
            for word in words:
                chosen |= _is_in_range(column, word)
        except (ValueError, IndexError):
            return None
        return chosen

    def _apply_count(self, name: str, number: int) -> None:
        """Exclude possible atoms, if the printed size of a group is none or all of the atoms."""
        if name not in self.members:
            return
        if name in self.answers and number != self.answers[name].of_atoms.sum():
            del self.answers[name]  # types have changed, or atoms have come or gone
        if number == 0:
            self.possible &= ~self.members[name]
        elif number == self.count:
            self.possible &= self.members[name]


def _double(flags: Bools) -> Bools:
    """Repeat the flags of possible atoms, once for each answer to a new question."""
    return np.concatenate([flags, flags])


def _is_in_range(column: Ints, word: str) -> Bools:
    """Tell which numbers (n,) are in a range FIRST, FIRST:LAST or FIRST:LAST:STEP.

    Raises ValueError if the word is not a range.
    """
    numbers = [int(number) for number in word.split(":")]
    first, last, step = (numbers + [0, 0])[:3]
    last = max(first, last)
    step = max(step, 1)
    return (column >= first) & (column <= last) & ((column - first) % step == 0)


def _find_parts(history: Sequence[Sequence[str]], names: Iterable[str]) -> set[str]:
    """Return the named groups and all groups that their definitions use."""
    relevant = set(names)
    size = 0
    while len(relevant) > size:
        size = len(relevant)
        for words in history:
            if words[0] == "group" and words[1] in relevant and words[2] in COMBINING_STYLES:
                relevant |= set(words[3:])
    return relevant
