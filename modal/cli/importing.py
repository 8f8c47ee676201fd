"""The command `import`: another program's packing as a contact network."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from modal.cli.options import add_command, add_output, say
from modal.exchange.contact_table import import_table
from modal.exchange.found import Found
from modal.exchange.lammps import import_lammps
from modal.exchange.liggghts import import_liggghts
from modal.exchange.mercury import import_mercury
from modal.exchange.program_law import SI, Units
from modal.exchange.report import summary_of
from modal.exchange.rows import fault, open_bytes
from modal.packing.network import read_network, write_network
from modal.tools.errors import InputError

read_product = read_network


def add(commands: Any) -> None:
    """The options of `import`."""
    text = "another program's packing: LAMMPS, LIGGGHTS, MercuryDPM, or tables"
    command = add_command(
        commands, "import", text, "import spheres.csv --contacts contacts.csv -o mine.network.h5"
    )
    command.add_argument("file", help="dump custom, *.restart of MercuryDPM, or *.csv of spheres")
    command.add_argument("--contacts", metavar="FILE", help="dump local, or *.csv of contacts")
    command.add_argument("--log", metavar="FILE", help="the log: units, law, walls, columns")
    command.add_argument(
        "--pair", metavar="LINE", help="the contact law as it stands behind pair_style"
    )
    command.add_argument(
        "--wall", metavar="LINE", help="the walls as they stand behind fix ... wall/gran"
    )
    command.add_argument(
        "--step", type=int, metavar="N", help="which one, of a dump with several times"
    )
    command.add_argument(
        "--scales",
        type=float,
        nargs=3,
        metavar=("M", "KG", "S"),
        help="the file's units of length, mass and time in SI",
    )
    add_output(command, "*.network.h5", required=True)


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Read the packing, write the network, and say what was found and assumed."""
    if not options.output.endswith(".network.h5"):
        raise InputError(f"-o {options.output}: a network's name ends in .network.h5")
    found = _found(options)
    told = summary_of(found)
    provenance = options.made.attributes() if options.made else {}
    write_network(options.output, replace(found.network, provenance=provenance))
    for remark in found.remarks:
        say(f"{options.file}: {remark}")
    return told | {"remarks": found.remarks}


def _found(options: argparse.Namespace) -> Found:
    scales = Units(*options.scales) if options.scales else None
    if scales is not None and not all(scale > 0 for scale in scales):
        raise InputError("--scales: give positive values in m, kg, s")
    with open_bytes(options.file) as file:
        head = file.read(200).decode("utf-8", "replace")
    first = head.split("\n", 1)[0]
    dump = (options.contacts, options.log, options.pair, options.wall)
    if first.startswith(("MercuryDPM", "restart_version")):
        if any(dump):
            raise InputError(
                f"{options.file}: a restart file of MercuryDPM has all in it; leave out "
                "--contacts, --log, --pair and --wall"
            )
        return import_mercury(options.file, scales or SI)
    if first.startswith("ITEM:"):
        if _of_liggghts(options):
            return import_liggghts(options.file, *dump, scales, options.step)
        return import_lammps(options.file, *dump, scales, options.step)
    if ".csv" in options.file:
        return import_table(options.file, options.contacts, scales or SI)
    fault(
        options.file,
        f"begins with {first[:30]!r}, which no program known here writes",
        "give a text dump of LAMMPS or LIGGGHTS, a restart file of MercuryDPM, or *.csv",
        1,
    )


def _of_liggghts(options: argparse.Namespace) -> bool:
    if options.pair:
        return bool(options.pair.split()[:1] == ["gran"])
    if not options.log:
        return False
    with open_bytes(options.log) as file:
        return b"LIGGGHTS" in file.read(2000)
