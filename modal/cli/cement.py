"""Cement hardens between the spheres of a packing at rest: its contacts become bonds."""

from dataclasses import replace

from modal.cli.options import REQUIRED, Option, Options, Result, output
from modal.cli.reading import NETWORK
from modal.exchange.registry import read, read_remarked
from modal.packing.cementation import cemented
from modal.packing.network import write_network
from modal.packing.sample import Sample
from modal.tools.errors import InputError

EXAMPLE = "cement rested.sample.h5 --cement 1e9 0.5 -o bonded.network.h5"
OPTIONS = (
    NETWORK,
    Option(
        "--cement",
        "X ...",
        "Young's modulus of the cement, Pa, radius of the bonds over that of the spheres, and "
        "normal over shear stiffness (default 2.5)",
        more=REQUIRED,
    ),
    output("*.network.h5", (".network.h5",), required=True),
)

read_product = read


def run(options: Options) -> Result:
    """Write the network with its bonds."""
    if len(options.cement) not in (2, 3):
        raise InputError(
            "cement_bond", "--cement", "two or three numbers", "give 1e9 0.5, for example"
        )
    packing = read_remarked(options.network, options.remarks.append)
    network = packing.network() if isinstance(packing, Sample) else packing
    bonded = cemented(network, *options.cement)
    write_network(options.output, replace(bonded, provenance=options.made.attributes()))
    return {
        "spheres": bonded.n_particles,
        "contacts": bonded.n_contacts,
        "stiffness_normal_over_before": float(
            bonded.stiffness_normal.mean() / network.stiffness_normal.mean()
        ),
    }
