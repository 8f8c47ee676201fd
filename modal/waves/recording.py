"""The columns of a recording, over time or over frequency: one table for both of their files.

A wave is recorded over time, in m and Pa (of torsion in rad, and torque over area, N/m); a response
over frequency, complex, per unit of the source's motion. What a source or a packing does not have,
as a cell without walls a chain and stresses on them, is an empty array, and not in the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
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
_RECORDED = {
    "source_stress": Column("source/stress", "f", ("n",), "Pa", optional=True),
    "receiver_stress": Column("receiver/stress", "f", ("n",), "Pa", optional=True),
    "chain_displacement": Column("chain/displacement", "f", ("n", "nc"), "m", optional=True),
    "layer_displacement": Column("layers/displacement", "f", ("n", "nl"), "m", optional=True),
}
_PLACES = {
    "chain_particle": Column("chain/particle", "i", ("nc",), "1", optional=True),
    "layer_position": Column("layers/position", "f", ("nl",), "m", optional=True),
    "source_height": Column("source/height", "f", (1,), "m", optional=True, since=2),
}
OF_TIME = {
    "time": Column("time", "f", ("n",), "s"),
    "source_displacement": Column("source/displacement", "f", ("n",), "m"),
    "particle_displacement": Column("particles/displacement", "f", ("n", "np"), "m", optional=True),
    "chain_position": Column("chain/position", "f", ("nc",), "m", optional=True),
    **(_PLACES | _RECORDED),
}
"""Of a recording over time."""
OF_FREQUENCY = {
    "frequency": Column("frequency", "f", ("n",), "Hz"),
    "gain": Column("gain", "f", ("n",), "1", optional=True),
    **_PLACES,
    **{
        name: column._replace(kind="c", unit=f"{column.unit}/m", optional=not name.startswith("layer"))
        for name, column in _RECORDED.items()
    },
}
"""Over frequency, per metre of the source; means over layers are always there."""
VERSION = (1, 2)
"""Of the files."""
TWISTED = {"m": "rad", "Pa": "N/m"}
"""Units in torsion, of what moves and of what resists."""
SAID = {"direction": str, "source": str, "network_sha256": str}
"""Attributes of both, with what files of before mean that do not say so."""
UNSAID = {"direction": "z", "source": "wall", "network_sha256": ""}


def write_recording(
    product: Product, path: str | Path, values: Mapping[str, Any], made: Provenance | None
) -> None:
    """Write what is there, torsion in its own units; what is empty is left out."""
    columns = product.columns
    if values["direction"] == TORSION:
        columns = {name: _twisted(column) for name, column in columns.items()}
    there = {
        name: None if name in columns and np.size(value) == 0 else value
        for name, value in values.items()
    }
    replace(product, columns=columns).write(path, there, made)


def read_recording(product: Product, path: str | Path) -> dict[str, Any]:
    """All values, what a file may lack as an empty array; InputError for anything wrong."""
    said = product.read(path)
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
