"""The parser of all commands, and the run of one."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from modal.cli.options import Parser, add_command, parsed, refused
from modal.tools.errors import InputError

GROUPS = {
    "your packing": {
        "measure": "start here: velocities, low-pass, moduli ... with errors",
        "figure": "when a number is not enough: one figure, or again from its CSV",
        "watch": "to see a wave or modes move: one page, in three dimensions",
        "agreement": "when a DEM run is in doubt: against the linear wave, by cause",
    },
    "the study": {"study": "of many packings: tables, figures, targets, one page; its stages"},
}
"""Commands by group, and when to use each. Its module has the same name in this room, is loaded
when it is called, and has what modules of `modal.cli` have: `EXAMPLE`, `OPTIONS`, `run`."""
COMMANDS = {name: when for group in GROUPS.values() for name, when in group.items()}


def parser(called: str = "") -> argparse.ArgumentParser:
    """The parser of the command that is `called`; with the names of all where it is none."""
    lines = ["Any packing measured, and the study of many; COMMAND --help has options, an example."]
    for title, group in GROUPS.items():
        lines += ["", f"{title}:", *(f"  {name:12s} {when}" for name, when in group.items())]
    whole = Parser(prog="python -m analysis", description="\n".join(lines))
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND"
    )
    if called not in COMMANDS:
        for name in COMMANDS:
            commands.add_parser(name)
        return whole
    module = importlib.import_module(f"analysis.cli.{called}")
    add_command(commands, called, module)
    commands.choices[called].set_defaults(run=module.run)
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; exit status 0, 2 with one line on stderr for a user's mistake.

    And 3 where something asked for is missing, which stderr has named.
    """
    words = sys.argv[1:] if argv is None else argv
    try:
        options = parsed(parser("".join(words[:1])), words)
        options.argv = words
        status: int | None = options.run(options)
    except InputError as error:
        return refused(error)
    return status or 0
