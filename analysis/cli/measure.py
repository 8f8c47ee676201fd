"""The command measure: what a packing is like, with errors and caveats."""

from __future__ import annotations

import argparse
from typing import Any

from analysis.cli.options import add_command
from analysis.measurement import measure_files
from analysis.quantities import QUANTITIES, QUICK
from modal.cli.options import add_output, json_text, say
from modal.cli.terminal import put
from modal.tools.errors import InputError


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
    command.add_argument("--keep", metavar="DIR", help="folder that keeps costly spectra")
    add_output(command, "write the result file of one packing, *.json")
    command.epilog = "\n".join(
        f"{q.name}: {q.definition} ({q.unit}){', on request' * q.asked}"
        for q in QUANTITIES.values()
    )


def _measure(options: argparse.Namespace) -> int:
    names = QUICK if options.quick else options.quantities
    found, mean = measure_files(options.files, names, options.keep)
    if options.output:
        if mean is not None:
            raise InputError(f"-o {options.output}: a result file is of one packing; measure each")
        (one,) = found.values()
        one.write(options.output)
    if options.json:
        told: dict[str, Any] = {path: each.as_json() for path, each in found.items()}
        if mean is None:
            (told,) = told.values()
        else:
            told["mean"] = mean.as_json()
        put(json_text(told))
    else:
        parts = [*found.items(), *([("mean", mean)] if mean is not None else [])]
        put("\n\n".join(f"{path}\n{each}" for path, each in parts))
    missing = {
        name for each in found.values() for name in options.quantities or () if not each[name].known
    }
    for name in sorted(missing):
        say(f"{name} could not be measured of every packing; its caveat says why")
    return 3 if missing else 0
