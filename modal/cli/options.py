"""Commands as data: options, a parser whose mistakes are one line, files to write, what is said."""

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

from modal.cli.terminal import json_text, put
from modal.formats.whole_file import refuse_unwritable
from modal.tools.errors import InputError, refuse_unknown
from modal.tools.visible import visible

Given = argparse.Namespace
"""What was typed, by the names of options, and `made`, `remarks`, `groups` of the command."""
Result = dict[str, Any]
"""What a command has found, by name."""


class Option(NamedTuple):
    """An option as it is typed, or a file by its place, with its help, which says the default.

    `kind` makes the value from a text; bool is for an option that is there or not, a tuple of words
    for one of these. A tuple as `metavar` names as many values, one that ends in ... any number;
    `more` is what argparse takes.
    """

    name: str
    metavar: str | tuple[str, ...]
    text: str
    default: Any = None
    kind: Any = float
    more: Mapping[str, Any] = {}


class Group(NamedTuple):
    """Options under a title in the help; without one, of which only one may be given."""

    title: str
    options: Sequence[Option]


class NewFile(str):
    """A name that was given for a file to be written: the type of such an option.

    It ends in one of the `endings`, those that the option's text says behind a *.
    """

    endings: tuple[str, ...] = ()


class NewFolder(str):
    """The name of a folder for files to be written."""


REQUIRED = {"required": True}


def flag(name: str, text: str) -> Option:
    """An option that is there or not."""
    return Option(name, "", text, kind=bool)


def output(text: str, metavar: str = "FILE", required: bool = False) -> Option:
    """The option -o of a command that writes a FILE, or into a folder (DIR)."""
    kind = NewFolder if metavar == "DIR" else NewFile
    return Option("--output", metavar, text, kind=kind, more={"required": required})


SKIP = flag("--skip-current", "keep FILE if sources and settings are the same")


SHORT = 3
"""Exit status where a product is written but falls short: a list of modes that lacks some, a sample
that has not come to rest within the tolerance."""
PACKINGS = ".network.h5", ".sample.h5"
"""How the names of packings end, by which they are known; other products are by what they hold."""
PRODUCTS = *PACKINGS, ".modes.h5", ".signals.h5", ".density.h5", ".response.h5", ".moduli.h5"
"""How names end that say what a file holds."""


FIRST = "; files stand before the options"
"""What is said where an option with several values may have taken them."""


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError where argparse would print its usage and end the program."""

    def __init__(self, **settings: Any) -> None:
        """Descriptions and what follows the help keep their lines."""
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._negative_number_matcher = re.compile(r"-(\.?\d|inf|nan)")  # as -1e5, no option

    def parse_known_args(self, *given: Any, **more: Any) -> Any:
        """Refuse what is no option here, where the command's own options are known."""
        found, unknown = super().parse_known_args(*given, **more)
        if unknown:
            near = get_close_matches(unknown[0], self._option_string_actions, 1)
            hint = f"; did you mean {near[0]}?" if near else FIRST * (unknown[0][0] != "-")
            self.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """A mistake in the command line, in one line."""
        if re.search(r"required: \w", message):
            message += FIRST
        raise InputError("input", f"{self.prog}: {message}", remedy=f"see {self.prog} --help")


def number(text: str) -> float:
    """What was typed, as a number."""
    with suppress(ValueError):
        if math.isfinite(value := float(text)):
            return value
    raise argparse.ArgumentTypeError(f"{text!r} is no number; give it in SI, as 1e5")


def whole(text: str) -> int:
    """What was typed, as a whole number: 1000, or 1e3."""
    if not (value := number(text)).is_integer():
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number; give one")
    return int(text) if text.isdigit() else int(value)


def one_of(words: tuple[str, ...]) -> Callable[[str], str]:
    """A function that passes these words on and refuses others."""

    def word(text: str) -> str:
        try:
            refuse_unknown("", text, words)
        except InputError as error:
            raise argparse.ArgumentTypeError(f"{error}{FIRST * os.path.isfile(text)}") from None
        return text

    return word


def add_command(commands: Any, name: str, module: ModuleType, *more: Option) -> None:
    """Give subparsers of argparse a command, with the options of its module and `more`.

    What it does is the first line of the module's docstring; its help ends in `EXAMPLE`, what is
    typed behind the program's name, after an `EPILOG` if it has one.
    """
    said = (module.__doc__ or name).split("\n")[0].rstrip(".")
    short = said[0].lower() + said[1:]
    command = commands.add_parser(name, description=said, help=short)
    example = f"example: {command.prog}{module.EXAMPLE.removeprefix(name)}"
    command.epilog = f"{getattr(module, 'EPILOG', '')}\n\n{example}".strip()
    add_options(command, [*more, *module.OPTIONS])


