"""Which networks are refused when they are made, however they are made.

A network says most things twice: the branch from centre to centre follows from the positions, from
radii and overlap, from normal and levers. An exporter that permutes a column, takes another unit or
writes another packing's contacts breaks that. Each bound below lies between what sound networks
show (positions of 7 digits over 400 radii, levers that end anywhere in the overlap) and what such
mistakes make; `docs/formats.md` has the table. What no check can tell is in
`modal.packing.plausibility`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from modal.packing.columns import COLUMNS, CONTACTS, PART, RECEIVER_WALL, Columns
from modal.packing.contact_law import sphere_volume
from modal.packing.neighbours import canonical
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

ANGLE = 0.02
"""Between normal and branch, rad. Sound: up to 3e-5; a permuted normal: 0.1 to pi."""
DEEPEST = 0.95
"""Overlap over the smaller radius, at 1 the centre of one lies on the surface of the other. Sound:
up to 0.11, very soft spheres some tenths; diameters in place of radii: 1 and more."""
WIDEST = 0.1
"""Gap over the sum of radii, across which cohesion may pull. A wrong particle or period: 1."""
LEVER = 0.02
"""Distance of a lever's end from the overlap of the two, in radii. Sound: up to 5e-6."""
MISFIT = 0.1
"""By which levers that do not end in one point miss each other, over the branch. Sound: up to 0.06,
levers as long as the radii with overlaps of 0.11 R; levers 0.7 as long: 0.3."""
OVERLAP = 0.02
"""Between overlap and positions, over the smaller radius. Sound: up to 5e-5; in mm: 0.3."""
ACROSS = 0.02
"""Share of a tangential force that lies along the normal. Sound: up to 3e-7; permuted: 0.5."""
SMALL_FORCE = 1e-6
"""Of the mean contact force: a tangential force so small may point anywhere."""
INERTIA = (0.12, 0.67)
"""Over m R^2: a heavy core of half the radius has 0.2, a sphere 0.4, a thin shell 2/3."""
DENSITY = 100.0
"""Factor from the packing's median density. Glass to tungsten: 9; kg for g: 1000."""
STATED_DENSITY = 3.0
"""Factor between the median density and that of the group `study`. kg for g: 1000."""
FORCE_RATIO = (1e-3, 10.0)
"""Median of force over stiffness times overlap: 2/3 for Hertz, 1 for a linear spring, 1/a for a
power a, less where plastic contacts are unloaded. Another unit of one of them: a factor 1000."""
STIFFNESS_RATIO = 10.0
"""Largest median of tangential over normal stiffness; elastic bodies have 2/3 to 1."""
PERIOD = 1e-3
"""Between the distance of the walls and a period along z, over that period."""


def converted(given: Mapping[str, Any]) -> dict[str, Any]:
    """What a network is `given`, its columns as arrays of their kind and shape; or InputError."""
    own, lengths = dict(given), dict[int | str, int]()
    for name, column in COLUMNS.items():
        if not (column.optional and given[name] is None):
            own[name] = column.array(name, given[name], lengths)
    for name in ("study", "provenance"):
        if not isinstance(given[name], Mapping):
            raise InputError(
                "input", f"{name} is {given[name]!r}, not a dict", remedy="give names and values"
            )
    return own


Faults = Iterable[tuple[str, Any, str]]
"""One after the other: the kind of thing, which of them (k,) bool are at fault, and what that is;
no kind and a single bool where it is the network as a whole."""


def refuse(faults: Faults, first: int = 0) -> None:
    """InputError for the first fault that there is; `first` is the number of the first thing."""
    for kind, wrong, fault in faults:
        if np.any(wrong):
            number = f"{kind} {first + int(np.argmax(wrong))} " if kind else ""
            raise InputError("input", f"{number}{fault}" + "; mend the export" * (";" not in fault))


def check(network: Columns) -> None:
    """InputError, of the first particle or contact at fault, for what no packing can have."""
    spheres, m = network.inertia_tensor is None, network.n_contacts
    refuse(_of_columns(network))
    refuse(_of_cell(network))
    refuse(_of_spheres(network) if spheres else _of_bodies(network))
    pushed = network.force_tangential if network.force_normal is None else network.force_normal
    least = 0.0 if pushed is None or m == 0 else SMALL_FORCE * float(abs(pushed).mean())
    for first in range(0, m, PART):
        refuse(_of_contacts(network.some(slice(first, first + PART)), spheres, least), first)
    if m and spheres:
        refuse(_of_pairs(network))
    if m:
        refuse(_of_forces(network))


