"""Packings of LAMMPS and LIGGGHTS: dump custom, dump local, and the log of what columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`. Walls are those of one or more `fix wall/gran` at low
and high z; their forces come with the spheres, in the columns f_ID[1] to f_ID[4] of `fix ID ...
contacts`. Spheres of a `fix rigid` become its bodies. What LIGGGHTS says otherwise stands in
`modal.exchange.liggghts`.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange import dump, liggghts
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import Script, read_log
from modal.exchange.lammps_law import coefficients, law_of_pairs
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, Packing
from modal.exchange.registry import Option, beginning
from modal.exchange.text import Words, fault, text_lines
from modal.packing.rigid_bodies import Bodies
from modal.tools.arrays import Floats, Ints

NAME = "LAMMPS or LIGGGHTS"
OPTIONS = {
    "contacts": Option("of the spheres: dump local, or *.csv"),
    "log": Option("the log: units, law, walls, columns"),
    "pair": Option("the contact law as it stands behind pair_style", "LINE"),
    "wall": Option("the walls as they stand behind fix ... wall/gran", "LINE"),
    "step": Option("which one, of a dump with several times", "N", int),
    "scales": Option("the file's units of length, mass and time in SI", ("M", "KG", "S"), float),
    "bodies": Option("masses and tensors of fix rigid, as write_restart writes them (*.rigid)"),
}
EXAMPLE = '--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"'
BODY, OF_A_BODY = "a rigid body (number, mass, centre, ixx iyy izz ixy ixz iyz ...)", 11
"""What a row of fix rigid tells, and how many of its numbers count."""


def sniff(path: Path, head: bytes) -> bool:
    """A text dump."""
    return head.startswith(b"ITEM:")


def read(path: Path, **given: Any) -> ImportResult:
    """A packing of one of the two: of LIGGGHTS where the log says so, or the law that is typed."""
    contacts, log, pair, wall, told_bodies = map(
        given.get, ("contacts", "log", "pair", "wall", "bodies")
    )
    words = tuple((pair or "").split())
    of_liggghts = words[:1] == ("gran",) or b"LIGGGHTS" in (beginning(log) if log else b"")
    # LAMMPS' own units, where a log names none, are lj.
    script = read_log(log, "si" if of_liggghts else "lj")
    fixes = tuple(script.walls)
    if pair:
        script.said, script.style, script.pair = "--pair", words, [("*", "*", *words[1:])]
    if wall:
        script.walls = {dump.TYPED: tuple(wall.split())}
    if not script.style:
        line = liggghts.EXAMPLE if of_liggghts else EXAMPLE
        do = f"`import` it with the log (--log log.lammps) or the line ({line})"
        fault(path, "no law of contact is known", do)
    if of_liggghts and script.bodies:
        fault(script.said, "fix rigid: clumps of LIGGGHTS are not known", "leave it out")
    frame, units = dump.opened(path, given, script)
    if of_liggghts:
        of_pairs = liggghts.law_of_types(script, units)
        walls = liggghts.walls_of(script, units, of_pairs)
    else:
        of_pairs, walls = law_of_pairs(script, units), walls_of(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        return of_pairs(a, b) if a >= 0 else walls[a].law(b)

    if told_bodies and not script.bodies:
        fault("--bodies", "no fix rigid is known", "give the log that has it (--log)")
    if frame.rows.has("mol") and not log:
        do = "give the log (--log), which says so, or leave mol out of the dump"
        fault(path, "spheres of one mol may be one rigid body or bonded", do)
    body = column_of_bodies(script, told_bodies is not None)
    planes = {code: each.z for code, each in walls.items()}
    packing = dump.packing_of(frame, units, planes, typed=script.by_type, body=body)
    of_all = any(script.groups[name] == "all" for name in script.bodies)
    if of_all and (packing.body < 1).any():
        do = "make single spheres no part of its group"
        fault(path, f"a {body} of 0, which is one more body to fix rigid", do)
    for name in script.walls:
        group = script.groups.get(name, "all")
        if contacts is None and wall is None and group != "all":
            do = "give the contacts that it has (--contacts), or type the walls (--wall)"
            fault(str(log), f"fix {name} pushes the group {group} alone", do)
    touching = None
    if contacts is not None and of_liggghts:
        told = dump.told_contacts(contacts, frame, packing, script, ("id1", "id2"))
        touching = liggghts.contacts_of(told, packing, units)
    elif contacts is not None:
        told = dump.told_contacts(contacts, frame, packing, script, ("patom1", "patom2"))
        touching = contacts_of(told, units)
        if walls:
            touching = touching.with_walls(*at_walls(frame, packing, units, walls, fixes))
    bodies = read_bodies(told_bodies, units) if told_bodies else None
    found = network_of(packing, touching, law_of, bodies)
    found.remarks += script.remarks
    return found


def contacts_of(told: dump.Told, units: Units) -> Contacts:
    """What `pair/local` tells of the contacts between spheres."""
    force, shear = units.force * told.values["force"][:, 0], told.values.get("shear")
    shear = None if shear is None else units.force * shear
    return Contacts(told.i, told.j, force, shear, told.values.get("line"), listed=told.rows)


def walls_of(script: Script, units: Units) -> dump.Walls:
    """The walls of each fix; InputError for others than one at low and one at high z."""

    def of_all(law: ProgramLaw) -> Callable[[int], ProgramLaw]:
        return lambda kind: law

    found: dict[int, dump.Wall] = {}
    for name, words in script.walls.items():
        where = name if name == dump.TYPED else f"fix {name} wall/gran"
        said = Words(words, where, f"give its law before it, or type it with {dump.TYPED}")
        other = next((word for word in words if word in ("xplane", "yplane", "zcylinder")), None)
        if other:
            do = "turn the packing, or make the other axes periodic"
            said.refuse(f"{other} is not known, a network has walls at low and high z", do)
        # The two words behind zplane, NULL for none.
        ends, at = said.numbers("zplane", 2, null=True), words.index("zplane")
        if "wiggle" in words[at:]:
            what = "it wiggles, and where it was at a step is not told"
            said.refuse(what, f"type where ({dump.TYPED})")
        law = coefficients(words[0], words[1:at], where, units, wall=True).law
        for code, end, z in zip(WALLS, ("low", "high"), ends, strict=True):
            if np.isnan(z):
                continue
            if code in found:
                what = f"a second wall at {end} z, beside that of fix {found[code].name}"
                said.refuse(f"{what}, where a network has one", f"type them with {dump.TYPED}")
            found[code] = dump.Wall(units.length * z, of_all(law), name)
    return found


def at_walls(
    frame: dump.Frame, packing: Packing, units: Units, walls: dump.Walls, fixes: Sequence[str]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at walls, codes (k,), normal force (k,) and shear force (k, 3) on the sphere, N.

    `fixes` are the IDs of the log's walls. A dump that has none of them is older than the log's
    end, or their IDs are not known: then all columns f_ID[1] to f_ID[4] count.
    """

    def columns(name: str) -> list[str]:
        return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]

    rows, parts = frame.rows, []
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    begun = re.findall(r"f_(\w+)\[1\]", " ".join(rows.columns))
    there = [name for name in begun if rows.has(*columns(name))]
    for name in fixes if set(fixes) & set(there) else there or fixes or ["ID"]:
        each = columns(name)
        rows.require(each, f"write fix {name} ... wall/gran ... contacts and dump {' '.join(each)}")
        table = rows.read(*each)
        do = "leave columns of other fixes out, or give the log that names the walls (--log)"
        wrong = ~np.isin(table[:, 0], (0, 1))
        rows.refuse(wrong, "not 1 at a wall and 0 elsewhere", do, each[0])
        (at,) = np.nonzero(table[order, 0])
        force = units.force * table[order][at, 1:]
        # The wall that pushes; a sphere between two walls of one fix would need two rows.
        code, push = np.where(force[:, 2] > 0, *WALLS), abs(force[:, 2])
        force[:, 2] = 0
        own = {code for code, wall in walls.items() if wall.name == name} or set(walls)
        absent = np.isin(np.arange(len(order)), at[~np.isin(code, list(own))])
        what = f"is pushed in f_{name} by a wall that is NULL in its zplane LOW HIGH"
        packing.refuse(absent, what, f"mend {dump.TYPED}, or bring the packing to rest")
        parts.append((at, code, push, force))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub


