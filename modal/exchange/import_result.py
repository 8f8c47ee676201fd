"""Build the contact network of a packing that another program has written.

Overlaps come from the positions, or from the forces if these determine them better; stiffnesses
follow from the law. Where a law computes stiffnesses from overlaps, the positions must determine
the overlaps, and the error of the overlaps is noted in the network (`modal.packing.precision`). If
a table lists the stiffnesses, positions only determine the normals. `ImportResult` also records
findings and assumptions of the import.
"""

from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np

from modal.exchange.law import ContactLaws, ProgramLaw
from modal.exchange.particles_and_contacts import Contacts, Packing, PairLaw
from modal.exchange.refusals import refuse
from modal.formats.hdf5 import named
from modal.packing.contact_checks import MAX_GAP_IN_SUMS_OF_RADII
from modal.packing.neighbours import ContactList
from modal.packing.network import Network
from modal.packing.precision import MAX_OVERLAP_ERROR, NOTED_OVERLAP_ERROR, OVERLAP_ERROR
from modal.packing.rigid_bodies import Bodies, joined
from modal.tools.arrays import Bools, Floats, Ints

MAX_RELATIVE_POSITION_ERROR = 1e-6
"""Error of an overlap by the digits of positions, divided by the median overlap. Beyond it overlaps
are taken from the forces, if these are known."""
CERTAIN_IN_ERRORS = 4.0
"""Contacts that are deeper than this many errors of an overlap are certainly contacts, and gaps
that are wider are certainly gaps."""
MAX_NORMAL_ERROR_RAD = 5e-3
"""Largest angle by which few digits of positions may turn the normals of a table."""
MIN_OVERLAP_IN_ERRORS = 0.1
"""Share of the error by digits that some overlap must exceed. If none does, the positions are exact
in few digits, as those of spheres that just touch on a lattice."""
TYPE_BASE = 2**32
"""Larger than any type number: packs a pair of types into one integer."""
MAX_OVERLAP_FACTOR = 10.0
"""Largest factor between the mean overlap of the forces and that of the positions. Beyond it the
two are in different units."""
RELATIVE_ROUND_OFF = 1e-14
"""Overlap, divided by the distance of two centres that touch, that is round-off."""
SMALLEST_NUMBER = 1e-300
"""Number that replaces a divisor of zero."""

OverlapSource = Literal["positions", "forces"]
"""The data that overlaps were computed from."""


@dataclass
class ImportResult:
    """The network of an import, with findings and assumptions.

    Attributes
    ----------
    network : Network
        The packing.
    laws : list of ProgramLaw
        The different laws of contacts; empty if the file has stiffnesses.
    law : ndarray (m,)
        Index of each contact's law among `laws`.
    told : dict
        Findings by name: `overlap_over_error_of_digits`, `overlaps_from`, `error_of_overlaps`.
    remarks : list of str
        Assumptions made where the files give no information.
    sought : bool
        Whether contacts were found from the positions, so that none is missing.
    """

    network: Network
    laws: list[ProgramLaw] = field(default_factory=list)
    law: Ints = field(default_factory=lambda: np.empty(0, int))
    told: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    sought: bool = False


class _ContactState(NamedTuple):
    """Overlaps, forces and columns of m contacts that follow from the contact law.

    overlap_error: error of the overlaps divided by their median, 0 if the error does not matter.
    sliding (m,): contacts at their limit of friction, or None if shear forces are unknown.
    """

    overlap: Floats
    overlaps_from: OverlapSource
    force: Floats | None
    columns: dict[str, Any]
    overlap_error: float = 0.0
    sliding: Bools | None = None


