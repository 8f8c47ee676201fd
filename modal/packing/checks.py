"""Check that a new network is physically possible, and refuse it if not.

Most data of a network are redundant: the branch vector follows from the positions, from radii and
overlap, and from normal and levers. If an exporter permutes a column, uses another unit or writes
the contacts of another packing, the data contradict each other. Each bound below lies between the
values of sound networks (positions of 7 digits in a packing 400 radii long, levers that end
anywhere in the overlap) and those that such mistakes cause; `docs/formats.md` has the table.
Unusual but possible values are reported by `modal.packing.plausibility`.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from modal.packing.columns import COLUMNS, CONTACTS, PART, RECEIVER_WALL, Columns
from modal.packing.contact_checks import check_contacts, check_forces, check_pairs, smallest_shear
from modal.packing.contact_law import sphere_volume
from modal.packing.faults import Fault, Faults, refuse_first
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

INERTIA_RANGE_IN_M_R2 = (0.12, 0.67)
"""Range of inertia / (m R^2). A heavy core of half the radius has 0.2, a homogeneous sphere 0.4, a
thin shell 2/3."""
MAX_DENSITY_FACTOR = 100.0
"""Largest ratio of a density to the median density of the packing. Glass and tungsten differ by 9;
kg in place of g gives 1000."""
MAX_STATED_DENSITY_FACTOR = 3.0
"""Largest ratio of the median density to the density in the group `study`. kg in place of g gives
1000."""
MAX_PERIOD_ERROR = 1e-3
"""Largest relative difference between the distance of the walls and the side of the cell along
z."""
MAX_VECTOR_ERROR = 1e-9
"""Largest difference between the diagonal of the cell's vectors and its sides, divided by the
longest component."""
MAX_ASYMMETRY = 1e-9
"""Largest difference between an inertia tensor and its transpose, relative to its largest entry."""
MAX_TRACE_ERROR = 1e-6
"""Largest relative difference between the inertia and a third of the tensor's trace."""


