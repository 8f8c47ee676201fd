"""The error for what a user can mend, and for a word that is none of those known."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import Any

from modal.tools.visible import visible


class InputError(ValueError):
    """Refuse what a user can mend: bad input, in one line that says what, why and what to do.

    The command line prints the line and ends with status 2. Names and texts of files stand in it as
    a terminal may show them: control characters are written as escapes.

    Parameters
    ----------
    code : str
        What is wrong, for programs and tests, which must not depend on the sentences.
    problem : str
        What is wrong, for a reader.
    reason : str
        Why, or what is allowed; empty where the problem says it.
    remedy : str
        What to do about it; empty where that is plain.

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
        # A process of a pool sends its errors to another one; subclasses have other arguments.
        return _restore, (type(self), self.args, vars(self))

    @property
    def as_json(self) -> dict[str, str]:
        """Code and sentences by their names, for a program that reads JSON."""
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
    """Refuse because of what a packing or a record is, whatever is asked of it and how.

    One quantity of several is then not known; any other refusal ends the list.
    """


SHOWN = 12
"""Words that are all named where another one was given."""


def refuse_unknown(what: str, word: object, known: Iterable[str]) -> None:
    """InputError for a `word` that is none of the `known`; it names these, of many the nearest.

    >>> refuse_unknown("solver", "magic", ["blocks", "superlu"])
    Traceback (most recent call last):
        ...
    modal.tools.errors.InputError: solver 'magic': unknown; choose from blocks, superlu
    """
    words = list(known)
    if word in words:
        return
    near = get_close_matches(str(word).lower(), words) if len(words) > SHOWN else []
    all_of_them = ", ".join(words[:SHOWN] + ["..."] * (len(words) > SHOWN))
    do = f"did you mean {' or '.join(near)}?" if near else f"choose from {all_of_them}"
    raise InputError("unknown_word", f"{what} {word!r}".lstrip(), "unknown", do)