def build_network(
    packing: Packing,
    contacts: Contacts | None,
    pair_law: PairLaw | None,
    bodies: Bodies | None = None,
) -> ImportResult:
    """Return the contact network of a packing.

    Parameters
    ----------
    packing : Packing
        The spheres.
    contacts : Contacts or None
        The contacts; None finds them from the positions.
    pair_law : callable or None
        Function that returns the law between two types of sphere; None if the contacts have their
        own stiffnesses.
    bodies : Bodies or None
        Masses and tensors of rigid bodies; None computes them from the members.

    Raises
    ------
    InputError
        If the digits of positions do not determine the overlaps, or if nothing touches.
    """
    all_contacts = contacts or packing.touching()
    geometry = packing.between(all_contacts.i, all_contacts.j)
    selected = _select_contacts(all_contacts, packing, geometry.overlap)
    listed = all_contacts.select(selected)
    geometry = ContactList(*(column[selected] for column in vars(geometry).values()))
    error = float(packing.distance_error(geometry.cell_shift).max())
    laws: ContactLaws | None = None
    if pair_law is None:
        state = _keep_stiffnesses(packing, listed, geometry, error)
    else:
        laws = _assign_laws(listed, packing, pair_law)
        if contacts is None and laws.values("acts_across_gaps").any():
            refuse(
                packing.name,
                "contacts_across_gaps",
                "JKR contacts act across gaps once they have touched",
                "positions do not tell which have",
                "give the contacts with their forces (--contacts)",
            )
        state = _apply_laws(packing, listed, geometry, laws, error)
    figures: dict[str, Any] = {
        "overlap_over_error_of_digits": float(
            np.median(state.overlap) / max(error, SMALLEST_NUMBER)
        ),
        "overlaps_from": state.overlaps_from,
    }
    study: dict[str, Any] = {}
    if state.overlap_error:
        study[OVERLAP_ERROR] = state.overlap_error
        figures["error_of_overlaps"] = state.overlap_error
    frictions = {law.friction for law in laws.laws} if laws else set()
    if len(frictions) == 1:
        study["mu_wave"] = float(frictions.pop())
    network = _assemble_network(packing, listed, geometry, state, study, bodies)
    found_by_positions = contacts is None
    if laws is None:
        return ImportResult(network, told=figures, sought=found_by_positions)
    return ImportResult(network, list(laws.laws), laws.index, figures, sought=found_by_positions)


def _keep_stiffnesses(
    packing: Packing, listed: Contacts, geometry: ContactList, error: float
) -> _ContactState:
    """Return the state of contacts whose stiffnesses are listed in the file.

    Raises InputError if the positions have too few digits for the directions of the normals.
    """
    if abs(geometry.overlap).max() >= MIN_OVERLAP_IN_ERRORS * error:
        reach, _ = packing.reach(listed.i, listed.j)
        distance = reach - geometry.overlap
        name = "median distance of spheres that touch"
        _refuse_few_digits(packing, error, MAX_NORMAL_ERROR_RAD, distance, name)
    columns = dict(listed.columns)
    sliding = columns.pop("sliding", None)
    is_sliding = None if sliding is None else sliding.astype(bool)
    return _ContactState(geometry.overlap, "positions", listed.force, columns, sliding=is_sliding)


def _apply_laws(
    packing: Packing, listed: Contacts, geometry: ContactList, laws: ContactLaws, error: float
) -> _ContactState:
    """Return the overlaps, forces and stiffnesses of contacts by their laws.

    If overlaps follow from forces, the normals of `geometry` are turned to the lines of the
    contacts.
    """
    overlap = geometry.overlap
    overlaps_from: OverlapSource = "positions"
    overlap_error = 0.0
    _, effective_radius = packing.reach(listed.i, listed.j)
    force_of_positions = laws.force(overlap, effective_radius)
    if listed.force is None:
        _refuse_few_digits(
            packing,
            error,
            MAX_OVERLAP_ERROR,
            overlap,
            "median overlap",
            ", or give the contacts with their forces",
        )
        overlap_error = _overlap_error(packing, error, laws, overlap)
        force = force_of_positions
    else:
        force = np.where(np.isnan(listed.force), force_of_positions, listed.force)
        overlap_of_forces = laws.overlap(force, effective_radius)
        _refuse_other_units(overlap_of_forces, overlap, packing.name)
        if error > MAX_RELATIVE_POSITION_ERROR * np.median(abs(overlap_of_forces)):
            overlaps_from = "forces"
            has_overlap = (overlap_of_forces > 0) | laws.values("acts_across_gaps")
            overlap = np.where(has_overlap, overlap_of_forces, overlap)
            if listed.line is not None:
                _turn_to_lines(geometry.normal, listed.line)
    sliding = None
    if listed.shear is not None:
        sliding = laws.are_sliding(force, listed.shear, effective_radius)
    columns: dict[str, Any] = dict(listed.columns) | laws.network_columns(overlap, effective_radius)
    return _ContactState(overlap, overlaps_from, force, columns, overlap_error, sliding)


