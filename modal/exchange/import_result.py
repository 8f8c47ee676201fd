"""The contact network of a packing that another program tells.

Overlaps come from the positions, or from the forces where these have more to tell; stiffnesses
follow from the law. What was found and assumed is told in `ImportResult`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modal.exchange.law import ProgramLaw
from modal.exchange.particles_and_contacts import Contacts, LawOf, Packing
from modal.exchange.precision_checks import (
    digits_of_table,
    refuse_drowned,
    refuse_impossible,
    unlisted,
)
from modal.formats.hdf5 import named
from modal.packing.checks import WIDEST
from modal.packing.network import Network
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError

BLURRED = 1e-6
"""Error of an overlap by the digits of positions, over the median overlap, from which overlaps are
taken from the forces where these are told."""
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
    packing: Packing, contacts: Contacts | None, law_of: LawOf | None, bodies: Bodies | None = None
) -> ImportResult:
    """The contact network of a packing; InputError where the digits do not tell the overlaps.

    Without `contacts` these are sought; no law is needed where stiffnesses are told. `bodies` are
    what is told of the rigid ones, if there are any and their members do not tell it.
    """
    remarks: list[str] = []
    listed = contacts or packing.touching()
    branch, shift = packing.branches(listed.i, listed.j)
    distance = np.linalg.norm(branch, axis=1)
    kept = _kept(listed, packing, distance, remarks)
    touch, branch, shift, distance = listed.some(kept), branch[kept], shift[kept], distance[kept]
    reach, effective = packing.reach(touch.i, touch.j)
    overlap = reach - distance
    error = packing.step / np.sqrt(6)  # root mean square of a distance whose ends are rounded
    how, force, columns = "positions", touch.force, dict[str, Any]()
    stiffness, turning, kinds = touch.stiffness, touch.turning, list[ProgramLaw]()
    which = np.zeros(len(overlap), int)
    if law_of is None:
        remarks += digits_of_table(packing, error, overlap, distance)
    else:
        kinds, which = _kinds(touch, packing, law_of)
        law = ProgramLaw.of_contacts(kinds, which)
        if contacts is not None:
            remarks += unlisted(listed, packing)
        by_law = law.force(overlap, effective)
        if force is None:
            refuse_drowned(packing, error, overlap)
            force = by_law
        else:
            force = np.where(np.isnan(force), by_law, force)
            pushed = law.overlap(force, effective)
            _refuse_other_units(pushed, overlap, packing.name)
            if error > BLURRED * np.median(pushed):
                how, overlap = "forces", np.where(force > 0, pushed, overlap)
                _turn_to_lines(branch, touch.line)
            else:
                _compare_forces(touch, force, by_law, remarks)
        stiffness = law.stiffnesses(overlap, effective)
        if law.resists_turning:
            turning = law.turning_stiffnesses(overlap, effective)
            remarks.append("rolling and twisting: contacts stick, their limits are not looked at")
        columns |= law.beyond_springs(overlap)
        if touch.shear is not None:
            columns["sliding"] = law.slides(force, touch.shear)
    for names, both in ((("normal", "tangential"), stiffness), (("rolling", "twisting"), turning)):
        if both is not None:
            rows = np.ascontiguousarray(both.T)
            columns |= {f"stiffness_{name}": row for name, row in zip(names, rows, strict=True)}
    frictions = {law.friction for law in kinds}
    told = {
        "overlap_over_error_of_digits": float(np.median(overlap) / max(error, 1e-300)),
        "overlaps_from": how,
    }
    normal = branch / np.linalg.norm(branch, axis=1)[:, None]
    radius_i, radius_j = packing.radius[touch.i], packing.radius[np.maximum(touch.j, 0)]
    with named(packing.name):
        network = Network(
            position=packing.position,
            radius=packing.radius,
            mass=packing.mass,
            inertia=0.4 * packing.mass * packing.radius**2,
            particle_i=touch.i,
            particle_j=touch.j,
            normal=normal,
            # To the middle of the overlap.
            lever_i=(radius_i - overlap / 2)[:, None] * normal,
            lever_j=np.where(touch.j < 0, 0.0, overlap / 2 - radius_j)[:, None] * normal,
            force_normal=force,
            force_tangential=touch.shear,
            overlap=overlap,
            cell_shift=shift,
            cell_size=packing.cell.high - packing.cell.low,
            cell_periodic=packing.cell.periodic,
            wall_position=np.array(packing.cell.planes),
            study={"mu_wave": float(frictions.pop())} if len(frictions) == 1 else {},
            **columns,
        )
        if packing.body is not None:
            network = joined(network, packing.body, bodies)
            told["spheres_of_bodies"] = len(packing.body)
    return ImportResult(network, kinds, which, told, remarks, bool(kinds))


def _kinds(contacts: Contacts, packing: Packing, law_of: LawOf) -> tuple[list[ProgramLaw], Ints]:
    """The different laws, and which of them each contact has."""
    kind, j = packing.kind, contacts.j
    ends = np.sort(np.column_stack([kind[contacts.i], np.where(j < 0, j, kind[j])]), axis=1)
    pairs, which = np.unique(ends, axis=0, return_inverse=True)
    return [law_of(int(a), int(b)) for a, b in pairs], which.reshape(-1)


def _kept(listed: Contacts, packing: Packing, distance: Floats, remarks: list[str]) -> Bools:
    """Shape (m,): contacts of spheres that touch, and not inside a body; InputError for others.

    What a table lists with a stiffness is a contact.
    """
    reach, _ = packing.reach(listed.i, listed.j)
    overlap = reach - distance
    kept = np.ones(len(overlap), bool)
    if listed.stiffness is None:
        kept = overlap > 0 if listed.force is None else listed.force != 0
    own = packing.inside_body(listed.i, listed.j)
    refuse_impossible(listed, packing, kept & (overlap < -WIDEST * reach), distance, -overlap)
    for left, why in ((~kept & ~own, "do not touch"), (own, "are inside rigid bodies")):
        if listed.listed is not None and left.any():
            remarks.append(f"{int(left.sum())} of {len(left)} listed contacts {why}: left out")
    kept = kept & ~own
    if not kept.any():
        raise InputError(f"{packing.name}: no two spheres touch; dump a packing under stress")
    return kept


def _refuse_other_units(pushed: Floats, overlap: Floats, name: str) -> None:
    """InputError where forces and positions tell overlaps that lie far from each other."""
    if not 1 / UNLIKE < float(pushed.mean() / max(overlap.mean(), 1e-300)) < UNLIKE:
        raise InputError(
            f"{name}: the law makes overlaps of {pushed.mean():.3g} m of the forces that are "
            f"told, positions and radii {overlap.mean():.3g} m; give stiffnesses, forces and "
            "lengths in one system of units (--scales)"
        )


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