def add_options(command: Any, options: Iterable[Option | Group]) -> None:
    """Give a parser of argparse its options."""
    for option in options:
        if isinstance(option, Group):
            titled = command.add_argument_group, command.add_mutually_exclusive_group
            add_options(titled[0](option.title) if option.title else titled[1](), option.options)
            continue
        names = ("-o", option.name) if option.name == "--output" else (option.name,)
        if option.kind is bool:
            command.add_argument(*names, action="store_true", help=option.text)
            continue
        how: dict[str, Any] = {"help": option.text, "default": option.default, **option.more}
        kind = one_of(option.kind) if isinstance(option.kind, tuple) else option.kind
        if kind is NewFile:
            endings = tuple(re.findall(r"\*(\.[\w.]+\w)", option.text))
            kind = type("NewFile", (NewFile,), {"endings": endings})
        how["type"] = number if kind is float else whole if kind is int else kind
        if option.metavar:
            how["metavar"] = option.metavar
        if isinstance(option.metavar, tuple):
            how["nargs"] = len(option.metavar)
        elif option.metavar.endswith(" ..."):
            how |= {"nargs": "+", "metavar": option.metavar.removesuffix(" ...")}
        if isinstance(option.default, int | float):
            how["help"] += f" (default {option.default:g})"
        elif option.default:
            how["help"] += f" (default {option.default})"
        command.add_argument(*names, **how)


def parsed(parser: argparse.ArgumentParser, words: Sequence[str]) -> Given:
    """What was typed; InputError for words that are no command, and for files that cannot be.

    A name whose bytes are no text is refused: a product could not say what it is made of.
    """
    for word in words:
        try:
            word.encode()
        except UnicodeEncodeError:
            raise InputError(
                "input", f"{ascii(word)}: not valid UTF-8", remedy="rename the file"
            ) from None
    options = parser.parse_args(words)
    _check_files(options)
    return options


def _check_files(options: Given) -> None:
    """InputError for a file to be written that cannot be, or that is read as well."""
    texts = list[str]()
    for name, value in vars(options).items():
        given = value if isinstance(value, list) else [value]
        if "" in given:
            raise InputError(
                "input",
                f"{name.replace('_', ' ')}: an empty text",
                remedy="give one, or leave it out",
            )
        texts += [text for text in given if isinstance(text, str)]
    read = [text for text in texts if not isinstance(text, NewFile) and os.path.isfile(text)]
    for path in texts:
        if isinstance(path, NewFolder):
            if os.path.isfile(path):
                raise InputError(
                    "input", f"{path}: a file, no folder", remedy="name a folder to write to"
                )
            refuse_unwritable(os.path.join(path, "file"))
        if not isinstance(path, NewFile):
            continue
        refuse_unwritable(path)
        if os.path.exists(path) and any(os.path.samefile(path, other) for other in read):
            raise InputError(
                "input",
                f"{path}: it is read, and would be written over",
                remedy="give another name to write to",
            )
        said = next((end for end in PRODUCTS if path.endswith(end)), Path(path).suffix)
        known = *path.endings, *(Path(end).suffix for end in {*path.endings} - {*PACKINGS})
        if known and said not in known:
            raise InputError(
                "input",
                f"{path}: its name must end in {' or '.join(path.endings)}",
                remedy="give one",
            )


def chosen(options: Given, *names: str) -> dict[str, Any]:
    """Options of these names that are given, as arguments of a function with the same names."""
    return {name: x for name in names if (x := getattr(options, name, None)) is not None}


def chosen_for(function: Callable[..., Any], options: Given) -> dict[str, Any]:
    """Options that are given, as what a function takes by name alone under the same names."""
    every = signature(function).parameters.values()
    return chosen(options, *(one.name for one in every if one.kind is one.KEYWORD_ONLY))


def typed(name: str) -> str:
    """The option of this name, as it is typed."""
    return "--" + name.replace("_", "-")


def refused(error: InputError, words: Sequence[str]) -> int:
    """Say an error in one line, and as JSON if the `words` of the command ask for it.

    Returns the exit status.
    """
    say(f"error: {error}")
    if "--json" in words:
        with suppress(InputError):  # of a full disk nothing is left to say
            put(json_text({"error": error.as_json}))
    return 2


def say(text: str) -> None:
    """A line for whoever sits at the terminal."""
    # Closed, or on a full disk: what is computed is worth more than what is said of it.
    with suppress(OSError):
        if sys.stderr:
            print(visible(text, keep="\n"), file=sys.stderr, flush=True)
