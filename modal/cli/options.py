"""What the commands share: a parser whose mistakes are one line, files to write, what is said."""

import argparse
import json
import math
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, NoReturn

from modal.cli.table import Given, NewFile, NewFolder
from modal.formats.hdf5 import refuse_unwritable
from modal.tools.errors import InputError

SHORT = 3
"""Exit status where a product is written but falls short: a list of modes that lacks some, a sample
that has not come to rest within the tolerance."""
PACKINGS = ".network.h5", ".sample.h5"
"""How the names of packings end."""
MAKE_PACKINGS = "import", "relax", "tile"
"""Commands that write one under a given name."""


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


def check_files(options: Given) -> None:
    """InputError for a file to be written that cannot be, or that is read as well."""
    texts = list[str]()
    for name, value in vars(options).items():
        if value == "":
            raise InputError(f"{name.replace('_', ' ')}: an empty text; give one, or leave it out")
        given = value if isinstance(value, list) else [value]
        texts += [text for text in given if isinstance(text, str)]
    read = [text for text in texts if not isinstance(text, NewFile) and os.path.isfile(text)]
    for path in texts:
        if isinstance(path, NewFolder):
            refuse_unwritable(os.path.join(path, "file"))
        if not isinstance(path, NewFile):
            continue
        refuse_unwritable(path)
        if os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
            raise InputError(
                f"{path}: it is read, and would be written over; give another name to write to"
            )
        if path.endswith(PACKINGS) and options.command not in MAKE_PACKINGS:
            raise InputError(f"{path}: the name of a packing, which this is none; give another")


def check_text(arguments: Sequence[str]) -> None:
    """InputError for a name whose bytes are no text: a product could not say what it is made of."""
    for argument in arguments:
        try:
            argument.encode()
        except UnicodeEncodeError:
            raise InputError(f"{ascii(argument)}: not valid UTF-8; rename the file") from None


def json_text(result: Any) -> str:
    """A result as JSON, which knows neither NaN nor infinity: null stands for them.

    >>> json_text({"velocity": [math.nan, 1.5], "worst": {"residual": math.inf}, "ok": True})
    '{"velocity": [null, 1.5], "worst": {"residual": null}, "ok": true}'
    """

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: plain(own) for name, own in value.items()}
        if isinstance(value, list | tuple):
            return [plain(own) for own in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(result), allow_nan=False)


def chosen(options: Given, *names: str) -> dict[str, Any]:
    """Options of these names, as arguments of a function that calls them the same."""
    return {name: getattr(options, name) for name in names}


def typed(name: str) -> str:
    """The option of this name, as it is typed."""
    return "--" + name.replace("_", "-")


def say_error(error: InputError) -> None:
    """One line, also where the name of a file has several."""
    say("error: " + str(error).replace("\n", "\\n"))


def say(text: str) -> None:
    """A line for whoever sits at the terminal."""
    # Closed, or on a full disk: what is computed is worth more than what is said of it.
    with suppress(OSError):
        if sys.stderr:
            print(text, file=sys.stderr, flush=True)
