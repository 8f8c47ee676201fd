"""The error for what a user can mend, and for a word that is none of those known."""

from collections.abc import Iterable
from difflib import get_close_matches

from modal.tools.visible import visible


class InputError(ValueError):
    """A user's mistake; the message says in one line what is wrong, why, and what to do.

    The command line prints it and ends with status 2. Names and texts of files stand in it as a
    terminal may show them: control characters are written as escapes.

    Attributes
    ----------
    code : str
        What is wrong, for programs and tests, which must not depend on the message; "input" where
        the error has no code of its own.

    Examples
    --------
    >>> import modal
    >>> try:
    ...     modal.fcc(cells=(2, 2, 0))
    ... except modal.InputError as error:
    ...     print(error)
    cells (2, 2, 0): give three whole numbers, along x and y, and layers
    """

    def __init__(self, message: str = "", *, code: str = "input") -> None:
        super().__init__(visible(message))
        self.code = code


class UnavailableError(InputError):
    """A refusal because of what a packing or a record is, whatever is asked of it and how.

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
    raise InputError(f"{what} {word!r}: unknown; {do}".lstrip(), code="unknown_word")
