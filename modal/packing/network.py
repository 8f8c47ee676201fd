"""The contact network: particles, contacts, periodic cell and walls, and its file format.

This module is the one definition of the format "granular-contact-network", version 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import h5py
import numpy as np

from modal.display import table
from modal.formats.arrays import Array, Bools, Floats, Ints
from modal.formats.hdf5 import InputError, atomic_h5, get, open_h5, put

SCHEMA = "granular-contact-network"
VERSION = 1
SOURCE_WALL = -1
"""Value of particle_j for the wall at low z, which sends the wave."""
RECEIVER_WALL = -2
"""Value of particle_j for the wall at high z."""

_PARTICLES = {
    "position": ("f", (3,), "m"),
    "radius": ("f", (), "m"),
    "mass": ("f", (), "kg"),
    "inertia": ("f", (), "kg m^2"),
}
_CONTACTS = {
    "particle_i": ("i", (), "1"),
    "particle_j": ("i", (), "1"),
    "normal": ("f", (3,), "1"),
    "lever_i": ("f", (3,), "m"),
    "lever_j": ("f", (3,), "m"),
    "stiffness_normal": ("f", (), "N/m"),
    "stiffness_tangential": ("f", (), "N/m"),
    "force_normal": ("f", (), "N"),
    "force_tangential": ("f", (3,), "N"),
    "overlap": ("f", (), "m"),
    "sliding": ("b", (), "1"),
    "cell_shift": ("i", (3,), "1"),
}
_OPTIONAL = ("force_normal", "force_tangential", "overlap", "sliding", "cell_shift")
Made = TypeVar("Made")


@dataclass(frozen=True, eq=False, repr=False)
class Network:
    """A packing at rest, n particles and m contacts, SI units; see `docs/formats.md`.

    `normal` (m, 3) points from i towards j or the wall; `lever_i`, `lever_j` (m, 3) from the
    centre to the contact point, zero for a wall. `study` and `provenance` are free attributes. A
    network does not change: what follows from it is kept with it (`once`), and
    `dataclasses.replace` makes another one.
    What a program does not know of its contacts is None, which is not zero: `force_normal` (m,),
    compression positive; `force_tangential` (m, 3) on i; `overlap` (m,); `sliding` (m,) bool;
    `cell_shift` (m, 3), the periods that are added to j.
    """

    position: Floats
    radius: Floats
    mass: Floats
    inertia: Floats
    particle_i: Ints
    particle_j: Ints
    normal: Floats
    lever_i: Floats
    lever_j: Floats
    stiffness_normal: Floats
    stiffness_tangential: Floats
    cell_size: Floats
    cell_periodic: Bools
    wall_position: Floats
    force_normal: Floats | None = None
    force_tangential: Floats | None = None
    overlap: Floats | None = None
    sliding: Bools | None = None
    cell_shift: Ints | None = None
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    _made: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    further: ClassVar[list[Callable[[Network], list[tuple[str, str]]]]] = []
    """What rooms above this one add to the lines of `print`: names and texts."""

    def __post_init__(self) -> None:
        """Arrays become views that cannot be written to; their owners still can write to them."""
        for name, data in vars(self).items():
            if isinstance(data, np.ndarray):
                view = data.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    def once(self, name: str, make: Callable[[], Made]) -> Made:
        """What `make` gives, made when this name is first asked for and kept with the network."""
        if name not in self._made:
            self._made[name] = make()
        made: Made = self._made[name]
        return made

    def __repr__(self) -> str:
        return f"<Network: {self.n_particles} particles, {self.n_contacts} contacts>"

    def __str__(self) -> str:
        from modal.packing.state import described  # it stands on this module

        return table(described(self) + [row for told in self.further for row in told(self)])

    @property
    def n_particles(self) -> int:
        """Number of particles n."""
        return len(self.position)

    @property
    def n_contacts(self) -> int:
        """Number of contacts m, walls included."""
        return len(self.particle_i)

    @property
    def length(self) -> float:
        """Distance between source and receiver wall, m."""
        return float(self.wall_position[1] - self.wall_position[0])

    @property
    def with_wall(self) -> Bools:
        """Shape (m,) bool: contacts between a particle and a wall."""
        return self.particle_j < 0

    @property
    def partner(self) -> Ints:
        """Shape (m,): index of the contact's second particle; 0, for none, at a wall."""
        return np.where(self.with_wall, 0, self.particle_j)

    @property
    def area(self) -> float:
        """Cross-section, m^2, to which stresses refer; InputError where the cell has none."""
        area = float(self.cell_size[0] * self.cell_size[1])
        if not area > 0:
            raise InputError(
                "the network has no cross-section for stresses (cell/size is 0 along x or y); "
                "give the widths of the packing there"
            )
        return area

    @property
    def absent(self) -> list[str]:
        """Names of the optional data of contacts that are not known."""
        return [name for name in _OPTIONAL if getattr(self, name) is None]

    def known(self, name: str, purpose: str) -> Array:
        """The optional data `name` of the contacts; InputError where they are absent.

        `purpose` says in the message what cannot be computed without them.
        """
        data: Array | None = getattr(self, name)
        if data is None:
            raise InputError(
                f"the network has no contacts/{name}, without which there is no {purpose}; "
                "export it too"
            )
        return data

    def noted(self, name: str) -> float | None:
        """The positive number that the free notes in `study` give under this name, or None."""
        said = self.study.get(name)
        if isinstance(said, int | float | np.number) and 0 < said < np.inf:
            return float(said)
        return None

    def with_contacts(self, kept: Bools | Ints) -> Network:
        """The same particles with the contacts that `kept` selects: (m,) bool, or indices."""
        columns = {name: getattr(self, name) for name in _CONTACTS}
        return replace(
            self, **{name: data[kept] for name, data in columns.items() if data is not None}
        )


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically; the 4-byte integers of the format are chosen here."""
    with atomic_h5(path) as file:
        file.attrs.update(schema=SCHEMA, schema_version=VERSION, creator="granular-wave-modes")
        for group, fields in (("particles", _PARTICLES), ("contacts", _CONTACTS)):
            for name, (kind, _, units) in fields.items():
                data = getattr(network, name)
                if data is None:
                    continue
                stored = np.asarray(data).astype({"f": np.float64, "i": np.int32, "b": bool}[kind])
                put(file, f"{group}/{name}", stored, units)
        put(file, "cell/size", np.asarray(network.cell_size, float), "m")
        put(file, "cell/periodic", np.asarray(network.cell_periodic, bool), "1")
        put(file, "walls/position", np.asarray(network.wall_position, float), "m")
        file.create_group("study").attrs.update(network.study)
        file.create_group("provenance").attrs.update(network.provenance)


def read_network(path: str | Path) -> Network:
    """Read and validate a network; raises InputError with one line for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        columns: dict[str, Any] = {}
        n: int | None = None
        for name, (kind, tail, _) in _PARTICLES.items():
            columns[name] = get(file, f"particles/{name}", kind, (n, *tail))
            n = len(columns[name])
        m: int | None = None
        for name, (kind, tail, _) in _CONTACTS.items():
            full = f"contacts/{name}"
            if name in _OPTIONAL and full not in file:
                continue
            columns[name] = get(file, full, kind, (m, *tail))
            m = len(columns[name])
        columns["cell_size"] = get(file, "cell/size", "f", (3,))
        columns["cell_periodic"] = get(file, "cell/periodic", "b", (3,))
        columns["wall_position"] = get(file, "walls/position", "f", (2,))
        study = _attributes(file, "study")
        provenance = _attributes(file, "provenance")
    network = Network(**columns, study=study, provenance=provenance)
    validate(network, str(path))
    return network


