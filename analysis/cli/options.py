"""What the commands share: adding one, adding cases to one."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

CASE = "a case of --products by name, as 2; or files: a NETWORK and what was made from it"
"""Help of what names a case."""


def add_command(
    commands: Any,
    name: str,
    text: str,
    example: str,
    run: Callable[[argparse.Namespace], int | None],
) -> argparse.ArgumentParser:
    """A command: its parser. `example` is what one types behind `python -m analysis`.

    `run` takes the options; `options.argv` are the words of the command line. It returns the exit
    status, 3 where something asked for is missing, or None for 0.
    """
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text, example=example
    )
    command.set_defaults(run=run)
    return command


def add_products(command: argparse.ArgumentParser) -> None:
    """The option --products of a command that reads cases of a folder."""
    command.add_argument("--products", default="products", metavar="DIR", help="folder to read")
