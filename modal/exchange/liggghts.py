"""Read features of LIGGGHTS alone: its law, its walls, and the columns of its contacts.

The law is `model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and a
tangential stiffness of 8 G* sqrt(R* overlap), with the memory of the shear displacement. `model
hooke` computes its stiffness from masses and a velocity that is typed in, and is refused. Contacts
come from `compute pair/gran/local`; the forces at walls are not dumped.
"""

from collections.abc import Sequence

import numpy as np

from modal.exchange.dump import DumpedContacts, Frame, WallLaw, Walls
from modal.exchange.input_script import MATERIAL_PROPERTIES, Script
from modal.exchange.lammps import WallContacts, check_material
from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import Contacts, Packing, PairLaw
from modal.exchange.words import Words

EXAMPLE = (
    '--pair "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 '
    'coefficientFriction 0.3"'
)
"""Example of a law that a message shows."""
TYPED_WALL_EXAMPLE = '--wall "type N zplane LOW HIGH"'
"""Example of a wall that a message shows."""
DEFAULT_UNITS = "si"
"""Name of the units if a log names none."""
PLANES_PER_FIX = 1
"""Number of planes of one fix wall/gran."""
END_COLUMNS = ("id1", "id2")
"""Columns of the two ends of a contact."""
MODELS_SWITCHED_OFF = {"cohesion": "off", "rolling_friction": "off", "surface": "default"}
"""Models with forces that springs cannot represent, and the word that switches each off."""


def convert_contacts(dumped: DumpedContacts, packing: Packing, units: Units) -> Contacts:
    """Return the contacts between spheres that `pair/gran/local` has written, in SI units."""
    if "parts" in dumped.values:
        forces = units.force * dumped.values["parts"]
        # A normal force gives a better direction than rounded bounds; the whole force does not.
        line = forces[:, :3]
        normal_force, _ = packing.split_forces(dumped.i, dumped.j, line)
        shear = forces[:, 3:]
    else:
        forces = units.force * dumped.values["whole"]
        line = None
        normal_force, shear = packing.split_forces(dumped.i, dumped.j, forces)
    # Versions differ in which of the two spheres bears the forces; a contact pushes.
    shear = np.where(normal_force < 0, -1.0, 1.0)[:, None] * shear
    return Contacts(dumped.i, dumped.j, abs(normal_force), shear, line, listed=dumped.rows)


def find_wall_contacts(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
) -> WallContacts:
    """Return the contacts with walls, found from positions; their forces follow from the law."""
    contacts = packing.touching()
    at_wall = contacts.j < 0
    i = contacts.i[at_wall]
    return WallContacts(i, contacts.j[at_wall], np.full(len(i), np.nan), None)


def read_pair_law(script: Script, units: Units) -> PairLaw:
    """Return the law between any two types of sphere."""
    line = Words(script.style, script.place, f"give {EXAMPLE}")
    typed = {name: line.numbers_after(name, 1) for name in MATERIAL_PROPERTIES if name in line}
    properties = script.properties | typed
    _refuse_other_models(line)
    missing = [name for name in MATERIAL_PROPERTIES if name not in properties]
    if missing:
        remedy = f"{line.remedy}, or the log that has them"
        line.refuse("no_material", f"no {', '.join(missing)}", remedy=remedy)
    elastic_constants = zip(properties["youngsModulus"], properties["poissonsRatio"], strict=False)
    materials = [
        check_material(units.pressure * young, poisson, line.place)
        for young, poisson in elastic_constants
    ]
    friction = properties["coefficientFriction"]
    n_types = len(materials)

    def find_law(first: int, second: int) -> ProgramLaw:
        low = min(first, second)
        high = max(first, second)
        is_known = low >= 1 and (high <= n_types or n_types == 1)
        if not is_known:
            unknown_type = low if low < 1 else high
            problem = f"no properties for type {unknown_type}"
            line.refuse("no_material", problem, remedy="give them for all types")
        material = materials[min(low, n_types) - 1]
        other_material = materials[min(high, n_types) - 1]
        young, shear = material.against(other_material)
        place = (low - 1) * n_types + high - 1
        return ProgramLaw(
            normal=4 / 3 * young,
            hertz=True,
            tangential=8 * shear,
            grows=True,
            friction=friction[place] if len(friction) > place else friction[0],
            shear_memory=DISPLACEMENT,
        )

    return find_law


def _refuse_other_models(line: Words) -> None:
    """Raise InputError for a law that is not `model hertz` with `tangential history` alone."""
    if "hertz" not in line or "history" not in line:
        line.refuse(
            "unknown_law",
            "only model hertz with tangential history is known",
            "the stiffness of others depends on more than the overlap",
        )
    for option, off in MODELS_SWITCHED_OFF.items():
        if option not in line:
            continue
        following = line.remaining[line.remaining.index(option) + 1 :]
        if following and following[0] != off:
            problem = f"{option} is resisted by no spring here"
            line.refuse("unknown_law", problem, remedy=f"only {option} {off}")


def read_wall_law(line: Words, script: Script, units: Units, pair_law: PairLaw) -> WallLaw:
    """Return the law between a wall and a kind of sphere.

    The material of the wall is the type that its line names, or else the type of the sphere.
    """
    if "type" not in line:
        script.remarks.append(
            f"walls are taken to be of the material of each sphere (else say {TYPED_WALL_EXAMPLE})"
        )
        return lambda kind: pair_law(kind, kind)
    wall_kind = int(line.number_after("type"))
    return lambda kind: pair_law(kind, wall_kind)
