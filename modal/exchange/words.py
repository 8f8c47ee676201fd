"""The words of a line of a script or a header."""

import math
from collections.abc import Iterable
from typing import NoReturn

from modal.exchange.refusals import quote, refuse


class Words:
    """The words of a line, which are taken one by one or looked up by the name before them.

    Attributes
    ----------
    remaining : list of str
        The words that have not been taken.
    place : str
        File and line, for messages.
    remedy : str
        The remedy of error messages, unless a call of `refuse` has another one.

    Examples
    --------
    >>> line = Words("zplane 0 NULL type 2".split(), "--wall", "give type N zplane LOW HIGH")
    >>> line.numbers_after("zplane", 2, null=True), line.number_after("type")
    ([0.0, nan], 2.0)
    """

    def __init__(self, words: Iterable[str], place: str, remedy: str) -> None:
        self.remaining = list(words)
        self.place = place
        self.remedy = remedy

    def __contains__(self, word: str) -> bool:
        return word in self.remaining

    def refuse(self, code: str, problem: str, reason: str = "", remedy: str = "") -> NoReturn:
        """Raise InputError about this line."""
        refuse(self.place, code, problem, reason, remedy or self.remedy)

    def take(self, name: str, known: Iterable[str] = ()) -> str:
        """Remove the next word and return it.

        `name` describes the word in error messages. Raises InputError if there is no word, or if it
        is not one of the `known` words.
        """
        if not self.remaining:
            self.refuse("missing_word", f"ends where {name} should stand")
        word = self.remaining.pop(0)
        if known and word not in known:
            remedy = f"give {', '.join(known)}"
            self.refuse("unknown_word", f"{name} {word!r} is not known", remedy=remedy)
        return word

    def take_numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Remove the next `count` words and return them as numbers; `null` as in `to_numbers`."""
        words = [self.take(f"a number of {name}") for _ in range(count)]
        return self.to_numbers(name, words, null=null)

    def take_only_numbers(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Remove `count` numbers and return them; raise InputError if further words follow."""
        numbers = self.take_numbers(name, count, null=null)
        if self.remaining:
            self.refuse("further_words", f"{name} has more than {count} numbers")
        return numbers

    def words_after(self, name: str, count: int) -> list[str]:
        """Return the `count` words that follow a name; raise InputError if they are missing."""
        if name not in self.remaining:
            self.refuse("missing_word", f"no {name} in it")
        first = self.remaining.index(name) + 1
        words = self.remaining[first : first + count]
        if len(words) < count:
            self.refuse("missing_word", f"{name} lacks words behind it")
        return words

    def numbers_after(self, name: str, count: int, *, null: bool = False) -> list[float]:
        """Return the `count` numbers after a name; `null` as in `to_numbers`."""
        return self.to_numbers(name, self.words_after(name, count), null=null)

    def number_after(self, name: str) -> float:
        """Return the number after a name; raise InputError if it is missing."""
        return self.numbers_after(name, 1)[0]

    def optional_number_after(self, *names: str) -> float:
        """Return the number after the first of these names that the line has; 0 if it has none."""
        for name in names:
            if name in self.remaining:
                return self.number_after(name)
        return 0.0

    def to_numbers(self, name: str, words: Iterable[str], *, null: bool = False) -> list[float]:
        """Return these words as numbers; with `null` the word NULL stands for NaN.

        Raises InputError, with the `name`, for a word that is not a finite number.
        """
        numbers = []
        for word in words:
            if null and word.upper() == "NULL":
                numbers.append(math.nan)
                continue
            try:
                number = float(word)
            except ValueError:
                self.refuse("not_a_number", f"{name} {quote(word)} is no number")
            if not math.isfinite(number):
                self.refuse("not_finite", f"{name} {quote(word)} is no finite number")
            numbers.append(number)
        return numbers
