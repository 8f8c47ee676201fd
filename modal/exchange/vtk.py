"""VTK files for ParaView and others, written by meshio: spheres as points, contacts as lines.

Spheres: NAME.vtu, one point each, fields as point data; in ParaView a Glyph filter of spheres, its
scale array `radius` and factor 2, draws them. Contacts: NAME.contacts.vtu. Frames: NAME_0000.vtu
and so on, and NAME.pvd, which lists them with their times.
"""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from modal.exchange.picture import Lines
from modal.formats.hdf5 import HOST, unwritable, write_whole
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError


def write_spheres(path: Path, position: Floats, fields: dict[str, Array]) -> None:
    """Points (n, 3), m, with fields (n,) or (n, k)."""
    cells = [("vertex", np.arange(len(position))[:, None])]
    _write(path, position, cells, fields, {})


def write_lines(path: Path, lines: Lines) -> None:
    """Lines with their fields; ends are points of their own, so that images need no cell."""
    m = len(lines.ends)
    cells = [("line", np.arange(2 * m).reshape(m, 2))]
    _write(path, lines.ends.reshape(-1, 3), cells, {}, lines.fields)


def write_series(path: Path, frames: list[tuple[float, str]]) -> None:
    """NAME.pvd: files, in its own folder, and their times, s."""
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for time, name in frames:
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), file=name)
    write_whole(path, ElementTree.tostring(root, xml_declaration=True))


def _write(
    path: Path,
    points: Floats,
    cells: list[tuple[str, Array]],
    point_data: dict[str, Array],
    cell_data: dict[str, Array],
) -> None:
    try:
        import meshio  # only where VTK is asked for
    except ImportError:
        raise InputError(
            f"{path}: VTK is written by meshio; pip install meshio, or write NAME.xyz"
        ) from None
    mesh = meshio.Mesh(
        points,
        cells,
        point_data=point_data,
        cell_data={name: [data] for name, data in cell_data.items()},
    )
    partial = path.with_name(f".{path.stem}.{HOST}.{os.getpid()}.part.vtu")
    try:
        mesh.write(partial, file_format="vtu")
        write_whole(path, partial.read_bytes())
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)
