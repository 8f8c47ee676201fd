"""The parser of all commands, and the run of one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from analysis.cli import cases, measure, packings, study, waves
from modal.cli.options import Parser, check_files, check_text, say_error
from modal.tools.errors import InputError


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    about = "Compare theory, modes and YADE; COMMAND --help has options and an example."
    whole = Parser(prog="python -m analysis", description=about)
    commands = whole.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )
    for group in (measure, cases, study, packings, waves):
        group.add(commands)
    return whole


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; exit status 0, 2 with one line on stderr for a user's mistake.

    And 3 where something asked for is missing, which stderr has named.
    """
    words = sys.argv[1:] if argv is None else argv
    try:
        check_text(words)
        options = parser().parse_args(words)
        check_files(options)
        options.argv = words
        status: int | None = options.run(options)
    except InputError as error:
        say_error(error)
        return 2
    return status or 0
