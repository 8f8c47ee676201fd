"""What a command's result looks like on a terminal: groups of names and quantities, in columns.

Nothing is said here about single commands: the end of a result's name tells its unit, as in
`stress_pa`. A command whose result is long sorts it into titled groups with its `shown(result)`.
"""

from __future__ import annotations

import math
import os
import sys
from typing import Any

from modal.tools.display import quantities, quantity, table
from modal.tools.errors import InputError

UNITS = {
    "_kg_per_m3": "kg/m^3",
    "_m_per_s": "m/s",
    "_n_per_m": "N/m",
    "_bytes": "B",
    "_hz": "Hz",
    "_pa": "Pa",
    "_m": "m",
    "_s": "s",
}
"""End of a name and what it is measured in; longer ends first."""
LABELS = {
    "products_with_k": "products with K",
    "f_low_pass": "low-pass frequency",
    "relative_error": "relative error of the solver",
    "largest_off_diagonal_stress": "largest off-diagonal stress",
    "particles_with_0_1_2_contacts": "particles with 0, 1, 2 contacts",
    "mu_comp": "friction of the compression",
    "mu_wave": "friction of the wave",
    "young": "Young's modulus",
    "poisson": "Poisson's ratio",
    "wall_young": "wall's Young's modulus",
    "wall_poisson": "wall's Poisson's ratio",
}
"""Names that do not read well with blanks for underscores."""
WITHOUT_PREFIX = ("kg/m^3", "m/s")
FREQUENCY_DIGITS = 6
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

Groups = dict[str, dict[str, Any]]


def put(text: object, end: str = "\n") -> None:
    """Print; once the reader, `head` for one, has seen enough, nowhere, and the work goes on."""
    try:
        print(text, end=end, flush=True)
    except OSError as error:
        # Also what Python still writes at its exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise InputError(f"standard output: cannot be written ({error.strerror})") from error


def page(result: dict[str, Any], groups: Groups | None = None) -> str:
    """The text for people: titled groups, then how long it took and how much memory.

    >>> print(page({"stress_pa": [1e5, 99976.0], "rattlers": 4127, "certified": True}))
    stress     100.0, 100.0 kPa
    rattlers   4,127
    certified  yes
    """
    cost = {"seconds": result.get("seconds"), "memory": result.get("peak_memory_bytes")}
    rest = {k: v for k, v in result.items() if k not in COST}
    parts = []
    for title, members in (groups or {"": rest}).items():
        if members:
            text = _group(members)
            if title:
                text = title + "\n" + _indented(text)
            parts.append(text)
    if cost["seconds"] is not None:
        memory = quantity(cost["memory"] or math.nan, "B", 3)
        parts.append(f"{cost['seconds']:.3g} s, at most {memory} of memory")
    return ("\n\n" if groups else "\n").join(parts)


def _group(members: dict[str, Any]) -> str:
    columns = _columns(members)
    rows = []
    for name, value in members.items():
        if name in columns:
            continue
        label, unit = label_and_unit(name)
        lines = _lines(value, unit)
        rows.append((label, lines[0]))
        rows += [("", line) for line in lines[1:]]
    text = [table(rows)] if rows else []
    if columns:
        text.append(_side_by_side(columns))
    return "\n".join(text)


def label_and_unit(name: str) -> tuple[str, str]:
    """A name as people read it, and the unit of its values; "" where they have none."""
    for end, unit in UNITS.items():
        if name.endswith(end):
            name = name.removesuffix(end)
            return LABELS.get(name, name.replace("_", " ")), unit
    return LABELS.get(name, name.replace("_", " ")), ""


