"""Commands as data: their options, the parser, files to be written, and messages."""

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, NoReturn

from modal.cli.terminal import json_text, put
from modal.formats.whole_file import refuse_unwritable
from modal.tools.errors import InputError, refuse_unknown
from modal.tools.visible import visible

Options = argparse.Namespace
"""Values of a command line by the names of options. The attributes `made`, `remarks` and `groups`
are added."""
Result = dict[str, Any]
"""Results of a command by their names."""

REQUIRED = {"required": True}
"""Setting of argparse for an option that must be given."""
FALLS_SHORT_STATUS = 3
"""Exit status if a product is written but falls short of the request: a list of modes that lacks
some, or a sample that has not come to rest within the tolerance."""
PACKING_ENDINGS = (".network.h5", ".sample.h5")
"""Endings of the names of packings, by which they are recognised; other products are recognised by
their content."""
PRODUCT_ENDINGS = (
    *PACKING_ENDINGS,
    ".modes.h5",
    ".signals.h5",
    ".density.h5",
    ".response.h5",
    ".moduli.h5",
)
"""Endings of names that say what a file holds."""
FILES_FIRST = "; files stand before the options"
"""Hint in the message if an option with several values may have taken a file as one of them."""


class Option(NamedTuple):
    """An option of a command, or a file that is given by its position.

    `text` is its help, to which the default is added. `kind` converts what was typed: a function, a
    tuple of words to choose from, or bool for an option without a value. A tuple as `metavar`
    stands for as many values as it has names; a `metavar` that ends in ... stands for any number of
    values. The name of a file to be written must end in one of the `endings`, if there are any.
    `more` are further settings of argparse.
    """

    name: str
    metavar: str | tuple[str, ...]
    text: str
    default: Any = None
    kind: Any = float
    more: Mapping[str, Any] = {}
    endings: tuple[str, ...] = ()


class Group(NamedTuple):
    """A group of options under a title; without a title, the options exclude each other."""

    title: str
    options: Sequence[Option]


class NewFile(str):
    """The name of a file to be written; it must end in one of the `endings`, if there are any."""

    endings: tuple[str, ...] = ()


class NewFolder(str):
    """The name of a folder for files to be written."""


def flag(name: str, text: str) -> Option:
    """Return an option without a value."""
    return Option(name, "", text, kind=bool)


def output(text: str, endings: tuple[str, ...] = (), *, required: bool = False) -> Option:
    """Return the option -o for a file whose name ends in one of the `endings`."""
    more = {"required": required}
    return Option("--output", "FILE", text, kind=NewFile, more=more, endings=endings)


def output_folder(text: str, default: str | None = None) -> Option:
    """Return the option -o for a folder; it must be given if there is no default."""
    more = {"required": default is None}
    return Option("--output", "DIR", text, default, kind=NewFolder, more=more)


SKIP = flag("--skip-current", "keep FILE if sources and settings are the same")


class Parser(argparse.ArgumentParser):
    """A parser that raises InputError where argparse would print its usage and exit."""

    def __init__(self, **settings: Any) -> None:
        """Create a parser that keeps the lines of descriptions and epilogs."""
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        self._negative_number_matcher = re.compile(r"-(\.?\d|inf|nan)")  # -1e5 is no option

    def parse_known_args(self, *args: Any, **kwargs: Any) -> Any:
        """Parse as argparse does, but refuse unknown words in the command's own parser."""
        options, unknown = super().parse_known_args(*args, **kwargs)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._hint(unknown[0])}")
        return options, unknown

    def _hint(self, word: str) -> str:
        """Return a guess at what is wrong with an unknown word, for the end of a message."""
        similar = get_close_matches(word, self._option_string_actions, 1)
        if similar:
            return f"; did you mean {similar[0]}?"
        if word.startswith("-"):
            return ""
        return FILES_FIRST

    def error(self, message: str) -> NoReturn:
        """Raise InputError for a mistake in the command line."""
        # argparse has only its sentence to say that an argument without a dash is missing.
        if re.search(r"required: \w", message):
            message += FILES_FIRST
        raise InputError(
            "command_line", f"{self.prog}: {message}", remedy=f"see {self.prog} --help"
        )


