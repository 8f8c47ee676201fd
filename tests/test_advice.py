"""Commands and options that texts name can be typed: they are those of the parsers."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest
from places import ROOT

from modal.cli.main import COMMANDS, command_of
from modal.cli.options import Group

PACKAGES = "modal", "analysis", "workflow", "yade_scripts"
COMMANDS_OF = {"modal": COMMANDS, "analysis": import_module("analysis.cli.main").COMMANDS}
IN_A_JOB = ROOT / "workflow" / "commands.py"
"""Its texts are read by workflow/in_turn.py, not typed."""
FOREIGN = {
    "--extra",
    "--force-reinstall",
    "--help",
    "--job-name",
    "--mem",
    "--no-install-recommends",
    "--privileged",
    "--site-packages",
    "--system-site-packages",
    "--user",
    "--version",
}
"""Options of apt, pip and others that texts name."""


def texts_of(path: Path) -> Iterator[str]:
    """Yield the string constants of a module without its docstrings; {} stands for values."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    skipped = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(value) for value in node.values}
    for node in nodes:
        if id(node) in skipped:
            continue
        if isinstance(node, ast.JoinedStr):
            values = node.values
            yield "".join(v.value if isinstance(v, ast.Constant) else "{}" for v in values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@cache
def all_texts() -> list[tuple[str, str]]:
    """Return the name of the module and the text, for each text of all packages."""
    texts = []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path != IN_A_JOB:
                name = str(path.relative_to(ROOT))
                texts += [(name, text) for text in texts_of(path)]
    return texts


def options_of(package: str, name: str) -> set[str]:
    """Return the names of the options of a command, as they are typed."""
    module = command_of(name) if package == "modal" else import_module(f"analysis.cli.{name}")
    names = {"--json", "-o", "--output", "--help"}
    options = list(module.OPTIONS)
    while options:
        option = options.pop()
        if isinstance(option, Group):
            options += option.options
        else:
            names.add(option.name)
    return names


CALL = r"(python -m |)\b(modal|analysis|granular-modes) ([a-z]+)\b([^`;]*)"


def test_commands_in_texts_exist_with_their_options():
    """Look up each command of ours that is named as it is typed, in backticks or not."""
    n_commands = 0
    for path, text in all_texts():
        for prefix, program, name, rest in re.findall(CALL, text):
            package = program.replace("granular-modes", "modal")
            if name not in COMMANDS_OF[package]:
                assert not prefix, f"{path}: {program} {name} is no command"
                continue
            n_commands += 1
            complete = prefix or program == "granular-modes"
            assert complete, f"{path}: python -m is missing in {text!r}"
            words = set(re.findall(r"(?<!\S)--[a-z][a-z-]*", rest.split(",")[0]))
            assert words <= options_of(package, name), f"{path}: {text!r}"
    assert n_commands > 5


@pytest.mark.parametrize("package", ["modal", "analysis"])
def test_options_in_texts_exist(package):
    """Look up each option in some command of ours, or of another program named above."""
    options = set(FOREIGN)
    for program, names in COMMANDS_OF.items():
        for name in names:
            options |= options_of(program, name)
    for path, text in all_texts():
        if path.startswith(package):
            for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", text):
                assert option in options, f"{path}: {option} in {text!r}"
