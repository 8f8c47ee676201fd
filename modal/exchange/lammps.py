"""LAMMPS' packings: dump custom, dump local, and the log that says what the columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`; the columns c_ID[k] of a dump mean what the compute
lines in the log say. Forces on walls come with the spheres (`fix wall/gran ... contacts`).
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from modal.exchange.bodies import Cell, Contacts, Spheres
from modal.exchange.dump import Frame, frame_of
from modal.exchange.found import Found, network_of
from modal.exchange.lammps_law import Coefficients, coefficients, mixed
from modal.exchange.lammps_script import Script, read_log, typed_pair
from modal.exchange.program_law import SI, ProgramLaw, Units
from modal.exchange.rows import fault, last_step
from modal.formats.arrays import Floats, Ints
from modal.formats.hdf5 import InputError
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""What LAMMPS' systems of units are in SI; `lj` has none."""
RECIPE = {
    4: ("patom1", "patom2", "ptype1", "ptype2"),
    9: ("dist", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
    12: ("dist", "dx", "dy", "dz", "force", "fx", "fy", "fz", "p1", "p2", "p3", "p4"),
}
"""Columns of `write_contacts.lmp`, and of a usual recipe, where no log names them."""


def import_lammps(
    atoms: str | Path,
    contacts: str | Path | None,
    log: str | Path | None,
    pair: str | None,
    wall: str | None,
    units: Units | None,
    step: int | None,
) -> Found:
    """A packing of LAMMPS; arguments as on the command line, files by their names."""
    script = read_log(log) if log else Script()
    if pair:
        own = typed_pair(pair)
        script.style, script.pair = own.style, own.pair
    if wall:
        script.walls = {"--wall": tuple(wall.split())}
    said = f"{log}" if log and not pair else "--pair"
    if not script.style:
        raise InputError(
            f"{atoms}: no law of contact is known; give the log (--log log.lammps) or the line "
            '(--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3")'
        )
    assumed = [] if log else ["units si"] * (units is None)
    frame = frame_of(atoms, "ATOMS", step)
    units = units or _units(script.units, said)
    law_of, planes = _laws_of(script, units, said)
    spheres = spheres_of(frame, units)
    cell = replace(cell_of(frame, units), walls=planes)
    touching, more = _contacts(frame, spheres, contacts, script, units, planes)
    found = network_of(spheres, cell, touching, law_of, str(atoms))
    found.told["assumed"] = assumed + more
    printed = script.thermo.get(frame.step) if log else None
    if printed:
        found.told["printed_stress_pa"] = [
            units.pressure * float(printed[name]) for name in ("pxx", "pyy", "pzz")
        ]
    return found


def _units(name: str, said: str) -> Units:
    if name not in UNITS:
        raise InputError(
            f"{said}: units {name} have no SI values here; give those of length, mass and time "
            "with --scales M KG S"
        )
    return UNITS[name]


def cell_of(frame: Frame, units: Units) -> Cell:
    """Bounds and periods of the frame's box."""
    return Cell(units.length * frame.low, units.length * frame.high, frame.periodic)


def spheres_of(frame: Frame, units: Units) -> Spheres:
    """The spheres of a dump, in the order of their numbers."""
    rows = frame.rows
    if not rows.has("id"):
        _missing(frame, "id", "dump ... custom N FILE id type x y z radius mass")
    scaled = rows.has("xs", "ys", "zs")
    options = (("x", "y", "z"), ("xu", "yu", "zu"), ("xs", "ys", "zs"))
    names = next((names for names in options if rows.has(*names)), None)
    if names is None:
        _missing(frame, "x y z", "dump ... custom N FILE id type x y z radius mass")
    size = next((name for name in ("radius", "diameter") if rows.has(name)), None)
    if size is None:
        _missing(frame, "radius", "add radius to the dump")
    heavy = next((name for name in ("mass", "rmass", "density") if rows.has(name)), None)
    if heavy is None:
        _missing(frame, "mass", "add mass to the dump")
    wanted = ["id", *names, size, heavy] + ["type"] * rows.has("type")
    table = rows.read(*wanted)
    number = table[:, 0].astype(np.int64)
    order = np.argsort(number, kind="stable")
    again = np.flatnonzero(np.diff(number[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"sphere {number[first]} stands in line {rows.line + first} already"
        fault(rows.path, what, "write each once, without ghosts or images", rows.line + second)
    table = table[order]
    position = table[:, 1:4]
    step = last_step(position, rows.digits(*names))
    if scaled:
        step *= float((frame.high - frame.low).max())
        position = frame.low + position * (frame.high - frame.low)
    radius = units.length * table[:, 4] * (0.5 if size == "diameter" else 1.0)
    mass = units.mass * table[:, 5]
    if heavy == "density":
        mass = units.density * table[:, 5] * 4 / 3 * np.pi * radius**3
    return Spheres(
        number=number[order],
        position=units.length * position,
        radius=radius,
        mass=mass,
        kind=table[:, 6].astype(int) if rows.has("type") else np.ones(len(table), int),
        digits=rows.digits(*names),
        step=units.length * step,
    )


def _missing(frame: Frame, column: str, do: str) -> NoReturn:
    had = " ".join(frame.rows.columns)
    fault(frame.rows.path, f"no column {column} among {had}", do, frame.rows.line - 1, column)


def index_of(number: Ints, ids: Floats, frame: Frame, column: str) -> Ints:
    """Indices of spheres by their numbers; InputError, with the line, for one that is not there."""
    place = np.clip(np.searchsorted(number, ids), 0, len(number) - 1)
    lost = number[place] != ids
    if lost.any():
        row = int(np.argmax(lost))
        what = f"sphere {ids[row]:.0f} is not among the spheres"
        do = "dump both files at the same step, of the same spheres"
        fault(frame.rows.path, what, do, frame.rows.line + row, column)
    return place


def once(i: Ints, j: Ints, frame: Frame) -> None:
    """InputError, with both lines, where two rows tell of the same pair."""
    key = np.minimum(i, j).astype(np.int64) * (int(max(i.max(), j.max())) + 1) + np.maximum(i, j)
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if len(again):
        first, second = order[again[0]], order[again[0] + 1]
        what = f"the contact of line {frame.rows.line + first} again"
        fault(frame.rows.path, what, "list each contact once", frame.rows.line + second)


def _contacts(
    frame: Frame,
    spheres: Spheres,
    path: str | Path | None,
    script: Script,
    units: Units,
    planes: tuple[float, float],
) -> tuple[Contacts | None, list[str]]:
    """The contacts that are told, those with walls too, and what had to be assumed."""
    if path is None:
        return None, []
    listed = frame_of(path, "ENTRIES", frame.step)
    columns, assumed = _meanings(listed, script)
    rows = listed.rows
    for name in ("patom1", "patom2", "force"):
        if name not in columns:
            known = " ".join(columns) or " ".join(rows.columns)
            do = "write compute property/local patom1 patom2 and pair/local force p1 p2 p3"
            fault(rows.path, f"no column of {name} among {known}", do, rows.line - 1, name)
    sheared = all(name in columns for name in ("p1", "p2", "p3"))
    lined = all(name in columns for name in ("fx", "fy", "fz"))
    names = (
        ["patom1", "patom2", "force"] + ["p1", "p2", "p3"] * sheared + ["fx", "fy", "fz"] * lined
    )
    table = rows.read(*(columns[name] for name in names))
    i, j = (
        index_of(spheres.number, table[:, k], listed, columns[names[k]]).astype(np.int32)
        for k in (0, 1)
    )
    once(i, j, listed)
    force = units.force * table[:, 2]
    shear = units.force * table[:, 3:6] if sheared else None
    line = table[:, -3:] if lined else None
    if np.isfinite(planes).any():
        at, code, push, rub = _on_walls(frame, spheres, units, planes)
        i, j = np.concatenate([i, at]), np.concatenate([j, code])
        force = np.concatenate([force, push])
        shear = None if shear is None else np.concatenate([shear, rub])
        upright = np.tile([0.0, 0.0, 1.0], (len(at), 1))
        line = None if line is None else np.concatenate([line, upright])
    digits = rows.digits(columns["force"])
    return Contacts(i, j, force, shear, digits, line=line), assumed


def _meanings(listed: Frame, script: Script) -> tuple[dict[str, str], list[str]]:
    """Name of a quantity: column that holds it; and what was assumed about that."""
    columns: dict[str, str] = {}
    groups: dict[str, list[str]] = {}
    for column in listed.rows.columns:
        indexed = re.fullmatch(r"c_(\w+)(?:\[(\d+)\])?", column)
        if indexed:
            groups.setdefault(indexed[1], []).append(column)
        else:
            columns[column] = column
    assumed = []
    for name, members in groups.items():
        words = script.computes.get(name)
        if words is None:
            words = RECIPE.get(len(members))
            if words is None:
                what = f"what {members[0]} means stands in a compute line"
                do = "give the log that has it (--log), or write as write_contacts.lmp does"
                fault(listed.rows.path, what, do, listed.rows.line - 1, members[0])
            assumed.append(f"columns of c_{name}: {' '.join(words)}")
        for member in members:
            at = re.search(r"\[(\d+)\]", member)
            place = int(at[1]) - 1 if at else 0
            if place < len(words):
                columns[words[place]] = member
    return columns, assumed


def _on_walls(
    frame: Frame, spheres: Spheres, units: Units, planes: tuple[float, float]
) -> tuple[Ints, Ints, Floats, Floats]:
    """Spheres at a wall, its code, normal force (k,) and shear force (k, 3) on the sphere, N."""
    rows = frame.rows
    fixes = sorted({column.split("[")[0] for column in rows.columns if column.startswith("f_")})
    names = next(
        (found for fix in fixes if rows.has(*(found := [f"{fix}[{k}]" for k in (1, 2, 3, 4)]))),
        None,
    )
    if names is None:
        do = "write fix ... wall/gran ... contacts and dump f_ID[1] f_ID[2] f_ID[3] f_ID[4]"
        fault(rows.path, "no forces of the walls", do, rows.line - 1, "f_ID[1..4]")
    order = np.argsort(rows.read("id")[:, 0], kind="stable")
    table = rows.read(*names)[order]
    (at,) = np.nonzero(table[:, 0] > 0)
    force = units.force * table[at, 1:4]
    # The wall that pushes; a sphere between two walls that touch it would need two rows.
    code = np.where(force[:, 2] > 0, SOURCE_WALL, RECEIVER_WALL)
    absent = np.isnan(planes)[np.where(code == SOURCE_WALL, 0, 1)]
    if absent.any():
        which = spheres.number[at[int(np.argmax(absent))]]
        raise InputError(f"{rows.path}: sphere {which} is pushed by a wall that --wall leaves NULL")
    push = abs(force[:, 2])
    force[:, 2] = 0
    return at.astype(np.int32), code.astype(np.int32), push, force


def _laws_of(script: Script, units: Units, said: str) -> tuple[Any, tuple[float, float]]:
    """The law between any two types or a type and a wall, and where the walls are."""
    style, *shared = script.style
    if style.startswith("hybrid"):
        raise InputError(
            f"{said}: pair_style hybrid is not known; give the granular part by --pair"
        )
    own: dict[tuple[int, int], Coefficients] = {}
    everywhere: Coefficients | None = None
    for first, second, *words in script.pair:
        law = coefficients(style, words or shared, said, units)
        if not (first.isdigit() and second.isdigit()):
            everywhere = law
            continue
        own[min(int(first), int(second)), max(int(first), int(second))] = law
    if style.startswith("gran/") and everywhere is None and not own:
        everywhere = coefficients(style, shared, said, units)
    wall, planes = _walls(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            if wall is None:
                raise InputError(f"{said}: a wall without a law; give --wall")
            return wall
        if (a, b) in own:
            return own[a, b].law
        if (a, a) in own and (b, b) in own:
            return mixed(own[a, a], own[b, b])
        if everywhere is None:
            raise InputError(f"{said}: no pair_coeff for types {a} and {b}; give one")
        return everywhere.law

    return law_of, planes


def _walls(script: Script, units: Units) -> tuple[ProgramLaw | None, tuple[float, float]]:
    """The law of the walls, and z of the lower and the upper one, m, or NaN."""
    law: ProgramLaw | None = None
    planes = [np.nan, np.nan]
    for name, words in script.walls.items():
        where = f"fix {name} wall/gran" if name != "--wall" else name
        kinds = [k for k, word in enumerate(words) if word in ("xplane", "yplane", "zcylinder")]
        if kinds:
            raise InputError(
                f"{where}: {words[kinds[0]]} is not known; a network has walls at low and high z: "
                "turn the packing, or make the other axes periodic"
            )
        if "zplane" not in words or len(words) < words.index("zplane") + 3:
            raise InputError(f"{where}: give its law and then zplane LOW HIGH (or NULL)")
        at = words.index("zplane")
        law = coefficients(words[0], words[1:at], where, units, wall=True).law
        for side, word in enumerate(words[at + 1 : at + 3]):
            if word.upper() == "NULL":
                continue
            try:
                planes[side] = units.length * float(word)
            except ValueError:
                raise InputError(
                    f"{where}: zplane {word} is no number; type the wall with --wall"
                ) from None
    return law, (planes[0], planes[1])