def _assemble_network(
    packing: Packing,
    listed: Contacts,
    geometry: ContactList,
    state: _ContactState,
    study: dict[str, Any],
    bodies: Bodies | None,
) -> Network:
    """Return the network, with the members of rigid bodies joined."""
    radius_i = packing.radius[listed.i]
    radius_j = packing.radius[np.maximum(listed.j, 0)]
    normal = geometry.normal
    with named(packing.name):
        network = Network(
            position=packing.position,
            radius=packing.radius,
            mass=packing.mass,
            inertia=0.4 * packing.mass * packing.radius**2,
            # Levers reach to the middle of the overlap.
            lever_i=(radius_i - state.overlap / 2)[:, None] * normal,
            lever_j=np.where(listed.j < 0, 0.0, state.overlap / 2 - radius_j)[:, None] * normal,
            force_normal=state.force,
            force_tangential=listed.shear,
            sliding=state.sliding,
            cell_size=packing.cell.high - packing.cell.low,
            cell_periodic=packing.cell.periodic,
            cell_vectors=packing.cell.edges if packing.cell.tilt.any() else None,
            wall_position=np.array(packing.cell.planes),
            study=study,
            fixed=packing.fixed,
            **vars(replace(geometry, overlap=state.overlap)),
            **state.columns,
        )
        if (packing.body > 0).any():
            network = joined(network, packing.body, bodies)
    return network


def _assign_laws(contacts: Contacts, packing: Packing, pair_law: PairLaw) -> ContactLaws:
    """Return the law of each contact."""
    kind_i = packing.kind[contacts.i]
    kind_j = np.where(contacts.j < 0, contacts.j, packing.kind[np.maximum(contacts.j, 0)])
    # Pairs as single numbers: sorted thus, they take a tenth of the time.
    pairs = np.minimum(kind_i, kind_j) * TYPE_BASE + np.maximum(kind_i, kind_j)
    different_pairs, index = np.unique(pairs, return_inverse=True)
    laws = [pair_law(*divmod(pair, TYPE_BASE)) for pair in different_pairs.tolist()]
    return ContactLaws(laws, index)


def _select_contacts(listed: Contacts, packing: Packing, overlap: Floats) -> Bools:
    """Return which (m,) of the listed pairs are contacts.

    Pairs in one rigid body are not contacts, nor are held spheres that overlap, nor spheres that do
    not touch, unless a table lists the pair. Raises InputError, with the line of the file, for two
    spheres at the same place, and for a listed contact of spheres that do not touch.
    """
    reach, _ = packing.reach(listed.i, listed.j)
    body_i = packing.body[listed.i]
    body_j = packing.body[np.maximum(listed.j, 0)]
    selected: Bools = (listed.j < 0) | (body_i < 1) | (body_i != body_j)
    if packing.fixed is not None and listed.force is None and not listed.columns:
        # Held spheres do not act on each other, however deep a program lets them overlap.
        held = np.asarray(packing.fixed.all(axis=1))
        selected &= (listed.j < 0) | ~held[listed.i] | ~held[np.maximum(listed.j, 0)]
    listed.refuse(
        selected & (overlap == reach),
        "same_place",
        lambda row: f"{_name_ends(listed, packing, row)} lie in one place",
        "mend the positions, or the numbers of the two",
        packing.name,
    )
    if not listed.columns:
        # Spheres that were placed so as to just touch overlap by round-off.
        round_off = RELATIVE_ROUND_OFF * reach
        selected &= overlap > round_off if listed.force is None else listed.force != 0
    listed.refuse(
        selected & (overlap < -MAX_GAP_IN_SUMS_OF_RADII * reach),
        "apart",
        lambda row: (
            f"{_name_ends(listed, packing, row)} do not touch, there are {-overlap[row]:.3g} m "
            "between them"
        ),
        "write both at one step, in one unit of length, with the cell's periods and walls",
        packing.name,
    )
    if not selected.any():
        remedy = "dump a packing under stress"
        refuse(packing.name, "no_contacts", "no two spheres touch", remedy=remedy)
    return selected


