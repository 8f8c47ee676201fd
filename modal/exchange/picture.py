"""Write pictures of a packing: fields on spheres, frames of motion, contacts as lines.

VTK files are written by meshio, for ParaView and others. Spheres are points in NAME.vtu, and fields
are point data; to draw spheres use a Glyph filter with the scale array `radius` and the factor 2.
Contacts are NAME.contacts.vtu. Frames are NAME_0000.vtu and so on, and NAME.pvd, which lists them
with their times.

In extended XYZ, which OVITO reads, a line of names precedes the rows of each frame. `Lattice` and
`Origin` are the cell as in OVITO's manual, `pbc` its periods. meshio cannot write this format, and
common writers of it round positions to 8 decimals; here positions have 17 digits.
"""

import io
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from modal.exchange.refusals import refuse
from modal.formats.attributes import read_attributes
from modal.formats.hdf5 import open_h5
from modal.formats.whole_file import unwritable, write_whole
from modal.modes.mode_set import SCHEMA as MODES_SCHEMA
from modal.modes.mode_set import ModeSet, read_modes
from modal.packing.network import Network
from modal.packing.state import contact_forces, contacts_per_particle, has_forces
from modal.tools.arrays import Array, Floats
from modal.waves.signals import EARLY_PLANE_SCHEMA, Signals, read_signals
from modal.waves.signals import SCHEMA as SIGNALS_SCHEMA

MAX_SHOWN_DISPLACEMENT_IN_RADII = 0.5
"""Largest displacement in a frame, in mean radii, unless a scale is given: it is visible, and
spheres stay beside their neighbours."""
VOIGT = (0, 1, 2, 1, 2, 0), (0, 1, 2, 2, 0, 1)
"""Rows and columns of xx yy zz yz zx xy."""

Motion = list[tuple[float, Floats]]
"""List of times, s, and displacements (n, 3), in m for a wave and in kg^-1/2 for a mode."""
Fields = dict[str, Array]
"""Fields (n,) or (n, k) of n points or lines, by their names."""
Frames = Iterable[tuple[float, Floats, Fields]]
"""Sequence of times, s, positions (n, 3), m, and fields of the spheres."""


class SphereMotion(NamedTuple):
    """Motion of every sphere in a wave or in modes.

    product: the wave or the modes. displacement: displacements (nt, n), m, of a wave, or shapes (k,
    n, 6) of modes. numbers: numbers of the chosen modes, from 1; empty for a wave.
    """

    product: Signals | ModeSet
    displacement: Floats
    numbers: list[int]


def read_sphere_motion(
    product: str | Path, chosen: list[int] | None, *, any_source: bool = False
) -> SphereMotion:
    """Return the motion of every sphere in a wave or in modes of a file.

    `chosen` are the numbers of modes, from 1, by default all; `any_source` is passed to
    `read_signals`. Raises InputError for another product, for one without the motion of every
    sphere, and for numbers of modes that the file does not have.
    """
    with open_h5(product) as file:
        schema = read_attributes(file).get("schema")
    if schema == MODES_SCHEMA:
        return _read_mode_shapes(product, chosen)
    if schema not in (SIGNALS_SCHEMA, EARLY_PLANE_SCHEMA):
        remedy = "give *.signals.h5 or *.modes.h5"
        refuse(product, "other_product", "neither signals nor modes", remedy=remedy)
    if chosen:
        refuse("--modes", "no_such_mode", "the file has a wave", remedy="give *.modes.h5")
    signals = read_signals(product, of_any_source=any_source)
    if signals.particle_displacement is None:
        problem = "without the motion of every sphere"
        remedy = "make it again with wave --particles"
        refuse(product, "no_sphere_motion", problem, remedy=remedy)
    return SphereMotion(signals, signals.particle_displacement, [])


def _read_mode_shapes(product: str | Path, chosen: list[int] | None) -> SphereMotion:
    """Return the shapes of modes; raise InputError if the file lacks them or a chosen mode."""
    modes = read_modes(product)
    count = len(modes.frequency)
    if modes.mode_shape is None or count == 0:
        remedy = "make it again with modes -o"
        refuse(product, "no_sphere_motion", "without mode shapes", remedy=remedy)
    numbers = chosen or list(range(1, count + 1))
    for number in numbers:
        if not 1 <= number <= count:
            refuse(f"--modes {number}", "no_such_mode", f"the file has modes 1 to {count}")
    return SphereMotion(modes, modes.mode_shape, numbers)


