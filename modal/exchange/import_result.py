"""The contact network of a packing that another program tells.

Overlaps come from the positions, or from the forces where these have more to tell; stiffnesses
follow from the law. Where a law makes them of overlaps, positions must tell these, and how well
they do is noted in the network (`modal.packing.precision`); where a table tells the stiffnesses,
positions only turn the normals. What was found is told in `ImportResult`.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modal.exchange.law import ProgramLaw
from modal.exchange.particles_and_contacts import Contacts, LawOf, Packing
from modal.exchange.text import fault
from modal.formats.hdf5 import named
from modal.packing.checks import MAX_GAP_IN_SUMS_OF_RADII
from modal.packing.neighbours import ContactList
from modal.packing.network import Network
from modal.packing.precision import MAX_OVERLAP_ERROR, NOTED_OVERLAP_ERROR, OVERLAP_ERROR
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.arrays import Bools, Floats, Ints

BLURRED = 1e-6
"""Error of an overlap by the digits of positions, over the median overlap, from which overlaps are
taken from the forces where these are told."""
CERTAIN = 4.0
"""Errors of an overlap: contacts that are deeper, or gaps that are wider, are there or not."""
BLUNT = 5e-3
"""Angle, rad, by which digits of positions turn the normals of a table, that is refused."""
EXACT = 0.1
"""Of the error by digits: if no overlap is larger, positions are those that few digits hold."""
TYPES = 2**32
"""More than there are types."""
UNLIKE = 10.0
"""Factor between told forces and those of the law, in the mean contact: other units."""


@dataclass
class ImportResult:
    """What an import made: the network, the law (m,) of each contact, and what is told of both.

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
    listed = contacts or packing.touching()
    found = packing.between(listed.i, listed.j)
    kept = _kept(listed, packing, found.overlap)
    touch, found = listed.some(kept), ContactList(*(x[kept] for x in vars(found).values()))
    overlap, normal = found.overlap, found.normal
    reach, effective = packing.reach(touch.i, touch.j)
    error = float(packing.distance_error(found.cell_shift).max())
    how, force = "positions", touch.force
    overlap_error = 0.0
    columns: dict[str, Any] = dict(touch.columns)
    kinds, which = list[ProgramLaw](), np.zeros(len(overlap), int)
    sliding = None
    if law_of is None:
        if abs(overlap).max() >= EXACT * error:
            what = "median distance of spheres that touch"
            _refuse_few_digits(packing, error, BLUNT, reach - overlap, what, "")
    else:
        kinds, which = _kinds(touch, packing, law_of)
        law = ProgramLaw.of_contacts(kinds, which)
        by_law = law.force(overlap, effective)
        if force is None:
            do = ", or give the contacts with their forces"
            _refuse_few_digits(packing, error, MAX_OVERLAP_ERROR, overlap, "median overlap", do)
            overlap_error = _noted_error(packing, error, law, overlap)
            force = by_law
        else:
            force = np.where(np.isnan(force), by_law, force)
            pushed = law.overlap(force, effective)
            _refuse_other_units(pushed, overlap, packing.name)
            if error > BLURRED * np.median(pushed):
                how, overlap = "forces", np.where(force > 0, pushed, overlap)
                if touch.line is not None:
                    _turn_to_lines(normal, touch.line)
        columns |= law.columns(overlap, effective)
        sliding = None if touch.shear is None else law.slides(force, touch.shear)
    told = {
        "overlap_over_error_of_digits": float(np.median(overlap) / max(error, 1e-300)),
        "overlaps_from": how,
    }
    study: dict[str, Any] = {}
    if overlap_error:
        study[OVERLAP_ERROR] = overlap_error
        told["error_of_overlaps"] = overlap_error
    radius_i, radius_j = packing.radius[touch.i], packing.radius[np.maximum(touch.j, 0)]
    frictions = {law.friction for law in kinds}
    if len(frictions) == 1:
        study["mu_wave"] = float(frictions.pop())
    with named(packing.name):
        network = Network(
            position=packing.position,
            radius=packing.radius,
            mass=packing.mass,
            inertia=0.4 * packing.mass * packing.radius**2,
            # To the middle of the overlap.
            lever_i=(radius_i - overlap / 2)[:, None] * normal,
            lever_j=np.where(touch.j < 0, 0.0, overlap / 2 - radius_j)[:, None] * normal,
            force_normal=force,
            force_tangential=touch.shear,
            sliding=sliding,
            cell_size=packing.cell.high - packing.cell.low,
            cell_periodic=packing.cell.periodic,
            wall_position=np.array(packing.cell.planes),
            study=study,
            **vars(replace(found, overlap=overlap)),
            **columns,
        )
        if (packing.body > 0).any():
            network = joined(network, packing.body, bodies)
    return ImportResult(network, kinds, which, told, sought=contacts is None)


