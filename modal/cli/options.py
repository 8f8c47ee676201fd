"""What the commands share: a parser whose mistakes are one line, options that several have."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from typing import Any, NoReturn

import numpy as np

from modal.formats.hdf5 import InputError

SHORT = 3
"""Exit status where a product is written but falls short: a list of modes that lacks some, a sample
that has not come to rest within the tolerance."""

PRE_STRESS = (
    "what carried forces add to the springs: nothing (none, default), normal ones, all (full), or "
    "as the law of the program that the packing is from (law)"
)
"""Help of an option that two commands have."""


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError where argparse would print its usage and end the program."""

    def __init__(self, *arguments: Any, example: str = "", **settings: Any) -> None:
        """A parser whose help ends in an example: what stands behind the program's name."""
        layout = argparse.RawDescriptionHelpFormatter
        super().__init__(*arguments, **{"formatter_class": layout, **settings})
        self.example = example

    def format_help(self) -> str:
        """The help, its example last."""
        program = self.prog.rsplit(" ", 1)[0]
        return super().format_help() + f"\nexample: {program} {self.example}\n" * bool(self.example)

    def error(self, message: str) -> NoReturn:
        """A mistake in the command line, in one line."""
        raise InputError(f"{self.prog}: {message}; see {self.prog} --help")


def add_command(commands: Any, name: str, text: str, example: str) -> argparse.ArgumentParser:
    """A command: its parser, with --json. `example` is what one types behind `python -m modal`."""
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text, example=example
    )
    command.add_argument("--json", action="store_true", help="print one JSON object")
    return command


def network_command(commands: Any, name: str, text: str, example: str) -> argparse.ArgumentParser:
    """A command that reads a packing: its parser, with the file and --json."""
    command = add_command(commands, name, text, example)
    command.add_argument("network", help="*.network.h5, or *.sample.h5")
    return command


def add_if_stale(command: argparse.ArgumentParser) -> None:
    """The option --if-stale of a command that writes one product."""
    command.add_argument(
        "--if-stale", action="store_true", help="keep FILE if sources and settings are the same"
    )


WRITTEN = "output", "layers", "exported"
"""Options that name files to be written."""


def refuse_overwriting(options: argparse.Namespace) -> None:
    """InputError where a file to be written is one that the command reads, or writes twice."""
    given = vars(options)
    named = [os.path.realpath(given[name]) for name in WRITTEN if given.get(name)]
    if len(set(named)) < len(named):
        raise InputError(f"{named[0]}: two outputs of one name; give each its own")
    read = [value for name, value in given.items() if name not in WRITTEN]
    files = [
        text
        for value in read
        for text in (value if isinstance(value, list) else [value])
        if isinstance(text, str) and os.path.isfile(text)
    ]
    for output in (given.get(name) for name in WRITTEN):
        if output and os.path.isfile(output):
            for path in files:
                if os.path.samefile(path, output):
                    raise InputError(
                        f"{output}: it is read, and would be written over; give another name to "
                        "write to"
                    )


def json_text(result: Any) -> str:
    """A result as JSON, which knows neither NaN nor infinity: null stands for them."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(own) for name, own in value.items()}
        if isinstance(value, list | tuple):
            return [plain(own) for own in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(result), allow_nan=False)


def numbers(at: list[str]) -> np.ndarray:
    """Shape (k,), Hz: the frequencies of --at, whose texts are the names of results."""
    try:
        return np.array([float(text) for text in at])
    except ValueError:
        raise InputError(f"--at {' '.join(at)}: give frequencies in Hz, as numbers") from None


def typed(name: str) -> str:
    """The option of this name, as it is typed."""
    return "--" + name.replace("_", "-")


def say(text: str) -> None:
    """A line for whoever sits at the terminal."""
    print(text, file=sys.stderr, flush=True)
