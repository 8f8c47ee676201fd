"""Pictures of a packing: fields on spheres, contacts as lines, frames of motion; as VTK by meshio.

In VTK, for ParaView and others, spheres are NAME.vtu, one point each, fields as point data; a Glyph
filter of spheres, its scale array `radius` and factor 2, draws them. Contacts: NAME.contacts.vtu.
Frames: NAME_0000.vtu and so on, and NAME.pvd, which lists them with their times.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from modal.formats.hdf5 import HOST, unwritable, write_whole
from modal.packing.network import Network
from modal.packing.state import contacts_per_particle
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError

VISIBLE = 0.5
"""Largest displacement in a frame, in mean radii, unless a scale is given."""


@dataclass(frozen=True)
class Lines:
    """Contacts as lines: ends (m, 2, 3), m, in the image of i, and fields (m,) or (m, 3)."""

    ends: Floats
    fields: dict[str, Array]


class Frame(NamedTuple):
    """Spheres at one time: its value, s; displacement (n, 3), m, or kg^-1/2 of a mode."""

    time: float
    displacement: Floats


def sphere_fields(network: Network) -> dict[str, Array]:
    """Fields of the spheres: radius, mass, number of contacts, and stress where forces are known.

    stress (n, 6), Pa, xx yy zz yz zx xy, compression positive: the mean inside each sphere, its
    contact forces times its levers over its volume. Times the volumes they add up to the packing's.
    """
    fields: dict[str, Array] = {
        "radius": network.radius,
        "mass": network.mass,
        "contacts": contacts_per_particle(network).astype(np.int32),
    }
    if network.force_normal is not None and network.force_tangential is not None:
        fields["stress"] = sphere_stress(network)
    return fields


def sphere_stress(network: Network) -> Floats:
    """Shape (n, 6), Pa: see `sphere_fields`; the symmetric part."""
    n, pair = network.n_particles, ~network.with_wall
    along = network.require("force_normal", "stress of spheres")
    on_j = along[:, None] * network.normal - network.require(
        "force_tangential", "stress of spheres"
    )
    virial = np.zeros((n, 3, 3))
    np.add.at(virial, network.particle_i, network.lever_i[:, :, None] * on_j[:, None, :])
    np.add.at(
        virial,
        network.particle_j[pair],
        -network.lever_j[pair][:, :, None] * on_j[pair][:, None, :],
    )
    virial = (virial + virial.transpose(0, 2, 1)) / 2
    rows, columns = (0, 1, 2, 1, 2, 0), (0, 1, 2, 2, 0, 1)
    stress: Floats = virial[:, rows, columns] / (4 / 3 * np.pi * network.radius**3)[:, None]
    return stress


def contact_lines(network: Network) -> Lines:
    """Contacts from the centre of i to that of j's image, or to the wall."""
    start = network.position[network.particle_i]
    fields: dict[str, Array] = {
        "stiffness_normal": network.stiffness_normal,
        "wall": network.with_wall.astype(np.int32),
    }
    if network.force_normal is not None:
        fields["force_normal"] = network.force_normal
        if network.force_tangential is not None:
            fields["force"] = (
                network.force_tangential - network.force_normal[:, None] * network.normal
            )
    for name in ("overlap", "sliding"):
        data = getattr(network, name)
        if data is not None:
            fields[name] = data.astype(np.int32) if name == "sliding" else data
    return Lines(np.stack([start, start + network.branch], axis=1), fields)


def mode_frames(shape: Floats, frequency: float, count: int) -> Iterator[Frame]:
    """One period of a mode, `shape` (n, 6): the displacements at `count` times, evenly spaced."""
    for k in range(count):
        phase = 2 * np.pi * k / count
        time = k / count / frequency if frequency > 0 else float(k)
        yield Frame(time, np.cos(phase) * shape[:, :3])


def wave_frames(time: Floats, moved: Floats, axis: int, count: int) -> Iterator[Frame]:
    """About `count` of the recorded times of a wave that `moved` (nt, n), m, along an axis."""
    every = max(1, -(-len(time) // count))
    for k in range(0, len(time), every):
        displacement = np.zeros((moved.shape[1], 3))
        displacement[:, axis] = moved[k]
        yield Frame(float(time[k]), displacement)


def scale_of(network: Network, largest: float, scale: float | None) -> float:
    """Factor on displacements: the one that is given, or one that makes the largest visible."""
    if scale is not None:
        return scale
    return VISIBLE * float(network.radius.mean()) / largest if largest > 0 else 1.0


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
