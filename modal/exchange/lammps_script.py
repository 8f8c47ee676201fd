"""What a log of LAMMPS, or the command line, says of units, law, walls and columns."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from modal.exchange.logged import logged_lines
from modal.formats.hdf5 import InputError

REFUSED_FIXES = {
    "rigid": "clumps are not spheres; a network knows single spheres alone",
    "bond": "bonds are no contacts that this project knows",
    "wall/gran/region": "walls of regions are not known; only zplane is",
}
STYLES = ("wall/gran", "property/local", "pair/local", *REFUSED_FIXES)
"""Of the fixes and computes that count, with those that go on after a slash (`rigid/nve/small`)."""


@dataclass
class Script:
    """What counts of the commands, and the printed stresses by step."""

    units: str = ""
    style: tuple[str, ...] = ()
    pair: list[tuple[str, ...]] = field(default_factory=list)
    walls: dict[str, tuple[str, ...]] = field(default_factory=dict)
    computes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    thermo: dict[int, dict[str, str]] = field(default_factory=dict)


def read_log(path: str | Path) -> Script:
    """The commands of a log that count at its end, and its printed stresses by step."""
    script = Script()
    names: list[str] = []
    for number, words in logged_lines(path, STYLES):
        if words[0] == "Step" and any(word.lower() == "pxx" for word in words):
            names = [word.lower() for word in words]
            continue
        if names and len(words) == len(names) and re.fullmatch(r"\d+", words[0]):
            script.thermo[int(words[0])] = dict(zip(names, words, strict=True))
            continue
        _command(script, words, f"{path}, line {number}")
    return script


def _command(script: Script, words: list[str], where: str) -> None:
    """What one command changes."""
    match words:
        case ["units", name]:
            script.units = name
        case ["pair_style", *style] if style:
            # LAMMPS keeps the coefficients where the same style is only given other arguments.
            if script.style[:1] != (style[0],):
                script.pair = []
            script.style = tuple(style)
        case ["pair_coeff", *rest] if len(rest) >= 2:
            script.pair.append(tuple(rest))
        case ["fix", name, _, "wall/gran", *rest]:
            script.walls[name] = tuple(rest)
        case ["unfix", name]:
            script.walls.pop(name, None)
        case ["compute", name, _, ("property/local" | "pair/local"), *rest]:
            script.computes[name] = tuple(rest)
        case ["fix", _, _, style, *_]:
            for kind, why in REFUSED_FIXES.items():
                if f"{style}/".startswith(f"{kind}/"):
                    raise InputError(f"{where}: fix {style}: {why}")


def typed_pair(line: str) -> Script:
    """The script that --pair alone says: one law for all types."""
    words = line.split()
    if not words:
        raise InputError("--pair: it is empty; give the style and its coefficients, as in LAMMPS")
    if words[0].startswith("gran/"):
        return Script(style=tuple(words), pair=[("*", "*")])
    return Script(style=(words[0],), pair=[("*", "*", *words[1:])])