def _attributes(file: h5py.File, group: str) -> dict[str, Any]:
    # `file.get` would take a damaged group for an absent one.
    return dict(file[group].attrs) if group in file else {}


def validate(network: Network, name: str = "network") -> None:
    """Refuse a network that no packing can have; InputError names the first contact at fault.

    Shapes of numbers and indices here, what they mean together in `modal.packing.consistency`.
    """
    from modal.packing.consistency import check_consistency  # it stands on this module

    n = network.n_particles
    if n == 0:
        raise InputError(f"{name}: it has no particles; export a packing with at least one")
    for group, fields in (("particles", _PARTICLES), ("contacts", _CONTACTS)):
        for field_name, (kind, _, _) in fields.items():
            data = getattr(network, field_name)
            if kind == "f" and data is not None and not np.isfinite(data).all():
                row = int(np.argwhere(~np.isfinite(data))[0, 0])
                raise InputError(
                    f"{name}: {group}/{field_name} is not finite in row {row}; mend the export"
                )
    for field_name in ("radius", "mass", "inertia"):
        refuse(getattr(network, field_name) <= 0, name, "particle", f"has {field_name} <= 0")
    for field_name in ("stiffness_normal", "stiffness_tangential"):
        refuse(getattr(network, field_name) < 0, name, "contact", f"has negative {field_name}")
    i, j = network.particle_i, network.particle_j
    refuse((i < 0) | (i >= n), name, "contact", f"has particle_i outside 0 to {n - 1}")
    refuse((j < RECEIVER_WALL) | (j >= n), name, "contact", f"has particle_j outside -2 to {n - 1}")
    size = np.linalg.norm(network.normal, axis=1)
    refuse(abs(size - 1) > 1e-6, name, "contact", "has a normal that is not a unit vector")
    cell, axes = network.cell_size, network.cell_periodic
    if not (np.isfinite(cell).all() and (cell[axes] > 0).all() and (cell >= 0).all()):
        raise InputError(
            f"{name}: cell/size must be positive along the periodic axes, and 0 or the width of "
            "the packing along the others; mend the export"
        )
    if network.cell_shift is not None:
        own = (i == j) & ~network.cell_shift.any(axis=1)
        refuse(
            own,
            name,
            "contact",
            "joins a particle to itself without a period (cell_shift is zero)",
        )
        shifted = network.cell_shift.any(axis=0) & ~axes
        if shifted.any():
            axis = "xyz"[int(np.argmax(shifted))]
            raise InputError(
                f"{name}: cell_shift along {axis}, which is not periodic; mend the export"
            )
    check_consistency(network, name)


def refuse(wrong: Bools, name: str, kind: str, fault: str) -> None:
    """InputError about the first of the particles or contacts that are `wrong` (m,) bool."""
    if wrong.any():
        raise InputError(f"{name}: {kind} {int(np.argmax(wrong))} {fault}; mend the export")
