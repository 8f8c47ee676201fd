"""The parser of all commands, and the run of one."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence

from modal.cli.options import Parser, check_files, check_text, say_error
from modal.tools.errors import InputError

GROUPS = {
    "your packing": {
        "measure": ("measure", "start here: velocities, low-pass, moduli ... with errors"),
        "figure": ("figure", "when a number is not enough: one figure, or again from its CSV"),
        "watch": ("waves", "to see a wave or modes move: one page, in three dimensions"),
        "agreement": ("waves", "when a DEM run is in doubt: against the linear wave, by cause"),
    },
    "the study": {
        "study": ("study", "of many packings: tables, figures, targets, one page; its stages"),
    },
}
"""Commands by group: the module of each in this room, loaded when it is called; when to use it."""
COMMANDS = {name: told for group in GROUPS.values() for name, told in group.items()}


def parser(called: str = "") -> argparse.ArgumentParser:
    """The parser of the command that is `called`; with the names of all where it is none."""
    lines = ["Any packing measured, and the study of many; COMMAND --help has options, an example."]
    for title, group in GROUPS.items():
        lines += ["", f"{title}:", *(f"  {name:12s} {when}" for name, (_, when) in group.items())]
    whole = Parser(prog="python -m analysis", description="\n".join(lines))
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND"
    )
    if called in COMMANDS:
        importlib.import_module(f"analysis.cli.{COMMANDS[called][0]}").add(commands)
    else:
        for name in COMMANDS:
            commands.add_parser(name)
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; exit status 0, 2 with one line on stderr for a user's mistake.

    And 3 where something asked for is missing, which stderr has named.
    """
    words = sys.argv[1:] if argv is None else argv
    try:
        check_text(words)
        options = parser("".join(words[:1])).parse_args(words)
        check_files(options)
        options.argv = words
        status: int | None = options.run(options)
    except InputError as error:
        say_error(error)
        return 2
    return status or 0
