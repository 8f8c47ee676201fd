"""The contact network of a packing that another program tells.

Overlaps come from the positions, or from the forces where these have more to tell; stiffnesses
follow from the law. What was found and assumed is told in `ImportResult`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modal.exchange.law import DISPLACEMENT, MIDDLE, ONE_SIDED, ProgramLaw
from modal.exchange.particles_and_contacts import (
    Cell,
    Contacts,
    LawOf,
    Spheres,
    branches,
    check_spheres,
    touching_pairs,
)
from modal.exchange.precision_checks import (
    digits_of_table,
    refuse_apart,
    refuse_drowned,
    refuse_one_place,
    unlisted,
)
from modal.packing.checks import WIDEST, named
from modal.packing.network import Network
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

BLURRED = 1e-6
"""The same from which overlaps are taken from the forces where these are told."""
AT_LIMIT = 1e-6
"""Relative: a shear force so near to friction times normal force slides."""
LIKE = 1e-3
"""Relative difference of forces and the law's from which it is remarked on."""
UNLIKE = 10.0
"""Factor between told forces and those of the law, in the median contact: other units."""


@dataclass
class ImportResult:
    """What an import made: the network, the law (m,) of each contact, and lines about both.

    `sought` says that contacts were sought among the positions, so that none is missing.
    """

    network: Network
    laws: list[ProgramLaw] = field(default_factory=list)
    law: Ints = field(default_factory=lambda: np.empty(0, int))
    told: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    sought: bool = False


@dataclass
class _Pairs:
    """Columns of m contacts, all cut alike, of what is told or follows."""

    i: Ints
    j: Ints
    branch: Floats
    shift: Ints
    law: Ints
    reach: Floats
    effective: Floats
    force: Floats | None
    shear: Floats | None
    line: Floats | None
    along: Floats | None = None
    across: Floats | None = None
    rolling: Floats | None = None
    twisting: Floats | None = None

    def cut(self, kept: Bools) -> _Pairs:
        cut: dict[str, Any] = {
            name: None if data is None else data[kept] for name, data in vars(self).items()
        }
        return _Pairs(**cut)


