"""Print a command's result on a terminal: groups of names and quantities, in columns.

The module does not depend on the command: the end of a result's name gives its unit, as in
`stress_pa`. A command with a long result sorts it into titled groups.
"""

import json
import math
import os
import sys
from itertools import zip_longest
from typing import Any

from modal.tools.display import plain, quantity, scaled, table
from modal.tools.errors import InputError
from modal.tools.visible import visible

UNITS = {
    "_kg_per_m3": "kg/m^3",
    "_m_per_s2": "m/s^2",
    "_m_per_s": "m/s",
    "_n_per_m": "N/m",
    "_bytes": "B",
    "_hz": "Hz",
    "_pa": "Pa",
    "_m": "m",
    "_s": "s",
}
"""Unit of a result by the end of its name; longer ends come first."""
WITHOUT_PREFIX = ("kg/m^3", "m/s", "m/s^2")
"""Units whose values are shown without a prefix such as k or M."""
DIGITS = {"Hz": 6}
"""Number of digits by unit: frequencies are the results with the most certain digits."""
USUAL_DIGITS = 4
"""Number of digits of values whose unit is not in `DIGITS`."""
MAX_NUMBERS_IN_LINE = 3
"""Largest length of lists that do not stand side by side in columns. Twice as many numbers are
shown of a longer list in one line."""
MAX_COLUMN_LINES = 24
"""Largest number of lines in columns that are shown; longer ones lose their middle."""
MAX_TEXT_WIDTH = 60
"""Number of characters up to which several texts stand in one line."""
INDENT = "  "
COST = ("seconds", "peak_memory_bytes")
"""Results that are shown in the last line: time and memory."""


def put(text: object, end: str = "\n") -> None:
    """Print a text to standard output, with control characters written as escapes.

    If the reader has closed the pipe, as `head` does, print nowhere and let the work go on. Raises
    InputError if the output cannot be written.
    """
    try:
        print(visible(str(text), keep="\n"), end=end, flush=True)
    except OSError as error:
        # What Python still writes at its exit goes nowhere, too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise InputError(
                "output_failed", "standard output", f"cannot be written ({error.strerror})"
            ) from error


def json_text(result: Any) -> str:
    """Return a result as JSON, with null for NaN and infinity, which JSON does not have.

    >>> json_text({"velocity": [math.nan, 1.5], "worst": {"residual": math.inf}, "ok": True})
    '{"velocity": [null, 1.5], "worst": {"residual": null}, "ok": true}'
    """
    return json.dumps(plain(result), allow_nan=False)


def page(result: dict[str, Any], groups: dict[str, dict[str, Any]] | None = None) -> str:
    """Return a text for people: titled groups, then the time and the memory that it took.

    >>> result = {"stress_pa": [1e5, 99976.0], "rattlers": 4127, "certified": True, "absent": []}
    >>> result |= {"count_below": {"1500": 12, "2e4": 40}}
    >>> result |= {"stiffness_pa": [[2.5e8, -1e6], [0.0, 1.25e7]]}
    >>> print(page(result | {"seconds": 0.25, "peak_memory_bytes": 2_000_000_000}))
    stress       100.0, 100.0 kPa
    rattlers     4,127
    certified    yes
    absent       none
    count below  1.5 kHz  12
                 20 kHz   40
    stiffness    in MPa
                 250.0  -1.0
                   0.0  12.5
    0.25 s, at most 2 GB of memory
    """
    if groups is None:
        groups = {"": {name: value for name, value in result.items() if name not in COST}}
    parts = []
    for title, members in groups.items():
        lines = _group_lines(members)
        if title:
            lines = [title] + [INDENT + line for line in lines]
        parts.append("\n".join(lines))
    seconds = result.get("seconds")
    memory = result.get("peak_memory_bytes")
    if seconds is not None:
        parts.append(f"{seconds:.3g} s, at most {quantity(memory or math.nan, 'B', 3)} of memory")
    separator = "\n\n" if len(groups) > 1 else "\n"
    return separator.join(filter(None, parts))


def _group_lines(members: dict[str, Any]) -> list[str]:
    """Return lines of names and values.

    Several long lists of numbers of the same length follow, side by side.
    """
    columns = _side_by_side_columns(members)
    rows: list[tuple[str, str]] = []
    for name, value in members.items():
        if name not in columns:
            label, unit = label_and_unit(name)
            rows += zip_longest([label], _value_lines(value, unit), fillvalue="")
    lines = []
    if rows:
        lines = table(rows).split("\n")
    if columns:
        lines += _column_lines(columns)
    return lines


