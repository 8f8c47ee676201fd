"""Known systems, made without YADE: used by the tests, the documentation and the benchmarks."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from modal.packing.checks import DEEPEST
from modal.packing.contact_law import GLASS, RADIUS, Material, overlap_of_force
from modal.packing.crystal import FccPacking
from modal.packing.equal_spheres import network_of
from modal.packing.neighbours import Touching
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.packing.sample import void_ratio
from modal.tools.arguments import checked
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above_memory

SPHERE_BYTES = 4000.0
"""Memory for each sphere of a crystal while its contacts are listed, measured."""

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
    return network_of(
        Touching(i, j, shift, normal.astype(float), overlap),
        crystal_radius,
        material,
        study=study,
        position=position,
        cell_size=cell,
        cell_periodic=periodic,
        wall_position=walls,
        provenance={"command": "modal.packing.examples"},
    )


@checked
def fcc(
    stress: float = 1e5,
    cells: tuple[int, int, int] = (4, 4, 200),
    *,
    radius: float = RADIUS,
    material: Material = GLASS,
    periodic_z: bool = False,
) -> Network:
    """A crystal of equal glass spheres between two flat walls, under the same pressure everywhere.

    The face-centred cubic packing of Otsubo et al. 2017, section 2, with [001] along z and periods
    along x and y: `cells` spheres along x and y, and that many layers along z. One or two spheres
    across are allowed: a sphere then touches itself, or a neighbour through several periods.
    `stress` in Pa, `radius` in m. With `periodic_z` there are no walls: the layers, an even number,
    go on through a period along z. InputError where there is no such crystal.

    >>> net = fcc(stress=1e5, cells=(2, 2, 20))
    >>> net.n_particles, net.n_contacts
    (80, 472)
    """
    if len(cells) != 3 or any(number < 1 or number % 1 != 0 for number in cells):
        raise InputError(f"cells {cells}: give three whole numbers, along x and y, and layers")
    nx, ny, layers = (int(number) for number in cells)
    if periodic_z and layers % 2:
        raise InputError(f"{layers} layers: a crystal periodic along z has an even number of them")
    refuse_above_memory(
        SPHERE_BYTES * nx * ny * layers,
        f"a crystal of {nx} x {ny} x {layers} spheres",
        "take fewer; `tile` repeats a packing",
    )
    crystal = FccPacking(stress, radius, material)
    if not periodic_z and crystal.wall_overlap > DEEPEST * radius:
        raise InputError(
            f"stress {stress:g} Pa: spheres of this material overlap with the walls by more than "
            f"{DEEPEST:g} of the radius; take less"
        )
    d, l_z = crystal.spacing, crystal.layer_distance
    z0 = l_z / 2 if periodic_z else radius - crystal.wall_overlap
    layer, y, x = np.meshgrid(np.arange(layers), np.arange(ny), np.arange(nx), indexing="ij")
    offset = 0.5 * (layer % 2)
    position = np.column_stack(
        [((x + offset) * d).ravel(), ((y + offset) * d).ravel(), (z0 + layer * l_z).ravel()]
    )

    def index(c: int, b: int, a: int) -> tuple[int, tuple[int, int, int]]:
        inside = (c % layers * ny + b % ny) * nx + a % nx
        return inside, (a // nx, b // ny, c // layers)

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
                if periodic_z or c + 1 < layers:
                    for db in (0, 1):
                        for da in (0, 1):
                            other, shift = index(c + 1, b + first + db, a + first + da)
                            contacts.append(
                                (own, other, (da - 0.5, db - 0.5, up), crystal.overlap, shift)
                            )
                for wall, at, nz in ((SOURCE_WALL, 0, -1), (RECEIVER_WALL, layers - 1, 1)):
                    if c == at and not periodic_z:
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
        np.array([True, True, periodic_z]),
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
