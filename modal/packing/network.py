"""The contact network: particles, contacts, periodic cell and walls; and its file.

Only this module defines the format "granular-contact-network". The columns are in
`modal.packing.columns`; `modal.packing.checks` decides which networks are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from modal.formats.hdf5 import named
from modal.formats.product import Product
from modal.formats.tables import html_table
from modal.packing.checks import check_network, convert_columns
from modal.packing.columns import (
    COLUMNS,
    OPTIONAL_CONTACT_COLUMNS,
    SCHEMA,
    VERSION,
    Columns,
    frozen,
)
from modal.packing.columns import RECEIVER_WALL as RECEIVER_WALL
from modal.packing.columns import SOURCE_WALL as SOURCE_WALL
from modal.tools.arrays import Array, Bools, Ints
from modal.tools.display import quantity
from modal.tools.errors import InputError, UnavailableError

FORMAT = Product(SCHEMA, COLUMNS, groups=("study", "provenance"), versions=VERSION)


@dataclass(frozen=True, eq=False, repr=False)
class Network(Columns):
    """A packing at rest, n particles and m contacts, SI units; see `docs/formats.md`.

    A network is checked when it is made and does not change; `dataclasses.replace` makes another
    one. Results that follow from it are kept with it (`cached`). Unknown data of the contacts are
    None, the default, and not zero. Contacts that resist rolling and twisting, as bonds do, exert
    on i the moment -(kr (1 - n n^T) + kw n n^T)(theta_i - theta_j); a wall does not turn.

    Parameters
    ----------
    position, radius, mass, inertia : ndarray (n, 3) m, (n,) m, (n,) kg, (n,) kg m^2
        Particles; the position of a body that is not a sphere is its centre of mass.
    particle_i, particle_j : ndarray of int (m,)
        Ends of the contacts; j < 0 is a wall.
    normal : ndarray (m, 3)
        Unit vectors from i towards j or the wall.
    lever_i, lever_j : ndarray (m, 3)
        Vector from the centre of each end to the contact point, m; zero for a wall.
    stiffness_normal, stiffness_tangential : ndarray (m,)
        Contact stiffnesses, N/m.
    cell_size, cell_periodic, wall_position : ndarray (3,) m, (3,) bool, (2,) m
        Sides of the cell, which of them are periods, and z of source and receiver wall.
    force_normal, force_tangential : ndarray (m,) and (m, 3), optional
        Normal force, compression positive, and tangential force on i, N.
    overlap, sliding : ndarray (m,) m and bool, optional
        Overlaps, and whether each contact is at its friction limit.
    cell_shift : ndarray of int (m, 3), optional
        Periods that are added to the position of j.
    shear_growth : ndarray (m,), optional
        Relative growth of the shear force with the overlap, 1/m, in the law of another program.
    motion_shortening, torque_shortening : ndarray (m,), optional
        Share of the overlap by which lever arms are shorter than the radius, in such a law.
    stiffness_rolling, stiffness_twisting : ndarray (m,), optional
        Rolling and twisting stiffnesses kr and kw, N m/rad.
    moment : ndarray (m, 3), optional
        Moment on i, N m, of contacts that resist rolling and twisting, in addition to the moment of
        their force.
    inertia_tensor : ndarray (n, 3, 3), optional
        Inertia tensors of bodies such as clumps, in the axes of the packing, kg m^2; `inertia` is a
        third of its trace.
    fixed : ndarray of bool (n, 6), optional
        Motions that a body cannot make: along x, y, z, and turns about them. A body that cannot
        move at all is a part of a wall; by default all bodies move freely.
    cell_vectors : ndarray (3, 3), optional
        Periods of a sheared cell as rows, m; the diagonal is `cell_size`.
    study, provenance : dict, optional
        Free attributes.

    Raises
    ------
    InputError
        If the columns contradict each other or are physically impossible.

    Examples
    --------
    >>> import modal
    >>> net = modal.fcc(cells=(2, 2, 4))
    >>> net.position.shape, net.normal.shape, net.stiffness_normal.shape
    ((16, 3), (88, 3), (88,))
    """

    def __post_init__(self) -> None:
        self.__setstate__(convert_columns(vars(self)))
        check_network(self)

    def __repr__(self) -> str:
        return f"<Network: {self.n_particles} particles, {self.n_contacts} contacts>"

    def _repr_html_(self) -> str:
        """Return numbers of bodies and contacts and the cell as a table, for a notebook."""
        rows = [
            ["particles", str(self.n_particles)],
            ["contacts", f"{self.n_contacts}, {int(self.with_wall.sum())} of them with the walls"],
            ["coordination number", f"{self.coordination_number:.3f}"],
            ["cell", " x ".join(quantity(side, "m") for side in self.cell_size)],
            ["periodic along", ", ".join(np.array(["x", "y", "z"])[self.cell_periodic]) or "none"],
        ]
        return html_table(["packing", "modal.describe says more"], rows)

    @property
    def coordination_number(self) -> float:
        """Mean number of contacts of a particle, walls and rattlers included.

        Held bodies count as walls, not as particles.
        """
        held = self.held
        ends = int((~held[self.particle_i]).sum())
        ends += int((~self.with_wall & ~held[self.partner]).sum())
        return ends / max(int((~held).sum()), 1)

    @property
    def fingerprint(self) -> str:
        """SHA-256 of every column; results in memory or in a file identify their network by it.

        The hash covers everything that a result can depend on, to the last bit: particles,
        contacts, cell and walls. It does not cover the notes in `study` and `provenance` and the
        widths of integers, so that a network keeps its fingerprint when it is written and read.
        """
        return self.cached("fingerprint", lambda: _digest(self._present(list(COLUMNS))))

    def matches(self, fingerprint: str) -> bool:
        """Return whether a fingerprint belongs to this network.

        The digest of the spheres alone, as in files of version 0.1.0, is accepted, too.
        """
        return fingerprint in (self.fingerprint, self._digest_of_spheres)

    @property
    def _digest_of_spheres(self) -> str:
        """SHA-256 of position, radius, mass and inertia, row by row."""
        spheres = (self.position, self.radius, self.mass, self.inertia)
        return sha256(np.column_stack(spheres).tobytes()).hexdigest()

    @property
    def length(self) -> float:
        """Distance between source and receiver wall, m."""
        return float(self.wall_position[1] - self.wall_position[0])

    @property
    def area(self) -> float:
        """Cross-section, m^2, to which stresses refer; UnavailableError if there is none.

        The cross-section times the `length` is the volume of the cell.
        """
        area = float(self.cell_size[0] * self.cell_size[1])
        if self.cell_vectors is not None:
            area = float(np.linalg.det(self.cell_vectors) / self.cell_size[2])
        if not area > 0:
            raise UnavailableError(
                "no_area",
                "the network has no cross-section for stresses (cell/size is 0 along x or y)",
                remedy="give the widths of the packing there",
            )
        return area

    @property
    def absent(self) -> list[str]:
        """Names of the optional columns of contacts that the network lacks."""
        return [name for name in OPTIONAL_CONTACT_COLUMNS if getattr(self, name) is None]

    def refuse_angles(self, purpose: str) -> None:
        """Raise UnavailableError for a sheared cell, which `purpose` does not support."""
        if self.cell_vectors is not None:
            raise UnavailableError(
                "triclinic_cell",
                f"no {purpose} of a cell whose periods are at angles",
                remedy="modes, counts, densities of states, moduli and linear waves take it",
            )

    def require(self, name: str, purpose: str) -> Array:
        """Return the optional column `name` of the contacts; UnavailableError if it is absent.

        `purpose` is the part of the message that says what needs the column.
        """
        data: Array | None = getattr(self, name)
        if data is None:
            raise UnavailableError(
                "unknown_column",
                f"the network has no contacts/{name}, without which there is no {purpose}",
                remedy="export it too",
            )
        return data

    def with_contacts(self, selection: Bools | Ints | slice) -> Network:
        """Return the network with the selected contacts and all particles.

        `selection` is (m,) bool, indices or a slice. Raises InputError if it selects a contact
        twice.
        """
        rows = np.arange(self.n_contacts)[selection]
        if np.bincount(rows).max(initial=0) > 1:
            raise InputError(
                "contact_twice",
                "a contact is selected twice",
                remedy="list each once, with its whole stiffness",
            )
        return self.some(rows)


def _digest(columns: Mapping[str, Array]) -> str:
    """Return the SHA-256 of columns: names, shapes and numbers, independent of integer width."""
    digest = sha256()
    for name, data in sorted(columns.items()):
        width = np.float64 if data.dtype.kind == "f" else np.int64
        numbers = np.ascontiguousarray(data, width) + width(0)  # no zero keeps a sign
        digest.update(f"{name} {data.dtype.kind} {data.shape}".encode())
        digest.update(numbers.tobytes())
    return digest.hexdigest()


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically.

    Parameters
    ----------
    path : str or Path
        `*.network.h5`, replaced if it exists.
    network : Network
        The network, which was checked when it was made.

    Raises
    ------
    InputError
        If the file cannot be written.

    Examples
    --------
    >>> import modal, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "mine.network.h5")
    >>> write_network(path, modal.fcc(cells=(1, 1, 4)))
    >>> modal.read(path).n_particles == modal.fcc(cells=(1, 1, 4)).n_particles
    True
    """
    FORMAT.write(path, vars(network))


def read_network(path: str | Path) -> Network:
    """Read and validate a network; raise InputError for any fault."""
    values = FORMAT.read(path)
    columns = {name: values[name] for name in COLUMNS if values[name] is not None}
    with named(path):
        return Network(**frozen(**columns), study=values["study"], provenance=values["provenance"])
