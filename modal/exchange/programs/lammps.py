"""Packings of LAMMPS and LIGGGHTS: dump custom, dump local, and the log of what columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`. Walls are those of one or more `fix wall/gran` at low
and high z; their forces come with the spheres, in the columns f_ID[1] to f_ID[4] of `fix ID ...
contacts`. Spheres of a `fix rigid` become its bodies. What each of the two says in its own way
stands in `modal.exchange.lammps` and `modal.exchange.liggghts`.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from modal.exchange import dump, lammps, liggghts
from modal.exchange.groups import COLUMNS
from modal.exchange.held import Motion, motion_of
from modal.exchange.import_result import ImportResult, network_of
from modal.exchange.input_script import Script, read_log
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.registry import Option, beginning
from modal.exchange.text import Words, fault, text_lines
from modal.packing.network import Network
from modal.packing.rigid_bodies import Bodies

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
    program = liggghts if of_liggghts else lammps
    script, frame = read_log(log, program.UNITS), dump.frame_of(path, "ATOMS", given.get("step"))
    script.refuse_other_run(path, frame.step, len(frame.rows.texts))
    motion = motion_of_spheres(script, frame)
    motion.refuse(turning_counts=False)
    fixes = tuple(script.walls)
    if pair:
        script.said, script.style, script.pair = "--pair", words, [("*", "*", *words[1:])]
    if wall:
        script.walls = {dump.TYPED: tuple(wall.split())}
    if not script.style:
        lost = " ".join(dump.lost_columns(frame.rows))
        what = "no law of contact is known" + f", and no column {lost}" * bool(lost)
        do = f"`import` it with the log (--log log.lammps) or the line ({program.EXAMPLE})"
        fault(path, what, do + f", and add {lost} to the dump" * bool(lost))
    if of_liggghts and script.bodies:
        fault(script.said, "fix rigid: clumps of LIGGGHTS are not known", "leave it out")
    units = dump.units_of(path, frame, given, script)
    of_types = program.law_of_types(script, units)
    of_wall = partial(program.law_of_wall, script=script, units=units, of_types=of_types)
    walls = dump.walls_of(script, units, of_wall, program.PLANES)

    def law_of(a: int, b: int) -> ProgramLaw:
        return of_types(a, b) if a >= 0 else walls[a].law(b)

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
    if contacts is not None:
        told = dump.told_contacts(contacts, frame, packing, script, program.ENDS)
        touching = program.contacts_of(told, packing, units)
        if walls:
            touching = touching.with_walls(*program.at_walls(frame, packing, units, walls, fixes))
    bodies = read_bodies(told_bodies, units) if told_bodies else None
    found = network_of(packing, touching, law_of, bodies)
    motion.refuse(turning_counts=resists_turning(found.network))
    found.remarks += script.remarks
    return found


def motion_of_spheres(script: Script, frame: dump.Frame) -> Motion:
    """Return how the spheres of a dump move, as the log says."""
    rows = frame.rows
    columns = {
        name: rows.whole(rows.read(name)[:, 0], name) for name in COLUMNS.values() if rows.has(name)
    }
    return motion_of(script.runs, script.history, frame.step, columns, len(rows.texts))


def resists_turning(network: Network) -> bool:
    """Whether some contact of a network resists that a sphere turns."""
    columns = (
        network.stiffness_tangential,
        network.stiffness_rolling,
        network.stiffness_twisting,
    )
    return any(stiffness is not None and bool(stiffness.any()) for stiffness in columns)


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