def read_number(text: str) -> float:
    """Return a finite number that was typed; raise argparse's error for any other text."""
    with suppress(ValueError):
        number = float(text)
        if math.isfinite(number):
            return number
    raise argparse.ArgumentTypeError(f"{text!r} is no number; give it in SI, as 1e5")


def read_whole_number(text: str) -> int:
    """Return a whole number that was typed, as 1000 or as 1e3."""
    number = read_number(text)
    if not number.is_integer():
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number; give one")
    if text.isdigit():
        return int(text)
    return int(number)


def choice_reader(words: tuple[str, ...]) -> Callable[[str], str]:
    """Return a function that returns a word if it is one of these, and raises an error if not."""

    def read_choice(text: str) -> str:
        try:
            refuse_unknown("", text, words)
        except InputError as error:
            hint = ""
            if os.path.isfile(text):
                hint = FILES_FIRST
            raise argparse.ArgumentTypeError(f"{error}{hint}") from None
        return text

    return read_choice


def new_file_reader(endings: tuple[str, ...]) -> Callable[[str], NewFile]:
    """Return a function that makes a text the name of a file with one of these endings."""

    def read_new_file(text: str) -> NewFile:
        path = NewFile(text)
        path.endings = endings
        return path

    return read_new_file


def add_command(commands: Any, name: str, module: ModuleType, *more: Option) -> None:
    """Add a command to subparsers of argparse, with the options of its module and `more`.

    The first line of the module's docstring is its description. Its help ends in the module's
    `EPILOG`, if there is one, and in its `EXAMPLE`, which is what one types after the program's
    name.
    """
    description = (module.__doc__ or name).split("\n")[0].rstrip(".")
    help_line = description[0].lower() + description[1:]
    command = commands.add_parser(name, description=description, help=help_line)
    example = f"example: {command.prog}{module.EXAMPLE.removeprefix(name)}"
    command.epilog = f"{getattr(module, 'EPILOG', '')}\n\n{example}".strip()
    add_options(command, [*more, *module.OPTIONS])


def add_options(command: Any, options: Iterable[Option | Group]) -> None:
    """Add options and groups of options to a parser of argparse."""
    for option in options:
        if isinstance(option, Group):
            if option.title:
                group = command.add_argument_group(option.title)
            else:
                group = command.add_mutually_exclusive_group()
            add_options(group, option.options)
        else:
            _add_option(command, option)


def _add_option(command: Any, option: Option) -> None:
    """Add one option to a parser of argparse."""
    names = [option.name]
    if option.name == "--output":
        names = ["-o", option.name]
    if option.kind is bool:
        command.add_argument(*names, action="store_true", help=option.text)
        return
    settings: dict[str, Any] = {
        "help": option.text + _default_text(option.default),
        "default": option.default,
        "type": _reader(option),
        **option.more,
    }
    if isinstance(option.metavar, tuple):
        settings["metavar"] = option.metavar
        settings["nargs"] = len(option.metavar)
    elif option.metavar.endswith(" ..."):
        settings["metavar"] = option.metavar.removesuffix(" ...")
        settings["nargs"] = "+"
    elif option.metavar:
        settings["metavar"] = option.metavar
    command.add_argument(*names, **settings)


def _reader(option: Option) -> Callable[[str], Any]:
    """Return the function that converts what was typed for an option."""
    if isinstance(option.kind, tuple):
        return choice_reader(option.kind)
    if option.kind is NewFile:
        return new_file_reader(option.endings)
    if option.kind is float:
        return read_number
    if option.kind is int:
        return read_whole_number
    reader: Callable[[str], Any] = option.kind
    return reader


def _default_text(default: Any) -> str:
    """Return the end of a help text that says the default; "" if there is none."""
    if isinstance(default, int | float):
        return f" (default {default:g})"
    if default:
        return f" (default {default})"
    return ""


def parsed(parser: argparse.ArgumentParser, words: Sequence[str]) -> Options:
    """Return the options of a command line.

    Raises InputError for unknown commands, for files that cannot be written, and for file names
    that are not valid text: a product could not record such a name as its source.
    """
    for word in words:
        try:
            word.encode()
        except UnicodeEncodeError:
            raise InputError(
                "not_utf8", f"{ascii(word)}: not valid UTF-8", remedy="rename the file"
            ) from None
    options = parser.parse_args(words)
    _check_files(options)
    return options


