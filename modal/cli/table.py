"""Commands as data: their options, which `add_options` gives to a parser of argparse."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

Given = argparse.Namespace
"""What was typed, by the names of options, and `made`, `remarks` of the command."""
Result = dict[str, Any]
"""What a command has found, by name."""


class Option(NamedTuple):
    """An option as it is typed, or a file by its place, with its help, which says the default.

    `kind` makes the value from a text; bool is for an option that is there or not, a tuple of words
    for one of these. A tuple as `metavar` names as many values; `more` is what argparse takes.
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
    """A name that was given for a file to be written: the type of such an option."""


class NewFolder(str):
    """The name of a folder for files to be written."""


ANY_NUMBER = {"nargs": "+"}
REQUIRED = {"required": True}


def flag(name: str, text: str) -> Option:
    """An option that is there or not."""
    return Option(name, "", text, kind=bool)


def output(
    text: str, metavar: str = "FILE", kind: type = NewFile, required: bool = False
) -> Option:
    """The option -o of a command that writes."""
    return Option("--output", metavar, text, kind=kind, more={"required": required})


SKIP = flag("--skip-current", "keep FILE if sources and settings are the same")


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
        how |= {"choices": option.kind} if isinstance(option.kind, tuple) else {"type": option.kind}
        if option.metavar:
            how["metavar"] = option.metavar
        if isinstance(option.metavar, tuple):
            how["nargs"] = len(option.metavar)
        if isinstance(option.default, int | float):
            how["help"] += f" (default {option.default:g})"
        elif option.default:
            how["help"] += f" (default {option.default})"
        command.add_argument(*names, **how)
