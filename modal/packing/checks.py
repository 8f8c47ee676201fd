"""Which networks are refused when they are made, however they are made.

A network says most things twice: the branch from centre to centre follows from the positions, from
radii and overlap, from normal and levers. An exporter that permutes a column, takes another unit or
writes another packing's contacts breaks that. Each bound below lies between what sound networks
show (positions of 7 digits over 400 radii, levers that end anywhere in the overlap) and what such
mistakes make; `docs/formats.md` has the table. What no check can tell is in
`modal.packing.plausibility`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from modal.packing.columns import COLUMNS, CONTACTS, PART, RECEIVER_WALL, Columns
from modal.packing.contact_law import sphere_volume
from modal.tools.arrays import Array, Bools, Floats
from modal.tools.errors import InputError

KINDS = {
    "f": ("fiu", "numbers", np.float64),
    "i": ("iu", "whole numbers", np.int64),
    "b": ("biu", "yes or no", np.bool_),
}
"""Of each kind of column: the kinds of array that are taken, its name, and what it is made."""
ANGLE = 0.02
"""Between normal and branch, rad. Sound: up to 3e-5; a permuted normal: 0.1 to pi."""
DEEPEST = 0.3
"""Overlap over the smaller radius. Sound: up to 0.11; a radius for a diameter: 1."""
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
        if column.optional and given[name] is None:
            continue
        data = own[name] = _array(name, given[name], column.kind)
        if isinstance(length := column.shape[0], str):
            lengths.setdefault(length, len(data) if data.ndim else 0)
        shape = tuple(lengths.get(n, n) for n in column.shape)
        if data.shape != shape:
            raise InputError(f"{name} has shape {data.shape}, not {shape}; mend the export")
    for name in ("study", "provenance"):
        if not isinstance(given[name], Mapping):
            raise InputError(f"{name} is {given[name]!r}, not a dict; give names and values")
    return own


def _array(name: str, given: Any, kind: str) -> Array:
    taken, words, dtype = KINDS[kind]
    try:
        data = np.asarray(given)
    except ValueError:  # rows of different lengths
        data = np.array(None)
    if data.dtype.kind not in taken:
        raise InputError(f"{name} is no array of {words}; mend the export")
    # Indices may have any width, but a sign: a wall's are negative.
    keeps = data.dtype.kind == kind and (kind == "i" or data.dtype == dtype)
    return data if keeps else data.astype(dtype)


@contextmanager
def named(path: str | Path) -> Iterator[None]:
    """Have what is refused begin with the file that it comes from."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def check(network: Columns) -> None:
    """InputError, of the first particle or contact at fault, for what no packing can have."""
    n = network.n_particles
    if n == 0:
        raise InputError("it has no particles; export a packing with at least one")
    for name, column in COLUMNS.items():
        data = getattr(network, name)
        if column.kind == "f" and data is not None and not np.isfinite(data).all():
            row = int(np.argwhere(~np.isfinite(data))[0, 0])
            raise InputError(f"{name} is not finite in row {row}; mend the export")
    _refuse_first(_of_columns(network))
    _check_cell(network)
    _check_walls(network)
    if (network.stiffness_rolling is None) != (network.stiffness_twisting is None):
        raise InputError(
            "one of stiffness_rolling and stiffness_twisting lacks; give both, zeros where a "
            "contact does not resist"
        )
    spheres = network.inertia_tensor is None
    _refuse_first(_of_particles(network) if spheres else _of_bodies(network))
    if network.n_contacts:
        pushed = network.force_tangential if network.force_normal is None else network.force_normal
        least = 0.0 if pushed is None else SMALL_FORCE * float(abs(pushed).mean())
        for first in range(0, network.n_contacts, PART):
            part = network.some(slice(first, first + PART))
            _refuse_first(_of_contacts(part, spheres, least), first)
        if spheres:
            _check_pairs(network)
        _check_forces(network)


Faults = Iterator[tuple[str, Bools, str]]
"""Kind of thing, which of them (k,) are at fault, and what that is: one after the other."""


def _refuse_first(faults: Faults, first: int = 0) -> None:
    """InputError for the first fault that there is; `first` is the number of the first thing."""
    for kind, wrong, fault in faults:
        refuse(wrong, kind, fault, first)


def _of_columns(network: Columns) -> Faults:
    """What each column must be by itself."""
    for name in ("radius", "mass", "inertia"):
        yield "particle", getattr(network, name) <= 0, f"has {name} <= 0"
    for name in (name for name in CONTACTS if name.startswith("stiffness")):
        if (stiffness := getattr(network, name)) is not None:
            yield "contact", stiffness < 0, f"has negative {name}"
    i, j, n = network.particle_i, network.particle_j, network.n_particles
    yield "contact", (i < 0) | (i >= n), f"has particle_i outside 0 to {n - 1}"
    yield "contact", (j < RECEIVER_WALL) | (j >= n), f"has particle_j outside -2 to {n - 1}"


def _check_cell(network: Columns) -> None:
    """Widths of the periods, and contacts through periods that are there."""
    cell, axes, shift = network.cell_size, network.cell_periodic, network.cell_shift
    if not ((cell[axes] > 0).all() and (cell >= 0).all()):
        raise InputError(
            "cell_size must be positive along the periodic axes, and 0 or the width of the "
            "packing along the others; mend the export"
        )
    if shift is None:
        return
    own = network.particle_i == network.particle_j
    fault = "joins a particle to itself without a period (cell_shift is zero)"
    refuse(own & ~shift.any(axis=1) if own.any() else own, "contact", fault)
    for axis in np.flatnonzero(~axes):
        if shift[:, axis].any():
            raise InputError(f"cell_shift along {'xyz'[axis]}, which is not periodic; mend it")