def network_of(
    spheres: Spheres,
    cell: Cell,
    contacts: Contacts | None,
    law_of: LawOf | None,
    name: str,
    bodies: Bodies | None = None,
) -> ImportResult:
    """The contact network of a packing; InputError where the digits do not tell the overlaps.

    `name` is the file of the spheres, for messages; no law is needed where stiffnesses are told.
    `bodies` are what is told of the rigid ones, if there are any and their members do not tell it.
    """
    check_spheres(spheres, cell, name)
    size = cell.high - cell.low
    inside = cell.low + (spheres.position - cell.low) % np.where(size > 0, size, 1.0)
    outside = (spheres.position < cell.low) | (spheres.position > cell.high)
    position = np.where(cell.periodic & outside, inside, spheres.position)
    ends = zip(cell.walls, (cell.low[2], cell.high[2]), strict=True)
    walls = np.array([bound if np.isnan(wall) else wall for wall, bound in ends])
    told: dict[str, Any] = {}
    remarks: list[str] = []

    given = contacts or touching_pairs(spheres, cell)
    pairs, laws = _pairs(spheres, cell, walls, position, given, law_of)
    distance = np.linalg.norm(pairs.branch, axis=1)
    refuse_one_place(given, spheres, distance, name)
    overlap = pairs.reach - distance
    if given.stiffness is not None:
        kept = np.ones(len(overlap), bool)  # what a table lists with a stiffness is a contact
    else:
        kept = overlap > 0 if pairs.force is None else pairs.force != 0
    own = spheres.inside(given.i, given.j)
    refuse_apart(given, spheres, kept & (overlap < -WIDEST * pairs.reach), -overlap, name)
    for left, why in ((~kept & ~own, "do not touch"), (own, "are inside rigid bodies")):
        if contacts is not None and left.any():
            remarks.append(f"{int(left.sum())} of {len(left)} listed contacts {why}: left out")
    kept &= ~own
    if not kept.any():
        raise InputError(f"{name}: no two spheres touch; dump a packing under stress")
    pairs, overlap, effective = pairs.cut(kept), overlap[kept], pairs.effective[kept]

    error = spheres.step / np.sqrt(6)  # root mean square of a distance whose ends are rounded
    if contacts is not None and laws:
        remarks += unlisted(given, spheres, cell)
    how = "positions"
    if not laws:
        remarks += digits_of_table(spheres, error, overlap, distance, name)
    elif pairs.force is None:
        refuse_drowned(spheres, error, overlap, name)
        (pairs.force,) = _by_law(ProgramLaw.force, laws, pairs.law, overlap, effective)
    else:
        (by_law,) = _by_law(ProgramLaw.force, laws, pairs.law, overlap, effective)
        pairs.force = np.where(np.isnan(pairs.force), by_law, pairs.force)
        (pushed,) = _by_law(ProgramLaw.overlap, laws, pairs.law, pairs.force, effective)
        factor = float(pushed.mean() / max(overlap.mean(), 1e-300))
        if not 1 / UNLIKE < factor < UNLIKE:
            raise InputError(
                f"{name}: the law makes overlaps of {pushed.mean():.3g} m of the forces that are "
                f"told, positions and radii {overlap.mean():.3g} m; give stiffnesses, forces and "
                "lengths in one system of units (--scales)"
            )
        if error > BLURRED * np.median(pushed):
            how, overlap = "forces", np.where(pairs.force > 0, pushed, overlap)
            _turn_to_lines(pairs)
        else:
            _compare_forces(pairs, by_law, remarks)
    told["overlap_over_error_of_digits"] = float(np.median(overlap) / max(error, 1e-300))
    told["overlaps_from"] = how
    if laws:
        of = laws, pairs.law, overlap, effective
        pairs.along, pairs.across = _by_law(ProgramLaw.stiffnesses, *of)
        if any(law.resists_turning for law in laws):
            pairs.rolling, pairs.twisting = _by_law(ProgramLaw.turning_stiffnesses, *of)
            remarks.append("rolling and twisting: contacts stick, their limits are not looked at")
    with named(name):
        network = _whole(spheres, cell, walls, position, pairs, overlap, laws)
        if spheres.body is not None:
            network = joined(network, spheres.body, bodies)
            told["spheres_of_bodies"] = len(spheres.body)
    return ImportResult(network, laws, pairs.law, told, remarks, sought=bool(laws))


def _pairs(
    spheres: Spheres,
    cell: Cell,
    walls: Floats,
    position: Floats,
    given: Contacts,
    law_of: LawOf | None,
) -> tuple[_Pairs, list[ProgramLaw]]:
    """The contacts as columns, and the different laws among them."""
    wall, partner = given.j < 0, np.where(given.j < 0, 0, given.j)
    branch, shift = branches(position, cell, walls.tolist(), given.i, given.j)
    laws, law = list[ProgramLaw](), np.zeros(len(given.i), int)
    if law_of is not None and given.stiffness is None:
        kinds = spheres.kind[given.i], np.where(wall, given.j, spheres.kind[partner])
        laws, law = _laws(*kinds, law_of)
    a, b = spheres.radius[given.i], spheres.radius[partner]
    # Sum of radii and effective radius; at a wall both are the sphere's own.
    reach, effective = np.where(wall, a, a + b), np.where(wall, a, a * b / (a + b))
    pairs = _Pairs(
        given.i, given.j, branch, shift, law, reach, effective,
        given.force, given.shear, given.line,
        *(given.stiffness or (None, None)), *(given.turning or (None, None)),
    )  # fmt: skip
    return pairs, laws


def _turn_to_lines(pairs: _Pairs) -> None:
    """Turn branches to the lines that are told: six digits of a force against six of a position."""
    if pairs.line is None:
        return
    size = np.linalg.norm(pairs.line, axis=1)
    told = size > 0
    way = np.sign((pairs.line * pairs.branch).sum(axis=1))[told] / size[told]
    length = np.linalg.norm(pairs.branch, axis=1)[told]
    pairs.branch[told] = (way * length)[:, None] * pairs.line[told]


