"""Parse the command line of `python -m analysis`, and run its command."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from modal.cli.options import Parser, add_command, parsed, refused
from modal.tools.errors import InputError
from modal.tools.workload import out_of_memory

COMMANDS = {
    "measure": "start here: velocities, low-pass, moduli ... of your packing, with errors",
    "transducers": "a bench test: two discs, V_P or V_S by the rules of laboratories",
    "figure": "when a number is not enough: one figure, or again from its CSV",
    "watch": "to see a wave or modes move: one page, in three dimensions",
    "agreement": "when a DEM run is in doubt: against the linear wave, by cause",
    "study": "of many packings: tables, figures, targets, one page; its stages",
}
"""Commands, and when to use each. The module of a command has the name of the command and lies in
this folder. It is loaded when the command is called, and defines `EXAMPLE`, `OPTIONS` and `run`, as
the modules of `modal.cli` do."""


USED_FOR = {
    "matplotlib": ("matplotlib", "draws"),
    "pandas": ("pandas", "groups the results of a study"),
    "yaml": ("pyyaml", "reads a study"),
    "jinja2": ("jinja2", "fills the page of a study"),
}
"""Modules that some commands need: their packages, and what these do."""


def parser(called: str = "") -> argparse.ArgumentParser:
    """Return the parser of all commands, with the options of the one that is `called`."""
    about = (
        "Your packing: measure, transducers, figure, watch, agreement. The study: study. See "
        "COMMAND --help."
    )
    whole = Parser(prog="python -m analysis", description=about)
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )
    for name, when in COMMANDS.items():
        if name == called:
            add_command(commands, name, importlib.import_module(f"analysis.cli.{name}"))
        else:
            commands.add_parser(name, help=when)
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status.

    The status is 0 if all is well; 2, with one line on stderr, for a user's mistake; and 3 if a
    requested result is missing; stderr then names it.
    """
    words = sys.argv[1:] if argv is None else argv
    try:
        options = parsed(parser("".join(words[:1])), words)
        options.argv = words
        command = importlib.import_module(f"analysis.cli.{options.command}")
        status: int | None = command.run(options)
    except ModuleNotFoundError as error:
        if error.name not in USED_FOR:
            raise
        package, use = USED_FOR[error.name]
        return refused(
            InputError(
                "no_package", f"{package} is absent, which {use}", remedy=f"pip install {package}"
            ),
            words,
        )
    except MemoryError as error:
        return refused(out_of_memory(error), words)
    except InputError as error:
        return refused(error, words)
    return status or 0
