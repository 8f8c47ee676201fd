"""LAMMPS' packings: dump custom, dump local, and the log that says what the columns mean.

The law is the user's own line of input. Contacts, where dumped, come from `compute property/local`
and `compute pair/local` with `cutoff radius`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.exchange.bodies import LawOf
from modal.exchange.dump import frame_of
from modal.exchange.dump_spheres import cell_of, spheres_of
from modal.exchange.found import Found, network_of
from modal.exchange.lammps_contacts import contacts_of
from modal.exchange.lammps_law import coefficients
from modal.exchange.lammps_pairs import law_of_pairs
from modal.exchange.lammps_script import Script, read_log, typed_pair
from modal.exchange.program_law import SI, ProgramLaw, Units
from modal.formats.hdf5 import InputError

UNITS = {"si": SI, "cgs": Units(1e-2, 1e-3, 1.0), "micro": Units(1e-6, 1e-15, 1e-6)}
"""What LAMMPS' systems of units are in SI; `lj` has none."""


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
    units = units or units_of(script.units, said)
    law_of, planes = _laws_of(script, units, said)
    spheres = spheres_of(frame, units)
    cell = replace(cell_of(frame, units), walls=planes)
    touching, more = contacts_of(frame, spheres, contacts, script, units, planes)
    found = network_of(spheres, cell, touching, law_of, str(atoms))
    found.told["assumed"] = assumed + more
    printed = script.thermo.get(frame.step) if log else None
    if printed:
        found.told["printed_stress_pa"] = [
            units.pressure * float(printed[name]) for name in ("pxx", "pyy", "pzz")
        ]
    return found


def units_of(name: str, said: str) -> Units:
    """What a system of units of that name is in SI; InputError for lj, which has none."""
    if name not in UNITS:
        raise InputError(
            f"{said}: units {name} have no SI values here; give those of length, mass and time "
            "with --scales M KG S"
        )
    return UNITS[name]


def _laws_of(script: Script, units: Units, said: str) -> tuple[LawOf, tuple[float, float]]:
    """The law between any two types or a type and a wall, and where the walls are."""
    of_pairs = law_of_pairs(script, units, said)
    wall, planes = _walls(script, units)

    def law_of(a: int, b: int) -> ProgramLaw:
        if a >= 0:
            return of_pairs(a, b)
        if wall is None:
            raise InputError(f"{said}: a wall without a law; give --wall")
        return wall

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
