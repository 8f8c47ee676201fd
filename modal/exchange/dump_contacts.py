"""Contacts in a dump local, of LAMMPS or LIGGGHTS: what its columns mean, and flat walls.

The columns c_ID[k] of a dump mean what the compute lines in the log say, or, where no log names
them, what a program's recipe of so many columns has.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modal.exchange.dump import Frame, frame_of
from modal.exchange.law import Units
from modal.exchange.particles_and_contacts import Spheres, ends_of
from modal.exchange.rows import Rows, fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import InputError

Words = Mapping[str, Sequence[str]]
"""What the columns of a compute mean, by its ID."""
CODES = (SOURCE_WALL, RECEIVER_WALL)


class Told(NamedTuple):
    """Contacts of a dump: ends (m,), columns (m, k) by what they are, what was assumed."""

    rows: Rows
    i: Ints
    j: Ints
    values: dict[str, Floats]
    assumed: list[str]


def told_contacts(
    path: str | Path,
    frame: Frame,
    spheres: Spheres,
    computes: Words,
    recipes: Mapping[int, Sequence[str]],
    quantities: Mapping[str, tuple[str, ...]],
) -> Told:
    """What a dump tells of contacts of `spheres`: those `quantities` whose columns are all there.

    The ends come first, and must be there. `frame` is that of the spheres.
    """
    listed = frame_of(path, "ENTRIES", frame.step)
    rows, columns, assumed = listed.rows, dict[str, str](), []
    groups: dict[str, dict[int, str]] = {}
    for column in rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            groups.setdefault(indexed[1], {})[int(indexed[2] or 1)] = column
        else:
            columns[column] = column
    for name, members in groups.items():
        words = computes.get(name)
        if words is None:
            words = recipes.get(len(members))
            if words is None:
                column = next(iter(members.values()))
                what = f"what the {len(members)} columns of c_{name} mean stands in a compute line"
                fault(path, what, "give the log that has it (--log)", rows.line - 1, column)
            assumed.append(f"columns of c_{name}: {' '.join(words)}")
        columns |= {words[k - 1]: column for k, column in members.items() if k <= len(words)}
    there = {what: names for what, names in quantities.items() if columns.keys() >= set(names)}
    ends, *_ = quantities.values()
    require(rows, columns, ends)
    names = [name for names in there.values() for name in names]
    table = rows.read(*(columns[name] for name in names))
    at = np.cumsum([len(names) for names in there.values()])
    values = dict(zip(there, np.split(table, at[:-1], axis=1), strict=True))
    i, j = ends_of(rows, spheres.number, table[:, :2].T, [columns[name] for name in ends])
    return Told(rows, i, j, values, assumed)


def require(rows: Rows, columns: Mapping[str, object], names: Sequence[str]) -> None:
    """InputError for the first of these names that is not among the columns."""
    for name in names:
        if name not in columns:
            what = f"no {name} among {' '.join(columns) or ' '.join(rows.columns)}"
            fault(rows.path, what, "let its compute line write it", rows.line - 1, name)


def planes_said(words: Sequence[str], units: Units, where: str, do: str) -> dict[int, float]:
    """z, m, of the walls by their codes: the two words behind zplane, NULL for none."""
    try:
        at = words.index("zplane") + 1
        ends = zip(CODES, words[at : at + 2], strict=True)
        return {code: units.length * float(z) for code, z in ends if z.upper() != "NULL"}
    except ValueError:
        raise InputError(f"{where}: no zplane LOW HIGH (a number or NULL); {do}") from None