def _of_columns(network: Columns) -> Faults:
    """What each column must be by itself."""
    n = network.n_particles
    yield "", n == 0, "it has no particles; export a packing with at least one"
    for name in ("radius", "mass", "inertia"):
        yield "particle", getattr(network, name) <= 0, f"has {name} <= 0"
    for name in (name for name in CONTACTS if name.startswith("stiffness")):
        if (stiffness := getattr(network, name)) is not None:
            yield "contact", stiffness < 0, f"has negative {name}"
    i, j = network.particle_i, network.particle_j
    yield "contact", (i < 0) | (i >= n), f"has particle_i outside 0 to {n - 1}"
    yield "contact", (j < RECEIVER_WALL) | (j >= n), f"has particle_j outside -2 to {n - 1}"
    lacks = (network.stiffness_rolling is None) != (network.stiffness_twisting is None)
    yield "", lacks, "one of stiffness_rolling and stiffness_twisting lacks; give both, or zeros"


def _of_cell(network: Columns) -> Faults:
    """Periods, contacts through periods that are there, and walls around the packing."""
    cell, axes, shift = network.cell_size, network.cell_periodic, network.cell_shift
    fault = "cell_size must be positive along the periodic axes, and 0 or the packing's width else"
    yield "", (cell[axes] <= 0).any() or (cell < 0).any(), fault
    if shift is not None:
        own = network.particle_i == network.particle_j
        fault = "joins a particle to itself without a period (cell_shift is zero)"
        yield "contact", own & ~shift.any(axis=1), fault
        for axis in np.flatnonzero(~axes):
            yield "", shift[:, axis].any(), f"cell_shift along {'xyz'[axis]}, which is not periodic"
    low, high = network.wall_position
    if axes[2]:
        fault = "it is periodic along z, but wall_position is not the two bounds of the period"
        yield "", abs(high - low - cell[2]) > PERIOD * cell[2], fault
    elif low != high or network.with_wall.any():  # coincident walls are none, if none needs them
        yield "", low >= high, "the source wall does not lie below the receiver wall"
        z = network.position[:, 2]
        yield "particle", (z < low) | (z > high), "has its centre beyond a wall"


def _of_spheres(network: Columns) -> Faults:
    """Inertia and mass of spheres of these radii."""
    share = network.inertia / (network.mass * network.radius**2)
    fault = "has an inertia that no sphere of its mass and radius has (0.4 m R^2, a shell 2/3)"
    yield "particle", (share < INERTIA[0]) | (share > INERTIA[1]), fault
    density = density_of(network)
    median = float(np.median(density))
    factor = np.maximum(density / median, median / density)
    fault = f"is {DENSITY:g} times lighter or heavier for its radius than the median of all"
    yield "particle", factor > DENSITY, fault
    stated = network.noted("density") or median
    fault = f"masses and radii give {median:.4g} kg/m^3, the group study says {stated:.4g}"
    off = not 1 / STATED_DENSITY < median / stated < STATED_DENSITY
    yield "", off, f"{fault}; give mass in kg and radius in m"


def density_of(network: Columns) -> Floats:
    """Shape (n,), kg/m^3: mass over volume of each sphere."""
    return network.mass / sphere_volume(network.radius)


def _of_bodies(network: Columns) -> Faults:
    """Tensors of inertia are those of bodies."""
    tensor = network.inertia_tensor
    assert tensor is not None
    size = abs(tensor).max(axis=(1, 2))
    skew = abs(tensor - tensor.transpose(0, 2, 1)).max(axis=(1, 2)) > 1e-9 * size
    yield "particle", skew, "has an inertia_tensor that is not symmetric"
    value = np.linalg.eigvalsh(tensor)
    yield "particle", value[:, 0] <= 0, "has an inertia_tensor that is not positive definite"
    # No axis has more than the two others together: a flat body has as much.
    flat = value[:, 2] > (1 + 1e-9) * (value[:, 0] + value[:, 1])
    yield "particle", flat, "has an inertia_tensor that no body has"
    off = abs(value.mean(axis=1) / network.inertia - 1) > 1e-6
    yield "particle", off, "has an inertia other than a third of its inertia_tensor's trace"


def _of_contacts(network: Columns, spheres: bool, least: float) -> Faults:
    """Normals, levers, overlaps and shear forces above the `least`, N, against each other."""
    normal, branch, wall = network.normal, network.branch, network.with_wall
    length = abs(_dot(normal, normal) - 1) > 2e-6
    yield "contact", length, "has a normal that is not a unit vector"
    held = np.zeros(len(wall), bool)
    held[wall] = network.lever_j[wall].any(axis=1)
    yield "contact", held, "is with a wall, whose lever_j must be zero"
    if spheres:
        yield from _of_touching(network, branch)
    missed = network.lever_i - network.lever_j
    missed -= branch
    missed[wall] = 0.0
    misfit = _dot(missed, missed) > MISFIT**2 * _dot(branch, branch)
    yield "contact", misfit, "has levers that do not end in one point"
    force = network.force_tangential
    if force is not None:
        along, size = abs(_dot(force, normal)), np.sqrt(_dot(force, force))
        yield "contact", along > ACROSS * size + least, "has a tangential force along its normal"


