"""Do positions, radii, normals, levers, walls and masses of a network tell of the same spheres?

A network says most things twice: the branch from centre to centre follows from the positions, from
radii and overlap, from normal and levers. An exporter that permutes a column, takes another unit or
writes another packing's contacts breaks that. Each bound below lies between what sound networks
show (positions of 7 digits over 400 radii, levers that end anywhere in the overlap) and what such
mistakes make; `docs/formats.md` has the table. What no check can tell is in
`modal.packing.plausibility`.
"""

from __future__ import annotations

import numpy as np

from modal.formats.arrays import Bools, Floats
from modal.formats.hdf5 import InputError
from modal.packing.contact_law import sphere_volume
from modal.packing.network import Network

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


def check_consistency(network: Network, name: str) -> None:
    """InputError where the parts of a network, each sound by itself, contradict each other."""
    _check_walls(network, name)
    _check_particles(network, name)
    if network.n_contacts:
        for first, part in network.parts():
            _check_geometry(part, name, first)
        _check_pairs(network, name)
        _check_forces(network, name)


def _check_walls(network: Network, name: str) -> None:
    """Walls apart and around the packing; coincident ones are none, if no contact needs them."""
    low, high = network.wall_position
    if not np.isfinite(network.wall_position).all():
        raise InputError(f"{name}: walls/position is not finite; mend the export")
    if network.cell_periodic[2]:
        period = network.cell_size[2]
        if abs(high - low - period) > PERIOD * period:
            raise InputError(
                f"{name}: the packing is periodic along z, but walls/position is not the two "
                "bounds of the period; mend the export"
            )
        return
    if low == high and not network.with_wall.any():
        return
    if not low < high:
        raise InputError(
            f"{name}: the source wall does not lie below the receiver wall; mend the export"
        )
    z = network.position[:, 2]
    refuse((z < low) | (z > high), name, "particle", "has its centre beyond a wall")


def _check_particles(network: Network, name: str) -> None:
    """Inertia and mass of spheres of these radii."""
    share = network.inertia / (network.mass * network.radius**2)
    wrong = (share < INERTIA[0]) | (share > INERTIA[1])
    fault = "has an inertia that no sphere of its mass and radius has (0.4 m R^2; a shell 2/3)"
    refuse(wrong, name, "particle", fault)
    density = density_of(network)
    median = float(np.median(density))
    factor = np.maximum(density / median, median / density)
    fault = f"is {DENSITY:g} times lighter or heavier for its radius than the median of all"
    refuse(factor > DENSITY, name, "particle", fault)
    stated = network.noted("density")
    if stated is not None and not 1 / STATED_DENSITY < median / stated < STATED_DENSITY:
        raise InputError(
            f"{name}: masses and radii give {median:.4g} kg/m^3, the group study says "
            f"{stated:.4g}; give mass in kg and radius in m"
        )


def density_of(network: Network) -> Floats:
    """Shape (n,), kg/m^3: mass over volume of each sphere."""
    return network.mass / sphere_volume(network.radius)


def branches(network: Network) -> Floats:
    """Shape (m, 3), m: from the centre of i to that of j, or straight to the wall.

    Where `cell_shift` is absent, through as many periods as bring it nearest to the levers.
    """
    i, wall = network.particle_i, network.with_wall
    branch = network.position[network.partner] - network.position[i]
    period = np.where(network.cell_periodic, network.cell_size, 0.0)
    if network.cell_shift is not None:
        branch += network.cell_shift * period
    elif network.cell_periodic.any():
        missing = network.lever_i - network.lever_j - branch
        branch += np.round(missing / np.where(period > 0, period, np.inf)) * period
    branch[wall] = 0
    branch[wall, 2] = network.wall_distance[wall]
    return branch


