"""The parser of all commands, and the run of one."""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from types import ModuleType
from typing import Any

from modal.cli import count, density, info, lattice, modes, pack, relax, response, wave
from modal.cli.options import SHORT, Parser, say
from modal.formats.hdf5 import InputError
from modal.formats.provenance import is_current, made_by

COMMANDS: dict[str, ModuleType] = {
    "pack": pack,
    "relax": relax,
    "info": info,
    "modes": modes,
    "count": count,
    "density": density,
    "wave": wave,
    "response": response,
    "lattice": lattice,
}
"""Each has `add(commands)`, its options, and `run(options)`, its result. One that writes a product
from sources and settings has `read_product` too, who reads it, or None; one whose product may fall
short has `short_of(path)`."""


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    whole = Parser(prog="python -m modal", description="Eigenmodes of granular packings")
    commands = whole.add_subparsers(dest="command", required=True, parser_class=Parser)
    for command in COMMANDS.values():
        command.add(commands)
    return whole


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns the exit status.

    2 for a user's mistake (one line on stderr), 3 for a product that falls short of what was asked.
    """
    start = time.perf_counter()
    try:
        options = parser().parse_args(argv)
        command = COMMANDS[options.command]
        options.made, options.remarks = None, []
        if hasattr(command, "read_product") and options.output:
            arguments = sys.argv[1:] if argv is None else argv
            options.made = made_by(options.command, vars(options), arguments)
        elif getattr(options, "if_stale", False):
            raise InputError("--if-stale is about the file of -o; give one")
        if getattr(options, "if_stale", False) and is_current(
            options.output, options.made, say, command.read_product
        ):
            result = {"current": options.output}
            if hasattr(command, "short_of"):
                result |= command.short_of(options.output)
        else:
            result = command.run(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, SystemError) as error:
        # Ctrl-C in the middle of compiled code arrives as a SystemError that it has caused.
        if not isinstance(error.__cause__ or error, KeyboardInterrupt):
            raise
        print("interrupted; files are whole or absent", file=sys.stderr)
        return 130
    # With an error its one line is enough.
    for remark in options.remarks:
        say(remark)
    result["seconds"] = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result["peak_memory_bytes"] = peak * (1 if sys.platform == "darwin" else 1024)
    if options.json:
        print(json.dumps(result))
    else:
        _print(result)
    return SHORT if result.get("missing") or not result.get("at_rest", True) else 0


def _print(result: dict[str, Any]) -> None:
    for key, value in result.items():
        if isinstance(value, list) and len(value) > 12:
            head = ", ".join(f"{item:.6g}" for item in value[:5])
            tail = ", ".join(f"{item:.6g}" for item in value[-5:])
            value = f"{head}, ... {tail} ({len(value)} values)"
        elif isinstance(value, list):
            value = ", ".join(i if isinstance(i, str) else f"{i:.9g}" for i in value)
        elif isinstance(value, dict):
            value = ", ".join(f"{name}: {item}" for name, item in value.items())
        elif isinstance(value, float):
            value = f"{value:.9g}"
        print(f"{key.replace('_', ' '):34s} {value}")
