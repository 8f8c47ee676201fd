"""Check contacts: their geometry against the spheres, their forces against their stiffnesses.

The bounds are chosen as those of `modal.packing.checks`.
"""

import numpy as np

from modal.packing.columns import Columns
from modal.packing.faults import Fault, Faults
from modal.packing.neighbours import canonical
from modal.tools.arrays import Floats
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
FORCE_RATIO_RANGE = (1e-3, 10.0)
"""Range of the median of force / (stiffness times overlap): 2/3 for Hertz, 1 for a linear spring,
1/a for a power a, less where plastic contacts are unloaded. Another unit of one of the three gives
a factor 1000."""
MAX_STIFFNESS_RATIO = 10.0
"""Largest median of tangential divided by normal stiffness; elastic bodies have 2/3 to 1."""


def smallest_shear(network: Columns) -> float:
    """Return the tangential force, N, below which the direction of a force is not checked."""
    force = network.force_normal
    if force is None:
        force = network.force_tangential
    if force is None:
        return 0.0
    return MIN_SHEAR_IN_MEAN_FORCES * float(abs(force).mean())


def check_contacts(network: Columns, are_spheres: bool, min_shear: float) -> Faults:
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


def check_pairs(network: Columns) -> Faults:
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


def check_forces(network: Columns) -> Faults:
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
