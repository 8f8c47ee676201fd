"""The command `import`: another program's packing as a contact network."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from modal.cli.options import add_command, add_output, add_value, say
from modal.exchange.registry import all_options, import_packing
from modal.exchange.report import summary_of
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError

read_product = read_network


def add(commands: Any) -> None:
    """The options of `import`: those of all programs that can be read."""
    text = "another program's packing: LAMMPS, LIGGGHTS, MercuryDPM, or tables"
    example = "import spheres.csv --contacts contacts.csv -o mine.network.h5"
    command = add_command(commands, "import", text, example)
    command.add_argument("file", help="dump custom, *.restart of MercuryDPM, or *.csv of spheres")
    for name, option in all_options().items():
        add_value(command, f"--{name}", option.metavar, option.text, kind=option.kind)
    add_output(command, "*.network.h5", required=True)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Read the packing, write the network, and say what was found and assumed."""
    if not options.output.endswith(".network.h5"):
        raise InputError(f"-o {options.output}: a network's name ends in .network.h5")
    given = {name: getattr(options, name) for name in all_options()}
    found = import_packing(options.file, **given)
    told = summary_of(found)
    provenance = options.made.attributes() if options.made else {}
    write_network(options.output, replace(found.network, provenance=provenance))
    for remark in found.remarks:
        say(f"{options.file}: {remark}")
    return told | {"remarks": found.remarks}
