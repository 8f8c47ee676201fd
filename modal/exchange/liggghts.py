"""What LIGGGHTS says otherwise than LAMMPS: its law, its walls, and the columns of its contacts.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused. Contacts come from `compute pair/gran/local`; the forces at walls
are not told.
"""

from collections.abc import Callable

import numpy as np

from modal.exchange.dump import TYPED, Told, Wall, Walls
from modal.exchange.input_script import PROPERTIES, Script
from modal.exchange.lammps_law import material_of
from modal.exchange.law import DISPLACEMENT, ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, LawOf, Packing
from modal.exchange.text import Words, fault

EXAMPLE = (
    '--pair "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 '
    'coefficientFriction 0.3"'
)
TYPED_WALL = '--wall "type N zplane LOW HIGH"'
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
    pairs = Contacts(told.i, told.j, abs(push), shear, line=line, listed=told.rows)
    if np.isnan(packing.cell.walls).all():
        return pairs
    found = packing.touching()
    found = found.some(found.j < 0)
    return pairs.with_walls(found.i, found.j, np.full(len(found.i), np.nan), None)


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


def walls_of(script: Script, units: Units, of_types: LawOf) -> Walls:
    """The walls by their codes; one whose type is not said is of that of each sphere.

    From --wall "type N zplane LOW HIGH", or from the log's fixes, each of one plane; a single one
    is the floor.
    """

    def law(kind: int | None) -> Callable[[int], ProgramLaw]:
        return lambda of: of_types(of, kind or of)

    found = []
    for name, words in script.walls.items():
        do = f"only primitive walls zplane are known; give {TYPED_WALL}"
        said = Words(words, name if name == TYPED else f"fix {name} wall/gran", do)
        heights = said.numbers("zplane", 1 + (name == TYPED), null=True)
        unsaid = name == TYPED and "type" not in said
        kind = None if unsaid else int(said.number("type"))
        found += [(z, kind) for z in heights]
        if unsaid:
            what = f"walls are taken to be of the material of each sphere (else say {TYPED_WALL})"
            script.remarks.append(what)
    if len(found) > len(WALLS):
        fault(script.said, f"{len(found)} walls zplane", f"give two, {TYPED_WALL}")
    if TYPED not in script.walls:
        found.sort()
    return {
        code: Wall(units.length * z, law(kind))
        for code, (z, kind) in zip(WALLS, found, strict=False)
        if not np.isnan(z)
    }
