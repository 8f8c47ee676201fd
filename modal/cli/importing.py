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

MIN_TERM_SHARE = 1e-14
"""Smallest relative change of K by a term of a law that is not round-off."""
MAX_WEIGHED_CONTACTS = 50_000
"""Largest number of contacts on whose matrices the terms of a law are compared: the matrices fill
half a gigabyte."""
EXAMPLE = "import spheres.csv --contacts contacts.csv -o mine.network.h5"
FILE_HELP = "dump custom, *.restart of MercuryDPM, or *.csv of spheres"
PROGRAM_OPTIONS = {
    name: Option(f"--{name}", option.metavar, option.text, kind=option.kind)
    for name, option in all_options().items()
}
"""Options of the import for other programs' packings, by name."""
OPTIONS = (
    Option("file", "", FILE_HELP, kind=str),
    *PROGRAM_OPTIONS.values(),
    output("*.network.h5", (".network.h5",), required=True),
)

read_product = read_network


def run(options: Options) -> Result:
    """Read the packing, write the network, and summarise it."""
    imported = import_packing(options.file, **chosen(options, *PROGRAM_OPTIONS))
    network = replace(imported.network, provenance=options.made.attributes())
    write_network(options.output, network)
    return summary_of(imported)


def summary_of(imported: ImportResult) -> dict[str, Any]:
    """Return figures of an import: spheres, contacts, stresses, balance, digits, law and its terms.

    `remarks` are first those of the import, then the remarks that `info` makes on any network.
    """
    network = imported.network
    plausible = plausibility(network, sought=imported.sought)
    result: dict[str, Any] = {
        "spheres": network.n_particles,
        "contacts": network.n_contacts,
        "wall_contacts": int(network.with_wall.sum()),
        "absent": plausible["absent"],
    }
    if has_forces(network) and network.cell_size[:2].all() and network.length > 0:
        result["stress_pa"] = np.diag(stress_tensor(network)).tolist()
    result |= imported.told
    balance = "net_force_over_contact_force"
    if balance in plausible:
        result[balance] = plausible[balance]
    if network.sliding is not None and network.n_contacts:
        result["sliding_share"] = float(network.sliding.mean())
    result["law"] = [str(law) for law in dict.fromkeys(imported.laws)]
    if imported.laws and network.inertia_tensor is None:
        result["terms_of_the_law_over_springs"] = law_term_sizes(network)
    result["remarks"] = imported.remarks + plausible["remarks"]
    return result


def law_term_sizes(network: Network) -> dict[str, float]:
    """Return the relative change of K by each term of the law: a root mean square over entries.

    Rotations count as arcs of the mean radius. Terms that the law does not have, or whose forces
    are not known, are left out. If there are more than `MAX_WEIGHED_CONTACTS` contacts, an evenly
    spaced selection is used.
    """
    every = 1 + (network.n_contacts - 1) // MAX_WEIGHED_CONTACTS
    network = network.some(np.arange(0, network.n_contacts, every))
    inverse_arc = 1 / float(network.radius.mean())
    scale = np.repeat([1.0, inverse_arc, inverse_arc], 3)

    def scaled_tangent(*terms: str) -> Any:
        return contact_tangent(network, terms) * scale[:, None] * scale

    unknown: tuple[str, ...] = ()
    if network.force_tangential is None:
        unknown = (SHEAR, GROWTH)
    springs = scaled_tangent()
    springs_size = np.linalg.norm(springs)
    sizes = {}
    for term in TANGENTS["law"]:
        if term not in unknown:
            share = float(np.linalg.norm(scaled_tangent(term) - springs) / springs_size)
            if share > MIN_TERM_SHARE:
                sizes[term] = share
    return sizes