def _check_walls(network: Columns) -> None:
    """Walls apart and around the packing; coincident ones are none, if no contact needs them."""
    low, high = network.wall_position
    if network.cell_periodic[2]:
        period = network.cell_size[2]
        if abs(high - low - period) > PERIOD * period:
            raise InputError(
                "the packing is periodic along z, but wall_position is not the two bounds of the "
                "period; mend the export"
            )
        return
    if low == high and not network.with_wall.any():
        return
    if not low < high:
        raise InputError("the source wall does not lie below the receiver wall; mend the export")
    z = network.position[:, 2]
    refuse((z < low) | (z > high), "particle", "has its centre beyond a wall")


def _of_particles(network: Columns) -> Faults:
    """Inertia and mass of spheres of these radii."""
    share = network.inertia / (network.mass * network.radius**2)
    fault = "has an inertia that no sphere of its mass and radius has (0.4 m R^2; a shell 2/3)"
    yield "particle", (share < INERTIA[0]) | (share > INERTIA[1]), fault
    density = density_of(network)
    median = float(np.median(density))
    factor = np.maximum(density / median, median / density)
    fault = f"is {DENSITY:g} times lighter or heavier for its radius than the median of all"
    yield "particle", factor > DENSITY, fault
    stated = network.noted("density")
    if stated is not None and not 1 / STATED_DENSITY < median / stated < STATED_DENSITY:
        raise InputError(
            f"masses and radii give {median:.4g} kg/m^3, the group study says "
            f"{stated:.4g}; give mass in kg and radius in m"
        )


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
    fault = f"has spheres that overlap by more than {DEEPEST:g} of the smaller radius"
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


def _check_pairs(network: Columns) -> None:
    """No contact twice: two spheres touch once through each period."""
    i, j, n = network.particle_i, network.particle_j, network.n_particles
    # 32 bits, which a network may have, do not hold the square of 46,341 spheres.
    key = np.minimum(i, j).astype(np.int64) * (n + 2) + np.maximum(i, j)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if not len(again):
        return
    # Contacts of one pair that differ in their periods point elsewhere.
    pairs = np.unique(key[order[again]])
    rows = np.flatnonzero(np.isin(key, pairs))
    rows = rows[np.argsort(key[rows], kind="stable")]
    branch = network.some(rows).branch
    branch *= np.where(i[rows] > j[rows], -1, 1)[:, None]
    own = (i[rows] == j[rows])[:, None]
    scale = network.radius[i[rows]][:, None]
    step = 1
    while True:
        same = key[rows[step:]] == key[rows[:-step]]
        if not same.any():
            return
        near = abs(branch[step:] - branch[:-step]) < scale[step:]
        mirrored = own[step:] & (abs(branch[step:] + branch[:-step]) < scale[step:])
        twice = same & (near.all(axis=1) | mirrored.all(axis=1))
        if twice.any():
            second, first = rows[step:][twice][0], rows[:-step][twice][0]
            raise InputError(
                f"contacts {min(first, second)} and {max(first, second)} are the same one; "
                "list each contact once, with its whole stiffness"
            )
        step += 1


def force_ratio(network: Columns) -> Floats:
    """Force over stiffness times overlap of the contacts that push, or empty where unknown."""
    if network.force_normal is None or network.overlap is None:
        return np.empty(0)
    force, resisted = network.force_normal, network.stiffness_normal * network.overlap
    told = (force > 0) & (resisted > 0)
    ratio: Floats = force / np.where(told, resisted, 1.0)
    return ratio if told.all() else ratio[told]


def check_force_ratio(network: Columns) -> None:
    """InputError where the median `force_ratio` is that of no law; without any nothing is told."""
    ratio = force_ratio(network)
    if _median_outside(ratio, *FORCE_RATIO):
        raise InputError(
            f"force over stiffness times overlap is {np.median(ratio):.3g} in the median contact, "
            "which no law of contact has (Hertz 2/3, linear 1); give forces in N, stiffnesses "
            "in N/m and overlaps in m"
        )


def _median_outside(ratio: Floats, low: float, high: float) -> bool:
    """Whether a median lies outside two bounds: to count takes a tenth of finding it."""
    half = len(ratio) / 2
    return bool(np.count_nonzero(ratio < low) > half or np.count_nonzero(ratio > high) > half)


def _check_forces(network: Columns) -> None:
    """Units of forces, stiffnesses and overlaps agree."""
    force, overlap, kn = network.force_normal, network.overlap, network.stiffness_normal
    # A packing whose contacts pull or are bonded may have any ratio.
    if force is not None and overlap is not None and min(f.min() for f in (force, overlap, kn)) > 0:
        check_force_ratio(network)
    stiff = kn > 0
    if not stiff.any():
        raise InputError("no contact has a normal stiffness; mend the export")
    ratio = network.stiffness_tangential / np.where(stiff, kn, np.inf)
    if _median_outside(ratio[stiff], 0.0, STIFFNESS_RATIO):
        raise InputError(
            f"tangential over normal stiffness is {np.median(ratio[stiff]):.3g} in the median "
            "contact (elastic bodies: 2/3 to 1); give both in N/m"
        )


def refuse(wrong: Bools, kind: str, fault: str, first: int = 0) -> None:
    """InputError about the first of the particles or contacts that are `wrong` (m,) bool.

    `first` is the number of the first of them.
    """
    if wrong.any():
        number = first + int(np.argmax(wrong))
        raise InputError(f"{kind} {number} {fault}; mend the export")


def _dot(a: Floats, b: Floats) -> Floats:
    """Shape (m,): the products of rows (m, 3)."""
    product: Floats = (a * b) @ np.ones(3)  # a third of what einsum takes
    return product