def sphere_fields(network: Network) -> Fields:
    """Return the fields of the n spheres.

    They are the radius, the mass, the number of contacts and, if forces are known, the stress.
    stress (n, 6), Pa, xx yy zz yz zx xy, compression positive, is the mean inside each sphere: its
    contact forces times its levers, divided by its volume. Weighted by the volumes the stresses add
    up to that of the packing.
    """
    fields: Fields = {
        "radius": network.radius,
        "mass": network.mass,
        "contacts": contacts_per_particle(network).astype(np.int32),
    }
    if has_forces(network):
        fields["stress"] = sphere_stress(network)
    return fields


def sphere_stress(network: Network) -> Floats:
    """Return the symmetric part of the stress of spheres, (n, 6), Pa, as in `sphere_fields`."""
    force_on_j = -contact_forces(network, "stress of spheres")
    is_pair = ~network.with_wall
    virial = np.zeros((network.n_particles, 3, 3))
    _add_products(virial, network.particle_i, network.lever_i, force_on_j)
    lever_j = -network.lever_j[is_pair]
    _add_products(virial, network.particle_j[is_pair], lever_j, force_on_j[is_pair])
    virial = (virial + virial.transpose(0, 2, 1)) / 2
    volume = 4 / 3 * np.pi * network.radius**3
    return virial[:, *VOIGT] / volume[:, None]


def _add_products(total: Floats, spheres: Array, lever: Floats, force: Floats) -> None:
    """Add the outer products of levers and forces (m, 3) to the sums (n, 3, 3) of their spheres."""
    np.add.at(total, spheres, lever[:, :, None] * force[:, None, :])


def contact_lines(network: Network) -> tuple[Floats, Fields]:
    """Return m contacts as lines: ends (m, 2, 3), m, and fields (m,) or (m, 3).

    A line leads from the centre of i to that of the image of j, or to the wall.
    """
    start = network.position[network.particle_i]
    fields: Fields = {"wall": network.with_wall.astype(np.int32)}
    for name in ("stiffness_normal", "force_normal", "overlap", "sliding"):
        column = getattr(network, name)
        if column is not None:
            fields[name] = column.astype(np.int32) if column.dtype == bool else column
    if has_forces(network):
        fields["force"] = contact_forces(network, "force")
    return np.stack([start, start + network.branch], axis=1), fields


def animate_mode(shape: Floats, frequency: float, count: int) -> Motion:
    """Return one period of a mode at `count` evenly spaced times.

    `shape` (n, 6) is the mode, `frequency` its frequency, Hz; for a frequency of zero each frame
    takes 1 s.
    """
    rate = frequency if frequency > 0 else 1 / count
    displacement = shape[:, :3]
    return [(k / count / rate, np.cos(2 * np.pi * k / count) * displacement) for k in range(count)]


def animate_wave(time: Floats, displacement: Floats, axis: int, count: int) -> Motion:
    """Return about `count` of the recorded times of a wave.

    `time` (nt,) is in s, `displacement` (nt, n), m, along one axis (0, 1, 2).
    """
    stride = -(-len(time) // count)
    is_axis = np.arange(3) == axis
    motion = []
    for instant, row in zip(time[::stride].tolist(), displacement[::stride], strict=True):
        motion.append((instant, np.where(is_axis, row[:, None], 0.0)))
    return motion


def displace_spheres(
    network: Network, fields: Fields, motion: Motion, scale: float | None
) -> Frames:
    """Yield a frame of spheres, displaced by `scale` times their motion, for each time.

    By default the scale makes the largest displacement half a mean radius.
    """
    largest = max(float(np.linalg.norm(moved, axis=1).max()) for _, moved in motion)
    if scale is None:
        scale = 1.0
        if largest > 0:
            scale = MAX_SHOWN_DISPLACEMENT_IN_RADII * float(network.radius.mean()) / largest
    for time, moved in motion:
        yield time, network.position + scale * moved, fields | {"displacement": moved}


def write_vtk(path: Path, network: Network, frames: Frames, *, series: bool) -> list[str]:
    """Write spheres and contacts as VTK; return the names of the files.

    Spheres are NAME.vtu or, as a `series`, one file a frame and NAME.pvd. Raises InputError if
    meshio is not installed or a file cannot be written.
    """
    ends, contact_fields = contact_lines(network)
    contacts = path.with_suffix(".contacts.vtu")
    # Ends are points of their own, so that images need no cell.
    cells = np.arange(2 * len(ends)).reshape(-1, 2)
    _write_mesh(contacts, ends.reshape(-1, 3), "line", cells, contact_fields)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    written: list[str] = []
    for k, (time, position, fields) in enumerate(frames):
        name = path.with_name(f"{path.stem}_{k:04d}.vtu") if series else path
        points = np.arange(len(position))[:, None]
        _write_mesh(name, position, "vertex", points, fields)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), file=name.name)
        written.append(str(name))
    if not series:
        return [*written, str(contacts)]
    list_of_frames = path.with_suffix(".pvd")
    write_whole(list_of_frames, ElementTree.tostring(root, xml_declaration=True))
    return [str(list_of_frames), str(contacts), *written]


