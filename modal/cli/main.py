"""The parser of all commands, and the run of one."""

import argparse
import importlib
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from modal import __version__
from modal.cli.options import (
    FALLS_SHORT_STATUS,
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
    *("pack", "relax", "info", "modes", "count", "density", "moduli", "wave", "response"),
    *("lattice", "import", "export", "tile"),
)
"""All of them; the module of each in this room is loaded when it is called."""
MODULES = {"import": "importing", "export": "exporting"}
"""Of those whose module has another name."""
FIRST = """first steps:
  {prog} pack --spheres 400 --stress 1e5 -o dense
  {prog} info dense/100000Pa.sample.h5
  {prog} modes dense/100000Pa.sample.h5 --lowest 10"""
"""What the help of the whole ends in."""


def command_of(name: str) -> ModuleType:
    """The module of a command.

    Its docstring's first line says what it does; it has `OPTIONS`, an `EXAMPLE` of what is typed
    behind `python -m modal`, perhaps an `EPILOG` of its help, and `run(options)`, its result. One
    that writes a product from sources and settings has `read_product` too, who reads it, or None;
    one whose product may fall short, or is not the only one, has `kept(options)` for a product that
    is current; one whose result is long sorts it for people into `options.groups`.
    """
    return importlib.import_module(f"modal.cli.{MODULES.get(name, name)}")


def parser(called: str = "") -> argparse.ArgumentParser:
    """The parser of the command that is `called`; of all commands where it is none of them."""
    script = Path(sys.argv[0]).stem
    prog = script if script == "granular-modes" else "python -m modal"
    about = "Waves and eigenmodes of sphere packings; COMMAND --help has options and an example."
    epilog = FIRST.format(prog=prog)
    whole = Parser(prog=prog, description=about, epilog=epilog)
    whole.add_argument("--version", action="version", version=f"granular-wave-modes {__version__}")
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )
    for name in [called] if called in COMMANDS else COMMANDS:
        add_command(commands, name, command_of(name), flag("--json", "print one JSON object"))
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status.

    2 for a user's mistake (one line on stderr), 3 for a product that falls short of what was asked.
    """
    start = time.perf_counter()
    Minute.begin()
    arguments = sys.argv[1:] if argv is None else argv
    try:
        options = parsed(parser("".join(arguments[:1])), arguments)
        command = command_of(options.command)
        skip = getattr(options, "skip_current", False)
        options.made, options.remarks, options.groups = None, [], None
        getattr(command, "in_force", lambda _: None)(options)
        if hasattr(command, "read_product") and options.output:
            options.made = made_by(options.command, vars(options), arguments)
        elif skip:
            raise InputError("input", "--skip-current is about the file of -o", remedy="give one")
        if skip and is_current(options.output, options.made, say, command.read_product):
            kept: Any = getattr(command, "kept", lambda _: {})
            result = {"current": options.output} | kept(options)
        else:
            result = command.run(options)
        for remark in dict.fromkeys(options.remarks):  # with an error its one line is enough
            say(remark)
        result["seconds"] = time.perf_counter() - start
        result["peak_memory_bytes"] = peak_memory()
        put(json_text(result) if options.json else page(result, options.groups))
    except MemoryError as error:
        return refused(out_of_memory(error), arguments)
    except InputError as error:
        return refused(error, arguments)
    return FALLS_SHORT_STATUS if falls_short(result) else 0


def falls_short(result: Result) -> bool:
    """Whether modes are missing, a sample is not at rest, or a state was not reached."""
    at_rest = result.get("at_rest", True) and result.get("reached", True)
    return bool(result.get("missing")) or not at_rest
