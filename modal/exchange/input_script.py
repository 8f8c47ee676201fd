"""Read the commands that matter from a log of LAMMPS or LIGGGHTS, with variables replaced.

These programs print a line with variables (`$E`, `${name}`, `$(formula)`) first as it stands in the
script, then again each time that a variable is replaced. The last of these lines is used. In a
script that never ran, this line is absent, and the value is not known.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from modal.exchange.held import ACCELERATED, HOLDING, INTEGRATING, Fix, Run
from modal.exchange.lines import Lines
from modal.exchange.refusals import Refusal, refuse
from modal.exchange.words import Words

VARIABLE = re.compile(r"\$(?:\{[^}]*\}?|\(.*\)|\w)", re.ASCII)
"""Pattern of a variable in a line of input."""
QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")
"""Pattern of a text in quotes, in which variables stay as they are; no line with quotes matters
here."""
COMMANDS = ("units", "dimension", "pair_style", "pair_coeff", "bond_style", "unfix")
"""Commands that are read, beside fixes, computes and `neigh_modify exclude`."""
NO_BONDS = "bonds are no contacts that this project knows"
NO_OTHER_WALLS = "walls of this kind are not known; only wall/gran with zplane is"
REFUSED_FIXES = {
    "multisphere": "clumps of LIGGGHTS are not known; pack single spheres",
    "bond": NO_BONDS,
    "wall": NO_OTHER_WALLS,
    "indent": NO_OTHER_WALLS,
}
"""Fixes that a network cannot represent, by their styles, and the reason."""
LOCAL_COMPUTES = ("property/local", "pair/local", "pair/gran/local")
"""Computes whose columns a dump local may have; the last one is of LIGGGHTS."""
LIGGGHTS_WIDTHS = {
    "pos": 6,
    "vel": 6,
    "id": 3,
    "force": 3,
    "force_normal": 3,
    "force_tangential": 3,
    "torque": 3,
    "history": 3,
    "contactArea": 1,
    "delta": 1,
}
"""Values that `pair/gran/local` writes, in this order, and the number of columns of each."""
LIGGGHTS_DEFAULTS = ("pos", "vel", "id", "force", "torque", "history", "contactArea")
"""Values that `pair/gran/local` writes if none is named."""
STYLES = ("wall/gran", "property/global", "rigid", *LOCAL_COMPUTES, *REFUSED_FIXES, *HOLDING)
"""Styles of fixes and computes that are read, also with further words after a slash
(`rigid/nve/small`)."""
INSERTING_FIXES = ("pour", "deposit", "insert")
"""Fixes that add atoms: during a run there may be fewer atoms than at its end."""
MIN_ATOMS_DURING_INSERTION = 0
"""Smallest number of atoms while atoms are inserted: none may exist at first."""
PROGRAMS = ("LAMMPS", "LIGGGHTS")
"""First words of the log of each program."""
MATERIAL_PROPERTIES = ("youngsModulus", "poissonsRatio", "coefficientFriction")
"""Properties of a material of LIGGGHTS that its law depends on."""
MAX_QUOTED_COMMAND = 80
"""Largest number of characters of a command that a message quotes."""


class Exclusion(NamedTuple):
    """A `neigh_modify exclude`, whose pairs of atoms have no contact.

    style: how pairs are chosen. words: the two words after the style. place: file and line.
    """

    style: str
    words: tuple[str, ...]
    place: str


@dataclass
class Script:
    """The settings of a log at its end, after all its commands.

    Attributes
    ----------
    place : str
        The file or the option that the law comes from, for messages.
    units : str
        Name of the system of units; empty if no line names it.
    style : tuple of str
        Words of pair_style.
    pair_coefficients : list of tuples of str
        Words of each pair_coeff.
    walls, bodies : dict
        Words of the fixes wall/gran and rigid after their styles, by ID.
    computes : dict
        Columns of the computes that a dump local may have, by ID.
    refused : dict
        Refusals of fixes that a network cannot represent, by ID.
    groups : dict
        Groups of the walls and bodies, by ID.
    properties : dict
        Material properties of LIGGGHTS by name.
    exclusions : list of Exclusion
        Pairs of atoms that have no contact.
    fixes : dict
        All fixes, by ID.
    dumps : set of str
        IDs of the dumps.
    runs : list of Run
        The runs so far.
    history : list of words
        Lines that define groups or create atoms.
    atoms : list of int
        Numbers of atoms that were printed.
    created : int
        Number of atoms that were created so far.
    has_all_tables : bool
        False for a truncated log, in which the table of a run is absent.
    changed : int
        Last step before the law or a wall changed.
    place_of_plane : str
        File and line of `dimension 2`; empty for motion in three dimensions.
    remarks : list of str
        Assumptions where the log says nothing.
    """

    place: str = "--pair"
    units: str = ""
    style: tuple[str, ...] = ()
    pair_coefficients: list[tuple[str, ...]] = field(default_factory=list)
    walls: dict[str, tuple[str, ...]] = field(default_factory=dict)
    bodies: dict[str, tuple[str, ...]] = field(default_factory=dict)
    computes: dict[str, Sequence[str]] = field(default_factory=dict)
    refused: dict[str, Refusal] = field(default_factory=dict)
    groups: dict[str, str] = field(default_factory=dict)
    properties: dict[str, list[float]] = field(default_factory=dict)
    exclusions: list[Exclusion] = field(default_factory=list)
    fixes: dict[str, Fix] = field(default_factory=dict)
    dumps: set[str] = field(default_factory=set)
    runs: list[Run] = field(default_factory=list)
    history: list[list[str]] = field(default_factory=list)
    atoms: list[int] = field(default_factory=list)
    created: int = 0
    has_all_tables: bool = True
    changed: int = 0
    place_of_plane: str = ""
    remarks: list[str] = field(default_factory=list)

    @property
    def depends_on_type(self) -> bool:
        """Tell whether the law depends on the types of spheres."""
        laws = {tuple(words) for _, _, *words in self.pair_coefficients}
        return len(laws) > 1 or any(len(values) > 1 for values in self.properties.values())

    def refuse_other_run(self, path: str | Path, step: int, atoms: int) -> None:
        """Raise InputError if no run of the log had the step and the number of atoms of a dump."""
        # A job that was killed in its last run may have gone on for an unknown time.
        was_killed = bool(self.steps) and not self.runs[-1].is_over
        if self.has_all_tables:
            self._refuse_outside(path, "step", step, self.steps, may_exceed=was_killed)
        if set(self.atoms) != {MIN_ATOMS_DURING_INSERTION}:
            inserts = MIN_ATOMS_DURING_INSERTION in self.atoms
            self._refuse_outside(
                path, "atoms", atoms, self.atoms, may_exceed=was_killed and inserts
            )

        self._refuse_part(path, step, atoms)

    def _refuse_part(self, path: str | Path, step: int, atoms: int) -> None:
        """Raise InputError if the log printed, at the step of the dump, another number of atoms."""
        runs = [run for run in self.runs if step in run.steps]
        printed = {run.atoms.get(step, atoms) for run in runs}
        if printed and atoms not in printed:
            numbers = " or ".join(map(str, sorted(printed)))
            refuse(
                path,
                "part_of_atoms",
                f"{atoms} spheres, and {self.place} has {numbers} at step {step}",
                "a dump of a group, or of atoms above a threshold, lacks contacts",
                "dump all (dump ID all custom ...), or give the log of this dump",
            )

    def _refuse_outside(
        self, path: str | Path, name: str, number: int, printed: Sequence[int], *, may_exceed: bool
    ) -> None:
        """Raise InputError for a number of the dump outside the range that the runs printed."""
        if not printed or min(printed) <= number <= max(printed):
            return
        if number > max(printed) and may_exceed:
            return
        refuse(
            path,
            "other_log",
            f"{name} {number}, the runs of {self.place} {min(printed)} to {max(printed)}",
            "the log of another run",
            "give the log of this dump, several parts of one in one file",
        )

    @property
    def steps(self) -> list[int]:
        """Return the steps that were printed."""
        return [step for run in self.runs for step in run.steps]

    def begin_run(self, length: int = 0) -> None:
        """Add a run of this many steps with the present fixes; the previous run is over."""
        if self.runs:
            self.runs[-1].is_over = True
        self.runs.append(Run(dict(self.fixes), bool(self.dumps), length))


def read_log(path: str | Path | None, units: str) -> Script:
    """Return the settings after all commands of a log; without a log, an empty script.

    `units` is the program's default, for a log that names no units. Raises InputError for a fix
    that a network cannot represent, and for variables without a value.
    """
    if path is None:
        return Script()
    script = Script(str(path), units)
    columns: list[str] = []
    for number, words in _read_commands(path):
        if words[0] == "Step":
            columns = words
            if not script.runs or script.runs[-1].steps:
                script.begin_run()
        elif words[0] == "Loop":
            columns = []
        elif words[0] in PROGRAMS and words[1:2] and words[1].startswith("("):
            # Another job begins, without the fixes of the previous one.
            columns = []
            script.fixes.clear()
            script.dumps.clear()
        elif columns and _is_row(words, columns):
            _read_row(script, dict(zip(columns, words, strict=True)))
            continue
        if words == ["clear"]:
            script = Script(str(path), units)
        law_before = (len(script.pair_coefficients), script.style, script.walls.copy())
        _apply_command(script, words, f"{path}, line {number}")
        if law_before != (len(script.pair_coefficients), script.style, script.walls):
            script.changed = script.steps[-1] if script.steps else 0
    if not script.runs:
        script.begin_run()
    for refusal in script.refused.values():
        refusal.raise_error()
    return script


def _is_row(words: Sequence[str], columns: Sequence[str]) -> bool:
    """Tell whether words are a row of a table of steps."""
    if len(words) != len(columns) or not words[0].isdigit():
        return False
    try:
        for word in words:
            float(word)
    except ValueError:
        return False
    return True


def _read_row(script: Script, row: Mapping[str, str]) -> None:
    """Store the time step of a row of thermodynamic output, and its number of atoms if given."""
    run = script.runs[-1]
    step = int(row["Step"])
    run.steps.append(step)
    if row.get("Atoms", "").isdigit():
        run.atoms[step] = int(row["Atoms"])
        script.atoms.append(run.atoms[step])


def _is_of_kind(style: str, kind: str) -> bool:
    """Tell whether a style is of a kind; the style may have further words after a slash."""
    return f"{style}/".startswith(f"{kind}/")


def _apply_command(script: Script, words: list[str], place: str) -> None:
    """Apply one command to the settings of the script."""
    _note_motion(script, words, place)
    _note_atoms(script, words)
    _note_exclusions(script, words, place)
    match words:
        case ["units", name]:
            script.units = name
        case ["dimension", number]:
            script.place_of_plane = place if number == "2" else ""
        case ["bond_style", style, *_] if style not in ("none", "zero"):
            refuse(place, "bonds", f"bond_style {style}", NO_BONDS)
        case ["pair_style", *style] if style:
            # The coefficients are kept if the same style only has other arguments.
            if script.style[:1] != (style[0],):
                script.pair_coefficients = []
            script.style = tuple(style)
        case ["pair_coeff", *rest] if len(rest) >= 2:
            script.pair_coefficients.append(tuple(rest))
        case ["fix", _, _, "property/global", name, kind, *rest] if name in MATERIAL_PROPERTIES:
            values = rest[1:] if kind == "peratomtypepair" else rest
            line = Words(words, place, "write numbers there")
            script.properties[name] = line.to_numbers(name, values)
        case ["fix", name, group, style, *rest] if _is_of_kind(style, "wall/gran"):
            script.walls[name] = tuple(rest)
            script.groups[name] = group
        case ["fix", name, group, style, *rest] if _is_of_kind(style, "rigid"):
            script.bodies[name] = tuple(rest)
            script.groups[name] = group
        case ["compute", name, _, style, *rest] if style in LOCAL_COMPUTES:
            script.computes[name] = list_liggghts_columns(rest) if "gran" in style else rest
        case ["fix", _, _, "adapt", *rest] if "pair" in rest:
            remedy = "type the law at the step of the dump (--pair) in place of the log"
            refuse(
                place, "changing_law", "fix adapt pair changes the law of contact", remedy=remedy
            )
        case ["fix", name, _, style, *_]:
            for kind, reason in REFUSED_FIXES.items():
                if _is_of_kind(style, kind):
                    script.refused[name] = Refusal(place, "unknown_fix", f"fix {style}", reason)


def _note_motion(script: Script, words: list[str], place: str) -> None:
    """Record fixes, dumps and runs, which show which atoms move when."""
    match words:
        case ["fix", name, group, style, *rest]:
            script.fixes[name] = Fix(group, ACCELERATED.sub("", style), tuple(rest), place)
            if style.split("/")[0] in INSERTING_FIXES:
                script.history.append(words)
        case ["unfix", name]:
            script.history.append(words)
            script.fixes.pop(name, None)
            script.walls.pop(name, None)
            script.bodies.pop(name, None)
            script.groups.pop(name, None)
            script.refused.pop(name, None)
        case ["dump", name, *_]:
            script.dumps.add(name)
        case ["undump", name]:
            script.dumps.discard(name)
        case ["run", length, *_] if length.isdigit():
            script.begin_run(int(length))
        case ["minimize" | "rerun", *_]:
            script.begin_run()
        case ["write_dump", *_] if script.steps:
            step = script.steps[-1]
            script.runs.append(Run(dict(script.fixes), True, 0, [step], is_over=True))
        case ["Loop", "time", *_]:
            if script.runs and script.runs[-1].steps:
                script.runs[-1].is_over = True
            else:
                script.has_all_tables = False


def _note_atoms(script: Script, words: list[str]) -> None:
    """Store printed numbers of atoms, and lines that define groups."""
    match words:
        case ["group", _, _, *_] | [_, "atoms", "in", "group", _]:
            script.history.append(words)
        case ["read_data" | "read_restart" | "create_atoms" | "read_dump", *_]:
            script.history.append(words)
        case ["replicate", *_]:
            script.created = 0  # the number that follows is that of all atoms
        case ["Created", number, "atoms"] | [number, "atoms"] if number.isdigit():
            script.history.append(words)
            script.created += int(number)
            script.atoms.append(script.created)
        case ["Deleted", _, "atoms,", "new", "total", "=", number] if number.isdigit():
            script.created = int(number)
            script.atoms.append(script.created)
        case ["Loop", "time", *rest] if "with" in rest:
            for word in rest[rest.index("with") + 1 :][:1]:
                if word.isdigit():
                    script.atoms.append(int(word))
                    _store_last_number(script, int(word))
        case ["fix", _, _, style, *_] if style.split("/")[0] in INSERTING_FIXES:
            script.atoms.append(MIN_ATOMS_DURING_INSERTION)


def _store_last_number(script: Script, number: int) -> None:
    """Store the number of atoms at the end of a run."""
    if script.runs and script.runs[-1].steps:
        run = script.runs[-1]
        run.atoms[run.steps[-1]] = number


def _note_exclusions(script: Script, words: list[str], place: str) -> None:
    """Store the pairs that `neigh_modify exclude` leaves without contact."""
    if words[0] != "neigh_modify":
        return
    for k, (word, style) in enumerate(zip(words, words[1:], strict=False)):
        if word == "exclude" and style == "none":
            script.exclusions.clear()
        elif word == "exclude":
            script.exclusions.append(Exclusion(style, tuple(words[k + 2 : k + 4]), place))


def list_liggghts_columns(values: Sequence[str] = ()) -> list[str]:
    """Return the columns of `pair/gran/local` with these values; the order of `values` is free.

    >>> list_liggghts_columns(["delta", "id"])
    ['id1', 'id2', 'id3', 'delta1']
    """
    values = values or LIGGGHTS_DEFAULTS
    columns = []
    for name, width in LIGGGHTS_WIDTHS.items():
        if name in values:
            columns += [f"{name}{k}" for k in range(1, width + 1)]
    return columns


class _UnreplacedLine(NamedTuple):
    """A line with variables: its number, and the pattern of the line with their values."""

    number: int
    replaced: re.Pattern[str]


def _read_commands(path: str | Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number, from 1, and the words of each line without variables and comments.

    Raises InputError for a line that may matter and contains a variable without a value.
    """
    lines = Lines(path)
    unreplaced: dict[str, _UnreplacedLine] = {}
    printed = None
    for number, line in lines:
        text = line.split("#")[0]
        while text.rstrip().endswith("&"):
            _, continuation = next(lines, (0, ""))
            text = text.rstrip()[:-1] + continuation
        words = text.split()
        text = " ".join(words)
        for raw, waiting in list(unreplaced.items()):
            if waiting.replaced.fullmatch(text):
                del unreplaced[raw]
        expected_print = printed
        printed = None
        if not words or (expected_print and expected_print.fullmatch(text)):
            continue
        if "$" not in text or not VARIABLE.search(QUOTED.sub("", text)):
            if words[0] == "print":  # what it prints may look like a command
                printed = _match_replaced(" ".join(words[1:]).strip("\"'"))
            yield number, words
        elif _may_count(words):
            unreplaced[text] = _UnreplacedLine(number, _match_replaced(text))
    for raw, waiting in unreplaced.items():
        variables = " ".join(VARIABLE.findall(raw))
        refuse(
            path,
            "unknown_variable",
            f"{variables} has no value in this file",
            raw[:MAX_QUOTED_COMMAND],
            "give the log of the run, or write the value in its place",
            line=waiting.number,
        )


def _match_replaced(text: str) -> re.Pattern[str]:
    """Return a pattern that matches a line once its variables are replaced, perhaps by nothing."""
    parts = [re.escape(part.strip()) for part in VARIABLE.split(text)]
    return re.compile(r"\s*.*".join(parts))


def _may_count(words: list[str]) -> bool:
    """Tell whether a line with variables may be one of the commands that are interpreted."""
    command = words[0]
    style = words[3] if len(words) > 3 else ""
    if command == "fix" and INTEGRATING.fullmatch(style):
        return "$" in "".join(words[1:3])
    if command in ("fix", "compute"):
        return "$" in style or any(_is_of_kind(style, kind) for kind in STYLES)
    if command == "neigh_modify":
        return "exclude" in words
    return command in COMMANDS or VARIABLE.fullmatch(command) is not None
