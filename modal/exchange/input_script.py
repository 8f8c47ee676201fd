"""What counts of the commands in a log of LAMMPS or LIGGGHTS, its variables put in.

These programs write a line that has variables (`$E`, `${name}`, `$(formula)`) as it stands in the
script, and again each time that one is replaced. The last of these counts; where it is not there,
as in a script that never ran, the value is not known.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from modal.exchange.held import ACCELERATED, HOLDING, INTEGRATING, Fix, Run
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
    "indent": "walls of this kind are not known; only wall/gran with zplane is",
}
LOCAL = ("property/local", "pair/local", "pair/gran/local")
"""Computes whose columns a dump local may have; the last is of LIGGGHTS."""
WIDTHS = {"pos": 6, "vel": 6, "id": 3, "force": 3, "force_normal": 3, "force_tangential": 3}
WIDTHS |= {"torque": 3, "history": 3, "contactArea": 1, "delta": 1}
"""What that one writes, in this order, and how many columns each takes."""
UNASKED = ("pos", "vel", "id", "force", "torque", "history", "contactArea")
"""Of these, what it writes when none is named."""
STYLES = ("wall/gran", "property/global", "rigid", *LOCAL, *REFUSED_FIXES, *HOLDING)
"""Of the fixes and computes that count, with those that go on after a slash (`rigid/nve/small`)."""
INSERTING = ("pour", "deposit", "insert")
"""Fixes that add atoms, of which there may be fewer on the way than at the end of a run."""
INSERTED = 0
"""The number of atoms that may be there where some are inserted, as none may be yet."""
PROGRAMS = ("LAMMPS", "LIGGGHTS")
"""First words of a log."""
PROPERTIES = ("youngsModulus", "poissonsRatio", "coefficientFriction")
"""Of a material of LIGGGHTS, those that its law has."""


@dataclass
class Script:
    """What counts of the commands.

    `said` tells in a message whose words they are. `bodies` has the words of each fix rigid behind
    its style; `refused` says why of each fix that a network has nothing for, `groups` whom the
    walls and bodies of these IDs are made of; `properties` are those of LIGGGHTS' materials.
    `fixes` are all that act, `dumps` the IDs of those that write; `runs` are what was run with
    which fixes; `history` are the lines that tell who is in which group. Numbers of `atoms` that
    were printed, `created` of them in all; `whole` is False of a part of a log, where a run ends
    whose table is not there. `changed` is the last step before the law or a wall changed;
    `remarks` are what is taken where nothing tells it.
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
    fixes: dict[str, Fix] = field(default_factory=dict)
    dumps: set[str] = field(default_factory=set)
    runs: list[Run] = field(default_factory=list)
    history: list[list[str]] = field(default_factory=list)
    atoms: list[int] = field(default_factory=list)
    created: int = 0
    whole: bool = True
    changed: int = 0
    remarks: list[str] = field(default_factory=list)

    @property
    def by_type(self) -> bool:
        """Whether the law asks for types."""
        laws = {tuple(words) for _, _, *words in self.pair}
        return len(laws) > 1 or any(len(values) > 1 for values in self.properties.values())

    def refuse_other_run(self, path: str | Path, step: int, atoms: int) -> None:
        """InputError where a dump has a step or a number of atoms that no run of the log had."""
        # A job that was killed in its last run went on, nobody knows how far.
        killed = bool(self.steps) and not self.runs[-1].over
        steps = self.steps if self.whole else []
        numbers = [] if set(self.atoms) == {INSERTED} else self.atoms
        open_ends = {"step": killed, "atoms": killed and INSERTED in numbers}
        for what, has, known in (("step", step, steps), ("atoms", atoms, numbers)):
            if not known or min(known) <= has <= max(known):
                continue
            if has < min(known) or not open_ends[what]:
                said = f"{what} {has}, the runs of {self.said} {min(known)} to {max(known)}"
                do = "give the log of this dump, several parts of one in one file"
                fault(path, f"{said}: the log of another run", do, code="other_log")

    @property
    def steps(self) -> list[int]:
        """Steps that were printed."""
        return [step for run in self.runs for step in run.steps]

    def begin_run(self, length: int = 0) -> None:
        """Note a run of so many steps with the fixes of now; the one before is over."""
        if self.runs:
            self.runs[-1].over = True
        self.runs.append(Run(dict(self.fixes), bool(self.dumps), length))