def column_of_bodies(script: Script, told: bool) -> str:
    """The column of the dump that numbers the rigid bodies, or none.

    `told` says that their masses are in a file of their own.
    """
    if len(script.bodies) > 1:
        fault(script.said, "several fix rigid", "give all bodies one fix and one column")
    column = ""
    for name, words in script.bodies.items():
        which, given = (*words, "", "")[:2]
        by_number = which == "custom" and given.startswith("i_")
        column = "mol" if which == "molecule" else given
        if not (which == "molecule" or by_number):
            what = f"fix {name} rigid {which}: which spheres are one body is not in a dump"
            do = "make it rigid molecule, or custom i_NAME, and dump mol or i_NAME"
            fault(script.said, what, do)
        if "infile" in words and not told:
            what = f"fix {name} rigid has masses of its own (infile)"
            do = "give those of this step, as write_restart writes them (--bodies FILE.rigid)"
            fault(script.said, what, do)
    return column


def read_bodies(path: str | Path, units: Units) -> Bodies:
    """Masses, centres and tensors of rigid bodies, in the format of `fix rigid ... infile`."""
    do = "give the file that write_restart wrote (*.rigid)"
    lines = ((n, line.split("#")[0].split()) for n, line in text_lines(path))
    rows = [Words(words, f"{path}, line {n}", do) for n, words in lines if len(words) > 1]
    if not rows:
        fault(path, "no rigid bodies", do)
    table = np.array([row.in_turn(BODY, OF_A_BODY) for row in rows])
    table = table[np.argsort(table[:, 0], kind="stable")]
    xx, yy, zz, xy, xz, yz = units.mass * units.length**2 * table[:, 5:].T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    number = table[:, 0].astype(int)
    return Bodies(number, units.mass * table[:, 1], units.length * table[:, 2:5], tensor)
