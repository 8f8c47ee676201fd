"""Pictures of a packing: fields on spheres, frames of motion, contacts as lines; VTK, extended XYZ.

In VTK (by meshio), for ParaView and others, spheres are NAME.vtu, one point each, fields as point
data; a Glyph filter of spheres, its scale array `radius` and factor 2, draws them. Contacts are
NAME.contacts.vtu. Frames: NAME_0000.vtu and so on, and NAME.pvd, which lists them with their times.

In extended XYZ, which OVITO reads, a line of names stands before the rows of each frame. `Lattice`
and `Origin` are the cell as OVITO's manual has them, `pbc` its periods. meshio does not know the
format, and common writers of it round positions to 8 decimals; here they have 17 digits.
"""

import io
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import numpy as np

from modal.formats.attributes import read_attributes
from modal.formats.hdf5 import open_h5
from modal.formats.whole_file import unwritable, write_whole
from modal.modes.mode_set import SCHEMA as MODES
from modal.modes.mode_set import ModeSet, read_modes
from modal.packing.network import Network
from modal.packing.state import contact_forces, contacts_per_particle, has_forces
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.waves.signals import EARLY_PLANE_SCHEMA, SCHEMA, Signals, read_signals

VISIBLE = 0.5
"""Largest displacement in a frame, in mean radii, unless a scale is given."""
VOIGT = (0, 1, 2, 1, 2, 0), (0, 1, 2, 2, 0, 1)
"""Rows and columns of xx yy zz yz zx xy."""

Motion = list[tuple[float, Floats]]
"""Times, s, and displacements (n, 3), m, or kg^-1/2 of a mode."""
Frames = Iterable[tuple[float, Floats, dict[str, Array]]]
"""Times, s, positions (n, 3), m, and fields (n,) or (n, k) of the spheres."""


def moving(
    product: str | Path, chosen: list[int] | None, *, any_source: bool = False
) -> tuple[Signals | ModeSet, Floats, list[int]]:
    """A wave or modes from a file, how every sphere moves, and the numbers of the chosen modes.

    Motions are (nt, n), m, of a wave, (k, n, 6) of modes, which are numbered from 1, by default
    all. InputError for another product, or one without the motion of every sphere; `any_source` as
    of `read_signals`.
    """
    with open_h5(product) as file:
        schema = read_attributes(file).get("schema")
    if schema not in (MODES, SCHEMA, EARLY_PLANE_SCHEMA):
        raise InputError(
            "input",
            f"{product}: neither signals nor modes",
            remedy="give *.signals.h5 or *.modes.h5",
        )
    if schema != MODES:
        if chosen:
            raise InputError("input", "--modes", "the file has a wave", "give *.modes.h5")
        signals = read_signals(product, of_any_source=any_source)
        if signals.particle_displacement is None:
            why = "without the motion of every sphere; make it again with wave --particles"
            raise InputError("input", f"{product}: {why}")
        return signals, signals.particle_displacement, []
    modes = read_modes(product)
    if modes.mode_shape is None or not len(modes.frequency):
        raise InputError(
            "input", f"{product}: without mode shapes", remedy="make it again with modes -o"
        )
    numbers = chosen or list(range(1, len(modes.frequency) + 1))
    for number in numbers:
        if not 1 <= number <= len(modes.frequency):
            raise InputError(
                "input", f"--modes {number}", f"the file has modes 1 to {len(modes.frequency)}"
            )
    return modes, modes.mode_shape, numbers


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
    if has_forces(network):
        fields["stress"] = sphere_stress(network)
    return fields


def sphere_stress(network: Network) -> Floats:
    """Shape (n, 6), Pa: see `sphere_fields`; the symmetric part."""
    on_j = -contact_forces(network, "stress of spheres")
    virial, pair = np.zeros((network.n_particles, 3, 3)), ~network.with_wall
    for end, lever, force in (
        (network.particle_i, network.lever_i, on_j),
        (network.particle_j[pair], -network.lever_j[pair], on_j[pair]),
    ):
        np.add.at(virial, end, lever[:, :, None] * force[:, None, :])
    virial = (virial + virial.transpose(0, 2, 1)) / 2
    return virial[:, *VOIGT] / (4 / 3 * np.pi * network.radius**3)[:, None]


def contact_lines(network: Network) -> tuple[Floats, dict[str, Array]]:
    """Contacts as lines: ends (m, 2, 3), m, and fields (m,) or (m, 3).

    From the centre of i to that of j's image, or to the wall.
    """
    start = network.position[network.particle_i]
    fields: dict[str, Array] = {"wall": network.with_wall.astype(np.int32)}
    for name in ("stiffness_normal", "force_normal", "overlap", "sliding"):
        if (data := getattr(network, name)) is not None:
            fields[name] = data.astype(np.int32) if data.dtype == bool else data
    if has_forces(network):
        fields["force"] = contact_forces(network, "force")
    return np.stack([start, start + network.branch], axis=1), fields


