"""Kinds of values of a study: numbers in a range, words, texts, lists, lines NAME: VALUE."""

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from analysis.expressions import short
from modal.tools.errors import InputError


class Kind(Protocol):
    """A kind of value that a setting may have."""

    @property
    def told(self) -> str:
        """What a user should give, as text for a message."""

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""


@dataclass(frozen=True)
class Number:
    """A finite number, whole or not, between bounds that are included or excluded."""

    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf
    below: float = math.inf
    whole: bool = False
    finite: bool = True

    @property
    def told(self) -> str:
        """What a user should give, as text for a message."""
        bounds = {
            "from": self.least,
            "above": self.above,
            "to": self.most,
            "below": self.below,
        }
        words = [f"{word} {bound:g}" for word, bound in bounds.items() if math.isfinite(bound)]
        return " ".join(["a whole number" if self.whole else "a number", *words])

    def holds(self, value: Any) -> bool:
        """Return whether a value is such a number."""
        if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            return False
        if self.finite and not math.isfinite(value):
            return False
        if self.whole and value != int(value):
            return False
        inside = self.least <= value <= self.most
        beyond = math.isinf(self.above) or value > self.above
        return inside and beyond and (math.isinf(self.below) or value < self.below)


@dataclass(frozen=True)
class Word:
    """One of several words."""

    words: Collection[str]

    @property
    def told(self) -> str:
        """What a user should give, as text for a message."""
        return " or ".join(self.words)

    def holds(self, value: Any) -> bool:
        """Return whether a value is one of the words."""
        return isinstance(value, str) and value in self.words


@dataclass(frozen=True)
class Text:
    """A text, of a pattern if there is one, and of no more than so many characters."""

    told: str = "a text"
    pattern: str = r"[\s\S]*"
    length: int = 20_000
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
    """Any value: it is checked elsewhere."""

    told: str = "anything"

    def holds(self, value: Any) -> bool:
        """Return True: any value is accepted."""
        return True


@dataclass(frozen=True)
class Truth:
    """True or false."""

    told: str = "true or false"

    def holds(self, value: Any) -> bool:
        """Return whether a value is true or false."""
        return isinstance(value, bool)


@dataclass(frozen=True)
class Several:
    """A list of values of one kind, of some length."""

    kind: Kind
    what: str
    least: int = 0
    most: int = 20_000

    @property
    def told(self) -> str:
        """What a user should give, as text for a message."""
        return f"a list of {self.what}"

    def holds(self, value: Any) -> bool:
        """Return whether a value is such a list."""
        if not isinstance(value, list) or not self.least <= len(value) <= self.most:
            return False
        return all(self.kind.holds(member) for member in value)


@dataclass(frozen=True)
class Lines:
    """Lines NAME: VALUE, with known names, or with any names and values of one kind."""

    kind: Kind | None = None
    known: Mapping[str, Kind] = field(default_factory=dict)
    needed: tuple[str, ...] = ()
    told: str = "lines NAME: VALUE"

    def holds(self, value: Any) -> bool:
        """Return whether a value consists of such lines."""
        return not self.fault(value)

    def fault(self, value: Any) -> str:
        """Return what is wrong with the lines of a value, in a few words; empty if nothing is."""
        if not isinstance(value, Mapping):
            return f"{short(value)}: give {self.told}"
        for name in self.needed:
            if name not in value:
                return f"{name} is missing; add it"
        for name, part in value.items():
            if not isinstance(name, str):
                return f"{short(name)}: names are texts; write them in quotes"
            kind = self.known.get(name, self.kind)
            if kind is None:
                return f"{short(name)} is unknown; known are {', '.join(self.known)}"
            if isinstance(kind, Lines) and (fault := kind.fault(part)):
                return f"{short(name)}: {fault}"
            if not kind.holds(part):
                return f"{short(name)} {short(part)}: give {kind.told}"
        return ""


@dataclass(frozen=True)
class Either:
    """One of two kinds."""

    first: Kind
    second: Kind

    @property
    def told(self) -> str:
        """What a user should give, as text for a message."""
        return f"{self.first.told} or {self.second.told}"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of one of the two kinds."""
        return self.first.holds(value) or self.second.holds(value)


def refuse_other(where: str, name: str, value: Any, kind: Kind) -> None:
    """Raise InputError if a value is not of the kind that its setting has."""
    if isinstance(kind, Lines) and (fault := kind.fault(value)):
        raise InputError("setting", f"{where}: {name}", f"{fault}")
    if not kind.holds(value):
        raise InputError("setting", f"{where}: {name} {short(value)}", remedy=f"give {kind.told}")


def whole(value: Any, kind: Kind) -> Any:
    """Return 1000 for 1e3 if the kind is a whole number, else the value as it is."""
    if isinstance(kind, Number) and kind.whole and value is not None:
        return int(value)
    return value
