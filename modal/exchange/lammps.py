"""LAMMPS' packings: dump custom, dump local, and the log that says what the columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.exchange.bodies import check_spheres
from modal.exchange.dump import Frame, frame_of
from modal.exchange.dump_spheres import cell_of, spheres_of
from modal.exchange.found import Found, network_of
from modal.exchange.lammps_contacts import contacts_of
from modal.exchange.lammps_pairs import law_of_pairs
from modal.exchange.lammps_script import Script, read_log, typed_pair
from modal.exchange.lammps_walls import TYPED, law_of_wall, planes_of, walls_of
from modal.exchange.program_law import SI, ProgramLaw, Units
from modal.exchange.rows import fault
from modal.tools.errors import InputError

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""What LAMMPS' systems of units are in SI; `lj` has none."""
STRESS = ("pxx", "pyy", "pzz")


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
    wall_fixes = tuple(script.walls)
    if pair:
        own = typed_pair(pair)
        script.style, script.pair = own.style, own.pair
    if wall:
        script.walls = {TYPED: tuple(wall.split())}
    said = f"{log}" if log and not pair else "--pair"
    if not script.style:
        raise InputError(
            f"{atoms}: no law of contact is known; give the log (--log log.lammps) or the line "
            '(--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3")'
        )
    frame = frame_of(atoms, "ATOMS", step)
    assumed = ["units si"] * (units is None and not (log or frame.units))
    # LAMMPS' own units, where a log names none, are lj.
    units = units_of(frame, units, (script.units or "lj") if log else "", said)
    of_pairs, walls = law_of_pairs(script, units, said), walls_of(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        return of_pairs(a, b) if a >= 0 else law_of_wall(walls, a, said)

    models = {tuple(words) for _, _, *words in script.pair}
    spheres = spheres_of(frame, units, typed=len(models) > 1)
    cell = replace(cell_of(frame, units), walls=planes_of(walls))
    check_spheres(spheres, cell, str(atoms))
    for name, group in script.groups.items():
        if contacts is None and wall is None and group != "all":
            do = "give the contacts that it has (--contacts), or type the walls (--wall)"
            raise InputError(f"{log}: fix {name} pushes the group {group} alone; {do}")
    touching, more = contacts_of(
        frame, spheres, contacts, script.computes, units, walls, wall_fixes
    )
    found = network_of(spheres, cell, touching, law_of, str(atoms))
    found.told["assumed"] = assumed + more
    if frame.step <= script.changed and frame.step not in script.since:
        found.remarks.append(
            f"{log} changes the law or the walls after step {frame.step}: those of its end are "
            "taken; type what held (--pair, --wall), or cut the log off there"
        )
    printed = script.thermo.get(frame.step) if log else None
    if printed and all(name in printed for name in STRESS):
        found.told["printed_stress_pa"] = [units.pressure * float(printed[name]) for name in STRESS]
    return found


def units_of(frame: Frame, typed: Units | None, logged: str, said: str) -> Units:
    """The units in SI: those that are typed, or of the name that log and dump give them (or si).

    InputError where two of them differ, and for lj, which has no SI.
    """
    dumped = frame.units
    if dumped and logged and dumped != logged:
        do = "give the log of this dump" if typed is None else "leave --log out, or mend one"
        fault(frame.rows.path, f"ITEM: UNITS {dumped}, and {said} has units {logged}", do)
    name = dumped or logged or "si"
    if typed is None and name not in UNITS:
        where = frame.rows.path if dumped else said
        raise InputError(
            f"{where}: units {name} have no SI values here; give those of length, mass and time "
            "with --scales M KG S"
        )
    if typed and dumped and not np.allclose(typed, UNITS.get(dumped, typed), rtol=1e-9, atol=0):
        what = f"ITEM: UNITS {dumped}, and --scales {' '.join(f'{one:g}' for one in typed)}"
        fault(frame.rows.path, what, "leave --scales out, which other units are for")
    return typed or UNITS[name]
