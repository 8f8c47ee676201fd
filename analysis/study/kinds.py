"""Define kinds of values in a study: numbers in a range, words, texts, lists, named values."""

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from analysis.expressions import short
from modal.tools.errors import InputError

MAX_LENGTH = 20_000
"""Largest number of characters of a text, and of members of a list. Texts of the studies here have
700 at most."""


class Kind(Protocol):
    """A kind of value that a setting may have."""

    @property
    def description(self) -> str:
        """Describe what a user should write, as the object of "give" in a message."""

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""


@dataclass(frozen=True)
class Number:
    """A finite number, whole or not, between bounds.

    It must be at least `least`, at most `most`, larger than `above` and smaller than `below`.
    """

    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    whole: bool = False
    finite: bool = True

    @property
    def description(self) -> str:
        """Describe the number: whether it is whole, and its bounds."""
        text = "a number"
        if self.whole:
            text = "a whole number"
        bounds = {
            "from": self.least,
            "above": self.above,
            "to": self.most,
            "below": self.below,
        }
        for preposition, bound in bounds.items():
            if math.isfinite(bound):
                text += f" {preposition} {bound:g}"
        return text

    def holds(self, value: Any) -> bool:
        """Return whether a value is such a number."""
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            return False
        if self.finite and not math.isfinite(value):
            return False
        if self.whole and value != int(value):
            return False
        # An infinite bound excludes nothing, not even infinity.
        if math.isfinite(self.above) and value <= self.above:
            return False
        if math.isfinite(self.below) and value >= self.below:
            return False
        return self.least <= value <= self.most


@dataclass(frozen=True)
class Word:
    """One of several words."""

    words: Collection[str]

    @property
    def description(self) -> str:
        """List the words."""
        return " or ".join(self.words)

    def holds(self, value: Any) -> bool:
        """Return whether a value is one of the words."""
        return isinstance(value, str) and value in self.words


@dataclass(frozen=True)
class Text:
    """A text that matches a pattern, has at most `length` characters, and none of `refused`."""

    description: str = "a text"
    pattern: str = r"[\s\S]*"
    length: int = MAX_LENGTH
    refused: str = ""

    def holds(self, value: Any) -> bool:
        """Return whether a value is a text of this kind."""
        if not isinstance(value, str) or len(value) > self.length:
            return False
        if self.refused and self.refused in value:
            return False
        return re.fullmatch(self.pattern, value, re.ASCII) is not None


@dataclass(frozen=True)
class Anything:
    """Any value, which is checked elsewhere."""

    description: str = "anything"

    def holds(self, value: Any) -> bool:
        """Return True: any value is accepted."""
        return True


@dataclass(frozen=True)
class Truth:
    """True or false."""

    description: str = "true or false"

    def holds(self, value: Any) -> bool:
        """Return whether a value is true or false."""
        return isinstance(value, bool)


@dataclass(frozen=True)
class Several:
    """A list of `least` to `most` values of the same kind; `plural` names them in messages."""

    kind: Kind
    plural: str
    least: int = 0
    most: int = MAX_LENGTH

    @property
    def description(self) -> str:
        """Name the members of the list."""
        return f"a list of {self.plural}"

    def holds(self, value: Any) -> bool:
        """Return whether a value is such a list."""
        if not isinstance(value, list) or not self.least <= len(value) <= self.most:
            return False
        return all(self.kind.holds(member) for member in value)


@dataclass(frozen=True)
class Lines:
    """Lines NAME: VALUE.

    The names in `needed` are required. `known` maps names to the kinds of their values; any other
    name has a value of `kind`, or is refused if `kind` is None.
    """

    kind: Kind | None = None
    known: Mapping[str, Kind] = field(default_factory=dict)
    needed: tuple[str, ...] = ()
    description: str = "lines NAME: VALUE"

    def holds(self, value: Any) -> bool:
        """Return whether a value consists of such lines."""
        return not self.find_fault(value)

    def find_fault(self, value: Any) -> str:
        """Return what is wrong with the lines of a value, in a few words; empty if nothing is."""
        if not isinstance(value, Mapping):
            return f"{short(value)}: give {self.description}"
        for name in self.needed:
            if name not in value:
                return f"{name} is missing; add it"
        for name, entry in value.items():
            if not isinstance(name, str):
                return f"{short(name)}: names are texts; write them in quotes"
            fault = self._find_fault_of_entry(name, entry)
            if fault:
                return fault
        return ""

    def _find_fault_of_entry(self, name: str, entry: Any) -> str:
        """Return what is wrong with the value of one line; empty if nothing is."""
        kind = self.known.get(name, self.kind)
        if kind is None:
            return f"{short(name)} is unknown; known are {', '.join(self.known)}"
        if isinstance(kind, Lines):
            fault = kind.find_fault(entry)
            if fault:
                return f"{short(name)}: {fault}"
        elif not kind.holds(entry):
            return f"{short(name)} {short(entry)}: give {kind.description}"
        return ""


@dataclass(frozen=True)
class Either:
    """One of two kinds."""

    first: Kind
    second: Kind

    @property
    def description(self) -> str:
        """Describe both kinds."""
        return f"{self.first.description} or {self.second.description}"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of one of the two kinds."""
        return self.first.holds(value) or self.second.holds(value)


def refuse_other(place: str, name: str, value: Any, kind: Kind) -> None:
    """Raise InputError if a value is not of the kind that its setting has.

    `place` names the file, and the case if there is one, in the message.
    """
    if isinstance(kind, Lines):
        fault = kind.find_fault(value)
        if fault:
            raise InputError("setting", f"{place}: {name}", fault)
    elif not kind.holds(value):
        problem = f"{place}: {name} {short(value)}"
        raise InputError("setting", problem, remedy=f"give {kind.description}")


def as_whole_number(value: Any, kind: Kind) -> Any:
    """Return 1e3 as the integer 1000 if the kind is a whole number, else the value unchanged."""
    if isinstance(kind, Number) and kind.whole and value is not None:
        return int(value)
    return value
