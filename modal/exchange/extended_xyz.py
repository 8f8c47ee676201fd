"""Extended XYZ, which OVITO reads: a line of names before the rows of each frame, 17 digits.

`Lattice` and `Origin` are the cell as OVITO's manual has them, `pbc` its periods; columns as
`Properties` names them. meshio does not know the format, and common writers of it round positions
to 8 decimals.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from modal.formats.hdf5 import write_whole
from modal.packing.network import Network
from modal.tools.arrays import Array, Floats


def write_frames(
    path: Path, network: Network, frames: Iterable[tuple[float, Floats, dict[str, Array]]]
) -> None:
    """Frames of time, s, position (n, 3), m, and fields (n,) or (n, k) of the spheres."""
    text = io.StringIO()
    for time, position, fields in frames:
        columns: dict[str, Array] = {"pos": position} | fields
        names = [
            f"{name}:{'I' if data.dtype.kind in 'ib' else 'R'}:{data.size // len(position)}"
            for name, data in columns.items()
        ]
        text.write(f"{len(position)}\n{_cell(network)} Time={time!r} ")
        text.write(f"Properties=species:S:1:{':'.join(names)}\n")
        table = np.column_stack(list(columns.values()))
        formats = [
            "%d" if data.dtype.kind in "ib" else "%.17g"
            for data in columns.values()
            for _ in range(data.size // len(position))
        ]
        np.savetxt(text, table, fmt="sphere " + " ".join(formats))
    write_whole(path, text.getvalue().encode())


def _cell(network: Network) -> str:
    """The cell: along z from wall to wall, across from 0, or where it holds all centres.

    A network does not keep where its lateral period began in another program's file. Along an axis
    without a size it is as wide as the spheres.
    """
    position, radius = network.position, network.radius[:, None]
    low, high = (position - radius).min(axis=0), (position + radius).max(axis=0)
    sized = network.cell_size > 0
    size = np.where(sized, network.cell_size, high - low)
    from_zero = (position.min(axis=0) >= 0) & (position.max(axis=0) <= size)
    low = np.where(sized, np.where(from_zero, 0.0, position.min(axis=0)), low)
    if sized[2]:
        low[2] = network.wall_position[0]
    lattice, origin = (" ".join(map(repr, of.ravel().tolist())) for of in (np.diag(size), low))
    pbc = " ".join("T" if axis else "F" for axis in network.cell_periodic)
    return f'Lattice="{lattice}" Origin="{origin}" pbc="{pbc}"'