def _side_by_side_columns(members: dict[str, Any]) -> dict[str, list[float]]:
    """Return the longest lists of numbers if there are at least two of the same length."""
    long = {}
    for name, value in members.items():
        if _is_numbers(value) and len(value) > MAX_NUMBERS_IN_LINE:
            long[name] = value
    longest = max(map(len, long.values()), default=0)
    columns = {name: value for name, value in long.items() if len(value) == longest}
    if len(columns) < 2:
        return {}
    return columns


def label_and_unit(name: str) -> tuple[str, str]:
    """Return the label of a result for people, and the unit of its values, "" without one."""
    for end, unit in UNITS.items():
        if name.endswith(end):
            return name.removesuffix(end).replace("_", " "), unit
    return name.replace("_", " "), ""


def _value_lines(value: Any, unit: str) -> list[str]:
    """Return the text for a result's value: one line, or several for texts and named values."""
    if isinstance(value, dict) and value:
        rows = []
        for key, item in value.items():
            label, own_unit = label_and_unit(key)
            lines = _value_lines(item, own_unit or unit)
            rows.append((label if own_unit else _key(key), ", ".join(lines)))
        return table(rows).split("\n")
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, int | float):
        value = [value]
    if _is_numbers(value):
        return [_numbers_line(value, unit)]
    if isinstance(value, list) and value:
        if all(map(_is_numbers, value)):
            return _matrix_lines(value, unit)
        texts = [", ".join(_value_lines(item, unit)) for item in value]
        if sum(map(len, texts)) < MAX_TEXT_WIDTH:
            return [", ".join(texts)]
        return texts
    if value is None or len(value) == 0:
        return ["none"]
    return [str(value)]


def _matrix_lines(rows: list[list[float]], unit: str) -> list[str]:
    """Return the lines of a matrix, its unit in the first one."""
    texts, unit = _scaled([number for row in rows for number in row], unit)
    width = len(rows[0])
    lines = _aligned([texts[k::width] for k in range(width)])
    if unit:
        return [f"in {unit}", *lines]
    return lines


def _key(name: str) -> str:
    """Return the label of one of several named values; a number is a frequency in Hz."""
    try:
        return quantity(float(name), "Hz", DIGITS["Hz"])
    except ValueError:
        if "." in name:  # the name of a file
            return name
        return name.replace("_", " ")


def _is_numbers(value: Any) -> bool:
    """Return whether a value is a list of numbers that is not empty."""
    if not isinstance(value, list) or not value:
        return False
    return all(isinstance(item, int | float) for item in value) and not isinstance(value[0], bool)


def _numbers_line(values: list[float], unit: str) -> str:
    """Return numbers as one line of text; of many numbers, the first and the last ones."""
    if len(values) > 2 * MAX_NUMBERS_IN_LINE:
        first = _numbers_line(values[:MAX_NUMBERS_IN_LINE], unit)
        last = _numbers_line(values[-MAX_NUMBERS_IN_LINE:], unit)
        return f"{first} ... {last}, {len(values)} in all"
    has_prefix = unit and unit not in WITHOUT_PREFIX
    if len(values) == 1 and has_prefix and not isinstance(values[0], int):
        return quantity(values[0], unit, DIGITS.get(unit, USUAL_DIGITS))
    texts, unit = _scaled(values, unit)
    line = ", ".join(texts)
    if unit:
        line += f" {unit}"
    return line


def _scaled(values: list[float], unit: str) -> tuple[list[str], str]:
    """Return texts of numbers, and their unit with the prefix that suits the largest."""
    if unit and not all(isinstance(value, int) for value in values):
        digits = DIGITS.get(unit, USUAL_DIGITS)
        return scaled(values, unit, digits, prefixed=unit not in WITHOUT_PREFIX)
    texts = []
    for value in values:
        texts.append(f"{value:,}" if isinstance(value, int) else f"{value:.4g}")
    return texts, unit


def _column_lines(columns: dict[str, list[float]]) -> list[str]:
    """Return numbered lines with a column for each list, its unit in the heading."""
    count = len(next(iter(columns.values())))
    numbers = ["", *map(str, range(1, count + 1))]
    texts = [numbers]
    for name, values in columns.items():
        label, unit = label_and_unit(name)
        cells, unit = _scaled(values, unit)
        heading = label
        if unit:
            heading += f", {unit}"
        texts.append([heading, *cells])
    lines = _aligned(texts)
    if len(lines) <= MAX_COLUMN_LINES + 1:
        return lines
    half = MAX_COLUMN_LINES // 2
    return [*lines[: half + 1], f"... {count - 2 * half} more", *lines[-half:]]


def _aligned(columns: list[list[str]]) -> list[str]:
    """Return the lines of columns of texts, each flush right."""
    widths = [max(map(len, column)) for column in columns]
    lines = []
    for row in zip(*columns, strict=True):
        cells = [text.rjust(width) for text, width in zip(row, widths, strict=True)]
        lines.append(INDENT.join(cells))
    return lines