def _compare_forces(pairs: _Pairs, by_law: Floats, remarks: list[str]) -> None:
    """Remark on told forces that are not the law's, apart for spheres and for walls."""
    assert pairs.force is not None
    ratio = pairs.force / np.where(by_law > 0, by_law, np.inf)
    for where, chosen in (("between spheres", pairs.j >= 0), ("at walls", pairs.j < 0)):
        if chosen.any() and np.percentile(abs(ratio[chosen] - 1), 95) > LIKE:
            remarks.append(
                f"forces {where} are {np.median(ratio[chosen]):.5g} of the law's in the median "
                "contact: damping of a packing that moves, or another law?"
            )


def _laws(first: Ints, second: Ints, law_of: LawOf) -> tuple[list[ProgramLaw], Ints]:
    """The different laws among contacts of these kinds, and which of them each follows (m,)."""
    low, high = np.minimum(first, second), np.maximum(first, second)
    kinds, law = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
    return [law_of(int(a), int(b)) for a, b in kinds], law.reshape(-1)


def _by_law(
    what: Callable[[ProgramLaw, Floats, Floats], Floats | tuple[Floats, Floats]],
    laws: list[ProgramLaw],
    law: Ints,
    values: Floats,
    effective: Floats,
) -> Floats:
    """Shape (1, m) or (2, m): what each contact's own law makes of its value."""
    parts = [
        np.atleast_2d(what(one, values[law == number], effective[law == number]))
        for number, one in enumerate(laws)
    ]
    result = np.empty((len(parts[0]), len(values)))
    for number, part in enumerate(parts):
        result[:, law == number] = part
    return result


def _whole(
    spheres: Spheres,
    cell: Cell,
    walls: Floats,
    position: Floats,
    pairs: _Pairs,
    overlap: Floats,
    laws: list[ProgramLaw],
) -> Network:
    """Normals, levers to the middle of the overlap, and what slides."""
    wall = pairs.j < 0
    normal = pairs.branch / np.linalg.norm(pairs.branch, axis=1)[:, None]
    radius_i, radius_j = spheres.radius[pairs.i], spheres.radius[np.where(wall, 0, pairs.j)]
    sliding = None
    frictions = np.array([law.friction for law in laws])
    if pairs.shear is not None and laws and pairs.force is not None:
        limit = frictions[pairs.law] * pairs.force
        # Without friction there is no spring that could slip.
        sliding = (np.linalg.norm(pairs.shear, axis=1) >= limit * (1 - AT_LIMIT)) & (limit > 0)
    assert pairs.along is not None and pairs.across is not None
    return Network(
        position=position,
        radius=spheres.radius,
        mass=spheres.mass,
        inertia=0.4 * spheres.mass * spheres.radius**2,
        particle_i=pairs.i,
        particle_j=pairs.j,
        normal=normal,
        lever_i=(radius_i - overlap / 2)[:, None] * normal,
        lever_j=np.where(wall, 0.0, overlap / 2 - radius_j)[:, None] * normal,
        stiffness_normal=pairs.along,
        stiffness_tangential=pairs.across,
        stiffness_rolling=pairs.rolling,
        stiffness_twisting=pairs.twisting,
        force_normal=pairs.force,
        force_tangential=pairs.shear,
        overlap=overlap,
        sliding=sliding,
        cell_shift=pairs.shift,
        cell_size=cell.high - cell.low,
        cell_periodic=cell.periodic,
        wall_position=walls,
        **_of_laws(laws, pairs.law, overlap),
        study={"mu_wave": float(frictions[0])} if laws and np.ptp(frictions) == 0 else {},
    )


def _of_laws(laws: list[ProgramLaw], law: Ints, overlap: Floats) -> dict[str, Any]:
    """What the laws do otherwise than springs, as a network tells it of each contact (m,)."""
    if not laws:
        return {}
    grows = np.array([each.grows and each.keeps in (DISPLACEMENT, ONE_SIDED) for each in laws])
    shortening = {
        f"{what}_shortening": np.array([0.5 * (getattr(each, arm) == MIDDLE) for each in laws])[law]
        for what, arm in (("motion", "moves"), ("torque", "turns"))
    }
    return {"shear_growth": np.where(grows[law], 0.5 / overlap, 0.0), **shortening}
