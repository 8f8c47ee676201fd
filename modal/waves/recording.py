"""The columns of a recording, over time or over frequency: one table for both of their files.

A wave is recorded over time, in m and Pa (of torsion in rad, and torque over area, N/m); a response
over frequency, complex, per unit of the source's motion. What a source or a packing does not have,
as a cell without walls a chain and stresses on them, is an empty array, and not in the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.product import Column, Product
from modal.formats.provenance import Provenance
from modal.tools.errors import InputError

TORSION = "torsion"
DIRECTIONS = ("x", "y", "z")
"""Along which a source may move: z sends P-waves, x and y send S-waves."""
COMPONENT = {"x": 0, "y": 1, "z": 2, TORSION: 5}
"""Of the six motions of a sphere the one that is recorded: along the direction, or about z."""
RECORDED = {
    "source_stress": Column("source/stress", "f", ("n",), "Pa", optional=True),
    "receiver_stress": Column("receiver/stress", "f", ("n",), "Pa", optional=True),
    "chain_displacement": Column("chain/displacement", "f", ("n", "nc"), "m", optional=True),
    "layer_displacement": Column("layers/displacement", "f", ("n", "nl"), "m", optional=True),
}
"""Over time or frequency, where they are complex and per metre."""
PLACES = {
    "chain_particle": Column("chain/particle", "i", ("nc",), "1", optional=True),
    "layer_position": Column("layers/position", "f", ("nl",), "m", optional=True),
    "source_height": Column("source/height", "f", (1,), "m", optional=True, since=2),
}
OF_TIME = {
    "time": Column("time", "f", ("n",), "s"),
    "source_displacement": Column("source/displacement", "f", ("n",), "m"),
    "particle_displacement": Column("particles/displacement", "f", ("n", "np"), "m", optional=True),
    "chain_position": Column("chain/position", "f", ("nc",), "m", optional=True),
}
OF_FREQUENCY = {
    "frequency": Column("frequency", "f", ("n",), "Hz"),
    "gain": Column("gain", "f", ("n",), "1", optional=True),
}
VERSION = (1, 2)
"""Of the files."""
TWISTED = {"m": "rad", "Pa": "N/m"}
"""Units in torsion, of what moves and of what resists."""
SAID = {"direction": str, "source": str, "network_sha256": str}
"""Attributes of both, with what files of before mean that do not say so."""
UNSAID = {"direction": "z", "source": "wall", "network_sha256": ""}


class Format:
    """The file of one kind of recording, over time or over frequency."""

    def __init__(self, schema: str, further: Mapping[str, Any], *, over_time: bool) -> None:
        recorded = {
            name: column if over_time else column._replace(kind="c", unit=f"{column.unit}/m")
            for name, column in RECORDED.items()
        }
        if not over_time:
            recorded["layer_displacement"] = recorded["layer_displacement"]._replace(optional=False)
        self.columns = (OF_TIME if over_time else OF_FREQUENCY) | PLACES | recorded
        twisted = {name: _twisted(column) for name, column in self.columns.items()}
        self._product, self._twisted = (
            Product(schema, columns, **further, versions=VERSION)
            for columns in (self.columns, twisted)
        )

    def write(self, path: str | Path, values: Mapping[str, Any], made: Provenance | None) -> None:
        """Write what is there; what is empty is left out."""
        product = self._twisted if values["direction"] == TORSION else self._product
        there = {
            name: None if name in self.columns and np.size(value) == 0 else value
            for name, value in values.items()
        }
        product.write(path, there, made)

    def read(self, path: str | Path) -> dict[str, Any]:
        """All values, what a file may lack as an empty array; InputError for anything wrong."""
        said = self._product.read(path)
        if said["direction"] not in COMPONENT:
            known = ", ".join(COMPONENT)
            raise InputError(f"{path}: direction {said['direction']!r} is none of {known}; mend it")
        length = len(said["time" if "time" in said else "frequency"])
        for name, empty in without_walls(length).items():
            if name in said and said[name] is None:
                said[name] = empty
        return said


def without_walls(length: int) -> dict[str, Any]:
    """Columns of a recording at so many times or frequencies that has no walls and no chain."""
    return {
        "source_stress": np.empty(0),
        "receiver_stress": np.empty(0),
        "chain_particle": np.empty(0, int),
        "chain_position": np.empty(0),
        "chain_displacement": np.empty((length, 0)),
    }


def _twisted(column: Column) -> Column:
    """The column in torsion's units, of what is recorded along its direction."""
    if column.dataset.rpartition("/")[2] not in ("displacement", "stress"):
        return column
    unit, *per = column.unit.split("/")
    return column._replace(unit="/".join([TWISTED[unit], *per]))
