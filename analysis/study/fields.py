"""Numbers in a study's texts: `{f_max_khz:.1f}` in a sentence, ` .3g` behind a column.

A text names a number and Python's format of it, and nothing else: no attributes, no calls, and no
width that would fill a page. Names of tables and figures are files in the study's folder alone.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analysis.expressions import short
from modal.tools.errors import InputError

FORMAT = re.compile(r"\+?(\.\d{1,2})?[defg%]?")
"""Pattern of a number's format: its sign, up to 99 digits, its kind."""
FIELD = re.compile(r"{(\w+)(?::([^{}]*))?}")
SHOWN = str | int | float | np.integer | np.bool_
"""Types of values that a sentence can show."""


def number_format(text: object) -> str:
    """Return a format of numbers; InputError where it is none.

    >>> number_format(".3g")
    '.3g'
    """
    if isinstance(text, str) and FORMAT.fullmatch(text):
        return text
    raise InputError("number_format", f"format {short(text)}", remedy="write as .3g, .1f or +.2f")


def field_names(text: str) -> set[str]:
    """Return the names that stand in braces in a text."""
    return {match[1] for match in FIELD.finditer(text)}


def fill(text: str, values: Mapping[str, Any]) -> str:
    """Return a text with values in the place of their names; InputError where one is unknown.

    >>> fill("case {case}: {peak:.1f} kHz", {"case": 2, "peak": 21.94})
    'case 2: 21.9 kHz'
    """

    def shown(match: re.Match[str]) -> str:
        name, form = match.groups()
        value = values.get(name)
        if not isinstance(value, SHOWN):
            raise InputError("field", f"{short(text)}: {name} is no number of a case")
        return format(value, number_format(form or ""))

    rest = FIELD.sub("", text)
    if "{" in rest or "}" in rest:
        raise InputError(
            "field", f"{short(text)}", remedy="write names in braces as {f_max_khz:.1f}"
        )
    return FIELD.sub(shown, text)


def inside(folder: Path, name: str) -> Path:
    """Return the file of this name in a folder; InputError for a name that leads out of it."""
    path = folder / name
    if path.parent.resolve() != folder.resolve() or name in ("", ".", ".."):
        raise InputError(
            "outside_folder",
            f"{short(name)}: leads out of {folder}",
            remedy="give a name without /",
        )
    return path