def read_log(path: str | Path | None, units: str) -> Script:
    """The commands of a log that count at its end.

    `units` are the program's where the log names none. Without a log nothing is known.
    """
    if path is None:
        return Script()
    script = Script(str(path), units)
    columns: list[str] = []
    for number, words in _lines(path):
        if words[0] == "Step":
            columns = words
            if not script.runs or script.runs[-1].steps:
                script.begin_run()
        elif words[0] == "Loop":
            columns = []
        elif words[0] in PROGRAMS and words[1:2] and words[1].startswith("("):
            # Another job begins, without the fixes of the one before.
            columns = []
            script.fixes.clear()
            script.dumps.clear()
        elif columns and _is_row(words, columns):
            _read_row(script, dict(zip(columns, words, strict=True)))
            continue
        if words == ["clear"]:
            script = Script(str(path), units)
        law = len(script.pair), script.style, script.walls.copy()
        _command(script, words, f"{path}, line {number}")
        if law != (len(script.pair), script.style, script.walls):
            script.changed = [0, *script.steps][-1]
    if not script.runs:
        script.begin_run()
    for why in script.refused.values():
        raise InputError("input", why)
    return script


def _is_row(words: Sequence[str], columns: Sequence[str]) -> bool:
    """Whether words are a row of a table of steps."""
    if len(words) != len(columns) or not words[0].isdigit():
        return False
    try:
        list(map(float, words))
    except ValueError:
        return False
    return True


def _read_row(script: Script, row: Mapping[str, str]) -> None:
    """Note the step of a row, and the number of atoms where it has one."""
    script.runs[-1].steps.append(int(row["Step"]))
    if row.get("Atoms", "").isdigit():
        script.atoms.append(int(row["Atoms"]))


def _is(style: str, kind: str) -> bool:
    """Whether a style is of a kind, which may go on after a slash, as with accelerated variants."""
    return f"{style}/".startswith(f"{kind}/")


def _command(script: Script, words: list[str], where: str) -> None:
    """Note what one line changes."""
    _note_motion(script, words, where)
    _note_atoms(script, words)
    match words:
        case ["units", name]:
            script.units = name
        case ["dimension", "2"]:
            fault(where, "dimension 2", "a network has spheres that move in space")
        case ["bond_style", style, *_] if style not in ("none", "zero"):
            raise InputError("input", f"{where}: bond_style {style}", f"{REFUSED_FIXES['bond']}")
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
        case ["compute", name, _, style, *rest] if style in LOCAL:
            script.computes[name] = columns_of_liggghts(rest) if "gran" in style else rest
        case ["fix", name, _, style, *_]:
            for kind, why in REFUSED_FIXES.items():
                if _is(style, kind):
                    script.refused[name] = f"{where}: fix {style}: {why}"


def _note_motion(script: Script, words: list[str], where: str) -> None:
    """Note fixes, dumps and runs: who moves, and when."""
    match words:
        case ["fix", name, group, style, *rest]:
            script.fixes[name] = Fix(group, ACCELERATED.sub("", style), tuple(rest), where)
            if style.split("/")[0] in INSERTING:
                script.history.append(words)
        case ["unfix", name]:
            script.history.append(words)
            for kept in (script.fixes, script.walls, script.bodies, script.groups, script.refused):
                kept.pop(name, None)
        case ["dump", name, *_]:
            script.dumps.add(name)
        case ["undump", name]:
            script.dumps.discard(name)
        case ["run", length, *_] if length.isdigit():
            script.begin_run(int(length))
        case ["minimize" | "rerun", *_]:
            script.begin_run()
        case ["write_dump", *_] if script.steps:
            now = script.steps[-1]
            script.runs.append(Run(dict(script.fixes), True, 0, [now], over=True))
        case ["Loop", "time", *_]:
            if script.runs and script.runs[-1].steps:
                script.runs[-1].over = True
            else:
                script.whole = False


def _note_atoms(script: Script, words: list[str]) -> None:
    """Note numbers of atoms, and who is in which group."""
    match words:
        case ["group", _, _, *_] | [_, "atoms", "in", "group", _]:
            script.history.append(words)
        case ["read_data" | "read_restart" | "create_atoms" | "read_dump", *_]:
            script.history.append(words)
        case ["replicate", *_]:
            script.created = 0  # what it prints are all
        case ["Created", number, "atoms"] | [number, "atoms"] if number.isdigit():
            script.history.append(words)
            script.created += int(number)
            script.atoms.append(script.created)
        case ["Deleted", _, "atoms,", "new", "total", "=", number] if number.isdigit():
            script.created = int(number)
            script.atoms.append(script.created)
        case ["Loop", "time", *rest] if "with" in rest:
            behind = rest[rest.index("with") + 1 :]
            script.atoms += [int(word) for word in behind[:1] if word.isdigit()]
        case ["fix", _, _, style, *_] if style.split("/")[0] in INSERTING:
            script.atoms.append(INSERTED)


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
        if command == "fix" and INTEGRATING.fullmatch(style):
            return "$" in "".join(words[1:3])
        return "$" in style or any(_is(style, each) for each in STYLES)
    return command in COMMANDS or VARIABLE.fullmatch(command) is not None
