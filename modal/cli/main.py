"""The parser of all commands, and the run of one of them."""

import argparse
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from modal import __version__
from modal.cli.options import (
    FALLS_SHORT_STATUS,
    Options,
    Parser,
    Result,
    add_command,
    flag,
    parsed,
    refused,
    say,
)
from modal.cli.terminal import json_text, page, put
from modal.formats.provenance import is_current, made_by
from modal.tools.errors import InputError
from modal.tools.memory import peak_memory
from modal.tools.progress import Minute
from modal.tools.workload import out_of_memory

COMMANDS = (
    "pack",
    "relax",
    "cement",
    "info",
    "modes",
    "count",
    "density",
    "moduli",
    "wave",
    "response",
    "lattice",
    "import",
    "export",
    "tile",
)
"""Names of the commands in the order of the help."""
MODULES = {"import": "importing", "export": "exporting"}
"""Modules whose names differ from those of their commands: `import` is a word of Python."""
FIRST_STEPS = """first steps:
  {prog} pack --spheres 400 --stress 1e5 -o dense
  {prog} info dense/100000Pa.sample.h5
  {prog} modes dense/100000Pa.sample.h5 --lowest 10"""
"""End of the general help."""


def command_of(name: str) -> ModuleType:
    """Return the module of a command, which is loaded when the command is called.

    The first line of its docstring says what the command does. It has `OPTIONS`, an `EXAMPLE` of
    what one types after `python -m modal`, and `run(options)`, which returns the result. It may
    have

    - `EPILOG`, a part of its help;
    - `set_defaults(options)`, which sets defaults that depend on other options;
    - `read_product`, if it writes a product from sources and settings: the function that reads the
      product, or None;
    - `current_result(options)`, the result for a product that is kept because it is current.

    A command with a long result sorts it for people into `options.groups`.
    """
    return importlib.import_module(f"modal.cli.{MODULES.get(name, name)}")


def parser(called: str = "") -> argparse.ArgumentParser:
    """Return the parser of all commands, or only of the command named `called`, if it exists."""
    script = Path(sys.argv[0]).stem
    prog = "python -m modal"
    if script == "granular-modes":
        prog = script
    main_parser = Parser(
        prog=prog,
        description=(
            "Waves and eigenmodes of sphere packings; COMMAND --help has options and an example."
        ),
        epilog=FIRST_STEPS.format(prog=prog),
    )
    version = f"granular-wave-modes {__version__}"
    main_parser.add_argument("--version", action="version", version=version)
    commands = main_parser.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )
    names: Sequence[str] = COMMANDS
    if called in COMMANDS:
        names = [called]
    for name in names:
        add_command(commands, name, command_of(name), flag("--json", "print one JSON object"))
    return main_parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, and return the exit status.

    The status is 2 for a user's mistake (one line on standard error), and 3 for a product that
    falls short of the request.
    """
    start = time.perf_counter()
    Minute.begin()
    words = sys.argv[1:] if argv is None else argv
    try:
        options = parsed(parser("".join(words[:1])), words)
        result = _run(options, words)
        for remark in dict.fromkeys(options.remarks):  # an error is printed without them
            say(remark)
        result["seconds"] = time.perf_counter() - start
        result["peak_memory_bytes"] = peak_memory()
        put(json_text(result) if options.json else page(result, options.groups))
    except MemoryError as error:
        return refused(out_of_memory(error), words)
    except InputError as error:
        return refused(error, words)
    if falls_short(result):
        return FALLS_SHORT_STATUS
    return 0


def _run(options: Options, words: Sequence[str]) -> Result:
    """Run a command and return its result.

    If its product is current and to be kept, return the result of that product instead.
    """
    command = command_of(options.command)
    options.made = None
    options.remarks = []
    options.groups = None
    if hasattr(command, "set_defaults"):
        command.set_defaults(options)
    skip_current = getattr(options, "skip_current", False)
    if hasattr(command, "read_product") and options.output:
        options.made = made_by(options.command, vars(options), words)
    elif skip_current:
        raise InputError("no_output", "--skip-current is about the file of -o", remedy="give one")
    if skip_current and is_current(options.output, options.made, say, command.read_product):
        result: Result = {"current": options.output}
        if hasattr(command, "current_result"):
            result |= command.current_result(options)
        return result
    result = command.run(options)
    return result


def falls_short(result: Result) -> bool:
    """Return whether modes are missing, a sample is still moving, or a state was not reached."""
    is_reached = result.get("at_rest", True) and result.get("reached", True)
    return bool(result.get("missing")) or not is_reached
