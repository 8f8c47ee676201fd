"""Another program's packing: LAMMPS, LIGGGHTS, MercuryDPM, or tables."""

from dataclasses import replace

from modal.cli.options import Given, Option, Result, chosen, output
from modal.exchange.registry import all_options, import_packing
from modal.exchange.report import summary_of
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError

EXAMPLE = "import spheres.csv --contacts contacts.csv -o mine.network.h5"
FILE = "dump custom, *.restart of MercuryDPM, or *.csv of spheres"
OF_PROGRAMS = {
    name: Option(f"--{name}", option.metavar, option.text, kind=option.kind)
    for name, option in all_options().items()
}
OPTIONS = (
    Option("file", "", FILE, kind=str),
    *OF_PROGRAMS.values(),
    output("*.network.h5", required=True),
)

read_product = read_network


def run(options: Given) -> Result:
    """Read the packing, write the network, and say what was found."""
    if not options.output.endswith(".network.h5"):
        raise InputError(f"-o {options.output}: a network's name ends in .network.h5")
    found = import_packing(options.file, **chosen(options, *OF_PROGRAMS))
    write_network(options.output, replace(found.network, provenance=options.made.attributes()))
    return summary_of(found)
