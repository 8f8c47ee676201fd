"""LAMMPS' packings: dump custom, dump local, and the log that says what the columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`. Spheres of a `fix rigid` become its bodies.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange.dump import of_liggghts, opened, packing_of
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import Script, read_log
from modal.exchange.lammps_contacts import TYPED, contacts_of, walls_of
from modal.exchange.lammps_law import law_of_pairs
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.registry import File, Option
from modal.exchange.rows import fault, read_lines
from modal.exchange.words import Words
from modal.packing.rigid_bodies import Bodies
from modal.tools.errors import InputError

NAME = "LAMMPS"
OPTIONS = {
    "contacts": Option("dump local"),
    "log": Option("the log: units, law, walls, columns"),
    "pair": Option("the contact law as it stands behind pair_style", "LINE"),
    "wall": Option("the walls as they stand behind fix ... wall/gran", "LINE"),
    "step": Option("which one, of a dump with several times", "N", int),
    "scales": Option("the file's units of length, mass and time in SI", ("M", "KG", "S"), float),
    "bodies": Option("masses and tensors of fix rigid, as write_restart writes them (*.rigid)"),
}
STRESS = ("pxx", "pyy", "pzz")
BODY, OF_A_BODY = "a rigid body (number, mass, centre, ixx iyy izz ixy ixz iyz ...)", 11
"""What a row of fix rigid tells, and how many of its numbers count."""


def sniff(file: File) -> bool:
    """A text dump, unless its log or law is of LIGGGHTS."""
    return file.head.startswith(b"ITEM:") and not of_liggghts(file)


def read(path: Path, **given: Any) -> ImportResult:
    """A packing of LAMMPS."""
    contacts, log, pair, wall, bodies = map(
        given.get, ("contacts", "log", "pair", "wall", "bodies")
    )
    # LAMMPS' own units, where a log names none, are lj.
    script = read_log(log, "lj")
    wall_fixes = tuple(script.walls)
    if pair:
        script.said, (script.style, script.pair) = "--pair", typed_pair(pair)
    if wall:
        script.walls = {TYPED: tuple(wall.split())}
    if not script.style:
        raise InputError(
            f"{path}: no law of contact is known; `import` it with the log (--log log.lammps) or "
            'the line (--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3")'
        )
    frame, units, assumed = opened(path, given, script)
    of_pairs, walls = law_of_pairs(script, units), walls_of(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        return of_pairs(a, b) if a >= 0 else walls[a].law

    models = {tuple(words) for _, _, *words in script.pair}
    body, more, whole = column_of_bodies(script, bodies is not None)
    if frame.rows.has("mol") and not log:
        do = "give the log (--log), which says so, or leave mol out of the dump"
        raise InputError(f"{path}: spheres of one mol may be one rigid body or bonded; {do}")
    planes = {code: each.z for code, each in walls.items()}
    packing = packing_of(frame, units, planes, typed=len(models) > 1, body=body)
    if whole and packing.body is not None and (packing.body < 1).any():
        do = "make single spheres no part of its group"
        raise InputError(f"{path}: a {body} of 0, which is one more body to fix rigid; {do}")
    for name in script.walls:
        group = script.groups.get(name, "all")
        if contacts is None and wall is None and group != "all":
            do = "give the contacts that it has (--contacts), or type the walls (--wall)"
            raise InputError(f"{log}: fix {name} pushes the group {group} alone; {do}")
    touching, meant = contacts_of(
        frame, packing, contacts, script.computes, units, walls, wall_fixes
    )
    found = network_of(packing, touching, law_of, read_bodies(bodies, units) if bodies else None)
    found.told["assumed"] = assumed + more + meant
    found.remarks += script.remark_on_changes(frame.step)
    printed = script.thermo.get(frame.step, {}) if log else {}
    if all(name in printed for name in STRESS):
        found.told["printed_stress_pa"] = [units.pressure * float(printed[name]) for name in STRESS]
    return found


def typed_pair(line: str) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The style and coefficients that --pair says: one law for all types."""
    words = line.split()
    if not words:
        raise InputError("--pair: it is empty; give the style and its coefficients, as in LAMMPS")
    if words[0].startswith("gran/"):
        return tuple(words), [("*", "*")]
    return (words[0],), [("*", "*", *words[1:])]


def column_of_bodies(script: Script, told: bool) -> tuple[str, list[str], bool]:
    """The column of the dump that numbers the rigid bodies, or none, and what is assumed.

    Last, whether 0 is a number as all others are: of fix rigid for all spheres. `told` says that
    their masses are in a file of their own.
    """
    if not script.bodies:
        if told:
            raise InputError("--bodies: no fix rigid is known; give the log that has it (--log)")
        return "", [], False
    if len(script.bodies) > 1:
        raise InputError(
            f"{script.said}: several fix rigid; give all bodies one fix and one column"
        )
    ((name, words),) = script.bodies.items()
    if words[:1] == ("molecule",):
        column = "mol"
    elif words[:1] == ("custom",) and words[1].startswith("i_"):
        column = words[1]
    else:
        raise InputError(
            f"{script.said}: fix {name} rigid {' '.join(words[:1])}: which spheres are one body is "
            "not in a dump; make it rigid molecule, or custom i_NAME, and dump mol or i_NAME"
        )
    if "infile" in words and not told:
        raise InputError(
            f"{script.said}: fix {name} rigid has masses of its own (infile); give those of this "
            "step, as write_restart writes them (--bodies FILE.rigid)"
        )
    whole = script.groups[name] == "all"
    return column, [f"spheres of one {column} are a rigid body (fix {name}), 0 is none"], whole


def read_bodies(path: str | Path, units: Units) -> Bodies:
    """Masses, centres and tensors of rigid bodies, in the format of `fix rigid ... infile`."""
    do = "give the file that write_restart wrote (*.rigid)"
    lines = enumerate((line.split("#")[0].split() for line in read_lines(path)), 1)
    rows = [Words(words, f"{path}, line {n}", do) for n, words in lines if len(words) > 1]
    if not rows:
        fault(path, "no rigid bodies", do)
    table = np.array([row.in_turn(BODY, OF_A_BODY) for row in rows])
    table = table[np.argsort(table[:, 0], kind="stable")]
    xx, yy, zz, xy, xz, yz = units.mass * units.length**2 * table[:, 5:].T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    number = table[:, 0].astype(int)
    return Bodies(number, units.mass * table[:, 1], units.length * table[:, 2:5], tensor)