def motion_of_mode(shape: Floats, frequency: float, count: int) -> Motion:
    """One period of a mode, `shape` (n, 6), at `count` times, evenly spaced."""
    rate = frequency if frequency > 0 else 1 / count
    return [(k / count / rate, np.cos(2 * np.pi * k / count) * shape[:, :3]) for k in range(count)]


def motion_of_wave(time: Floats, moved: Floats, axis: int, count: int) -> Motion:
    """About `count` of the recorded times of a wave that `moved` (nt, n), m, along an axis."""
    every = -(-len(time) // count)
    rows = zip(time[::every].tolist(), moved[::every], strict=True)
    along = np.arange(3) == axis
    return [(at, np.where(along, row[:, None], 0.0)) for at, row in rows]


def frames_of(
    network: Network, fields: dict[str, Array], motion: Motion, scale: float | None
) -> Frames:
    """Spheres that are displaced by `scale` times their motion; None: the largest is visible."""
    largest = max(float(np.linalg.norm(moved, axis=1).max()) for _, moved in motion)
    if scale is None:
        scale = VISIBLE * float(network.radius.mean()) / largest if largest > 0 else 1.0
    for time, moved in motion:
        yield time, network.position + scale * moved, fields | {"displacement": moved}


def write_vtk(path: Path, network: Network, frames: Frames, *, series: bool) -> list[str]:
    """NAME.vtu, or of a `series` NAME.pvd and a file a frame; and the contacts. Their names."""
    ends, of_contacts = contact_lines(network)
    contacts, written = path.with_suffix(".contacts.vtu"), list[str]()
    # Ends are points of their own, so that images need no cell.
    cells = np.arange(2 * len(ends)).reshape(-1, 2)
    _write_mesh(contacts, ends.reshape(-1, 3), "line", cells, of_contacts)
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(root, "Collection")
    for k, (time, position, fields) in enumerate(frames):
        name = path.with_name(f"{path.stem}_{k:04d}.vtu") if series else path
        points = np.arange(len(position))[:, None]
        _write_mesh(name, position, "vertex", points, fields)
        ElementTree.SubElement(collection, "DataSet", timestep=repr(time), file=name.name)
        written.append(str(name))
    if not series:
        return [*written, str(contacts)]
    listed = path.with_suffix(".pvd")
    write_whole(listed, ElementTree.tostring(root, xml_declaration=True))
    return [str(listed), str(contacts), *written]


def _write_mesh(
    path: Path, points: Floats, shape: str, cells: Array, fields: dict[str, Array]
) -> None:
    """Fields are of the points, of lines of the cells."""
    try:
        import meshio  # only where VTK is asked for
    except ImportError:
        do = "pip install meshio, or write NAME.xyz"
        raise InputError("input", f"{path}: VTK is written by meshio", remedy=f"{do}") from None
    of_cells = {name: [data] for name, data in fields.items()}
    given = {"cell_data": of_cells} if shape == "line" else {"point_data": fields}
    mesh = meshio.Mesh(points, [(shape, cells)], **given)
    try:
        with TemporaryDirectory() as folder:
            draft = Path(folder, path.name)
            mesh.write(draft, file_format="vtu")
            written = draft.read_bytes()
    except OSError as error:
        raise unwritable(path, error) from error
    write_whole(path, written)


def write_xyz(path: Path, network: Network, frames: Frames, *, series: bool) -> list[str]:
    """All frames, of a `series` or one, in one file; its name."""
    text = io.StringIO()
    for time, position, fields in frames:
        columns: dict[str, Array] = {"pos": position} | fields
        kinds = ["I" if data.dtype.kind in "ib" else "R" for data in columns.values()]
        widths = [data.size // len(position) for data in columns.values()]
        named = zip(columns, kinds, map(str, widths), strict=True)
        text.write(f"{len(position)}\n{_cell(network)} Time={time!r} ")
        text.write(f"Properties=species:S:1:{':'.join(map(':'.join, named))}\n")
        formats = np.repeat([{"I": "%d", "R": "%.17g"}[kind] for kind in kinds], widths)
        table = np.column_stack(list(columns.values()))
        np.savetxt(text, table, fmt=" ".join(["sphere", *formats]))
    write_whole(path, text.getvalue().encode())
    return [str(path)]


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


WRITERS = {".vtu": write_vtk, ".xyz": write_xyz}
"""By the end of the name."""
