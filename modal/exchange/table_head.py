"""What stands above the rows of a table: lines behind #, and the names of columns.

Three keys tell of the cell: `# cell XLO XHI YLO YHI ZLO ZHI`, `# periodic x y` and `# walls ZLOW
ZHIGH`, in any case, with or without a colon. Any other line behind # is a comment, unless it looks
like one of the three with its name mistyped: a wrong cell takes contacts for gaps.
"""

from __future__ import annotations

import difflib
import math
import re
from pathlib import Path

import numpy as np

from modal.exchange.bodies import Cell
from modal.exchange.program_law import Units
from modal.exchange.rows import Rows, fault, open_bytes, shown

KEYS = {
    "cell": "# cell XLO XHI YLO YHI ZLO ZHI",
    "periodic": "# periodic x y, with the axes that are, or leave the line out for none",
    "walls": "# walls ZLOW ZHIGH, or NULL for none",
}
"""Words with which a line behind # tells of the cell, and how it is written."""
REFUSED = ("clump", "parent", "bond", "cohesion", "rolling", "twist")
"""Columns that tell of what a network does not know."""
ALIKE = 0.7
"""Likeness, by difflib, from which a word is a mistyped key."""
FLAGS = ("0", "1", "yes", "no", "true", "false", "on", "off", "t", "f", "p", "pp", "ff")
"""Words that other programs have for an axis that is periodic or not."""

Said = dict[str, tuple[int, list[str]]]
"""Key of a line behind #: its number, and the words after the key."""


def table_of(path: str | Path, needed: tuple[str, ...]) -> tuple[Rows, Said]:
    """The rows of a table with these columns, and what its lines behind # say of the cell."""
    said: Said = {}
    with open_bytes(path) as file:
        number = 0
        for line in file:
            number += 1
            # A spreadsheet puts a byte order mark before all and empty columns behind a line.
            text = line.decode("utf-8-sig" if number == 1 else "utf-8", "replace").strip()
            if text.startswith("#"):
                _hear(path, number, text.rstrip(", "), said)
            elif text:
                break
        else:
            fault(path, "no line with the names of columns", f"begin with {','.join(needed)}")
        offset = file.tell()
        count = sum(bool(line.strip()) for line in file)
    columns = tuple(name.strip() for name in text.split(","))
    for name in needed:
        if name not in columns:
            what = f"no column {name} among {shown(text)}"
            fault(path, what, _remedy(text, name, needed), number, name)
    for name in columns:
        if any(word in name.lower() for word in REFUSED):
            what = f"{shown(name)[1:-1]} is more than a network knows"
            do = "only single spheres that touch are known; leave the column out if it is idle"
            fault(path, what, do, number, shown(name)[1:-1])
    return Rows(Path(path), columns, offset, number + 1, count, ","), said


def cell_of(path: str | Path, said: Said, units: Units) -> Cell:
    """The cell that a table's lines behind # tell of; walls are its bounds where none are told."""
    line, words = said.get("cell", (0, []))
    try:
        bounds = units.length * np.array(words, float).reshape(3, 2)
    except ValueError:
        bounds = np.full((3, 2), np.nan)
    if not np.isfinite(bounds).all():
        fault(path, "no bounds of the cell", f"write {KEYS['cell']} before the names", line)
    line, words = said.get("periodic", (0, []))
    axes = [word.lower() for word in words]
    for word, axis in zip(words, axes, strict=True):
        if axis not in ("x", "y", "z"):
            fault(path, f"{shown(word)} is no axis", f"write {KEYS['periodic']}", line)
    line, words = said.get("walls", (0, []))
    walls: list[float] = [np.nan, np.nan] if "z" in axes else bounds[2].tolist()
    if line:
        try:
            walls = [np.nan if w.upper() == "NULL" else units.length * float(w) for w in words]
        except ValueError:
            walls = [math.inf]
        if len(walls) != 2 or np.isinf(walls).any():
            what = f"walls {shown(' '.join(words))} are not two numbers"
            fault(path, what, f"write {KEYS['walls']}", line)
        if "z" in axes and not np.isnan(walls).all():
            fault(path, "walls beside a period along z", "leave one of the two out", line)
    periodic = np.array([axis in axes for axis in "xyz"])
    return Cell(bounds[:, 0], bounds[:, 1], periodic, (walls[0], walls[1]))


def _hear(path: str | Path, number: int, text: str, said: Said) -> None:
    """Keep a line behind # if it is a key's; InputError if it looks like one mistyped."""
    found = re.fullmatch(r"#[#\s]*([^\s:=]+)\s*[:=]?\s*(.*)", text)
    if found is None:
        return
    key, words = found[1].lower(), found[2].split()
    if key not in KEYS:
        meant = _meant(key, words)
        if meant:
            what = f"{shown(text)} tells of no cell, and looks as if it did"
            do = f"write {KEYS[meant]}; or put a comment into words"
            fault(path, what, do, number)
        return
    if key in said:
        what = f"# {key} again (line {said[key][0]})"
        fault(path, what, f"write {KEYS[key]}, once", number)
    said[key] = number, words


def _meant(key: str, words: list[str]) -> str:
    """The key that a line with another one may have meant, by its name or by its values."""
    low = [word.lower() for word in words]
    axes = bool(words) and all(word in ("x", "y", "z") for word in low)
    flags = len(words) == 3 and all(word in FLAGS for word in low)
    numbers = bool(words) and all(_is_number(word) or word == "null" for word in low)
    if axes or flags:
        return "periodic"
    if not numbers:
        return ""
    if len(words) == 6:
        return "cell"
    near = [name for name in KEYS if key.startswith(name.rstrip("s"))]
    near += difflib.get_close_matches(key, KEYS, 1, ALIKE)
    return near[0] if near else ""


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _remedy(text: str, name: str, needed: tuple[str, ...]) -> str:
    """What to do about a line of names without this one, by its likeliest cause."""
    if "\0" in text or "\ufffd" in text:
        return "it is no text in UTF-8; write the table as one"
    mark = {";": "semicolons", "\t": "tabulators", " ": "blanks"}
    if "," not in text:
        for separator, said in mark.items():
            if separator in text:
                return f"columns are separated by {said}; separate them by commas"
    bare = [column.strip(" \"'").lower() for column in text.split(",")]
    if name in bare:
        return f"write names in small letters, without quotes: {','.join(needed)}"
    return f"name the columns {','.join(needed)} in its first line"
