"""The command measure: what a packing is like, with errors and caveats."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from analysis.cli.options import add_command
from analysis.measurement import Measurement, measure_files
from analysis.quantities import QUANTITIES, QUICK
from analysis.quantities.amplitude import AMPLITUDE
from analysis.table import Table
from modal.cli.options import json_text, say
from modal.cli.table import add_options, output
from modal.cli.terminal import put
from modal.formats.hdf5 import write_text


def add(commands: Any) -> None:
    """The command's options."""
    text = "velocities, low-pass frequency, moduli ... of any packing, with errors and caveats"
    command = add_command(commands, "measure", text, "measure mine.network.h5 --quick", _measure)
    command.add_argument(
        "files", nargs="+", metavar="FILE", help="packings, and waves recorded in them"
    )
    which = command.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help=f"only {', '.join(QUICK)}")
    which.add_argument(
        "--quantities", nargs="+", choices=QUANTITIES, metavar="NAME", help=", ".join(QUANTITIES)
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    command.add_argument(
        "--amplitudes", nargs="+", type=float, default=(), metavar="A",
        help=f"of pulses through a sample, m: {', '.join(AMPLITUDE)}",
    )  # fmt: skip
    command.add_argument("--keep", metavar="DIR", help="folder that keeps costly spectra")
    add_options(command, [output("what --json prints, *.json; or a table, *.md")])
    command.epilog = "\n".join(
        f"{q.name}: {q.definition} ({q.unit}){', on request' * q.asked}"
        for q in QUANTITIES.values()
    )


def _table(found: dict[str, Measurement]) -> str:
    """All packings side by side, one line a quantity, as Markdown."""
    stems = [Path(name).name.split(".h5")[0] for name in found]
    first = next(iter(found.values()))
    rows = [[name, *(one[name].text() for one in found.values())] for name in first]
    return Table("Quantities", ["quantity", *stems], rows).markdown()


def _json(found: dict[str, Measurement], mean: Measurement | None) -> str:
    """By file, and `mean`; of one packing without its file."""
    told: dict[str, Any] = {path: each.as_json() for path, each in found.items()}
    if mean is None:
        (told,) = told.values()
    else:
        told["mean"] = mean.as_json()
    return json_text(told)


def _measure(options: argparse.Namespace) -> int:
    names = QUICK if options.quick else options.quantities
    found, mean = measure_files(options.files, names, options.keep, options.amplitudes)
    if options.output:
        as_json = options.output.endswith(".json")
        write_text(options.output, _json(found, mean) + "\n" if as_json else _table(found))
    if options.json:
        put(_json(found, mean))
    else:
        parts = [*found.items(), *([("mean", mean)] if mean is not None else [])]
        put("\n\n".join(f"{path}\n{each}" for path, each in parts))
    missing = {
        name for each in found.values() for name in options.quantities or () if not each[name].known
    }
    for name in sorted(missing):
        say(f"{name} could not be measured of every packing; its caveat says why")
    return 3 if missing else 0
