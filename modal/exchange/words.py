"""The words of one line of input, whoever wrote it: taken in turn, or behind a name."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NoReturn

from modal.exchange.rows import shown
from modal.tools.errors import InputError


class Words:
    """The words that are `left` of a line; `where` and what to `do` stand in messages about it.

    >>> line = Words("zplane 0 NULL type 2".split(), "--wall", "give type N zplane LOW HIGH")
    >>> line.numbers("zplane", 2, null=True), line.number("type")
    ([0.0, nan], 2.0)
    """

    def __init__(self, words: Iterable[str], where: str, do: str) -> None:
        self.left, self.where, self.do = list(words), where, do

    def __contains__(self, word: str) -> bool:
        return word in self.left

    def refuse(self, what: str, do: str = "") -> NoReturn:
        """InputError about this line."""
        raise InputError(f"{self.where}: {what}; {do or self.do}")

    def next(self, what: str, known: Iterable[str] = ()) -> str:
        """The next word, which is `what`, one of those that are `known`; it is no longer left."""
        if not self.left:
            self.refuse(f"ends where {what} should stand")
        word = self.left.pop(0)
        if known and word not in known:
            self.refuse(f"{what} {word!r} is not known", f"give {', '.join(known)}")
        return word

    def in_turn(self, what: str, count: int, *, null: bool = False) -> list[float]:
        """The next `count` words as numbers, those of `what`; they are no longer left."""
        words = [self.next(f"a number of {what}") for _ in range(count)]
        return self.converted(what, words, null=null)

    def alone(self, what: str, count: int, *, null: bool = False) -> list[float]:
        """All words, which are `count` numbers."""
        numbers = self.in_turn(what, count, null=null)
        if self.left:
            self.refuse(f"{what} has more than {count} numbers")
        return numbers

    def behind(self, name: str, count: int) -> list[str]:
        """The `count` words behind a name, which all stay."""
        if name not in self.left:
            self.refuse(f"no {name} in it")
        at = self.left.index(name) + 1
        words = self.left[at : at + count]
        if len(words) < count:
            self.refuse(f"{name} lacks words behind it")
        return words

    def numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """The `count` numbers behind a name; with `null` a word NULL is no number, NaN."""
        return self.converted(name, self.behind(name, count), null=null)

    def converted(self, name: str, words: Iterable[str], *, null: bool = False) -> list[float]:
        """These words as numbers, which are those of a `name`."""
        numbers = []
        for word in words:
            try:
                number = math.nan if null and word.upper() == "NULL" else float(word)
            except ValueError:
                self.refuse(f"{name} {shown(word)} is no number")
            if not (math.isfinite(number) or word.upper() == "NULL"):
                self.refuse(f"{name} {shown(word)} is no finite number")
            numbers.append(number)
        return numbers

    def number(self, name: str) -> float:
        """The number behind a name."""
        return self.numbers(name, 1)[0]

    def first(self, *names: str) -> float:
        """The number behind the first of these names that is there, or 0."""
        return next((self.number(name) for name in names if name in self.left), 0.0)
