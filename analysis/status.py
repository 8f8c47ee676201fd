"""Which cases have which products."""

from __future__ import annotations

from pathlib import Path

from analysis.products import KINDS, Products


def status_table(folder: Path, cases: range = range(1, 33)) -> str:
    """One line per case that has any product: `yes` or `-` for each kind."""
    lines = ["case    " + "  ".join(KINDS)]
    for number in cases:
        case = Products(f"case{number:02d}", folder)
        found = [case.has(kind) for kind in KINDS]
        if any(found):
            marks = ("yes" if yes else "-" for yes in found)
            cells = (mark.ljust(len(kind)) for mark, kind in zip(marks, KINDS, strict=True))
            lines.append((case.name + "  " + "  ".join(cells)).rstrip())
    if len(lines) == 1:
        lines.append("no case has a product yet")
    return "\n".join(lines)
