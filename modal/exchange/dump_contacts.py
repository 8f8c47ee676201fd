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
from modal.exchange.particles_and_contacts import WALLS, Packing, ends_of
from modal.exchange.rows import Rows, fault
from modal.exchange.words import Words
from modal.tools.arrays import Floats, Ints

Meanings = Mapping[str, Sequence[str]]
"""What the columns of a compute mean, by its ID."""
DO = "let its compute line write it"


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
    packing: Packing,
    computes: Meanings,
    recipes: Mapping[int, Sequence[str]],
    quantities: Mapping[str, tuple[str, ...]],
) -> Told:
    """What a dump tells of contacts of spheres: those `quantities` whose columns are all there.

    The ends come first, and must be there. `frame` is that of the spheres.
    """
    rows = frame_of(path, "ENTRIES", frame.step).rows
    columns, assumed = dict[str, str](), list[str]()
    groups: dict[str, dict[int, str]] = {}
    for column in rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            groups.setdefault(indexed[1], {})[int(indexed[2] or 1)] = column
        else:
            columns[column] = column
    for name, members in groups.items():
        words = computes.get(name) or recipes.get(len(members))
        if words is None:
            what = f"what the {len(members)} columns of c_{name} mean stands in a compute line"
            do = "give the log that has it (--log)"
            fault(path, what, do, rows.line - 1, next(iter(members.values())))
        if name not in computes:
            assumed.append(f"columns of c_{name}: {' '.join(words)}")
        columns |= {words[k - 1]: column for k, column in members.items() if k <= len(words)}
    ends, *_ = quantities.values()
    rows.require(ends, DO, columns)
    there = {what: names for what, names in quantities.items() if columns.keys() >= set(names)}
    table = rows.read(*(columns[name] for names in there.values() for name in names))
    at = np.cumsum([len(names) for names in there.values()])
    values = dict(zip(there, np.split(table, at[:-1], axis=1), strict=True))
    named = [columns[name] for name in ends]
    i, j = ends_of(rows, packing.number, table[:, :2].T, named, walls=False)
    return Told(rows, i, j, values, assumed)


def planes_said(words: Words, units: Units) -> dict[int, float]:
    """z, m, of the walls by their codes: the two words behind zplane, NULL for none."""
    ends = zip(WALLS, words.numbers("zplane", 2, null=True), strict=True)
    return {code: units.length * z for code, z in ends if not np.isnan(z)}
