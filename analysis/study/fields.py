"""Fill numbers into a study's texts, such as `{f_max_khz:.1f}` in a sentence.

A text names a number and its format as in Python, and nothing else: attributes, calls and widths
that would fill a page are refused. Names of tables and figures become files, which must lie in the
folder of the study's results.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analysis.expressions import short
from modal.tools.errors import InputError

FORMAT = re.compile(r"\+?(\.\d{1,2})?[defg%]?")
"""Pattern of a number's format: a sign, up to 99 digits, and the type d, e, f, g or %."""
FIELD = re.compile(r"{(\w+)(?::([^{}]*))?}")
"""Pattern of a field: a name in braces, and a format after a colon, if any."""
SHOWN_TYPES = str | int | float | np.integer | np.bool_
"""Types of values that a sentence can show."""


def number_format(text: object) -> str:
    """Return a format of numbers; raise InputError if the text is not one.

    >>> number_format(".3g")
    '.3g'
    """
    if isinstance(text, str) and FORMAT.fullmatch(text):
        return text
    raise InputError("number_format", f"format {short(text)}", remedy="write as .3g, .1f or +.2f")


def field_names(text: str) -> set[str]:
    """Return the names in braces in a text."""
    return {match[1] for match in FIELD.finditer(text)}


def fill(text: str, values: Mapping[str, Any]) -> str:
    """Return a text whose fields are replaced by the values that they name.

    Raises InputError if a value is unknown or is neither a number nor a text, and if there is a
    brace outside of a field.

    >>> fill("case {case}: {peak:.1f} kHz", {"case": 2, "peak": 21.94})
    'case 2: 21.9 kHz'
    """

    def format_field(match: re.Match[str]) -> str:
        name, form = match.groups()
        value = values.get(name)
        if not isinstance(value, SHOWN_TYPES):
            raise InputError("field", f"{short(text)}: {name} is no number of a case")
        return format(value, number_format(form or ""))

    without_fields = FIELD.sub("", text)
    if "{" in without_fields or "}" in without_fields:
        raise InputError("field", short(text), remedy="write names in braces as {f_max_khz:.1f}")
    return FIELD.sub(format_field, text)


def file_below_here(name: str) -> Path:
    """Return the file of this name below the working folder; raise InputError if it is outside."""
    path = Path(name)
    if path.is_absolute() or not path.resolve().is_relative_to(Path.cwd().resolve()):
        raise InputError(
            "outside_folder",
            f"{short(name)}: lies outside the working folder",
            remedy="give its path from there",
        )
    return path


def file_inside(folder: Path, name: str) -> Path:
    """Return the file of this name in a folder; raise InputError if it leads outside."""
    path = folder / name
    if path.parent.resolve() != folder.resolve() or name in ("", ".", ".."):
        raise InputError(
            "outside_folder",
            f"{short(name)}: leads out of {folder}",
            remedy="give a name without /",
        )
    return path
