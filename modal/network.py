"""The contact network: particles, contacts, periodic cell and walls, and its file format.

This module is the one definition of the format "granular-contact-network", version 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from modal.storage import InputError, atomic_h5, get, open_h5, put

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
_OPTIONAL = {"force_normal", "force_tangential", "overlap", "sliding", "cell_shift"}


@dataclass
class Network:
    """A packing at rest, n particles and m contacts, SI units; see `docs/formats.md`.

    `normal` (m, 3) points from i towards j or the wall; `lever_i`, `lever_j` (m, 3) from the
    centre to the contact point, zero for a wall; `cell_shift` (m, 3) counts the periods that are
    added to j. `study` and `provenance` are free attributes.
    """

    position: np.ndarray
    radius: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    particle_i: np.ndarray
    particle_j: np.ndarray
    normal: np.ndarray
    lever_i: np.ndarray
    lever_j: np.ndarray
    stiffness_normal: np.ndarray
    stiffness_tangential: np.ndarray
    force_normal: np.ndarray
    force_tangential: np.ndarray
    overlap: np.ndarray
    sliding: np.ndarray
    cell_shift: np.ndarray
    cell_size: np.ndarray
    cell_periodic: np.ndarray
    wall_position: np.ndarray
    study: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

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
    def with_wall(self) -> np.ndarray:
        """Shape (m,) bool: contacts between a particle and a wall."""
        return self.particle_j < 0

    def with_contacts(self, kept: np.ndarray) -> Network:
        """The same particles with the contacts that `kept` selects: (m,) bool, or indices."""
        return replace(self, **{name: getattr(self, name)[kept] for name in _CONTACTS})


def write_network(path: str | Path, network: Network) -> None:
    """Write the network atomically; the 4-byte integers of the format are chosen here."""
    with atomic_h5(path) as file:
        file.attrs.update(schema=SCHEMA, schema_version=VERSION, creator="granular-wave-modes")
        for group, fields in (("particles", _PARTICLES), ("contacts", _CONTACTS)):
            for name, (kind, _, units) in fields.items():
                data = np.asarray(getattr(network, name))
                stored = {"f": np.float64, "i": np.int32, "b": bool}[kind]
                put(file, f"{group}/{name}", data.astype(stored), units, compress=True)
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
                columns[name] = np.zeros(
                    (m or 0, *tail), {"f": float, "i": np.int64, "b": bool}[kind]
                )
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
    """Refuse a network that no packing can have; InputError names the first contact at fault."""
    n = network.n_particles
    if n == 0:
        raise InputError(f"{name}: it has no particles; export a packing with at least one")
    for group, fields in (("particles", _PARTICLES), ("contacts", _CONTACTS)):
        for field_name, (kind, _, _) in fields.items():
            data = getattr(network, field_name)
            if kind == "f" and not np.isfinite(data).all():
                row = int(np.argwhere(~np.isfinite(data))[0, 0])
                raise InputError(
                    f"{name}: {group}/{field_name} is not finite in row {row}; mend the export"
                )
    for field_name in ("radius", "mass", "inertia"):
        _refuse(getattr(network, field_name) <= 0, name, "particle", f"has {field_name} <= 0")
    for field_name in ("stiffness_normal", "stiffness_tangential"):
        _refuse(getattr(network, field_name) < 0, name, "contact", f"has negative {field_name}")
    i, j = network.particle_i, network.particle_j
    _refuse((i < 0) | (i >= n), name, "contact", f"has particle_i outside 0 to {n - 1}")
    _refuse(
        (j < RECEIVER_WALL) | (j >= n), name, "contact", f"has particle_j outside -2 to {n - 1}"
    )
    _refuse(
        (i == j) & ~network.cell_shift.any(axis=1),
        name,
        "contact",
        "joins a particle to itself without a period (cell_shift is zero)",
    )
    size = np.linalg.norm(network.normal, axis=1)
    _refuse(abs(size - 1) > 1e-6, name, "contact", "has a normal that is not a unit vector")
    shifted = network.cell_shift.any(axis=0) & ~network.cell_periodic
    if shifted.any():
        axis = "xyz"[int(np.argmax(shifted))]
        raise InputError(f"{name}: cell_shift along {axis}, which is not periodic; mend the export")
    axes = network.cell_periodic
    period = network.cell_size[axes]
    if not (np.isfinite(network.cell_size).all() and (period > 0).all()):
        raise InputError(f"{name}: cell/size must be positive along the periodic axes")
    if not np.isfinite(network.wall_position).all():
        raise InputError(f"{name}: walls/position is not finite; mend the export")
    if {SOURCE_WALL, RECEIVER_WALL} <= set(j[j < 0].tolist()) and network.length < 0:
        raise InputError(f"{name}: the source wall lies above the receiver wall; mend the export")
    # Centres within a cell meet through one period; unwrapped ones through as many as they span.
    reach = 1 + np.ceil(np.ptp(network.position, axis=0) / np.where(axes, network.cell_size, 1.0))
    _refuse(
        (abs(network.cell_shift) > reach).any(axis=1),
        name,
        "contact",
        "has a cell_shift beyond the packing",
    )
    _refuse(_misfit(network) > 0.5, name, "contact", "joins places that do not touch by its levers")


def _misfit(network: Network) -> np.ndarray:
    """Shape (m,): distance by which the lever arms miss the other centre, over their length.

    Whole periods do not count, since cell_shift may be absent; nor do walls. Levers that end
    anywhere in the overlap miss by its share of the diameter, a wrong particle by about 1.
    """
    pair = ~network.with_wall
    i, j = network.particle_i[pair], network.particle_j[pair]
    branch = (network.lever_i - network.lever_j)[pair]
    gap = network.position[j] - network.position[i] - branch
    axes = network.cell_periodic
    gap[:, axes] -= np.round(gap[:, axes] / network.cell_size[axes]) * network.cell_size[axes]
    length = np.linalg.norm(branch, axis=1)
    misfit = np.zeros(network.n_contacts)
    misfit[pair] = np.linalg.norm(gap, axis=1) / np.where(length > 0, length, 1.0)
    return misfit


def _refuse(wrong: np.ndarray, name: str, kind: str, fault: str) -> None:
    if wrong.any():
        raise InputError(f"{name}: {kind} {int(np.argmax(wrong))} {fault}; mend the export")
