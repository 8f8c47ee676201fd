"""The contact network: particles, contacts, periodic cell and walls; and its file.

This module is the one definition of the format "granular-contact-network". The columns:
`modal.packing.columns`; which networks are refused: `modal.packing.checks`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from modal.formats.hdf5 import named
from modal.formats.product import Product
from modal.packing.checks import check_network, convert_columns
from modal.packing.columns import COLUMNS, SCHEMA, UNKNOWN, VERSION, Columns, frozen
from modal.packing.columns import RECEIVER_WALL as RECEIVER_WALL
from modal.packing.columns import SOURCE_WALL as SOURCE_WALL
from modal.tools.arrays import Array, Bools, Ints
from modal.tools.errors import InputError, UnavailableError

FORMAT = Product(SCHEMA, COLUMNS, groups=("study", "provenance"), versions=VERSION)


@dataclass(frozen=True, eq=False, repr=False)
class Network(Columns):
    """A packing at rest, n particles and m contacts, SI units; see `docs/formats.md`.

    A network is checked when it is made and does not change: what follows from it is kept with it
    (`cached`), and `dataclasses.replace` makes another one. What a program does not know of its
    contacts is None, the default, which is not zero. Contacts that resist rolling and twisting, as
    bonds do, put on i the moment minus (kr (1 - n n^T) + kw n n^T)(theta_i - theta_j); a wall does
    not turn.

    Parameters
    ----------
    position, radius, mass, inertia : ndarray (n, 3) m, (n,) m, (n,) kg, (n,) kg m^2
        Of the particles; of bodies that are no spheres their centres of mass.
    particle_i, particle_j : ndarray of int (m,)
        Of the contacts; j < 0 is a wall.
    normal : ndarray (m, 3)
        From i towards j or the wall.
    lever_i, lever_j : ndarray (m, 3)
        From the centre to the contact point, m; zero for a wall.
    stiffness_normal, stiffness_tangential : ndarray (m,)
        N/m.
    cell_size, cell_periodic, wall_position : ndarray (3,) m, (3,) bool, (2,) m
        The cell, and the walls along z.
    force_normal, force_tangential : ndarray (m,) and (m, 3), optional
        N, compression positive; on i.
    overlap, sliding : ndarray (m,) m and bool, optional
        Of the contacts.
    cell_shift : ndarray of int (m, 3), optional
        Periods that are added to j.
    shear_growth : ndarray (m,), optional
        Another program's law: by which share the shear force grows per overlap, 1/m.
    motion_shortening, torque_shortening : ndarray (m,), optional
        Which share of the overlap its lever arms lack of the radius.
    stiffness_rolling, stiffness_twisting : ndarray (m,), optional
        kr, kw, N m/rad.
    inertia_tensor : ndarray (n, 3, 3), optional
        kg m^2, of bodies as clumps, in the packing's axes; `inertia` is its trace over three.
    study, provenance : dict, optional
        Free attributes.

    Raises
    ------
    InputError
        For what no packing can be.

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

    @property
    def coordination_number(self) -> float:
        """Contacts a particle, walls included, of all particles: rattlers too."""
        return (2 * self.n_contacts - int(self.with_wall.sum())) / self.n_particles

    @property
    def fingerprint(self) -> str:
        """SHA-256 of every column: by this a result in memory or in a file knows its network.

        It holds all that an answer can depend on, to the last bit: spheres or bodies, contacts with
        their levers, stiffnesses, forces, overlaps and which of them slide, cell, periods and
        walls. The free notes in `study` and `provenance` are not in it, nor how wide its integers
        are, so a network that was written and read again has the same.
        """
        return self.cached("fingerprint", lambda: _digest(self._known(list(COLUMNS))))

    def matches(self, fingerprint: str) -> bool:
        """Return whether the fingerprint that a result holds is that of this network.

        Files of version 0.1.0 hold a digest of the spheres alone, which is known as well.
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
        """Cross-section, m^2, to which stresses refer; InputError where the cell has none."""
        area = float(self.cell_size[0] * self.cell_size[1])
        if not area > 0:
            raise UnavailableError(
                "no_area",
                "the network has no cross-section for stresses (cell/size is 0 along x or y)",
                remedy="give the widths of the packing there",
            )
        return area

    @property
    def absent(self) -> list[str]:
        """Names of the optional data of contacts that are not known."""
        return [name for name in UNKNOWN if getattr(self, name) is None]

    def require(self, name: str, purpose: str) -> Array:
        """The optional data `name` of the contacts; InputError where they are absent.

        `purpose` says in the message what cannot be computed without them.
        """
        data: Array | None = getattr(self, name)
        if data is None:
            raise UnavailableError(
                "unknown_column",
                f"the network has no contacts/{name}, without which there is no {purpose}",
                remedy="export it too",
            )
        return data

    def with_contacts(self, kept: Bools | Ints | slice) -> Network:
        """The same particles with the contacts that `kept` selects: (m,) bool, indices, a slice."""
        rows = np.arange(self.n_contacts)[kept]
        if np.bincount(rows).max(initial=0) > 1:
            raise InputError(
                "contact_twice",
                "a contact is selected twice",
                remedy="list each once, with its whole stiffness",
            )
        return self.some(rows)


def _digest(columns: Mapping[str, Array]) -> str:
    """Return the SHA-256 of columns: their names, shapes and numbers, whatever their widths."""
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
        `*.network.h5`, replaced if it is there.
    network : Network
        The packing; it was checked when it was made.

    Raises
    ------
    InputError
        Where the file cannot be written.

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
    """Read and validate a network; raises InputError with one line for anything wrong."""
    said = FORMAT.read(path)
    columns = {name: said[name] for name in COLUMNS if said[name] is not None}
    with named(path):
        return Network(**frozen(**columns), study=said["study"], provenance=said["provenance"])
