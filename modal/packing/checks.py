"""Check that a new network is physically possible, and refuse it if not.

Most data of a network are redundant: the branch vector follows from the positions, from radii and
overlap, and from normal and levers. If an exporter permutes a column, uses another unit or writes
the contacts of another packing, the data contradict each other. Each bound below lies between the
values of sound networks (positions of 7 digits in a packing 400 radii long, levers that end
anywhere in the overlap) and those that such mistakes cause; `docs/formats.md` has the table.
Unusual but possible values are reported by `modal.packing.plausibility`.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from modal.packing.columns import COLUMNS, CONTACTS, PART, RECEIVER_WALL, Columns
from modal.packing.contact_law import sphere_volume
from modal.packing.neighbours import canonical
from modal.tools.arrays import Bools, Floats
from modal.tools.errors import InputError

MAX_NORMAL_ANGLE_RAD = 0.02
"""Largest angle between normal and branch vector. Sound networks have up to 3e-5; a permuted normal
gives 0.1 to pi."""
MAX_OVERLAP_IN_SMALLER_RADII = 0.95
"""Largest overlap divided by the smaller radius; at 1 the centre of one sphere lies on the surface
of the other. Sound networks have up to 0.11, very soft spheres a few tenths; diameters in place of
radii give 1 and more."""
MAX_GAP_IN_SUMS_OF_RADII = 0.1
"""Largest gap between spheres in contact, divided by the sum of radii: cohesion may pull across a
gap. A wrong particle or period gives 1."""
MAX_LEVER_ERROR_IN_RADII = 0.02
"""Largest distance of the end of a lever from the overlap of the two bodies, in radii. Sound
networks have up to 5e-6."""
MAX_LEVER_MISFIT_IN_BRANCHES = 0.1
"""Largest distance between the ends of the two levers of a contact, divided by the branch length.
Sound networks have up to 0.06, where levers are as long as the radii and overlaps are 0.11 R;
levers that are too short by a factor 0.7 give 0.3."""
MAX_OVERLAP_ERROR_IN_SMALLER_RADII = 0.02
"""Largest difference between a stated overlap and the overlap that follows from positions and
radii, divided by the smaller radius. Sound networks have up to 5e-5; overlaps in mm give 0.3."""
MAX_NORMAL_SHARE_OF_SHEAR = 0.02
"""Largest share of a tangential force that lies along the normal. Sound networks have up to 3e-7;
permuted forces give 0.5."""
MIN_SHEAR_IN_MEAN_FORCES = 1e-6
"""Tangential force, divided by the mean normal force, below which forces are round-off and may
point anywhere."""
INERTIA_RANGE_IN_M_R2 = (0.12, 0.67)
"""Range of inertia / (m R^2). A heavy core of half the radius has 0.2, a homogeneous sphere 0.4, a
thin shell 2/3."""
MAX_DENSITY_FACTOR = 100.0
"""Largest ratio of a density to the median density of the packing. Glass and tungsten differ by 9;
kg in place of g gives 1000."""
MAX_STATED_DENSITY_FACTOR = 3.0
"""Largest ratio of the median density to the density in the group `study`. kg in place of g gives
1000."""
FORCE_RATIO_RANGE = (1e-3, 10.0)
"""Range of the median of force / (stiffness times overlap): 2/3 for Hertz, 1 for a linear spring,
1/a for a power a, less where plastic contacts are unloaded. Another unit of one of the three gives
a factor 1000."""
MAX_STIFFNESS_RATIO = 10.0
"""Largest median of tangential divided by normal stiffness; elastic bodies have 2/3 to 1."""
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
MEND_EXPORT = "mend the export"
"""Text of the remedy for what only a faulty exporter writes."""


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


class Fault(NamedTuple):
    """A possible fault: which particles or contacts have it, and the error to raise if any does.

    subject: what the fault is about, such as "contact", or "" for the whole network. wrong: which
    particles or contacts (k,) are at fault, or a single bool. The other fields are those of
    `InputError`; the message names the first particle or contact at fault.
    """

    subject: str
    wrong: Any
    code: str
    problem: str
    reason: str = ""
    remedy: str = MEND_EXPORT


Faults = Iterable[Fault]


def refuse_first(faults: Faults, offset: int = 0) -> None:
    """Raise InputError for the first fault that applies; add `offset` to the number in its message.

    If `faults` is a generator, later faults are not computed.
    """
    for fault in faults:
        if np.any(fault.wrong):
            problem = fault.problem
            if fault.subject:
                number = offset + int(np.argmax(fault.wrong))
                problem = f"{fault.subject} {number} {problem}"
            raise InputError(fault.code, problem, fault.reason, fault.remedy)


def check_network(network: Columns) -> None:
    """Raise InputError for an impossible network, naming the first particle or contact at fault."""
    are_spheres = network.inertia_tensor is None
    refuse_first(_check_columns(network))
    refuse_first(_check_cell(network))
    refuse_first(_check_spheres(network) if are_spheres else _check_bodies(network))
    if network.n_contacts == 0:
        return
    min_shear = _smallest_shear(network)
    for first in range(0, network.n_contacts, PART):
        part = network.some(slice(first, first + PART))
        refuse_first(_check_contacts(part, are_spheres, min_shear), first)
    if are_spheres:
        refuse_first(_check_pairs(network))
    refuse_first(_check_forces(network))


def _smallest_shear(network: Columns) -> float:
    """Return the tangential force, N, below which the direction of a force is not checked."""
    force = network.force_normal
    if force is None:
        force = network.force_tangential
    if force is None:
        return 0.0
    return MIN_SHEAR_IN_MEAN_FORCES * float(abs(force).mean())


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


def _check_contacts(network: Columns, are_spheres: bool, min_shear: float) -> Faults:
    """Check normals, levers, overlaps and tangential forces above `min_shear`, N."""
    normal = network.normal
    branch = network.branch
    wall = network.with_wall
    yield Fault(
        "contact",
        abs(_dot(normal, normal) - 1) > 2e-6,
        "normal_length",
        "has a normal that is not a unit vector",
    )
    has_wall_lever = np.zeros(len(wall), bool)
    has_wall_lever[wall] = network.lever_j[wall].any(axis=1)
    yield Fault(
        "contact", has_wall_lever, "lever_of_wall", "is with a wall, whose lever_j must be zero"
    )
    if are_spheres:
        yield from _check_geometry(network, branch)
    between_ends = network.lever_i - network.lever_j
    between_ends -= branch
    between_ends[wall] = 0.0
    max_square = MAX_LEVER_MISFIT_IN_BRANCHES**2 * _dot(branch, branch)
    yield Fault(
        "contact",
        _dot(between_ends, between_ends) > max_square,
        "lever_misfit",
        "has levers that do not end in one point",
    )
    force = network.force_tangential
    if force is not None:
        along_normal = abs(_dot(force, normal))
        size = np.sqrt(_dot(force, force))
        yield Fault(
            "contact",
            along_normal > MAX_NORMAL_SHARE_OF_SHEAR * size + min_shear,
            "shear_along_normal",
            "has a tangential force along its normal",
        )


def _check_geometry(network: Columns, branch: Floats) -> Faults:
    """Check normals, levers and overlaps against positions and radii of spheres."""
    normal = network.normal
    walls = np.flatnonzero(network.with_wall)
    distance = np.sqrt(_dot(branch, branch))
    radius_i = network.radius.take(network.particle_i)
    radius_j = network.radius.take(network.partner)
    radius_j[walls] = np.inf
    smaller = np.minimum(radius_i, radius_j)
    radius_j[walls] = 0.0
    reach = radius_i + radius_j
    overlap = reach - distance
    yield Fault(
        "contact",
        overlap < -MAX_GAP_IN_SUMS_OF_RADII * reach,
        "no_touch",
        "joins places that do not touch",
        "centres (or wall) further apart than the radii reach",
    )
    yield Fault(
        "contact",
        overlap > MAX_OVERLAP_IN_SMALLER_RADII * smaller,
        "deep_overlap",
        f"has spheres that overlap by more than {MAX_OVERLAP_IN_SMALLER_RADII:g} of the smaller "
        "radius, the centre of one nearly inside the other",
        remedy="give radii, not diameters, and the cell's periods",
    )
    yield Fault(
        "contact",
        _dot(branch, normal) < np.cos(MAX_NORMAL_ANGLE_RAD) * distance,
        "normal_direction",
        "has a normal that does not point from the centre of i to that of j, or to the wall",
    )
    gap = np.minimum(overlap, 0.0)
    depth = overlap - gap
    for lever, radius, sign in ((network.lever_i, radius_i, 1), (network.lever_j, radius_j, -1)):
        along = sign * _dot(lever, normal)
        # From the other sphere's surface to the sphere's own one, or across a gap.
        shortest = (1 - MAX_LEVER_ERROR_IN_RADII) * radius - depth
        longest = (1 + MAX_LEVER_ERROR_IN_RADII) * radius - gap
        outside = (along < shortest) | (along > longest)
        across_square = _dot(lever, lever) - along**2
        outside |= across_square > (MAX_LEVER_ERROR_IN_RADII * radius) ** 2
        yield Fault(
            "contact", outside, "lever", "has a lever that does not end where the two touch"
        )
    if network.overlap is not None:
        error = abs(network.overlap - overlap)
        yield Fault(
            "contact",
            error > MAX_OVERLAP_ERROR_IN_SMALLER_RADII * smaller,
            "overlap",
            "has an overlap other than positions and radii give",
        )


def _check_pairs(network: Columns) -> Faults:
    """Check that no contact is listed twice: two spheres touch once through each period."""
    i = network.particle_i
    j = network.particle_j
    # 32 bits, which a network may have, do not hold the square of 46,341 spheres.
    key = np.minimum(i, j).astype(np.int64, copy=False)
    key *= network.n_particles + 2
    key += np.maximum(i, j)
    ordered = np.sort(key)
    rows = np.flatnonzero(np.isin(key, ordered[1:][ordered[1:] == ordered[:-1]]))
    repeated = network.some(rows)
    order, first_ends, second_ends, shifts, _ = canonical(
        repeated.particle_i, repeated.particle_j, repeated.periods
    )
    steps = [np.diff(column, axis=0) for column in (first_ends, second_ends, shifts)]
    is_repeated = ~np.column_stack(steps).any(axis=1)
    if is_repeated.any():
        row = int(np.argmax(is_repeated))
        first, second = np.sort(rows[order[row : row + 2]])
        yield Fault(
            "",
            True,
            "contact_twice",
            f"contacts {first} and {second} are the same one",
            remedy="list each contact once, with its whole stiffness",
        )


def force_ratio(network: Columns) -> Floats:
    """Return force / (stiffness times overlap) of compressed contacts; empty if unknown."""
    if network.force_normal is None or network.overlap is None:
        return np.empty(0)
    force = network.force_normal
    elastic = network.stiffness_normal * network.overlap
    pushes = (force > 0) & (elastic > 0)
    return force[pushes] / elastic[pushes]


def stiffness_ratio(network: Columns) -> Floats:
    """Return tangential divided by normal stiffness of the contacts with a normal stiffness."""
    stiff = network.stiffness_normal > 0
    return network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]


def check_force_ratio(network: Columns) -> None:
    """Raise InputError if no contact law has the median `force_ratio`; pass if it is unknown."""
    ratio = force_ratio(network)
    if _median_is_outside(ratio, FORCE_RATIO_RANGE):
        raise InputError(
            "force_ratio",
            f"force over stiffness times overlap is {np.median(ratio):.3g} in the median contact, "
            "which no law of contact has (Hertz 2/3, linear 1)",
            remedy="give forces in N, stiffnesses in N/m, overlaps in m",
        )


def _check_forces(network: Columns) -> Faults:
    """Check that the units of forces, stiffnesses and overlaps agree."""
    force = network.force_normal
    overlap = network.overlap
    if force is not None and overlap is not None:
        smallest = min(force.min(), overlap.min(), network.stiffness_normal.min())
        # A packing whose contacts pull or are bonded may have any ratio.
        if smallest > 0:
            check_force_ratio(network)
    ratio = stiffness_ratio(network)
    yield Fault("", len(ratio) == 0, "no_stiffness", "no contact has a normal stiffness")
    if _median_is_outside(ratio, (0.0, MAX_STIFFNESS_RATIO)):
        yield Fault(
            "",
            True,
            "stiffness_ratio",
            f"tangential over normal stiffness is {np.median(ratio):.3g} in the median contact "
            "(elastic bodies: 2/3 to 1)",
            remedy="give both in N/m",
        )


def _median_is_outside(values: Floats, bounds: tuple[float, float]) -> bool:
    """Return whether the median lies outside of the bounds; found by counting, not sorting."""
    low, high = bounds
    below = np.count_nonzero(values < low)
    above = np.count_nonzero(values > high)
    return bool(max(below, above) > len(values) / 2)


def _dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar products (m,) of rows (m, 3)."""
    return (a * b) @ np.ones(3)  # a third of the time of einsum
