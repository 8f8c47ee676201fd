"""Tables of yade-batch: a line a job, its cells by the names in the first.

Read as YADE itself reads them: cells stand apart by blanks, `#` begins a comment, `=` repeats the
cell above.
"""

from __future__ import annotations

from pathlib import Path

from modal.tools.errors import InputError

Line = dict[str, str]


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
