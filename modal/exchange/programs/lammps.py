"""Packings of LAMMPS and LIGGGHTS: dump custom, dump local, and the log that explains them.

The contact law is read from the user's own input line of LAMMPS. Contacts, if dumped, come from
`compute property/local` and `compute pair/local` with `cutoff radius`. Walls are those of one or
more `fix wall/gran` at low and high z; their forces come with the spheres, in the columns f_ID[1]
to f_ID[4] of `fix ID ... contacts`. Spheres of a `fix rigid` become its bodies. Features of only
one of the two programs are in `modal.exchange.lammps` and `modal.exchange.liggghts`.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from modal.exchange import dump, lammps, liggghts
from modal.exchange.gravity import find_gravity
from modal.exchange.groups import COLUMNS
from modal.exchange.held import IN_PLANE, HeldMotions, find_held_motions
from modal.exchange.import_result import ImportResult, build_network
from modal.exchange.input_script import Script, read_log
from modal.exchange.law import ProgramLaw, Units
from modal.exchange.lines import Lines
from modal.exchange.particles_and_contacts import Packing, PairLaw
from modal.exchange.refusals import refuse
from modal.exchange.registry import Option, read_beginning
from modal.exchange.unread_fixes import remark_on_unread_fixes
from modal.exchange.words import Words
from modal.packing.rigid_bodies import Bodies
from modal.packing.weight import with_gravity
from modal.tools.arrays import Bools

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
BODY = "a rigid body (number, mass, centre, ixx iyy izz ixy ixz iyz ...)"
"""Description of a row of fix rigid, for messages."""
BODY_NUMBERS = 11
"""Number of leading numbers of a row of fix rigid that are used."""


class Request(NamedTuple):
    """The files and lines that were given beside the dump, by their names in `OPTIONS`."""

    contacts: str | Path | None = None
    log: str | Path | None = None
    pair: str | None = None
    wall: str | None = None
    step: int | None = None
    scales: Sequence[float] | None = None
    bodies: str | Path | None = None


def sniff(path: Path, head: bytes) -> bool:
    """Tell whether a file is a text dump."""
    return head.startswith(b"ITEM:")


def read(
    path: Path,
    contacts: str | Path | None = None,
    log: str | Path | None = None,
    pair: str | None = None,
    wall: str | None = None,
    step: int | None = None,
    scales: Sequence[float] | None = None,
    bodies: str | Path | None = None,
) -> ImportResult:
    """Return the packing of a dump; the arguments are described in `OPTIONS` of this module.

    The dump counts as one of LIGGGHTS if the log or the typed law is of LIGGGHTS. Raises InputError
    for missing or damaged input, and for features that a network cannot represent.
    """
    request = Request(contacts, log, pair, wall, step, scales, bodies)
    is_liggghts = _is_of_liggghts(request)
    program = liggghts if is_liggghts else lammps
    script = read_log(log, program.DEFAULT_UNITS)
    frame = dump.read_frame(path, "ATOMS", step)
    script.refuse_other_run(path, frame.head.step, len(frame.rows.texts))
    held = find_held_motions_of_spheres(script, frame)
    _refuse_free_in_plane(script, held)
    _refuse_exclusions(script, request, held)
    fixes = tuple(script.walls)
    _apply_typed_lines(script, request)
    if not script.style:
        _refuse_without_law(path, frame, program)
    if is_liggghts and script.bodies:
        problem = "fix rigid: clumps of LIGGGHTS are not known"
        refuse(script.place, "unknown_fix", problem, remedy="leave it out")
    if frame.head.step < script.changed and pair is None:
        script.remarks.append(
            f"{script.place} changes the law or the walls after step {script.changed}: those of "
            "its end are taken"
        )
    units = dump.choose_units(path, frame, Units.from_scales(scales), script)
    pair_law = program.read_pair_law(script, units)
    read_wall_law = partial(program.read_wall_law, script=script, units=units, pair_law=pair_law)
    walls = dump.read_walls(script, units, read_wall_law, program.PLANES_PER_FIX)
    packing = _read_spheres(path, frame, units, walls, script, request, held.fixed)
    _refuse_walls_of_groups(script, request)
    touching = None
    if contacts is not None:
        _refuse_short_cutoff(script)
        dumped = dump.read_contacts(contacts, frame, packing, script, program.END_COLUMNS)
        touching = program.convert_contacts(dumped, packing, units)
        if walls:
            at_walls = program.find_wall_contacts(frame, packing, units, walls, fixes)
            touching = touching.with_walls(*at_walls)
    rigid_bodies = read_bodies(bodies, units) if bodies else None
    result = build_network(packing, touching, _join_laws(pair_law, walls), rigid_bodies)
    gravity, remarks = find_gravity(script.runs, frame.head.step, units)
    if gravity is not None:
        result.network = with_gravity(result.network, gravity)
    remarks += remark_on_unread_fixes(script.runs, frame.head.step)
    result.remarks += script.remarks + remarks
    return result


def _is_of_liggghts(request: Request) -> bool:
    """Tell whether the typed law or the log is one of LIGGGHTS."""
    if request.pair and lammps.parse_typed_pair(request.pair).style[0] == "gran":
        return True
    return bool(request.log) and b"LIGGGHTS" in read_beginning(request.log or "")


def _apply_typed_lines(script: Script, request: Request) -> None:
    """Replace the law and the walls of the log by those that were typed."""
    if request.pair:
        typed = lammps.parse_typed_pair(request.pair)
        script.place = "--pair"
        script.style = typed.style
        script.pair_coefficients = [typed.coefficients]
    if request.wall:
        script.walls = {dump.TYPED_WALL: tuple(request.wall.split())}


def _join_laws(pair_law: PairLaw, walls: dump.Walls) -> PairLaw:
    """Combine the laws between spheres and at walls into one function of two types."""

    def find_law(first: int, second: int) -> ProgramLaw:
        if first < 0:
            return walls[first].law(second)
        return pair_law(first, second)

    return find_law


def _refuse_without_law(path: Path, frame: dump.Frame, program: ModuleType) -> None:
    """Raise InputError for a dump without a law; name its missing columns, too."""
    problem = "no law of contact is known"
    remedy = f"`import` it with the log (--log log.lammps) or the line ({program.EXAMPLE})"
    missing = " ".join(dump.list_missing_columns(frame.rows))
    if missing:
        problem += f", and no column {missing}"
        remedy += f", and add {missing} to the dump"
    refuse(path, "no_law", problem, remedy=remedy)


def _refuse_free_in_plane(script: Script, held: HeldMotions) -> None:
    """Raise InputError for `dimension 2` without `enforce2d`, which keeps spheres in the plane."""
    if script.place_of_plane and (held.fixed is None or not held.fixed[:, IN_PLANE].all()):
        remedy = "hold them there (fix ID all enforce2d), or let them move in space"
        refuse(script.place_of_plane, "two_dimensions", "dimension 2", remedy=remedy)


def _refuse_exclusions(script: Script, request: Request, held: HeldMotions) -> None:
    """Raise InputError if `neigh_modify exclude` removes contacts that are found from positions.

    A dump of contacts lacks such pairs already. Pairs inside one rigid body are not contacts here
    either, nor are pairs of held spheres.
    """
    if request.contacts is not None:
        return
    for exclusion in script.exclusions:
        inside_bodies = exclusion.style == "molecule/intra" and any(
            words[:1] == ("molecule",) for words in script.bodies.values()
        )
        of_held = exclusion.style == "group" and held.groups.issuperset(exclusion.words)
        if not (inside_bodies or of_held):
            refuse(
                exclusion.place,
                "excluded_pairs",
                f"neigh_modify exclude {exclusion.style}",
                "spheres that overlap without a contact are not known from positions",
                "give the contacts of the dump (--contacts), which lack these",
            )


def _read_spheres(
    path: Path,
    frame: dump.Frame,
    units: Units,
    walls: dump.Walls,
    script: Script,
    request: Request,
    fixed: Bools | None,
) -> Packing:
    """Return the spheres of a dump, in the order of its rows; `fixed` (n, 6) are held motions.

    Raises InputError if it is unclear which spheres form one rigid body.
    """
    if request.bodies and not script.bodies:
        problem = "no fix rigid is known"
        refuse("--bodies", "no_bodies", problem, remedy="give the log that has it (--log)")
    if frame.rows.has("mol") and not request.log:
        problem = "spheres of one mol may be one rigid body or bonded"
        remedy = "give the log (--log), which says so, or leave mol out of the dump"
        refuse(path, "unknown_bodies", problem, remedy=remedy)
    column = find_body_column(script, has_masses=request.bodies is not None)
    planes = {code: wall.z for code, wall in walls.items()}
    needs_type = script.depends_on_type
    packing = dump.read_packing(
        frame, units, planes, needs_type=needs_type, body=column, fixed=fixed
    )
    if script.place_of_plane:
        # The period across the plane only has to hold the spheres.
        periodic = packing.cell.periodic & np.array([True, True, False])
        packing = replace(packing, cell=replace(packing.cell, periodic=periodic))
    includes_all = any(script.groups[name] == "all" for name in script.bodies)
    if includes_all and (packing.body < 1).any():
        problem = f"a {column} of 0, which is one more body to fix rigid"
        remedy = "make single spheres no part of its group"
        refuse(path, "unknown_bodies", problem, remedy=remedy)
    return packing


def _refuse_short_cutoff(script: Script) -> None:
    """Raise InputError if the computes of a log leave out the contacts of JKR across gaps."""
    acts_across_gaps = any("jkr" in words for words in (script.style, *script.pair_coefficients))
    for name, words in script.computes.items():
        cutoff = list(itertools.dropwhile(lambda word: word != "cutoff", words))
        if acts_across_gaps and cutoff[1:2] == ["radius"]:
            refuse(
                script.place,
                "contacts_across_gaps",
                f"compute {name} ends at cutoff radius",
                "JKR contacts act across gaps",
                "write cutoff type (variable cutoff string type, before write_contacts.lmp)",
            )


def _refuse_walls_of_groups(script: Script, request: Request) -> None:
    """Raise InputError if a wall acts on some spheres only and wall contacts are not dumped."""
    if request.contacts is not None or request.wall is not None:
        return
    for name in script.walls:
        group = script.groups.get(name, "all")
        if group != "all":
            problem = f"fix {name} pushes the group {group} alone"
            remedy = "give the contacts that it has (--contacts), or type the walls (--wall)"
            refuse(str(request.log), "wall_of_group", problem, remedy=remedy)


def find_held_motions_of_spheres(script: Script, frame: dump.Frame) -> HeldMotions:
    """Return the held motions of the spheres of a dump, read from the log."""
    rows = frame.rows
    columns = {}
    names = [name for name in COLUMNS.values() if rows.has(name)]
    if script.runs and names:
        for name, column in zip(names, rows.read(*names).T, strict=True):
            columns[name] = rows.to_integers(column, name)
    excluded: list[str] = []
    for exclusion in script.exclusions:
        if exclusion.style == "group":
            excluded += exclusion.words
    count = len(rows.texts)
    step = frame.head.step
    return find_held_motions(script.runs, script.history, step, columns, count, excluded)


def find_body_column(script: Script, *, has_masses: bool) -> str:
    """Return the column of the dump that numbers the rigid bodies; empty if there are none.

    `has_masses` says that another file has the masses of the bodies. Raises InputError if the dump
    does not show which spheres belong to a body.
    """
    if len(script.bodies) > 1:
        remedy = "give all bodies one fix and one column"
        refuse(script.place, "several_bodies", "several fix rigid", remedy=remedy)
    column = ""
    for name, words in script.bodies.items():
        style, custom_column = (*words, "", "")[:2]
        if style == "molecule":
            column = "mol"
        elif style == "custom" and custom_column.startswith("i_"):
            column = custom_column
        else:
            problem = f"fix {name} rigid {style}: which spheres are one body is not in a dump"
            remedy = "make it rigid molecule, or custom i_NAME, and dump mol or i_NAME"
            refuse(script.place, "unknown_bodies", problem, remedy=remedy)
        if "infile" in words and not has_masses:
            problem = f"fix {name} rigid has masses of its own (infile)"
            remedy = "give those of this step, as write_restart writes them (--bodies FILE.rigid)"
            refuse(script.place, "unknown_masses", problem, remedy=remedy)
    return column


def read_bodies(path: str | Path, units: Units) -> Bodies:
    """Return rigid bodies from a file of the format of `fix rigid ... infile`."""
    remedy = "give the file that write_restart wrote (*.rigid)"
    rows = []
    for number, line in Lines(path):
        words = line.split("#")[0].split()
        if len(words) > 1:
            row = Words(words, f"{path}, line {number}", remedy)
            rows.append(row.take_numbers(BODY, BODY_NUMBERS))
    if not rows:
        refuse(path, "no_bodies", "no rigid bodies", remedy=remedy)
    table = np.array(rows)
    table = table[np.argsort(table[:, 0], kind="stable")]
    xx, yy, zz, xy, xz, yz = units.mass * units.length**2 * table[:, 5:].T
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    body = table[:, 0].astype(int)
    return Bodies(body, units.mass * table[:, 1], units.length * table[:, 2:5], tensor)
