"""Tables of yade-batch, as those of the cases: a line a job, its cells by the names in the first.

Read as YADE itself reads them: cells stand apart by blanks, `#` begins a comment, `=` repeats the
cell above.
"""

from __future__ import annotations

from pathlib import Path

from modal.tools.errors import InputError

Line = dict[str, str]
KINDS = "fcc", "random"
"""Tables of the cases."""


def lines_of(path: str | Path) -> list[Line]:
    """Lines of a table; InputError where one has not a cell for each name."""
    texts = Path(path).read_text().splitlines()
    rows = [cells for text in texts if (cells := text.split("#")[0].split())]
    names = rows[0] if rows else []
    found: list[Line] = []
    if len(set(names)) < len(names):
        raise InputError(f"{path}: its first line names a column twice: {' '.join(names)}")
    for cells in rows[1:]:
        if len(cells) != len(names):
            raise InputError(
                f"{path}: line {' '.join(cells)!r} has {len(cells)} values for {len(names)} names; "
                "give each column one"
            )
        line = dict(zip(names, cells, strict=True))
        above = found[-1] if found else line
        found.append({name: above[name] if cell == "=" else cell for name, cell in line.items()})
    return found


def lines_by(path: str | Path, column: str) -> dict[str, Line]:
    """Lines by the numbers of a column, in short form; InputError where one stands there twice."""
    found: dict[str, Line] = {}
    for line in lines_of(path):
        if column not in line:
            raise InputError(f"{path}: its first line names no column {column}; add it")
        try:
            key = short(line[column])
        except ValueError:
            raise InputError(f"{path}: {column} {line[column]!r} is no number") from None
        if key in found:
            raise InputError(f"{path}: {column} {key} stands there twice; remove one of the lines")
        found[key] = line
    return found


def cases(folder: Path) -> dict[str, dict[str, Line]]:
    """Lines of the cases in the tables of a folder, by kind and by name, as case02."""
    found: dict[str, dict[str, Line]] = {kind: {} for kind in KINDS}
    for kind in KINDS:
        path = folder / f"{kind}.table"
        for key, line in (lines_by(path, "case") if path.is_file() else {}).items():
            if not key.isdecimal():
                raise InputError(f"{path}: case {key} is no whole number")
            found[kind][f"case{int(key):02d}"] = line
    if both := found["fcc"].keys() & found["random"].keys():
        raise InputError(f"{', '.join(sorted(both))}: a line in each of the tables; remove one")
    return found


def short(text: str) -> str:
    """A number in the short form that names of files have."""
    return f"{float(text):g}"


def word(cell: str) -> str:
    """The text of a cell, which YADE takes for Python: without quotes, `_` for a blank.

    >>> word('"lognormal_0.2"')
    'lognormal 0.2'
    """
    return cell.strip("\"'").replace("_", " ")


def value(cell: str) -> float | str:
    """A cell's number, or its text."""
    try:
        return float(cell)
    except ValueError:
        return word(cell)