def _of_touching(network: Columns, branch: Floats) -> Faults:
    """Normals, levers and overlaps against positions and radii."""
    normal, walls = network.normal, np.flatnonzero(network.with_wall)
    distance = np.sqrt(_dot(branch, branch))
    radius_i = network.radius.take(network.particle_i)
    radius_j = network.radius.take(network.partner)
    radius_j[walls] = np.inf
    smaller = np.minimum(radius_i, radius_j)
    radius_j[walls] = 0.0
    reach = radius_i + radius_j
    overlap = reach - distance
    fault = "joins places that do not touch: centres (or wall) further apart than the radii reach"
    yield "contact", overlap < -WIDEST * reach, fault
    fault = (
        f"has spheres that overlap by more than {DEEPEST:g} of the smaller radius, the centre of "
        "one nearly inside the other; give radii, not diameters, and the cell's periods"
    )
    yield "contact", overlap > DEEPEST * smaller, fault
    fault = "has a normal that does not point from the centre of i to that of j, or to the wall"
    yield "contact", _dot(branch, normal) < np.cos(ANGLE) * distance, fault

    gap = np.minimum(overlap, 0.0)
    deep = overlap - gap
    for lever, radius, sign in ((network.lever_i, radius_i, 1), (network.lever_j, radius_j, -1)):
        along = sign * _dot(lever, normal)
        # From where the other sphere's surface crosses the normal to its own, or across a gap.
        off = (along < (1 - LEVER) * radius - deep) | (along > (1 + LEVER) * radius - gap)
        off |= _dot(lever, lever) - along**2 > (LEVER * radius) ** 2
        yield "contact", off, "has a lever that does not end where the two touch"
    if network.overlap is not None:
        wrong = abs(network.overlap - overlap) > OVERLAP * smaller
        yield "contact", wrong, "has an overlap other than positions and radii give"


def _of_pairs(network: Columns) -> Faults:
    """No contact twice: two spheres touch once through each period."""
    i, j = network.particle_i, network.particle_j
    # 32 bits, which a network may have, do not hold the square of 46,341 spheres.
    key = np.minimum(i, j).astype(np.int64, copy=False)
    key *= network.n_particles + 2
    key += np.maximum(i, j)
    ordered = np.sort(key)
    rows = np.flatnonzero(np.isin(key, ordered[1:][ordered[1:] == ordered[:-1]]))
    again = network.some(rows)
    order, *said, _ = canonical(again.particle_i, again.particle_j, again.periods)
    twice = ~np.column_stack([np.diff(column, axis=0) for column in said]).any(axis=1)
    for here in np.flatnonzero(twice)[:1]:
        first, second = np.sort(rows[order[here : here + 2]])
        fault = f"contacts {first} and {second} are the same one"
        yield "", True, f"{fault}; list each contact once, with its whole stiffness"


def force_ratio(network: Columns) -> Floats:
    """Force over stiffness times overlap of the contacts that push, or empty where unknown."""
    if network.force_normal is None or network.overlap is None:
        return np.empty(0)
    force, elastic = network.force_normal, network.stiffness_normal * network.overlap
    told = (force > 0) & (elastic > 0)
    return force[told] / elastic[told]


def stiffness_ratio(network: Columns) -> Floats:
    """Tangential over normal stiffness of the contacts that have any."""
    stiff = network.stiffness_normal > 0
    return network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]


def check_force_ratio(network: Columns) -> None:
    """InputError where the median `force_ratio` is that of no law; without any nothing is told."""
    fault = (
        "force over stiffness times overlap is {:.3g} in the median contact, which no law of "
        "contact has (Hertz 2/3, linear 1); give forces in N, stiffnesses in N/m, overlaps in m"
    )
    refuse(_of_median(force_ratio(network), FORCE_RATIO, fault))


def _of_forces(network: Columns) -> Faults:
    """Units of forces, stiffnesses and overlaps agree."""
    force, overlap, kn = network.force_normal, network.overlap, network.stiffness_normal
    # A packing whose contacts pull or are bonded may have any ratio.
    if force is not None and overlap is not None and min(f.min() for f in (force, overlap, kn)) > 0:
        check_force_ratio(network)
    ratio = stiffness_ratio(network)
    yield "", not len(ratio), "no contact has a normal stiffness"
    fault = (
        "tangential over normal stiffness is {:.3g} in the median contact (elastic bodies: 2/3 to "
        "1); give both in N/m"
    )
    yield from _of_median(ratio, (0.0, STIFFNESS_RATIO), fault)


def _of_median(ratio: Floats, bounds: tuple[float, float], fault: str) -> Faults:
    """Whether the median lies outside the bounds: to count takes a tenth of finding it."""
    low, high = bounds
    if max(np.count_nonzero(ratio < low), np.count_nonzero(ratio > high)) > len(ratio) / 2:
        yield "", True, fault.format(np.median(ratio))


def _dot(a: Floats, b: Floats) -> Floats:
    """Shape (m,): the products of rows (m, 3)."""
    return (a * b) @ np.ones(3)  # a third of what einsum takes
