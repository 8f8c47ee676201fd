"""Refusals of files: errors that name the file, the line and the column."""

from pathlib import Path
from typing import NamedTuple, NoReturn

from modal.tools.errors import InputError

MAX_QUOTED_CHARACTERS = 60
"""Largest number of characters of a file that a message quotes."""


def refuse(
    path: str | Path,
    code: str,
    problem: str,
    reason: str = "",
    remedy: str = "",
    *,
    line: int = 0,
    column: str = "",
) -> NoReturn:
    """Raise InputError with the place of the fault before the problem.

    Parameters
    ----------
    path : str or Path
        The file, or the option that is at fault.
    code, problem, reason, remedy : str
        As in `InputError`.
    line : int
        Number of the line, from 1; 0 if it is not known.
    column : str
        Name of the column; empty if it is not known.
    """
    place = str(path)
    if line:
        place += f", line {line}"
    if column:
        place += f", column {column}"
    raise InputError(code, f"{place}: {problem}", reason, remedy)


class Refusal(NamedTuple):
    """A refusal that is stored until it is clear whether the fault matters.

    place: the file and the line, or the option. The other fields are those of `InputError`.
    """

    place: str
    code: str
    problem: str
    reason: str = ""
    remedy: str = ""

    def raise_error(self) -> NoReturn:
        """Raise the InputError."""
        refuse(*self)


def quote(text: str) -> str:
    """Return the beginning of a text in quotes, with control characters as escapes."""
    quoted = repr(text[:MAX_QUOTED_CHARACTERS])
    if len(text) > MAX_QUOTED_CHARACTERS:
        quoted += "..."
    return quoted
