"""Write a network as tables and matrices, for other programs.

NAME.csv has the contacts and NAME.spheres.csv the spheres, in the columns that `import` reads; both
together give the network back. NAME.npz (scipy) and NAME.mtx (Matrix Market) have the stiffness
matrix K, NAME.mass.npz and NAME.mass.mtx the mass matrix M.
"""

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse as sp

from modal.formats.whole_file import write_whole
from modal.packing.network import Network
from modal.system.matrices import mass_matrix, stiffness_matrix
from modal.tools.arrays import Array

FURTHER_CONTACT_COLUMNS = {
    "force_normal": ("fn",),
    "force_tangential": ("ftx", "fty", "ftz"),
    "stiffness_rolling": ("kr",),
    "stiffness_twisting": ("kw",),
    "normal": ("nx", "ny", "nz"),
    "overlap": ("overlap",),
    "sliding": ("sliding",),
    "cell_shift": ("shift_x", "shift_y", "shift_z"),
    "shear_growth": ("shear_growth",),
    "motion_shortening": ("motion_shortening",),
    "torque_shortening": ("torque_shortening",),
}
"""Names in a table of further columns of contacts, by their names in a network."""
HELD_MOTIONS = ("held_x", "held_y", "held_z", "held_turn_x", "held_turn_y", "held_turn_z")
"""Columns for the motions that a body cannot make."""
MAX_INERTIA_ERROR = 1e-9
"""Largest relative deviation from 0.4 m R^2 with which the inertia of a sphere is not written."""


def write_tables(path: Path, network: Network) -> list[str]:
    """Write contacts and spheres as two tables (CSV); return the names of the files.

    Raises UnavailableError for a sheared cell.
    """
    network.refuse_angles("table")
    columns: dict[str, Array] = {
        "i": network.particle_i,
        "j": network.particle_j,
        "kn": network.stiffness_normal,
        "kt": network.stiffness_tangential,
    }
    for name, headings in FURTHER_CONTACT_COLUMNS.items():
        data = getattr(network, name)
        if data is not None:
            parts = data.reshape(len(data), -1).T
            columns |= dict(zip(headings, parts, strict=True))
    spheres = path.with_suffix(".spheres.csv")
    write_whole(path, _csv(columns).encode())
    text = _describe_cell(network) + _csv(_sphere_columns(network))
    write_whole(spheres, text.encode())
    return [str(path), str(spheres)]


def _sphere_columns(network: Network) -> dict[str, Array]:
    """Return the columns of the spheres; bodies that are not spheres have their tensors of inertia.

    A reader refuses a table with columns that it does not know.
    """
    x, y, z = network.position.T
    columns: dict[str, Array] = {
        "id": np.arange(network.n_particles),
        "x": x,
        "y": y,
        "z": z,
        "radius": network.radius,
        "mass": network.mass,
    }
    homogeneous = 0.4 * network.mass * network.radius**2
    if abs(network.inertia / homogeneous - 1).max() > MAX_INERTIA_ERROR:
        columns["inertia"] = network.inertia
    if network.fixed is not None:
        for place, motion in enumerate(HELD_MOTIONS):
            columns[motion] = network.fixed[:, place]
    if network.inertia_tensor is not None:
        for row, first in enumerate("xyz"):
            for column, second in enumerate("xyz"):
                columns[f"i{first}{second}"] = network.inertia_tensor[:, row, column]
    return columns


def _describe_cell(network: Network) -> str:
    """Return the lines before a table of spheres that describe their cell."""
    position = network.position
    size = network.cell_size
    low = np.where(network.cell_periodic, position.min(axis=0), 0.0)
    fits_from_zero = (position.min(axis=0) >= 0) & (position.max(axis=0) <= size)
    low = np.where(fits_from_zero, 0.0, low)
    radius = network.radius[:, None]
    low = np.where(size > 0, low, (position - radius).min(axis=0))
    high = np.where(size > 0, low + size, (position + radius).max(axis=0))
    low[2], high[2] = network.wall_position
    bounds = np.column_stack([low, high]).ravel().tolist()
    axes = [axis for axis, on in zip("xyz", network.cell_periodic, strict=True) if on]
    lines = [f"# cell {' '.join(map(repr, bounds))}", f"# periodic {' '.join(axes)}"]
    if not network.cell_periodic[2]:
        walls = ["NULL", "NULL"]
        for place, code in enumerate((-1, -2)):
            if (network.particle_j == code).any():
                walls[place] = repr(float(network.wall_position[place]))
        lines.append(f"# walls {' '.join(walls)}")
    return "\n".join(lines) + "\n"


def _csv(columns: Mapping[str, Array]) -> str:
    """Return columns (n,) as the text of a table; numbers have all their digits."""
    formats = ["%d" if data.dtype.kind in "iub" else "%.17g" for data in columns.values()]
    rows = len(next(iter(columns.values())))
    table = np.empty(rows, dtype=[(name, data.dtype) for name, data in columns.items()])
    for name, data in columns.items():
        table[name] = data
    text = io.StringIO()
    np.savetxt(text, table, fmt=formats, delimiter=",", header=",".join(columns), comments="")
    return text.getvalue()


def write_npz(path: Path, network: Network) -> list[str]:
    """Write K and M in scipy's format (`scipy.sparse.load_npz`); return the names of the files."""

    def as_bytes(matrix: sp.csr_matrix) -> bytes:
        file = io.BytesIO()
        sp.save_npz(file, matrix)
        return file.getvalue()

    return _write_matrices(path, network, as_bytes)


def write_matrix_market(path: Path, network: Network) -> list[str]:
    """Write K and M in the format Matrix Market; return the names of the files."""

    def as_bytes(matrix: sp.csr_matrix) -> bytes:
        file = io.BytesIO()
        scipy.io.mmwrite(file, matrix, precision=17, symmetry="symmetric")
        return file.getvalue()

    return _write_matrices(path, network, as_bytes)


def _write_matrices(path: Path, network: Network, as_bytes: Callable[[Any], bytes]) -> list[str]:
    """Write K to the path and M beside it; return the names of the files."""
    mass_path = path.with_suffix(f".mass{path.suffix}")
    write_whole(path, as_bytes(stiffness_matrix(network)))
    write_whole(mass_path, as_bytes(mass_matrix(network)))
    return [str(path), str(mass_path)]


WRITERS = {".csv": write_tables, ".npz": write_npz, ".mtx": write_matrix_market}
"""Functions that write tables and matrices, by the ending of the file's name."""
