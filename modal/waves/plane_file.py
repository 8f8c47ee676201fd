"""Waves from a plane inside a cell as a file: "granular-plane-wave", version 1.

No wave signals: there is neither a wall, whose stress would be recorded, nor a chain between two.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modal.formats.hdf5 import complete, get, open_h5, put
from modal.formats.provenance import Provenance, new_product
from modal.tools.errors import InputError
from modal.waves.plane_source import PlaneWave
from modal.waves.signals import DIRECTIONS

SCHEMA = "granular-plane-wave"
VERSION = 1


def write_plane_wave(
    path: str | Path,
    wave: PlaneWave,
    network_sha256: str = "",
    made: Provenance | None = None,
    *,
    particles: bool = False,
) -> None:
    """Write the wave atomically: its layers, and with `particles` the motion of every sphere."""
    with new_product(path, SCHEMA, VERSION, made) as file:
        file.attrs["network_sha256"] = network_sha256
        file.attrs.update(height=wave.height, direction=wave.direction, products=wave.products)
        file.attrs["truncation"] = wave.truncation
        put(file, "time", wave.time, "s")
        put(file, "source/displacement", wave.source_displacement, "m")
        put(file, "layers/position", wave.layer_position, "m")
        put(file, "layers/displacement", wave.layer_displacement, "m")
        if particles and wave.particle_displacement is not None:
            put(file, "particles/displacement", wave.particle_displacement, "m")


def read_plane_wave(path: str | Path) -> PlaneWave:
    """Read and validate; InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        time = get(file, "time", "f", (None,))
        place = get(file, "layers/position", "f", (None,))
        columns: dict[str, Any] = {
            "source_displacement": get(file, "source/displacement", "f", time.shape),
            "layer_displacement": get(
                file, "layers/displacement", "f", (*time.shape, *place.shape)
            ),
            "particle_displacement": None,
        }
        if "particles/displacement" in file:
            name = "particles/displacement"
            columns["particle_displacement"] = get(file, name, "f", (*time.shape, None))
        with complete(path):
            columns["height"] = float(file.attrs["height"])
            columns["direction"] = str(file.attrs["direction"])
            columns["products"] = int(file.attrs["products"])
            columns["truncation"] = float(file.attrs.get("truncation", np.nan))
    finite = all(np.isfinite(c).all() for c in columns.values() if isinstance(c, np.ndarray))
    if not (finite and columns["direction"] in DIRECTIONS and (np.diff(time) > 0).all()):
        raise InputError(f"{path}: not finite, times that do not rise, or no direction; mend it")
    return PlaneWave(time=time, layer_position=place, **columns)
