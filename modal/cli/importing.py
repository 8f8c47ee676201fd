"""Another program's packing: LAMMPS, LIGGGHTS, MercuryDPM, or tables."""

from dataclasses import replace
from typing import Any

import numpy as np

from modal.cli.options import Option, Options, Result, chosen, output
from modal.exchange.import_result import ImportResult
from modal.exchange.registry import all_options, import_packing
from modal.packing.network import Network, read_network, write_network
from modal.packing.plausibility import plausibility
from modal.packing.state import has_forces, stress_tensor
from modal.system.contacts import GROWTH, SHEAR, TANGENTS, contact_tangent

ROUND_OFF = 1e-14
"""A share below which a term is none."""
WEIGHED = 50_000
"""Contacts on which the terms of a law are weighed: their matrices fill half a gigabyte."""
EXAMPLE = "import spheres.csv --contacts contacts.csv -o mine.network.h5"
FILE = "dump custom, *.restart of MercuryDPM, or *.csv of spheres"
OF_PROGRAMS = {
    name: Option(f"--{name}", option.metavar, option.text, kind=option.kind)
    for name, option in all_options().items()
}
OPTIONS = (
    Option("file", "", FILE, kind=str),
    *OF_PROGRAMS.values(),
    output("*.network.h5", (".network.h5",), required=True),
)

read_product = read_network


def run(options: Options) -> Result:
    """Read the packing, write the network, and say what was found."""
    found = import_packing(options.file, **chosen(options, *OF_PROGRAMS))
    write_network(options.output, replace(found.network, provenance=options.made.attributes()))
    return summary_of(found)


def summary_of(found: ImportResult) -> dict[str, Any]:
    """Spheres, contacts, stresses, balance, digits, sliding, the law and what its terms are worth.

    `remarks` are those of the import, then those that `info` has on any network.
    """
    network = found.network
    plausible = plausibility(network, sought=found.sought)
    told: dict[str, Any] = {
        "spheres": network.n_particles,
        "contacts": network.n_contacts,
        "wall_contacts": int(network.with_wall.sum()),
        "absent": plausible["absent"],
    }
    if has_forces(network) and network.cell_size[:2].all() and network.length > 0:
        told["stress_pa"] = np.diag(stress_tensor(network)).tolist()
    balance = "net_force_over_contact_force"
    told |= found.told | {name: plausible[name] for name in [balance] if name in plausible}
    if network.sliding is not None and network.n_contacts:
        told["sliding_share"] = float(network.sliding.mean())
    told["law"] = [str(law) for law in dict.fromkeys(found.laws)]
    if found.laws and network.inertia_tensor is None:
        told["terms_of_the_law_over_springs"] = law_term_sizes(network)
    return told | {"remarks": found.remarks + plausible["remarks"]}


def law_term_sizes(network: Network) -> dict[str, float]:
    """What each of the law's terms adds to K, relative: root mean square over all entries.

    Rotations count as arcs of the mean radius. Terms that this law does not have, or whose forces
    are not told, are left out. Of more than `WEIGHED` contacts evenly spaced ones are taken.
    """
    every = 1 + (network.n_contacts - 1) // WEIGHED
    network = network.some(np.arange(0, network.n_contacts, every))
    arc = 1 / float(network.radius.mean())
    scale = np.repeat([1.0, arc, arc], 3)

    def tangent(*terms: str) -> Any:
        return contact_tangent(network, terms) * scale[:, None] * scale

    springs = tangent()
    unknown = (SHEAR, GROWTH) if network.force_tangential is None else ()
    size = np.linalg.norm(springs)
    added = {
        term: float(np.linalg.norm(tangent(term) - springs) / size)
        for term in TANGENTS["law"]
        if term not in unknown
    }
    return {term: share for term, share in added.items() if share > ROUND_OFF}
