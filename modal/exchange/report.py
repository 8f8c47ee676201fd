"""What an import found and assumed, as numbers and lines for whoever reads them."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.exchange.import_result import ImportResult
from modal.exchange.law import ONE_SIDED, ProgramLaw
from modal.packing.network import Network
from modal.packing.plausibility import plausibility
from modal.packing.state import has_forces, stress_tensor
from modal.system.contacts import GROWTH, SHEAR, TANGENTS, Contacts

NEEDS_SHEAR = SHEAR, GROWTH
"""Terms that are not known where shear forces are not told."""
ROUND_OFF = 1e-14
"""A share below which a term is none."""
WEIGHED = 50_000
"""Contacts on which the terms of a law are weighed."""


def summary_of(found: ImportResult) -> dict[str, Any]:
    """Spheres, contacts, stresses, balance, digits, sliding, the law and what its terms are worth.

    `remarks` of `found` grow by what a reader should know.
    """
    network, remarks = found.network, found.remarks
    # Where a law made the contacts, those that are not listed have been sought already.
    plausible = plausibility(network, sought=found.sought)
    remarks += plausible["remarks"]
    told: dict[str, Any] = {
        "spheres": network.n_particles,
        "contacts": network.n_contacts,
        "wall_contacts": int(network.with_wall.sum()),
    }
    if network.force_normal is not None and network.force_tangential is None:
        remarks.append("no shear forces: stresses and balance are not told")
    if has_forces(network) and network.cell_size[:2].all() and network.length > 0:
        told["stress_pa"] = np.diag(stress_tensor(network)).tolist()
    told |= found.told
    balance = "net_force_over_contact_force"
    told |= {balance: plausible[balance]} if balance in plausible else {}
    if "printed_stress_pa" in told and network.with_wall.any() and "stress_pa" in told:
        pairs = network.some(~network.with_wall)
        # The program leaves walls out, and divides by the volume of its box.
        of_box = network.length / float(network.cell_size[2])
        told["stress_of_spheres_alone_pa"] = (np.diag(stress_tensor(pairs)) * of_box).tolist()
    if network.sliding is not None and network.n_contacts:
        told["sliding_share"] = float(network.sliding.mean())
    laws = list(dict.fromkeys(found.laws))
    told["law"] = [law_in_words(law) for law in laws]
    if any(law.shear_grows for law in laws):
        remarks.append(
            "this contact model keeps a shear displacement: a shear force Ft grows with the "
            "contact radius, by Ft / (2 overlap), which springs lack; --pre-stress law has it"
        )
    if any(law.keeps == ONE_SIDED for law in laws):
        remarks.append("its shear shrinks on unloading alone: no linear law has both directions")
    if laws and all(law.tangential == 0 for law in laws):
        remarks.append("no tangential stiffness: spheres turn and slide freely")
    if laws and network.inertia_tensor is None:
        told["terms_of_the_law_over_springs"] = law_term_sizes(network)
    return told


def law_in_words(law: ProgramLaw) -> str:
    """One line about a law."""
    unit = "Pa" if law.hertz else "N/m"
    normal = "k sqrt(R* d) d" if law.hertz else "k d"
    across = (
        "none" if law.tangential == 0 else f"{law.tangential:.6g} " + ("Pa" if law.grows else "N/m")
    )
    grows = " times the circle's radius" * (law.grows and law.tangential > 0)
    turning = ""
    if law.resists_turning:
        twisting = f"{law.twisting:.6g} N m/rad"
        if law.marshall:
            twisting = f"{law.marshall:.6g} times the tangential coefficient and R* d"
        turning = f"; rolling {law.rolling:.6g} N/m times R*^2; twisting {twisting}"
    return (
        f"N = {normal}, k = {law.normal:.6g} {unit}; tangential {across}{grows}; "
        f"friction {law.friction:g}; keeps the shear {law.keeps}; arms: {law.moves} (motion), "
        f"{law.turns} (torque){turning}"
    )


def law_term_sizes(network: Network) -> dict[str, float]:
    """What each of the law's terms adds to K, relative: root mean square over all entries.

    Rotations count as arcs of the mean radius. Terms that this law does not have, or whose forces
    are not told, are left out. Of more than `WEIGHED` contacts evenly spaced ones are taken, whose
    matrices fill half a gigabyte.
    """
    m = network.n_contacts
    if m > WEIGHED:
        network = network.some(np.arange(0, m, -(-m // WEIGHED)))
    arc = np.array([1.0] * 3 + [1 / float(network.radius.mean())] * 3)
    scale = np.array([*arc, *arc[3:]])
    springs = Contacts.of(network).tangent() * scale[:, None] * scale
    size = float(np.linalg.norm(springs))
    added = {}
    for term in TANGENTS["law"]:
        if network.force_tangential is None and term in NEEDS_SHEAR:
            continue
        change = Contacts.of(network, (term,)).tangent() * scale[:, None] * scale - springs
        added[term] = float(np.linalg.norm(change)) / size
    return {term: share for term, share in added.items() if share > ROUND_OFF}
