"""The contact network of a packing that another program tells.

Overlaps come from the positions, or from the forces where these have more to tell; stiffnesses
follow from the law. What was found and assumed is told in `ImportResult`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modal.exchange.law import ProgramLaw
from modal.exchange.laws import Laws
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
TURNING = ("stiffness_rolling", "stiffness_twisting")
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

    listed = contacts or touching_pairs(spheres, cell)
    branch, shift = branches(position, cell, walls.tolist(), listed.i, listed.j)
    distance = np.linalg.norm(branch, axis=1)
    refuse_one_place(listed, spheres, distance, name)
    kept = _kept(listed, spheres, distance, name, remarks)
    touch, branch, shift = listed.some(kept), branch[kept], shift[kept]
    reach, effective = _radii(spheres, touch)
    overlap = reach - distance[kept]
    laws = Laws.of(touch, spheres, law_of if touch.stiffness is None else None)

    error = spheres.step / np.sqrt(6)  # root mean square of a distance whose ends are rounded
    if contacts is not None and laws.kinds:
        remarks += unlisted(listed, spheres, cell)
    how, force = "positions", touch.force
    if not laws.kinds:
        remarks += digits_of_table(spheres, error, overlap, distance[kept], name)
    elif force is None:
        refuse_drowned(spheres, error, overlap, name)
        (force,) = laws.each(ProgramLaw.force, overlap, effective)
    else:
        (by_law,) = laws.each(ProgramLaw.force, overlap, effective)
        force = np.where(np.isnan(force), by_law, force)
        (pushed,) = laws.each(ProgramLaw.overlap, force, effective)
        factor = float(pushed.mean() / max(overlap.mean(), 1e-300))
        if not 1 / UNLIKE < factor < UNLIKE:
            raise InputError(
                f"{name}: the law makes overlaps of {pushed.mean():.3g} m of the forces that are "
                f"told, positions and radii {overlap.mean():.3g} m; give stiffnesses, forces and "
                "lengths in one system of units (--scales)"
            )
        if error > BLURRED * np.median(pushed):
            how, overlap = "forces", np.where(force > 0, pushed, overlap)
            _turn_to_lines(branch, touch.line)
        else:
            _compare_forces(touch, force, by_law, remarks)
    told["overlap_over_error_of_digits"] = float(np.median(overlap) / max(error, 1e-300))
    told["overlaps_from"] = how
    stiffness, turning = touch.stiffness, touch.turning
    if laws.kinds:
        stiffness = laws.each(ProgramLaw.stiffnesses, overlap, effective)
        if any(law.resists_turning for law in laws.kinds):
            turning = laws.each(ProgramLaw.turning_stiffnesses, overlap, effective)
            remarks.append("rolling and twisting: contacts stick, their limits are not looked at")
    assert stiffness is not None
    columns: dict[str, Any] = {} if turning is None else dict(zip(TURNING, turning, strict=True))
    columns |= {"force_normal": force, "force_tangential": touch.shear, "overlap": overlap}
    columns |= laws.columns(overlap) | {"sliding": laws.sliding(force, touch.shear)}
    wall = touch.j < 0
    radius_i, radius_j = spheres.radius[touch.i], spheres.radius[np.maximum(touch.j, 0)]
    normal = branch / np.linalg.norm(branch, axis=1)[:, None]
    with named(name):
        network = Network(
            position=position,
            radius=spheres.radius,
            mass=spheres.mass,
            inertia=0.4 * spheres.mass * spheres.radius**2,
            particle_i=touch.i,
            particle_j=touch.j,
            normal=normal,
            # To the middle of the overlap.
            lever_i=(radius_i - overlap / 2)[:, None] * normal,
            lever_j=np.where(wall, 0.0, overlap / 2 - radius_j)[:, None] * normal,
            stiffness_normal=stiffness[0],
            stiffness_tangential=stiffness[1],
            cell_shift=shift,
            cell_size=size,
            cell_periodic=cell.periodic,
            wall_position=walls,
            study=laws.notes(),
            **columns,
        )
        if spheres.body is not None:
            network = joined(network, spheres.body, bodies)
            told["spheres_of_bodies"] = len(spheres.body)
    return ImportResult(network, laws.kinds, laws.of_each, told, remarks, bool(laws.kinds))


def _radii(spheres: Spheres, contacts: Contacts) -> tuple[Floats, Floats]:
    """Sum of radii and effective radius (m,), m; at a wall both are the sphere's own."""
    a, b = spheres.radius[contacts.i], spheres.radius[np.maximum(contacts.j, 0)]
    wall = contacts.j < 0
    return np.where(wall, a, a + b), np.where(wall, a, a * b / (a + b))


def _kept(
    listed: Contacts, spheres: Spheres, distance: Floats, name: str, remarks: list[str]
) -> Bools:
    """Shape (m,): contacts of spheres that touch, and not inside a body; InputError for others.

    What a table lists with a stiffness is a contact.
    """
    reach, _ = _radii(spheres, listed)
    overlap = reach - distance
    kept = np.ones(len(overlap), bool)
    if listed.stiffness is None:
        kept = overlap > 0 if listed.force is None else listed.force != 0
    own = spheres.inside(listed.i, listed.j)
    refuse_apart(listed, spheres, kept & (overlap < -WIDEST * reach), -overlap, name)
    for left, why in ((~kept & ~own, "do not touch"), (own, "are inside rigid bodies")):
        if listed.listed is not None and left.any():
            remarks.append(f"{int(left.sum())} of {len(left)} listed contacts {why}: left out")
    kept = kept & ~own
    if not kept.any():
        raise InputError(f"{name}: no two spheres touch; dump a packing under stress")
    return kept


def _turn_to_lines(branch: Floats, line: Floats | None) -> None:
    """Turn branches to the lines that are told: six digits of a force against six of a position."""
    if line is None:
        return
    size = np.linalg.norm(line, axis=1)
    told = size > 0
    way = np.sign((line * branch).sum(axis=1))[told] / size[told]
    length = np.linalg.norm(branch, axis=1)[told]
    branch[told] = (way * length)[:, None] * line[told]


def _compare_forces(contacts: Contacts, force: Floats, by_law: Floats, remarks: list[str]) -> None:
    """Remark on told forces that are not the law's, apart for spheres and for walls."""
    ratio = force / np.where(by_law > 0, by_law, np.inf)
    for where, chosen in (("between spheres", contacts.j >= 0), ("at walls", contacts.j < 0)):
        if chosen.any() and np.percentile(abs(ratio[chosen] - 1), 95) > LIKE:
            remarks.append(
                f"forces {where} are {np.median(ratio[chosen]):.5g} of the law's in the median "
                "contact: damping of a packing that moves, or another law?"
            )
