"""Known systems, made without YADE: used by the tests, the documentation and the benchmarks."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np

from modal.formats.arrays import Bools, Floats
from modal.formats.hdf5 import InputError
from modal.packing.contact_law import (
    GLASS,
    RADIUS,
    Material,
    normal_force,
    overlap_of_force,
    stiffness_normal,
    stiffness_tangential,
)
from modal.packing.crystal import FccPacking
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import void_ratio

Row = tuple[int, int, tuple[float, float, float], float, tuple[int, int, int]]
"""A contact: i, j, normal, overlap (m), periods that are added to j."""


def _network(
    position: Floats,
    contacts: list[Row],
    crystal_radius: float,
    material: Material,
    cell: Floats,
    periodic: Bools,
    walls: Floats,
    study: dict[str, Any],
) -> Network:
    """Complete a network of equal spheres from (i, j, normal, overlap, shift) rows."""
    i, j, normal, overlap, shift = (np.array(column) for column in zip(*contacts, strict=True))
    n, m = len(position), len(i)
    radius = crystal_radius
    mass = material.density * 4 / 3 * np.pi * radius**3
    wall = j < 0
    effective = np.where(wall, radius, radius / 2)
    # The contact point lies in the middle of the overlap, also at a wall, as in the DEM law.
    lever = (radius - overlap / 2)[:, None] * normal
    return Network(
        position=position,
        radius=np.full(n, radius),
        mass=np.full(n, mass),
        inertia=np.full(n, 0.4 * mass * radius**2),
        particle_i=i,
        particle_j=j,
        normal=normal.astype(float),
        lever_i=lever,
        lever_j=np.where(wall[:, None], 0.0, -lever),
        stiffness_normal=stiffness_normal(overlap, effective, material),
        stiffness_tangential=stiffness_tangential(overlap, effective, material),
        force_normal=normal_force(overlap, effective, material),
        force_tangential=np.zeros((m, 3)),
        overlap=overlap,
        sliding=np.zeros(m, bool),
        cell_shift=shift,
        cell_size=cell,
        cell_periodic=periodic,
        wall_position=walls,
        study=study
        | {"young": material.young, "poisson": material.poisson, "density": material.density},
        provenance={"command": "modal.packing.examples"},
    )


def fcc(
    stress: float = 1e5,
    cells: tuple[int, int, int] = (4, 4, 200),
    *,
    radius: float = RADIUS,
    material: Material = GLASS,
) -> Network:
    """A crystal of equal glass spheres between two flat walls, under the same pressure everywhere.

    The face-centred cubic packing of Otsubo et al. 2017, section 2, with [001] along z and periods
    along x and y: `cells` spheres along x and y, and that many layers along z. One or two spheres
    across are allowed: a sphere then touches itself, or a neighbour through several periods.
    `stress` in Pa, `radius` in m. InputError where there is no such crystal.

    >>> net = fcc(stress=1e5, cells=(2, 2, 20))
    >>> net.n_particles, net.n_contacts
    (80, 472)
    """
    if len(cells) != 3 or any(number < 1 or number != int(number) for number in cells):
        raise InputError(f"cells {cells}: give three whole numbers, along x and y, and layers")
    nx, ny, layers = (int(number) for number in cells)
    crystal = FccPacking(stress, radius, material)
    d, l_z = crystal.spacing, crystal.layer_distance
    z0 = radius - crystal.wall_overlap
    layer, y, x = np.meshgrid(np.arange(layers), np.arange(ny), np.arange(nx), indexing="ij")
    offset = 0.5 * (layer % 2)
    position = np.column_stack(
        [((x + offset) * d).ravel(), ((y + offset) * d).ravel(), (z0 + layer * l_z).ravel()]
    )

    def index(c: int, b: int, a: int) -> tuple[int, tuple[int, int, int]]:
        inside = (c * ny + b % ny) * nx + a % nx
        return inside, (a // nx, b // ny, 0)

    up = sqrt(0.5)
    contacts: list[Row] = []
    for c in range(layers):
        first = -1 if c % 2 == 0 else 0
        for b in range(ny):
            for a in range(nx):
                own, _ = index(c, b, a)
                for right, normal in (((b, a + 1), (1, 0, 0)), ((b + 1, a), (0, 1, 0))):
                    other, shift = index(c, *right)
                    contacts.append((own, other, normal, crystal.overlap, shift))
                if c + 1 < layers:
                    for db in (0, 1):
                        for da in (0, 1):
                            other, shift = index(c + 1, b + first + db, a + first + da)
                            contacts.append(
                                (own, other, (da - 0.5, db - 0.5, up), crystal.overlap, shift)
                            )
                for wall, at, nz in ((SOURCE_WALL, 0, -1), (RECEIVER_WALL, layers - 1, 1)):
                    if c == at:
                        row = (own, wall, (0, 0, nz), crystal.wall_overlap, (0, 0, 0))
                        contacts.append(row)
    height = 2 * z0 + (layers - 1) * l_z
    pairs = sum(1 for row in contacts if row[1] >= 0)
    study = {
        "case": "fcc",
        "stress": stress,
        "void_ratio": void_ratio(len(position), radius, np.array([nx * d, ny * d]), height),
        "coordination_number": (2 * pairs + len(contacts) - pairs) / len(position),
    }
    return _network(
        position,
        contacts,
        radius,
        material,
        np.array([nx * d, ny * d, height]),
        np.array([True, True, False]),
        np.array([0.0, height]),
        study,
    )


def column(
    particles: int = 3, force: float = 0.5, radius: float = RADIUS, material: Material = GLASS
) -> Network:
    """Spheres on one another between two flat walls under `force` (N): a chain known exactly."""
    overlap = float(overlap_of_force(force, radius / 2, material))
    at_wall = float(overlap_of_force(force, radius, material))
    z = radius - at_wall + np.arange(particles) * (2 * radius - overlap)
    position = np.column_stack([np.zeros(particles), np.zeros(particles), z])
    contacts: list[Row] = [(0, SOURCE_WALL, (0, 0, -1), at_wall, (0, 0, 0))]
    contacts += [(k, k + 1, (0, 0, 1), overlap, (0, 0, 0)) for k in range(particles - 1)]
    contacts += [(particles - 1, RECEIVER_WALL, (0, 0, 1), at_wall, (0, 0, 0))]
    height = z[-1] + radius - at_wall
    return _network(
        position,
        contacts,
        radius,
        material,
        np.array([4 * radius, 4 * radius, height]),
        np.array([False, False, False]),
        np.array([0.0, height]),
        {"case": "column"},
    )


def repeat(network: Network, times_x: int, times_y: int) -> Network:
    """The network repeated sideways across its periods: times_x times_y copies in a larger cell.

    The copies of a particle follow each other, so a sample sorted along z stays sorted. A plane
    wave in the copies is that of the sample: a test of size that needs no larger DEM run.
    """
    copies, wanted = times_x * times_y, np.array([times_x, times_y, 1])
    if min(times_x, times_y) < 1 or (~network.cell_periodic & (wanted > 1)).any():
        raise InputError(
            f"cannot repeat {times_x} by {times_y}: the network must be periodic along the axis"
        )
    cell = np.array([(a, b, 0) for a in range(times_x) for b in range(times_y)])
    contacts = network.with_contacts(np.repeat(np.arange(network.n_contacts), copies))
    shifts = contacts.known("cell_shift", "telling which copies touch")
    there = np.tile(cell, (network.n_contacts, 1)) + shifts
    shift = there // wanted
    inside = there - shift * wanted
    i, j = contacts.particle_i, contacts.particle_j
    own = np.tile(np.arange(copies), network.n_contacts)
    others = inside[:, 0] * times_y + inside[:, 1]
    offset = np.tile(cell * network.cell_size, (network.n_particles, 1))
    return replace(
        contacts,
        position=np.repeat(network.position, copies, axis=0) + offset,
        radius=np.repeat(network.radius, copies),
        mass=np.repeat(network.mass, copies),
        inertia=np.repeat(network.inertia, copies),
        particle_i=i * copies + own,
        particle_j=np.where(j < 0, j, j * copies + others),
        cell_shift=np.where((j < 0)[:, None], shifts, shift),
        cell_size=network.cell_size * wanted,
        provenance=network.provenance | {"repeated": f"{times_x} x {times_y}"},
    )