def convert_columns(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a network as arrays of the kind and shape of each column.

    InputError for data that have another kind or shape.
    """
    converted = dict(columns)
    lengths: dict[int | str, int] = {}
    for name, column in COLUMNS.items():
        if columns[name] is None and column.optional:
            continue
        converted[name] = column.array(name, columns[name], lengths)
    if converted["fixed"] is not None and not converted["fixed"].any():
        converted["fixed"] = None  # a packing whose bodies are all free has no such column
    vectors = converted["cell_vectors"]
    if vectors is not None and np.array_equal(vectors, np.diag(converted["cell_size"])):
        converted["cell_vectors"] = None  # a cell without angles has no such column
    for name in ("study", "provenance"):
        if not isinstance(columns[name], Mapping):
            raise InputError(
                "not_a_dict",
                f"{name} is {columns[name]!r}, not a dict",
                remedy="give names and values",
            )
    return converted


def check_network(network: Columns) -> None:
    """Raise InputError for an impossible network, naming the first particle or contact at fault."""
    are_spheres = network.inertia_tensor is None
    refuse_first(_check_columns(network))
    refuse_first(_check_cell(network))
    refuse_first(_check_spheres(network) if are_spheres else _check_bodies(network))
    if network.n_contacts == 0:
        return
    min_shear = smallest_shear(network)
    for first in range(0, network.n_contacts, PART):
        part = network.some(slice(first, first + PART))
        refuse_first(check_contacts(part, are_spheres, min_shear), first)
    if are_spheres:
        refuse_first(check_pairs(network))
    refuse_first(check_forces(network))


def _check_columns(network: Columns) -> Faults:
    """Check, column by column, that the values of each column are possible."""
    n = network.n_particles
    yield Fault(
        "",
        n == 0,
        "no_particles",
        "it has no particles",
        remedy="export a packing with at least one",
    )
    for name in ("radius", "mass", "inertia"):
        not_positive = getattr(network, name) <= 0
        yield Fault("particle", not_positive, f"{name}_not_positive", f"has {name} <= 0")
    for name in CONTACTS:
        stiffness = getattr(network, name)
        if name.startswith("stiffness") and stiffness is not None:
            yield Fault("contact", stiffness < 0, "negative_stiffness", f"has negative {name}")
    i = network.particle_i
    j = network.particle_j
    yield Fault(
        "contact",
        (i < 0) | (i >= n),
        "unknown_particle",
        f"has particle_i outside 0 to {n - 1}",
    )
    yield Fault(
        "contact",
        (j < RECEIVER_WALL) | (j >= n),
        "unknown_particle",
        f"has particle_j outside -2 to {n - 1}",
    )
    yield Fault(
        "",
        (network.stiffness_rolling is None) != (network.stiffness_twisting is None),
        "incomplete_bonds",
        "one of stiffness_rolling and stiffness_twisting lacks",
        remedy="give both, or zeros",
    )


def _check_cell(network: Columns) -> Faults:
    """Check the periods, the contacts through them, and the walls around the packing."""
    cell = network.cell_size
    periodic = network.cell_periodic
    shift = network.cell_shift
    yield Fault(
        "",
        (cell[periodic] <= 0).any() or (cell < 0).any(),
        "cell_size",
        "cell_size must be positive along the periodic axes, and 0 or the packing's width else",
    )
    if network.cell_vectors is not None:
        yield from _check_vectors(network.cell_vectors, cell, periodic)
    if shift is not None:
        with_itself = network.particle_i == network.particle_j
        yield Fault(
            "contact",
            with_itself & ~shift.any(axis=1),
            "contact_with_itself",
            "joins a particle to itself without a period (cell_shift is zero)",
        )
        for axis in np.flatnonzero(~periodic):
            yield Fault(
                "",
                shift[:, axis].any(),
                "shift_without_period",
                f"cell_shift along {'xyz'[axis]}, which is not periodic",
            )
    low, high = network.wall_position
    if periodic[2]:
        yield Fault(
            "",
            abs(high - low - cell[2]) > MAX_PERIOD_ERROR * cell[2],
            "period_bounds",
            "it is periodic along z, but wall_position is not the two bounds of the period",
        )
        return
    has_walls = low != high or network.with_wall.any()
    if has_walls:  # coincident walls are none, if none needs them
        yield Fault(
            "",
            low >= high,
            "wall_order",
            "the source wall does not lie below the receiver wall",
        )
        z = network.position[:, 2]
        yield Fault(
            "particle", (z < low) | (z > high), "beyond_wall", "has its centre beyond a wall"
        )


def _check_vectors(vectors: Floats, cell: Floats, periodic: Bools) -> Faults:
    """Check the periods (3, 3) of a sheared cell against its sides (3,)."""
    disagrees = abs(np.diag(vectors) - cell) > MAX_VECTOR_ERROR * abs(vectors).max()
    yield Fault(
        "",
        disagrees.any() or not np.linalg.det(vectors) > 0,
        "cell_vectors",
        "cell_vectors must have cell_size on its diagonal, and enclose a volume",
    )
    along_own_axis = np.diag(np.diag(vectors))
    aslant = (vectors != along_own_axis).any(axis=1)
    yield Fault(
        "",
        (aslant & ~periodic).any() or (not periodic[2] and vectors[:2, 2].any()),
        "cell_vectors",
        "only periods may be at angles, and between walls they must be parallel to these",
    )


def _check_spheres(network: Columns) -> Faults:
    """Check inertias and masses against the radii of spheres."""
    low, high = INERTIA_RANGE_IN_M_R2
    share = network.inertia / (network.mass * network.radius**2)
    yield Fault(
        "particle",
        (share < low) | (share > high),
        "inertia",
        "has an inertia that no sphere of its mass and radius has (0.4 m R^2, a shell 2/3)",
    )
    density = density_of(network)
    median = float(np.median(density))
    factor = np.maximum(density / median, median / density)
    yield Fault(
        "particle",
        factor > MAX_DENSITY_FACTOR,
        "density_of_particle",
        f"is {MAX_DENSITY_FACTOR:g} times lighter or heavier for its radius than the median of all",
    )
    stated = network.noted("density") or median
    agrees = 1 / MAX_STATED_DENSITY_FACTOR < median / stated < MAX_STATED_DENSITY_FACTOR
    yield Fault(
        "",
        not agrees,
        "density_of_study",
        f"masses and radii give {median:.4g} kg/m^3, the group study says {stated:.4g}",
        remedy="give mass in kg and radius in m",
    )


def density_of(network: Columns) -> Floats:
    """Return the density of each sphere (n,), kg/m^3: its mass divided by its volume."""
    return network.mass / sphere_volume(network.radius)


def _check_bodies(network: Columns) -> Faults:
    """Check that each inertia tensor is physically possible."""
    tensor = network.inertia_tensor
    assert tensor is not None
    largest_entry = abs(tensor).max(axis=(1, 2))
    asymmetry = abs(tensor - tensor.transpose(0, 2, 1)).max(axis=(1, 2))
    yield Fault(
        "particle",
        asymmetry > MAX_ASYMMETRY * largest_entry,
        "inertia_tensor",
        "has an inertia_tensor that is not symmetric",
    )
    principal = np.linalg.eigvalsh(tensor)
    yield Fault(
        "particle",
        principal[:, 0] <= 0,
        "inertia_tensor",
        "has an inertia_tensor that is not positive definite",
    )
    # No principal moment exceeds the sum of the two others; a flat body reaches it.
    limit = (1 + MAX_ASYMMETRY) * (principal[:, 0] + principal[:, 1])
    yield Fault(
        "particle",
        principal[:, 2] > limit,
        "inertia_tensor",
        "has an inertia_tensor that no body has",
    )
    error = abs(principal.mean(axis=1) / network.inertia - 1)
    yield Fault(
        "particle",
        error > MAX_TRACE_ERROR,
        "inertia",
        "has an inertia other than a third of its inertia_tensor's trace",
    )