def _name_ends(contacts: Contacts, packing: Packing, row: int) -> str:
    """Return the names of a contact's two ends, with the numbers that the program gave them."""
    first = packing.number[contacts.i[row]]
    if contacts.j[row] < 0:
        return f"sphere {first} and the wall"
    return f"spheres {first} and {packing.number[contacts.j[row]]}"


def _overlap_error(packing: Packing, error: float, laws: ContactLaws, overlap: Floats) -> float:
    """Return the error of overlaps divided by their median, or 0 if the error does not matter.

    The error does not matter if it is small, or if stiffnesses do not depend on overlaps and no two
    spheres lie so near to touching that the digits decide whether they do.
    """
    relative = error / float(np.median(overlap))
    if relative < NOTED_OVERLAP_ERROR:
        return 0.0
    if laws.values("hertz").any() or laws.values("grows").any():
        return relative
    enlarged = replace(packing, radius=packing.radius + CERTAIN_IN_ERRORS * error / 2)
    possible_contacts = len(enlarged.touching().i)
    certain_contacts = int((overlap > CERTAIN_IN_ERRORS * error).sum())
    if possible_contacts == certain_contacts:
        return 0.0
    return relative


def _refuse_few_digits(
    packing: Packing, error: float, share: float, size: Floats, name: str, other_remedy: str = ""
) -> None:
    """Raise InputError if the `error` of distances, m, exceeds `share` times the median `size`, m.

    `name` describes `size` in the message; `other_remedy` is added to the remedy.
    """
    median = float(np.median(size))
    if error <= share * median:
        return
    step = packing.step
    cause = f"positions have {packing.digits} digits"
    if step / np.sqrt(6) <= share * median:
        step = error * np.sqrt(6)
        cause = "bounds of the cell, through which spheres touch, are rounded"
    largest = float(abs(packing.position).max())
    needed = int(np.ceil(np.log10(largest * error / (step * share * median)))) + 1
    refuse(
        packing.name,
        "few_digits",
        f"{cause}, steps of {step:.0e} m, where the {name} is {median:.1e} m",
        remedy=f"write {needed} digits or more (17 are all){other_remedy}",
    )


def _refuse_other_units(overlap_of_forces: Floats, overlap: Floats, name: str) -> None:
    """Raise InputError if forces and positions give overlaps that differ much in size."""
    size_of_forces = float(abs(overlap_of_forces).mean())
    size_of_positions = float(abs(overlap).mean())
    factor = size_of_forces / max(size_of_positions, SMALLEST_NUMBER)
    if not 1 / MAX_OVERLAP_FACTOR < factor < MAX_OVERLAP_FACTOR:
        refuse(
            name,
            "other_units",
            f"the law makes overlaps of {size_of_forces:.3g} m of the forces, "
            f"positions and radii {size_of_positions:.3g} m",
            remedy="give stiffnesses, forces and lengths in one system of units (import --scales)",
        )


def _turn_to_lines(normal: Floats, line: Floats) -> None:
    """Turn normals (m, 3) in place to lines (m, 3) that are not zero; their senses are kept.

    The direction of a force with six digits is more exact than that of two positions with six
    digits.
    """
    size = np.linalg.norm(line, axis=1)
    known = size > 0
    factor = np.sign((line * normal).sum(axis=1))[known] / size[known]
    normal[known] = factor[:, None] * line[known]