def _kinds(contacts: Contacts, packing: Packing, law_of: LawOf) -> tuple[list[ProgramLaw], Ints]:
    """The different laws, and which of them each contact has."""
    one, other = packing.kind[contacts.i], contacts.j
    other = np.where(other < 0, other, packing.kind[np.maximum(other, 0)])
    # Pairs as single numbers: sorted thus, they take a tenth of the time.
    pairs = np.minimum(one, other) * TYPES + np.maximum(one, other)
    found, which = np.unique(pairs, return_inverse=True)
    return [law_of(*divmod(pair, TYPES)) for pair in found.tolist()], which


def _kept(listed: Contacts, packing: Packing, overlap: Floats) -> Bools:
    """Shape (m,): contacts of spheres that touch, and not inside a body.

    What a table lists with a stiffness is a contact. InputError, with its line, for two in one
    place, and for a contact of bodies that lie apart.
    """
    reach, _ = packing.reach(listed.i, listed.j)
    body = packing.body[[listed.i, np.maximum(listed.j, 0)]]
    kept: Bools = (listed.j < 0) | (body[0] < 1) | (body[0] != body[1])

    def ends(row: int) -> str:
        one, other = (packing.number[end] for end in (listed.i[row], max(listed.j[row], 0)))
        return f"spheres {one} and {other}" if listed.j[row] >= 0 else f"sphere {one} and the wall"

    do = "mend the positions, or the numbers of the two"
    where = kept & (overlap == reach)
    listed.refuse(where, lambda row: f"{ends(row)} lie in one place", do, packing.name)
    if not listed.columns:
        kept &= overlap > 0 if listed.force is None else listed.force != 0
    do = "write both at one step, in one unit of length, with the cell's periods and walls"
    listed.refuse(
        kept & (overlap < -MAX_GAP_IN_SUMS_OF_RADII * reach),
        lambda row: f"{ends(row)} do not touch, there are {-overlap[row]:.3g} m between them",
        do,
        packing.name,
    )
    if not kept.any():
        fault(packing.name, "no two spheres touch", "dump a packing under stress")
    return kept


def _noted_error(packing: Packing, error: float, law: ProgramLaw, overlap: Floats) -> float:
    """Return the error of overlaps over their median, or 0 where it moves nothing.

    That is, where it is small, or where stiffnesses do not depend on overlaps and no two spheres
    lie so near to touching that the digits decide whether they do.
    """
    relative = error / float(np.median(overlap))
    if relative < NOTED_OVERLAP_ERROR:
        return 0.0
    if np.any(law.hertz) or np.any(law.grows):
        return relative
    nearer = replace(packing, radius=packing.radius + CERTAIN * error / 2).touching()
    in_doubt = len(nearer.i) - int((overlap > CERTAIN * error).sum())
    return relative if in_doubt else 0.0


def _refuse_few_digits(
    packing: Packing, error: float, share: float, size: Floats, what: str, do: str
) -> None:
    """Raise InputError where the `error` of distances, m, exceeds a share of the median `size`."""
    median = float(np.median(size))
    if error <= share * median:
        return
    step = packing.step
    whose = f"positions have {packing.digits} digits"
    if step / np.sqrt(6) <= share * median:
        step = error * np.sqrt(6)
        whose = "bounds of the cell, through which spheres touch, are rounded"
    largest = float(abs(packing.position).max())
    needed = int(np.ceil(np.log10(largest * error / (step * share * median)))) + 1
    what = f"{whose}, steps of {step:.0e} m, where the {what} is {median:.1e} m"
    fault(packing.name, what, f"write {needed} digits or more (17 are all){do}", code="few_digits")


def _refuse_other_units(pushed: Floats, overlap: Floats, name: str) -> None:
    """InputError where forces and positions tell overlaps that lie far from each other."""
    if not 1 / UNLIKE < float(pushed.mean() / max(overlap.mean(), 1e-300)) < UNLIKE:
        what = f"told, positions and radii {overlap.mean():.3g} m"
        what = f"the law makes overlaps of {pushed.mean():.3g} m of the forces that are {what}"
        do = "give stiffnesses, forces and lengths in one system of units (import --scales)"
        fault(name, what, do)


def _turn_to_lines(normal: Floats, line: Floats) -> None:
    """Turn normals to the lines that are told: six digits of a force against six of a position."""
    size = np.linalg.norm(line, axis=1)
    told = size > 0
    way = np.sign((line * normal).sum(axis=1))[told] / size[told]
    normal[told] = way[:, None] * line[told]
