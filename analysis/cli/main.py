"""The parser of all commands, and the run of one."""

from __future__ import annotations

import argparse
import sys

from analysis.cli import cases, packings, study, waves
from modal.cli.options import Parser, refuse_overwriting
from modal.formats.hdf5 import InputError


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    about = "Compare theory, modes and YADE; COMMAND --help has options and an example."
    whole = Parser(prog="python -m analysis", description=about)
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )
    for group in (cases, study, packings, waves):
        group.add(commands)
    return whole


def main(argv: list[str] | None = None) -> int:
    """Run one command; exit status 0, or 2 with one line on stderr for a user's mistake."""
    words = sys.argv[1:] if argv is None else argv
    try:
        options = parser().parse_args(words)
        refuse_overwriting(options)
        options.argv = words
        options.run(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0