def _check_geometry(network: Network, name: str, first: int) -> None:
    """Normals, levers and overlaps against positions and radii; `first` is that of the contacts."""

    def refuse_contact(wrong: Bools, fault: str) -> None:
        refuse(wrong, name, "contact", fault, first)

    i, j, wall = network.particle_i, network.partner, network.with_wall
    branch, normal = branches(network), network.normal
    distance = np.linalg.norm(branch, axis=1)
    radius_i = network.radius[i]
    radius_j = np.where(wall, 0.0, network.radius[j])
    smaller = np.where(wall, radius_i, np.minimum(radius_i, network.radius[j]))
    overlap = radius_i + radius_j - distance
    fault = "joins places that do not touch: centres (or wall) further apart than the radii reach"
    refuse_contact(overlap < -WIDEST * (radius_i + radius_j), fault)
    fault = f"has spheres that overlap by more than {DEEPEST:g} of the smaller radius"
    refuse_contact(overlap > DEEPEST * smaller, fault)
    # A centre on the wall's plane was refused with the overlap, so no distance is zero.
    along = (branch * normal).sum(axis=1)
    across = np.linalg.norm(branch - along[:, None] * normal, axis=1)
    fault = "has a normal that does not point from the centre of i to that of j, or to the wall"
    refuse_contact((along <= 0) | (across > ANGLE * distance), fault)

    for lever, radius, sign, inside in (
        (network.lever_i, radius_i, 1.0, np.ones(len(i), bool)),
        (network.lever_j, radius_j, -1.0, ~wall),
    ):
        along = sign * (lever * normal).sum(axis=1)
        aside = np.linalg.norm(lever - sign * along[:, None] * normal, axis=1)
        # From where the other sphere's surface crosses the normal to its own, or across a gap.
        ends = np.sort([radius - overlap, radius], axis=0)
        off = (along < ends[0] - LEVER * radius) | (along > ends[1] + LEVER * radius)
        wrong = inside & (off | (aside > LEVER * radius))
        refuse_contact(wrong, "has a lever that does not end where the two touch")
    fault = "is with a wall, whose lever_j must be zero"
    refuse_contact(wall & network.lever_j.any(axis=1), fault)
    missed = np.linalg.norm(network.lever_i - network.lever_j - branch, axis=1)
    fault = "has levers that do not end in one point"
    refuse_contact(~wall & (missed > MISFIT * distance), fault)
    if network.overlap is not None:
        wrong = abs(network.overlap - overlap) > OVERLAP * smaller
        refuse_contact(wrong, "has an overlap other than positions and radii give")


def _check_pairs(network: Network, name: str) -> None:
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
    branch = branches(network.with_contacts(rows))
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
                f"{name}: contacts {min(first, second)} and {max(first, second)} are the same one; "
                "list each contact once, with its whole stiffness"
            )
        step += 1


def force_ratio(network: Network) -> Floats:
    """Force over stiffness times overlap of the contacts that push, or empty where unknown."""
    if network.force_normal is None or network.overlap is None:
        return np.empty(0)
    force, resisted = network.force_normal, network.stiffness_normal * network.overlap
    told = (force > 0) & (resisted > 0)
    return force[told] / resisted[told]


def check_force_ratio(ratio: Floats, name: str) -> None:
    """InputError where the median `force_ratio` is that of no law; an empty one tells nothing."""
    if len(ratio) and not FORCE_RATIO[0] <= (median := float(np.median(ratio))) <= FORCE_RATIO[1]:
        raise InputError(
            f"{name}: force over stiffness times overlap is {median:.3g} in the median contact, "
            "which no law of contact has (Hertz 2/3, linear 1); give forces in N, stiffnesses "
            "in N/m and overlaps in m"
        )


def _check_forces(network: Network, name: str) -> None:
    """Tangential forces lie across the normal; units of forces, stiffnesses and overlaps agree."""
    if network.force_tangential is not None:
        force, normal = network.force_tangential, network.normal
        size = np.sqrt(np.einsum("ck,ck->c", force, force))
        pushed = size if network.force_normal is None else abs(network.force_normal)
        along = abs(np.einsum("ck,ck->c", force, normal))
        wrong = along > ACROSS * size + SMALL_FORCE * pushed.mean()
        refuse(wrong, name, "contact", "has a tangential force along its normal")
    ratio = force_ratio(network)
    # A packing whose contacts pull or are bonded may have any ratio.
    if len(ratio) == network.n_contacts:
        check_force_ratio(ratio, name)
    stiff = network.stiffness_normal > 0
    if not stiff.any():
        raise InputError(f"{name}: no contact has a normal stiffness; mend the export")
    ratio = network.stiffness_tangential[stiff] / network.stiffness_normal[stiff]
    if np.median(ratio) > STIFFNESS_RATIO:
        raise InputError(
            f"{name}: tangential over normal stiffness is {np.median(ratio):.3g} in the median "
            "contact (elastic bodies: 2/3 to 1); give both in N/m"
        )


def refuse(wrong: Bools, name: str, kind: str, fault: str, first: int = 0) -> None:
    """InputError about the first of the particles or contacts that are `wrong` (m,) bool.

    `first` is the number of the first of them.
    """
    if wrong.any():
        number = first + int(np.argmax(wrong))
        raise InputError(f"{name}: {kind} {number} {fault}; mend the export")