def _check_files(options: Options) -> None:
    """Raise InputError for an output file that cannot be written, or that is also an input file."""
    texts = _texts(options)
    read_files = []
    for text in texts:
        if not isinstance(text, NewFile) and os.path.isfile(text):
            read_files.append(text)
    for path in texts:
        if isinstance(path, NewFolder):
            _check_new_folder(path)
        elif isinstance(path, NewFile):
            _check_new_file(path, read_files)


def _texts(options: Options) -> list[str]:
    """Return all texts among the values of options; raise InputError for an empty one."""
    texts = list[str]()
    for name, value in vars(options).items():
        values = value if isinstance(value, list) else [value]
        if "" in values:
            raise InputError(
                "empty_text",
                f"{name.replace('_', ' ')}: an empty text",
                remedy="give one, or leave it out",
            )
        texts += [text for text in values if isinstance(text, str)]
    return texts


def _check_new_folder(path: NewFolder) -> None:
    """Raise InputError for a folder that is a file, or that cannot be written to."""
    if os.path.isfile(path):
        raise InputError(
            "not_a_folder", f"{path}: a file, no folder", remedy="name a folder to write to"
        )
    refuse_unwritable(os.path.join(path, "file"))


def _check_new_file(path: NewFile, read_files: Sequence[str]) -> None:
    """Raise InputError for an output file with a wrong ending, or that is read or unwritable."""
    refuse_unwritable(path)
    if os.path.exists(path) and any(os.path.samefile(path, other) for other in read_files):
        raise InputError(
            "overwrites_source",
            f"{path}: it is read, and would be written over",
            remedy="give another name to write to",
        )
    if path.endings and not has_ending(path, path.endings):
        raise InputError(
            "file_ending",
            f"{path}: its name must end in {' or '.join(path.endings)}",
            remedy="give one",
        )


def has_ending(path: str, endings: Sequence[str]) -> bool:
    """Return whether a file name has an ending that the command accepts.

    A product may be called results.h5, but not results.modes.h5 if it holds signals; packings are
    recognised by their ending, and need it.

    >>> has_ending("a.modes.h5", [".modes.h5"]), has_ending("a.h5", [".modes.h5"])
    (True, True)
    >>> has_ending("a.signals.h5", [".modes.h5"]), has_ending("a.h5", [".network.h5"])
    (False, False)
    """
    for product_ending in PRODUCT_ENDINGS:
        if path.endswith(product_ending):
            return product_ending in endings
    suffix = Path(path).suffix
    if suffix in endings:
        return True
    formats = {"." + end.rpartition(".")[2] for end in endings if end not in PACKING_ENDINGS}
    return suffix in formats


def chosen(options: Options, *names: str) -> dict[str, Any]:
    """Return the options of these names that were given, as arguments of a function."""
    arguments = {}
    for name in names:
        value = getattr(options, name, None)
        if value is not None:
            arguments[name] = value
    return arguments


def chosen_for(function: Callable[..., Any], options: Options) -> dict[str, Any]:
    """Return the options that were given, as keyword-only arguments of a function."""
    parameters = signature(function).parameters.values()
    names = [each.name for each in parameters if each.kind is Parameter.KEYWORD_ONLY]
    return chosen(options, *names)


def typed(name: str) -> str:
    """Return the option with a Python name as the user types it, such as --skip-current."""
    return "--" + name.replace("_", "-")


def refused(error: InputError, words: Sequence[str]) -> int:
    """Print an error in one line, and as JSON if the `words` of the command ask for JSON.

    Return the exit status.
    """
    say(f"error: {error}")
    if "--json" in words:
        with suppress(InputError):  # a full disk leaves nothing to print to
            put(json_text({"error": error.as_json}))
    return 2


def say(text: str) -> None:
    """Print a line for the user to standard error."""
    # Closed, or on a full disk: what is computed is worth more than the message.
    with suppress(OSError):
        if sys.stderr:
            print(visible(text, keep="\n"), file=sys.stderr, flush=True)
