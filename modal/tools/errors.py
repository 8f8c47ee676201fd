"""Define the error for mistakes that a user can correct, and refuse unknown words."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import Any

from modal.tools.visible import visible


class InputError(ValueError):
    """A mistake that a user can correct: bad input, in one line with problem, reason and remedy.

    The command line prints the line and ends with status 2. Control characters in names and texts
    of files are written as escapes.

    Parameters
    ----------
    code : str
        The kind of mistake, for programs and tests, which must not depend on the sentences.
    problem : str
        What is wrong, for a reader.
    reason : str
        Why it is wrong, or what is allowed; empty if the problem already says so.
    remedy : str
        What to do about it; empty if that is obvious.

    Examples
    --------
    >>> import modal
    >>> try:
    ...     modal.fcc(cells=(2, 2, 0))
    ... except modal.InputError as error:
    ...     print(error)
    ...     print(error.code)
    cells (2, 2, 0); give three whole numbers, along x and y, and layers
    cells
    """

    def __init__(self, code: str, problem: str, reason: str = "", remedy: str = "") -> None:
        sentence = problem
        if reason:
            sentence += f": {reason}"
        if remedy:
            sentence += f"; {remedy}"
        super().__init__(visible(sentence))
        self.code = code
        self.problem = problem
        self.reason = reason
        self.remedy = remedy

    def __reduce__(self) -> tuple[Callable[..., InputError], tuple[Any, ...]]:
        # A process of a pool sends its errors to its parent; subclasses have other arguments.
        return _restore, (type(self), self.args, vars(self))

    @property
    def as_json(self) -> dict[str, str]:
        """Code, problem, reason and remedy by name, for a program that reads JSON."""
        names = ("code", "problem", "reason", "remedy")
        return {name: visible(getattr(self, name)) for name in names}


def _restore(
    kind: type[InputError], args: tuple[str, ...], attributes: dict[str, Any]
) -> InputError:
    """Return the error that another process has sent."""
    error = kind.__new__(kind, *args)
    vars(error).update(attributes)
    return error


class UnavailableError(InputError):
    """A refusal because of a property of a packing or a record, not because of an argument.

    A quantity whose measurement raises this error is "not known"; any other InputError ends the
    program.
    """


MAX_LISTED_WORDS = 12
"""Largest number of known words that are all named in a refusal: about a line."""


def refuse_unknown(kind: str, word: object, known: Iterable[str]) -> None:
    """Raise InputError for a `word` that is not one of the `known` words.

    The message begins with the `kind` of word, and names the known words; if there are many, only
    the most similar ones.

    >>> refuse_unknown("solver", "magic", ["blocks", "superlu"])
    Traceback (most recent call last):
        ...
    modal.tools.errors.InputError: solver 'magic': unknown; choose from blocks, superlu
    """
    words = list(known)
    if word in words:
        return
    remedy = f"choose from {', '.join(words)}"
    if len(words) > MAX_LISTED_WORDS:
        similar = get_close_matches(str(word).lower(), words)
        remedy = f"choose from {', '.join(words[:MAX_LISTED_WORDS])}, ..."
        if similar:
            remedy = f"did you mean {' or '.join(similar)}?"
    raise InputError("unknown_word", f"{kind} {word!r}".lstrip(), "unknown", remedy)
