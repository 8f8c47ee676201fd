"""Groups of atoms that a script of LAMMPS or LIGGGHTS defines: who may be in which.

A log tells how groups are made of each other, of types and numbers, and how many atoms each has,
but not who is in a region. So groups are sets of *possible atoms*: a possible atom is one
combination of answers to the questions that tell groups apart (is it of type 2, is it in the
region slab, was it inserted later). Each new question doubles them. Questions about types and
numbers are answered by the dump, which leaves the combinations that some atom has; a printed count
of none or of all atoms leaves out more. What holds for all possible atoms holds for all atoms,
whoever is in the regions: a group and its complement cover all.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from modal.tools.arrays import Bools, Ints
from modal.tools.errors import InputError

MAX_QUESTIONS = 16
"""Possible atoms are two to this power at most."""
COLUMNS = {"type": "type", "id": "id", "molecule": "mol"}
"""Styles of `group` whose question a column of the dump answers."""
MADE_OF_OTHERS = ("union", "subtract", "intersect")
"""Styles whose words are names of groups."""
CREATING = {"read_data", "read_restart", "create_atoms", "Created"}
"""First words of lines of a log that make atoms at once, or say so."""
COMPARISONS: Mapping[str, Callable[[Ints, int], Bools]] = {
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


class Groups:
    """The groups after the commands of a log, as sets of possible atoms.

    `columns` (n,) are those of the dump, by their names: id, type, mol, as far as they are there.
    """

    def __init__(self, columns: Mapping[str, Ints], count: int) -> None:
        self.columns = columns
        self.count = count
        self.possible: Bools = np.ones(1, bool)
        self.members: dict[str, Bools] = {}
        self.answers: dict[str, tuple[Bools, Bools]] = {}  # of possible atoms, of the dump's
        self.later: list[Bools] = []  # possible atoms that came by one command or fix each
        self.growing: set[str] = set()
        self.questions = 0

    @classmethod
    def of_history(
        cls,
        history: Sequence[Sequence[str]],
        columns: Mapping[str, Ints],
        count: int,
        names: Iterable[str],
    ) -> Groups:
        """Return the groups after the commands and printed counts of a log, in their order.

        Of these `names`, and those that they are made of.
        """
        groups = cls(columns, count)
        relevant = _with_parts(history, names)
        for words in history:
            if words[0] != "group" or words[1] in relevant:
                groups._follow(words)
        if groups.later and not {words[0] for words in history} & CREATING:
            # All atoms were inserted.
            groups.possible &= np.logical_or.reduce(groups.later)
        return groups

    def of(self, name: str) -> Bools:
        """Return the possible atoms of a group; of one that the log does not define, anybody."""
        if name == "all":
            return np.ones(len(self.possible), bool)
        if name not in self.members:
            self.members[name] = self._ask()
        return self.members[name]

    def inhabited(self, chosen: Bools) -> bool:
        """Whether an atom of the dump may be one of these possible atoms."""
        likely = chosen & self.possible
        key_of_likely = np.zeros(int(likely.sum()), int)
        key_of_atom = np.zeros(self.count, int)
        for k, (possible_answer, answer) in enumerate(self.answers.values()):
            key_of_likely += possible_answer[likely].astype(int) << k
            key_of_atom += answer.astype(int) << k
        return bool(np.isin(key_of_likely, key_of_atom).any())

    def _ask(self) -> Bools:
        """Double the possible atoms by a question; return those that say yes."""
        if self.questions >= MAX_QUESTIONS:
            raise InputError(
                "held_bodies",
                f"the groups of the script hang on more than {MAX_QUESTIONS} regions and types, "
                "so that nobody knows which spheres it holds",
                remedy="let it move all of them alike",
            )
        self.questions += 1
        size = len(self.possible)

        def twice(flags: Bools) -> Bools:
            return np.concatenate([flags, flags])

        self.possible = twice(self.possible)
        self.members = {name: twice(flags) for name, flags in self.members.items()}
        self.later = [twice(flags) for flags in self.later]
        self.answers = {name: (twice(flags), own) for name, (flags, own) in self.answers.items()}
        return np.arange(2 * size) >= size

    def _follow(self, words: Sequence[str]) -> None:
        """Do what a command does to groups, or hear what is printed of them."""
        match words:
            case ["group", name, style, *rest]:
                self._define(name, style, rest)
            case [number, "atoms", "in", "group", name] if number.isdigit():
                self._count(name, int(number))
            case ["read_data" | "create_atoms" | "read_dump", *rest] if self.members:
                joins = rest[rest.index("group") + 1 :][:1] if "group" in rest else []
                self._add(joins)
            case ["fix", name, group, *_]:
                self._add([group])
                self.growing.add(name)
            case ["unfix", name]:
                self.growing.discard(name)

    def _add(self, groups: Sequence[str]) -> None:
        """Add atoms that were in no group before, and are in these from now on."""
        for group in groups:
            self.of(group)
        later = self._ask()
        self.possible |= later
        for others in self.later:
            self.possible &= ~(later & others)
        for name in self.members:
            self.members[name] &= ~later
            if name in groups:
                self.members[name] |= later
        self.later.append(later)

    def _define(self, name: str, style: str, words: Sequence[str]) -> None:
        """Add to a group whom a command of this style adds."""
        if style in ("delete", "clear"):
            self.members.pop(name, None)
            self.answers.pop(name, None)
            if style == "clear":
                self.members[name] = np.zeros(len(self.possible), bool)
            return
        if style == "static":
            return
        if style in MADE_OF_OTHERS:
            for each in words:
                self.of(each)  # new questions double all, so they are asked first
            parts = [self.of(each) for each in words]
            joint = {"union": np.logical_or, "intersect": np.logical_and}
            if style == "subtract":
                chosen = parts[0] & ~np.logical_or.reduce([*parts[1:], ~parts[0]])
            else:
                chosen = joint[style].reduce(parts)
        elif style == "empty":
            chosen = np.zeros(len(self.possible), bool)
        else:
            chosen = self._ask()
            answer = self._answer(style, words)
            if answer is not None and name not in self.members:
                self.answers[name] = chosen, answer
        before = self.members.get(name, np.zeros(len(self.possible), bool))
        self.members[name] = before | chosen

    def _answer(self, style: str, words: Sequence[str]) -> Bools | None:
        """Return which atoms (n,) of the dump a group by type or number has, if that is known.

        While atoms are inserted nobody knows which of them were there.
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
                first, last, every = ([int(n) for n in word.split(":")] + [0, 0])[:3]
                last = max(first, last)
                inside = (column >= first) & (column <= last)
                chosen |= inside & ((column - first) % max(every, 1) == 0)
        except (ValueError, IndexError):
            return None
        return chosen

    def _count(self, name: str, number: int) -> None:
        """Leave out possible atoms that a printed number of none or of all atoms excludes."""
        if name not in self.members:
            return
        if name in self.answers and number != self.answers[name][1].sum():
            del self.answers[name]  # types have changed, or atoms have come or gone
        if number == 0:
            self.possible &= ~self.members[name]
        elif number == self.count:
            self.possible &= self.members[name]


def _with_parts(history: Sequence[Sequence[str]], names: Iterable[str]) -> set[str]:
    """Return these groups and all that they are made of."""
    relevant = set(names)
    size = 0
    while len(relevant) > size:
        size = len(relevant)
        for words in history:
            if words[0] == "group" and words[1] in relevant and words[2] in MADE_OF_OTHERS:
                relevant |= set(words[3:])
    return relevant
