"""What a command's result looks like on a terminal: groups of names and quantities, in columns.

Nothing is said here about single commands: the end of a result's name tells its unit, as in
`stress_pa`. A command whose result is long sorts it into titled groups.
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
"""End of a name and what it is measured in; longer ends first."""
WITHOUT_PREFIX = ("kg/m^3", "m/s", "m/s^2")
DIGITS = {"Hz": 6}
"""Of frequencies, which are the results with the most certain digits; others have four."""
LONG = 3
"""Numbers in a list from which lists of equal length stand in columns."""
LINES = 24
"""Lines of such columns; in the middle of longer ones some are left out."""
WIDTH = 60
"""Characters up to which several texts stand in one line."""
INDENT = "  "
COST = ("seconds", "peak_memory_bytes")
"""Results that stand in the last line."""


def put(text: object, end: str = "\n") -> None:
    """Print, as a terminal may show it; control characters are written as escapes.

    Once the reader, `head` for one, has seen enough, nowhere, and the work goes on.
    """
    try:
        print(visible(str(text), keep="\n"), end=end, flush=True)
    except OSError as error:
        # Also what Python still writes at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise InputError(
                "input", "standard output", f"cannot be written ({error.strerror})"
            ) from error


def json_text(result: Any) -> str:
    """A result as JSON, which knows neither NaN nor infinity: null stands for them.

    >>> json_text({"velocity": [math.nan, 1.5], "worst": {"residual": math.inf}, "ok": True})
    '{"velocity": [null, 1.5], "worst": {"residual": null}, "ok": true}'
    """
    return json.dumps(plain(result), allow_nan=False)


def page(result: dict[str, Any], groups: dict[str, dict[str, Any]] | None = None) -> str:
    """The text for people: titled groups, then how long it took and how much memory.

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
    groups = groups or {"": {k: v for k, v in result.items() if k not in COST}}
    parts = []
    for title, members in groups.items():
        lines = _group(members)
        parts.append("\n".join([title, *(INDENT + line for line in lines)] if title else lines))
    seconds, memory = (result.get(name) for name in COST)
    if seconds is not None:
        parts.append(f"{seconds:.3g} s, at most {quantity(memory or math.nan, 'B', 3)} of memory")
    return ("\n\n" if len(groups) > 1 else "\n").join(filter(None, parts))


def _group(members: dict[str, Any]) -> list[str]:
    """Names and values; several long lists of numbers of one length stand side by side."""
    long = {k: v for k, v in members.items() if _is_numbers(v) and len(v) > LONG}
    count = max(map(len, long.values()), default=0)
    columns = {k: v for k, v in long.items() if len(v) == count}
    rows: list[tuple[str, str]] = []
    for name, value in members.items():
        if len(columns) < 2 or name not in columns:
            label, unit = label_and_unit(name)
            rows += zip_longest([label], _lines(value, unit), fillvalue="")
    lines = table(rows).split("\n") if rows else []
    return lines + (_side_by_side(columns, count) if len(columns) > 1 else [])


def label_and_unit(name: str) -> tuple[str, str]:
    """A name as people read it, and the unit of its values; "" where they have none."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " "), UNITS.get(end, "")


def _lines(value: Any, unit: str) -> list[str]:
    """What stands behind a name: one line, or several of texts and of named values."""
    if isinstance(value, dict) and value:
        text = [(_key(key), ", ".join(_lines(inner, unit))) for key, inner in value.items()]
        return table(text).split("\n")
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if _is_numbers(value := [value] if isinstance(value, int | float) else value):
        return [_numbers(value, unit)]
    if isinstance(value, list) and value:
        if all(map(_is_numbers, value)):
            texts, unit = _scaled([number for row in value for number in row], unit)
            wide = len(value[0])
            return [f"in {unit}"] * bool(unit) + _aligned([texts[k::wide] for k in range(wide)])
        texts = [", ".join(_lines(item, unit)) for item in value]
        return [", ".join(texts)] if sum(map(len, texts)) < WIDTH else texts
    return ["none" if value is None or len(value) == 0 else str(value)]


def _key(name: str) -> str:
    """The name of a value among others; a number is a frequency in Hz that was asked for."""
    try:
        return quantity(float(name), "Hz", DIGITS["Hz"])
    except ValueError:
        return name if "." in name else name.replace("_", " ")  # of a file, as it is


def _is_numbers(value: Any) -> bool:
    """Whether it is a list of numbers."""
    numbers = isinstance(value, list) and all(isinstance(each, int | float) for each in value)
    return numbers and bool(value) and not isinstance(value[0], bool)


def _numbers(values: list[float], unit: str) -> str:
    """Numbers in one line; of many the first and the last."""
    if len(values) > 2 * LONG:
        ends = [_numbers(part, unit) for part in (values[:LONG], values[-LONG:])]
        return f"{ends[0]} ... {ends[1]}, {len(values)} in all"
    if len(values) == 1 and unit and unit not in WITHOUT_PREFIX and not isinstance(values[0], int):
        return quantity(values[0], unit, DIGITS.get(unit, 4))
    texts, unit = _scaled(values, unit)
    return ", ".join(texts) + f" {unit}" * bool(unit)


def _scaled(values: list[float], unit: str) -> tuple[list[str], str]:
    """Texts of numbers, and their unit with the prefix that suits the largest."""
    if unit and not all(isinstance(value, int) for value in values):
        return scaled(values, unit, DIGITS.get(unit, 4), prefixed=unit not in WITHOUT_PREFIX)
    return [f"{v:,}" if isinstance(v, int) else f"{v:.4g}" for v in values], unit


def _side_by_side(columns: dict[str, list[float]], count: int) -> list[str]:
    """Numbered lines, a column for each list, its unit in the heading."""
    texts = [["", *map(str, range(1, count + 1))]]
    for name, values in columns.items():
        label, unit = label_and_unit(name)
        numbers, unit = _scaled(values, unit)
        texts.append([f"{label}, {unit}".removesuffix(", "), *numbers])
    lines, half = _aligned(texts), LINES // 2
    if len(lines) > LINES + 1:
        lines = [*lines[: half + 1], f"... {count - 2 * half} more", *lines[-half:]]
    return lines


def _aligned(columns: list[list[str]]) -> list[str]:
    """Lines of texts that stand below each other, to the right."""
    widths = [max(map(len, column)) for column in columns]
    return [
        INDENT.join(text.rjust(width) for text, width in zip(row, widths, strict=True))
        for row in zip(*columns, strict=True)
    ]
