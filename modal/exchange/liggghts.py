"""What LIGGGHTS says otherwise than LAMMPS: its law, its walls, and the columns of its contacts.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused. Contacts come from `compute pair/gran/local`; the forces at walls
are not told.
"""

from collections.abc import Sequence

import numpy as np

from modal.exchange.dump import Frame, OfKind, Told, Walls
from modal.exchange.input_script import PROPERTIES, Script
from modal.exchange.lammps import material_of
from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import Contacts, LawOf, Packing
from modal.exchange.text import Words
from modal.tools.arrays import Floats, Ints

EXAMPLE = (
    '--pair "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 '
    'coefficientFriction 0.3"'
)
TYPED_WALL = '--wall "type N zplane LOW HIGH"'
UNITS, PLANES, ENDS = "si", 1, ("id1", "id2")
"""As of `modal.exchange.lammps`."""
OFF = {"cohesion": "off", "rolling_friction": "off", "surface": "default"}
"""Models that do more than springs, and the word that turns each off."""


def contacts_of(told: Told, packing: Packing, units: Units) -> Contacts:
    """What `pair/gran/local` tells of the contacts between spheres; those at walls by positions."""
    parted = "parts" in told.values
    forces = units.force * told.values["parts" if parted else "whole"]
    along = forces[:, :3]
    push, shear = packing.pushes(told.i, told.j, along)
    shear = forces[:, 3:] if parted else shear
    # Versions differ in which of the two bears the forces that are written; a contact pushes.
    shear = np.where(push < 0, -1.0, 1.0)[:, None] * shear
    # A normal of its own tells more than rounded bounds; that of the whole force is not one.
    line = along if parted else None
    return Contacts(told.i, told.j, abs(push), shear, line=line, listed=told.rows)


def at_walls(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
) -> tuple[Ints, Ints, Floats, None]:
    """Spheres at walls, by positions, and codes (k,); forces that follow from the law, no shear."""
    found = packing.touching()
    i, j = found.i[found.j < 0], found.j[found.j < 0]
    return i, j, np.full(len(i), np.nan), None


def law_of_types(script: Script, units: Units) -> LawOf:
    """The law between two types."""
    said = Words(script.style, script.said, f"give {EXAMPLE}")
    typed = {name: said.numbers(name, 1) for name in PROPERTIES if name in said}
    properties = script.properties | typed
    if "hertz" not in said or "history" not in said:
        why = "the stiffness of others depends on more than the overlap"
        said.refuse("only model hertz with tangential history is known", why)
    for option, off in OFF.items():
        if option in said and said.left[said.left.index(option) + 1 :][:1] not in ([off], []):
            said.refuse(f"{option} is resisted by no spring here", f"only {option} {off}")
    lost = [name for name in PROPERTIES if name not in properties]
    if lost:
        said.refuse(f"no {', '.join(lost)}", f"{said.do}, or the log that has them")
    pairs = zip(properties["youngsModulus"], properties["poissonsRatio"], strict=False)
    materials = [material_of(units.pressure * young, nu, said.where) for young, nu in pairs]
    friction = properties["coefficientFriction"]

    def law_of(a: int, b: int) -> ProgramLaw:
        a, b = sorted((a, b))
        if a < 1 or (b > len(materials) and len(materials) > 1):
            lost = f"no properties for type {a if a < 1 else b}"
            said.refuse(lost, "give them for all types")
        one, two = (materials[min(k, len(materials)) - 1] for k in (a, b))
        young, shear = one.against(two)
        place = (a - 1) * len(materials) + b - 1
        limit = friction[place] if len(friction) > place else friction[0]
        return ProgramLaw(4 / 3 * young, True, 8 * shear, True, limit, DISPLACEMENT)

    return law_of


def law_of_wall(said: Words, script: Script, units: Units, of_types: LawOf) -> OfKind:
    """The law between a wall, of the type that is said or of that of each sphere, and a kind."""
    if "type" not in said:
        what = f"walls are taken to be of the material of each sphere (else say {TYPED_WALL})"
        script.remarks.append(what)
        return lambda of: of_types(of, of)
    kind = int(said.number("type"))
    return lambda of: of_types(of, kind)