def _lines(value: Any, unit: str) -> list[str]:
    """What stands behind a name: one line, or several of texts and of named values."""
    if isinstance(value, dict):
        rows = [(_key(key), inner) for key, inner in value.items()]
        text = [(label, ", ".join(_lines(inner, unit))) for label, inner in rows]
        return table(text).split("\n") if text else ["none"]
    if isinstance(value, list):
        if not value:
            return ["none"]
        if all(_is_number(item) for item in value):
            return [_numbers(value, unit)]
        if all(isinstance(row, list) and all(map(_is_number, row)) for row in value):
            return _matrix(value, unit)
        texts = [", ".join(_lines(item, unit)) for item in value]
        return [", ".join(texts)] if sum(map(len, texts)) < WIDTH else texts
    return [_single(value, unit)]


def _matrix(rows: list[list[float]], unit: str) -> list[str]:
    """Rows in columns with one prefix, which the largest number of all decides."""
    everything = [number for row in rows for number in row]
    if unit:
        *texts, last = quantities(everything, unit).split(", ")
        last, unit = last.split(" ")
        texts.append(last)
    else:
        texts = [f"{number:.4g}" for number in everything]
    width, wide = max(map(len, texts)), len(rows[0])
    lines = [
        INDENT.join(text.rjust(width) for text in texts[k : k + wide])
        for k in range(0, len(texts), wide)
    ]
    return [f"in {unit}", *lines] if unit else lines


def _key(name: str) -> str:
    """The name of a value among others; a number is a frequency in Hz that was asked for."""
    try:
        return quantity(float(name), "Hz", FREQUENCY_DIGITS)
    except ValueError:
        return name if "." in name else name.replace("_", " ")  # of a file, as it is


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _single(value: Any, unit: str) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value == "":
        return "none"
    if isinstance(value, int):
        return f"{value:,}" + f" {unit}" * bool(unit)
    if isinstance(value, float):
        return _numbers([value], unit)
    return str(value)


def _numbers(values: list[float], unit: str) -> str:
    """Numbers in one line; of many the first and the last."""
    if len(values) > 2 * LONG:
        ends = [_numbers(part, unit) for part in (values[:LONG], values[-LONG:])]
        return f"{ends[0]} ... {ends[1]}, {len(values)} in all"
    if not unit:
        return ", ".join(f"{v:,}" if isinstance(v, int) else f"{v:.4g}" for v in values)
    if unit in WITHOUT_PREFIX:
        return quantities(values, unit, prefixed=False)
    digits = FREQUENCY_DIGITS if unit == "Hz" else 4
    if len(values) == 1:
        return quantity(values[0], unit, digits)
    return quantities(values, unit, digits)


def _columns(members: dict[str, Any]) -> dict[str, list[float]]:
    """Long lists of numbers of one length, if there are several; they stand side by side."""
    lists = {
        name: value
        for name, value in members.items()
        if isinstance(value, list) and len(value) > LONG and all(map(_is_number, value))
    }
    length = max(map(len, lists.values()), default=0)
    same = {name: value for name, value in lists.items() if len(value) == length}
    return same if len(same) > 1 else {}


def _side_by_side(columns: dict[str, list[float]]) -> str:
    """Numbered lines, a column for each list, its unit in the heading."""
    count = len(next(iter(columns.values())))
    texts = [["", *map(str, range(1, count + 1))]]
    for name, values in columns.items():
        label, unit = label_and_unit(name)
        if unit and unit not in WITHOUT_PREFIX:
            *numbers, last = quantities(
                values, unit, FREQUENCY_DIGITS if unit == "Hz" else 4
            ).split(", ")
            last, unit = last.split(" ")
            texts.append([f"{label}, {unit}", *numbers, last])
        else:
            texts.append([label, *(f"{value:.1e}" for value in values)])
    widths = [max(map(len, column)) for column in texts]
    lines = [
        INDENT.join(text.rjust(width) for text, width in zip(row, widths, strict=True))
        for row in zip(*texts, strict=True)
    ]
    if len(lines) > LINES + 1:
        half = LINES // 2
        lines = [*lines[: half + 1], f"... {count - 2 * half} more", *lines[-half:]]
    return "\n".join(lines)


def _indented(text: str) -> str:
    return "\n".join(INDENT + line for line in text.split("\n"))