def _write_mesh(path: Path, points: Floats, shape: str, cells: Array, fields: Fields) -> None:
    """Write a mesh of vertices with fields of the points, or of lines with fields of the lines."""
    try:
        import meshio  # only needed for VTK
    except ImportError:
        problem = "VTK is written by meshio"
        remedy = "pip install meshio, or write NAME.xyz"
        refuse(path, "no_meshio", problem, remedy=remedy)
    if shape == "line":
        cell_data = {name: [column] for name, column in fields.items()}
        mesh = meshio.Mesh(points, [(shape, cells)], cell_data=cell_data)
    else:
        mesh = meshio.Mesh(points, [(shape, cells)], point_data=fields)
    try:
        with TemporaryDirectory() as folder:
            draft = Path(folder, path.name)
            mesh.write(draft, file_format="vtu")
            written = draft.read_bytes()
    except OSError as error:
        raise unwritable(path, error) from error
    write_whole(path, written)


def write_xyz(path: Path, network: Network, frames: Frames, *, series: bool) -> list[str]:
    """Write frames into one file of extended XYZ; return its name.

    A `series` has many frames, otherwise there is one.
    """
    text = io.StringIO()
    for time, position, fields in frames:
        columns: Fields = {"pos": position} | fields
        names = []
        formats = ["sphere"]
        for name, column in columns.items():
            is_whole = column.dtype.kind in "ib"
            width = column.size // len(position)
            names.append(f"{name}:{'I' if is_whole else 'R'}:{width}")
            formats += ["%d" if is_whole else "%.17g"] * width
        text.write(f"{len(position)}\n{_describe_cell(network)} Time={time!r} ")
        text.write(f"Properties=species:S:1:{':'.join(names)}\n")
        table = np.column_stack(list(columns.values()))
        np.savetxt(text, table, fmt=" ".join(formats))
    write_whole(path, text.getvalue().encode())
    return [str(path)]


def _describe_cell(network: Network) -> str:
    """Return `Lattice`, `Origin` and `pbc` of extended XYZ.

    Along z the cell reaches from wall to wall. Along x and y it starts at 0, or at the lowest
    centre if a cell from 0 does not contain all centres: a network does not store where the lateral
    periods began in another program's file. Along an axis without a size the cell is as wide as the
    spheres.
    """
    position = network.position
    radius = network.radius[:, None]
    lowest_surface = (position - radius).min(axis=0)
    highest_surface = (position + radius).max(axis=0)
    has_size = network.cell_size > 0
    size = np.where(has_size, network.cell_size, highest_surface - lowest_surface)
    lowest_centre = position.min(axis=0)
    fits_from_zero = (lowest_centre >= 0) & (position.max(axis=0) <= size)
    low = np.where(has_size, np.where(fits_from_zero, 0.0, lowest_centre), lowest_surface)
    if has_size[2]:
        low[2] = network.wall_position[0]
    edges = np.diag(size)
    if network.cell_vectors is not None:
        edges = network.cell_vectors
    lattice = _join_numbers(edges)
    origin = _join_numbers(low)
    pbc = " ".join("T" if periodic else "F" for periodic in network.cell_periodic)
    return f'Lattice="{lattice}" Origin="{origin}" pbc="{pbc}"'


def _join_numbers(numbers: Floats) -> str:
    """Return numbers in full precision, with blanks between them."""
    return " ".join(repr(number) for number in numbers.ravel().tolist())


WRITERS = {".vtu": write_vtk, ".xyz": write_xyz}
"""Functions that write a picture, by the ending of the file's name."""
