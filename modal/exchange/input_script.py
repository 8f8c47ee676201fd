"""What counts of the commands in a log of LAMMPS or LIGGGHTS, its variables put in.

These programs write a line that has variables (`$E`, `${name}`, `$(formula)`) as it stands in the
script, and again each time that one is replaced. The last of these counts; where it is not there,
as in a script that never ran, the value is not known.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from modal.exchange.text import Words, fault, text_lines
from modal.tools.errors import InputError

VARIABLE = re.compile(r"\$(?:\{[^}]*\}?|\(.*\)|\w)", re.ASCII)
QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")
"""Variables in quotes stay as they are; a line of such a kind counts for nothing here."""
COMMANDS = ("units", "dimension", "pair_style", "pair_coeff", "bond_style", "unfix")
REFUSED_FIXES = {
    "multisphere": "clumps of LIGGGHTS are not known; pack single spheres",
    "bond": "bonds are no contacts that this project knows",
    "wall": "walls of this kind are not known; only wall/gran with zplane is",
    "freeze": "frozen spheres; a network knows free ones alone: make them a wall",
}
LOCAL = ("property/local", "pair/local", "pair/gran/local")
"""Computes whose columns a dump local may have; the last is of LIGGGHTS."""
WIDTHS = {"pos": 6, "vel": 6, "id": 3, "force": 3, "force_normal": 3, "force_tangential": 3}
WIDTHS |= {"torque": 3, "history": 3, "contactArea": 1, "delta": 1}
"""What that one writes, in this order, and how many columns each takes."""
UNASKED = ("pos", "vel", "id", "force", "torque", "history", "contactArea")
"""Of these, what it writes when none is named."""
STYLES = ("wall/gran", "property/global", "rigid", *LOCAL, *REFUSED_FIXES)
"""Of the fixes and computes that count, with those that go on after a slash (`rigid/nve/small`)."""
INSERTING = ("pour", "deposit", "insert")
"""Fixes that add atoms, of which there may be fewer on the way than at the end of a run."""
PROPERTIES = ("youngsModulus", "poissonsRatio", "coefficientFriction")
"""Of a material of LIGGGHTS, those that its law has."""


@dataclass
class Script:
    """What counts of the commands.

    `said` tells in a message whose words they are. `bodies` has the words of each fix rigid behind
    its style; `refused` says why of each fix that a network has nothing for, `groups` whom the
    walls and bodies of these IDs are made of; `properties` are those of LIGGGHTS' materials.
    `steps` and numbers of `atoms` that were printed, and how many more `tables` of steps than runs
    are over; `changed` is the last step before the law or a wall changed; `remarks` are what is
    taken where nothing tells it.
    """

    said: str = "--pair"
    units: str = ""
    style: tuple[str, ...] = ()
    pair: list[tuple[str, ...]] = field(default_factory=list)
    walls: dict[str, tuple[str, ...]] = field(default_factory=dict)
    bodies: dict[str, tuple[str, ...]] = field(default_factory=dict)
    computes: dict[str, Sequence[str]] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    groups: dict[str, str] = field(default_factory=dict)
    properties: dict[str, list[float]] = field(default_factory=dict)
    steps: list[int] = field(default_factory=list)
    atoms: list[int] = field(default_factory=list)
    tables: int = 0
    changed: int = 0
    remarks: list[str] = field(default_factory=list)

    @property
    def by_type(self) -> bool:
        """Whether the law asks for types."""
        laws = {tuple(words) for _, _, *words in self.pair}
        return len(laws) > 1 or any(len(values) > 1 for values in self.properties.values())

    def refuse_other_run(self, path: str | Path, step: int, atoms: int) -> None:
        """InputError where a dump has a step or a number of atoms that no run of the log had."""
        steps = self.steps if self.tables >= 0 else []
        for what, has, told in (("step", step, steps), ("atoms", atoms, self.atoms)):
            if told and not min(told) <= has <= max(told):
                said = f"{what} {has}, the runs of {self.said} {min(told)} to {max(told)}"
                do = "give the log of this dump, several parts of one in one file"
                fault(path, f"{said}: the log of another run", do)


def read_log(path: str | Path | None, units: str) -> Script:
    """The commands of a log that count at its end.

    `units` are the program's where the log names none. Without a log nothing is known.
    """
    if path is None:
        return Script()
    script, printed = Script(str(path), units), False
    for number, words in _lines(path):
        printed = words[0] == "Step" or (printed and words[0] != "Loop")
        if printed and words[0].isdigit():
            script.steps.append(int(words[0]))
        script.tables += (words[0] == "Step") - (words[:2] == ["Loop", "time"])
        if words == ["clear"]:
            script = Script(str(path), units)
        law = len(script.pair), script.style, script.walls.copy()
        _command(script, words, f"{path}, line {number}")
        if law != (len(script.pair), script.style, script.walls):
            script.changed = [0, *script.steps][-1]
    for why in script.refused.values():
        raise InputError(why)
    return script


def _is(style: str, kind: str) -> bool:
    """Whether a style is of a kind, which may go on after a slash, as with accelerated variants."""
    return f"{style}/".startswith(f"{kind}/")


def _command(script: Script, words: list[str], where: str) -> None:
    """What one command changes."""
    match words:
        case ["units", name]:
            script.units = name
        case (
            ["Loop", "time", *_, number, "atoms"] | ["Created", number, "atoms"] | [number, "atoms"]
        ):
            script.atoms += [int(number)] if number.isdigit() else []
        case ["fix", _, _, style, *_] if style.split("/")[0] in INSERTING:
            script.atoms.append(0)
        case ["dimension", "2"]:
            fault(where, "dimension 2", "a network has spheres that move in space")
        case ["bond_style", style, *_] if style not in ("none", "zero"):
            raise InputError(f"{where}: bond_style {style}: {REFUSED_FIXES['bond']}")
        case ["pair_style", *style] if style:
            # The coefficients are kept where the same style is only given other arguments.
            if script.style[:1] != (style[0],):
                script.pair = []
            script.style = tuple(style)
        case ["pair_coeff", *rest] if len(rest) >= 2:
            script.pair.append(tuple(rest))
        case ["fix", _, _, "property/global", name, kind, *rest] if name in PROPERTIES:
            listed = rest[1:] if kind == "peratomtypepair" else rest
            said = Words(words, where, "write numbers there")
            script.properties[name] = said.converted(name, listed)
        case ["fix", name, group, style, *rest] if _is(style, "wall/gran"):
            script.walls[name], script.groups[name] = tuple(rest), group
        case ["fix", name, group, style, *rest] if _is(style, "rigid"):
            script.bodies[name], script.groups[name] = tuple(rest), group
        case ["unfix", name]:
            for kept in (script.walls, script.bodies, script.groups, script.refused):
                kept.pop(name, None)
        case ["compute", name, _, style, *rest] if style in LOCAL:
            script.computes[name] = columns_of_liggghts(rest) if "gran" in style else rest
        case ["fix", name, _, style, *_]:
            for kind, why in REFUSED_FIXES.items():
                if _is(style, kind):
                    script.refused[name] = f"{where}: fix {style}: {why}"


def columns_of_liggghts(asked: Sequence[str] = ()) -> list[str]:
    """The columns of `pair/gran/local` whose values are `asked` for, in any order."""
    asked = asked or UNASKED
    return [f"{name}{k + 1}" for name, n in WIDTHS.items() if name in asked for k in range(n)]


def _lines(path: str | Path) -> Iterator[tuple[int, list[str]]]:
    """Number, from 1, and words of each line that has no variable left, comments left out.

    InputError for a line that may count, and whose variables have no value.
    """
    lines = text_lines(path)
    waiting: dict[str, tuple[int, re.Pattern[str]]] = {}
    printed = None
    for number, line in lines:
        text = line.split("#")[0]
        while text.rstrip().endswith("&"):
            text = text.rstrip()[:-1] + next(lines, (0, ""))[1]
        words = text.split()
        text = " ".join(words)
        waiting = {raw: at for raw, at in waiting.items() if not at[1].fullmatch(text)}
        said, printed = printed, None
        if not words or (said and said.fullmatch(text)):
            continue
        if "$" not in text or not VARIABLE.search(QUOTED.sub("", text)):
            if words[0] == "print":  # what it prints may look like a command
                printed = _replaced(" ".join(words[1:]).strip("\"'"))
            yield number, words
        elif _counts(words):
            waiting[text] = number, _replaced(text)
    for raw, (number, _) in waiting.items():
        what = f"{' '.join(VARIABLE.findall(raw))} has no value in this file: {raw[:80]}"
        fault(path, what, "give the log of the run, or write the value in its place", number)


def _replaced(text: str) -> re.Pattern[str]:
    """What a line becomes when its variables are put in, which may be empty; blanks are single."""
    parts = [re.escape(part.strip()) for part in VARIABLE.split(text)]
    return re.compile(r"\s*.*".join(parts))


def _counts(words: list[str]) -> bool:
    """Whether a line with variables may be one that counts."""
    command, style = words[0], (words[3:4] or [""])[0]
    if command in ("fix", "compute"):
        return "$" in style or any(_is(style, each) for each in STYLES)
    return command in COMMANDS or VARIABLE.fullmatch(command) is not None
