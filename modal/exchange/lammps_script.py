"""What a log of LAMMPS, or the command line, says of units, law, walls and columns."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from modal.exchange.lammps_law import without_suffix
from modal.exchange.logged import logged_lines
from modal.tools.errors import InputError

REFUSED_FIXES = {
    "rigid": "clumps are not spheres; a network knows single spheres alone",
    "bond": "bonds are no contacts that this project knows",
    "wall": "walls of this kind are not known; only wall/gran with zplane is",
    "freeze": "frozen spheres; a network knows free ones alone: make them a wall",
}
STYLES = ("wall/gran", "property/local", "pair/local", *REFUSED_FIXES)
"""Of the fixes and computes that count, with those that go on after a slash (`rigid/nve/small`)."""


@dataclass
class Script:
    """What counts of the commands, and the printed stresses by step.

    `refused` says why of each fix that a network has nothing for, `groups` whom the walls of these
    IDs push; `changed` is the last step that was printed before the law or a wall changed, `since`
    are those printed after it.
    """

    units: str = ""
    style: tuple[str, ...] = ()
    pair: list[tuple[str, ...]] = field(default_factory=list)
    walls: dict[str, tuple[str, ...]] = field(default_factory=dict)
    computes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    groups: dict[str, str] = field(default_factory=dict)
    thermo: dict[int, dict[str, str]] = field(default_factory=dict)
    changed: int = -1
    since: set[int] = field(default_factory=set)


def read_log(path: str | Path) -> Script:
    """The commands of a log that count at its end, and its printed stresses by step."""
    script = Script()
    names: list[str] = []
    last = -1
    for number, words in logged_lines(path, STYLES):
        if words[0] == "Step":
            names = [word.lower() for word in words]
        elif names and len(words) == len(names) and re.fullmatch(r"\d+", words[0]):
            last = int(words[0])
            printed = dict(zip(names, words, strict=True))
            script.thermo[last] = script.thermo.get(last, {}) | printed
            script.since.add(last)
        elif words == ["clear"]:
            script = Script(thermo=script.thermo, changed=last)
        else:
            before = script.style, list(script.pair), dict(script.walls)
            _command(script, words, f"{path}, line {number}")
            if before != (script.style, script.pair, script.walls):
                script.changed, script.since = last, set()
    for why in script.refused.values():
        raise InputError(why)
    return script


def _command(script: Script, words: list[str], where: str) -> None:
    """What one command changes."""
    match words:
        case ["units", name]:
            script.units = name
        case ["dimension", "2"]:
            raise InputError(f"{where}: dimension 2; a network has spheres that move in space")
        case ["bond_style", style, *_] if style not in ("none", "zero"):
            raise InputError(f"{where}: bond_style {style}: {REFUSED_FIXES['bond']}")
        case ["pair_style", *style] if style:
            # LAMMPS keeps the coefficients where the same style is only given other arguments.
            if script.style[:1] != (style[0],):
                script.pair = []
            script.style = tuple(style)
        case ["pair_coeff", *rest] if len(rest) >= 2:
            script.pair.append(tuple(rest))
        case ["fix", name, group, style, *rest] if without_suffix(style) == "wall/gran":
            script.walls[name] = tuple(rest)
            script.groups[name] = group
        case ["unfix", name]:
            script.walls.pop(name, None)
            script.groups.pop(name, None)
            script.refused.pop(name, None)
        case ["compute", name, _, ("property/local" | "pair/local"), *rest]:
            script.computes[name] = tuple(rest)
        case ["fix", name, _, style, *_]:
            for kind, why in REFUSED_FIXES.items():
                if f"{style}/".startswith(f"{kind}/"):
                    script.refused[name] = f"{where}: fix {style}: {why}"


def typed_pair(line: str) -> Script:
    """The script that --pair alone says: one law for all types."""
    words = line.split()
    if not words:
        raise InputError("--pair: it is empty; give the style and its coefficients, as in LAMMPS")
    if words[0].startswith("gran/"):
        return Script(style=tuple(words), pair=[("*", "*")])
    return Script(style=(words[0],), pair=[("*", "*", *words[1:])])
