"""What a log of LIGGGHTS, or the command line, says of units, law, walls and columns.

`model hertz` with `tangential history`: N = 4/3 E* sqrt(R* overlap) overlap and 8 G* sqrt(R*
overlap), the shear displacement kept. `model hooke` takes its stiffness from masses and a velocity
that is typed in, and is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from modal.exchange.bodies import LawOf
from modal.exchange.lammps_law import material_of
from modal.exchange.logged import logged_lines
from modal.exchange.program_law import DISPLACEMENT, MIDDLE, ProgramLaw, Units
from modal.exchange.rows import fault
from modal.packing.network import RECEIVER_WALL, SOURCE_WALL
from modal.tools.errors import InputError

PROPERTIES = ("youngsModulus", "poissonsRatio", "coefficientFriction")
EXAMPLE = (
    '--pair "gran model hertz tangential history youngsModulus 6e10 poissonsRatio 0.2 '
    'coefficientFriction 0.3"'
)
TYPED_WALL = '--wall "type N zplane LOW HIGH"'
REFUSED_FIXES = {
    "multisphere": "clumps are not spheres; a network knows single spheres alone",
    "rigid": "clumps are not spheres; a network knows single spheres alone",
    "bond": "bonds are no contacts that this project knows",
}
STYLES = ("property/global", "pair/gran/local", "wall/gran", *REFUSED_FIXES)
"""Of the fixes and computes that count."""
OFF = {"cohesion": "off", "rolling_friction": "off", "surface": "default"}
"""Models that do more than springs, and the word that turns each off."""


@dataclass
class Script:
    """What counts of the commands; `where` says in a message whose words they are."""

    where: str
    units: str = "si"
    model: list[str] = field(default_factory=list)
    properties: dict[str, list[float]] = field(default_factory=dict)
    computes: dict[str, list[str]] = field(default_factory=dict)
    walls: dict[str, list[str]] = field(default_factory=dict)


def read_script(log: str | Path | None, pair: str | None) -> Script:
    """The commands of a log that count at its end; the law of `pair` where it is typed."""
    script = Script("--pair" if pair else f"{log}")
    for number, words in logged_lines(log, STYLES) if log else ():
        _command(script, words, str(log), number)
    if pair:
        script.model = pair.split()
        typed = [name for name in PROPERTIES if name in script.model]
        script.properties |= {name: _after(script.model, name) for name in typed}
    return script


def _command(script: Script, words: list[str], log: str, number: int) -> None:
    """What one command changes."""
    match words:
        case ["units", name]:
            script.units = name
        case ["pair_style", "gran", *_]:
            script.model = words[1:]
        case ["fix", _, _, "property/global", name, kind, *rest] if name in PROPERTIES:
            listed = rest[1:] if kind == "peratomtypepair" else rest
            try:
                script.properties[name] = [float(word) for word in listed]
            except ValueError as error:
                what, do = f"{name}: {error}", "write numbers there"
                fault(log, what, do, number)
        case ["compute", name, _, "pair/gran/local", *rest]:
            script.computes[name] = rest
        case ["fix", name, _, "wall/gran", *rest]:
            script.walls[name] = rest
        case ["unfix", name]:
            script.walls.pop(name, None)
        case ["fix", _, _, style, *_] if style.split("/")[0] in REFUSED_FIXES:
            what = f"fix {style}: {REFUSED_FIXES[style.split('/')[0]]}"
            fault(log, what, "pack single spheres", number)


def _after(words: list[str], name: str) -> list[float]:
    try:
        return [float(words[words.index(name) + 1])]
    except (ValueError, IndexError):
        raise InputError(f"--pair: {name} needs a number behind it") from None


def law_of_types(script: Script, units: Units, of_wall: dict[int, int]) -> LawOf:
    """The law between two types, or a type and a wall; `of_wall` has the types of walls."""
    words, properties, where = script.model, script.properties, script.where
    if words[:1] != ["gran"]:
        raise InputError(f"no law of contact is known; give {EXAMPLE}")
    if "hertz" not in words or "history" not in words:
        raise InputError(
            f"{where}: only model hertz with tangential history is known; the stiffness of others "
            "depends on more than the overlap"
        )
    for option, off in OFF.items():
        if option in words and words[words.index(option) + 1 :][:1] not in ([off], []):
            raise InputError(
                f"{where}: {option} is resisted by no spring here; only {option} {off}"
            )
    lost = [name for name in PROPERTIES if name not in properties]
    if lost:
        raise InputError(f"{where}: no {', '.join(lost)}; give {EXAMPLE}, or the log that has them")
    materials = [
        material_of(units.pressure * young, poisson, where)
        for young, poisson in zip(
            properties["youngsModulus"], properties["poissonsRatio"], strict=False
        )
    ]
    friction = properties["coefficientFriction"]

    def law_of(a: int, b: int) -> ProgramLaw:
        if a < 0:
            a, b = sorted((b, of_wall.get(a, b)))
        if a < 1 or (b > len(materials) and len(materials) > 1):
            raise InputError(
                f"{where}: no properties for type {a if a < 1 else b}; give them for all types"
            )
        one, two = (materials[min(k, len(materials)) - 1] for k in (a, b))
        young, shear = one.against(two)
        place = (a - 1) * len(materials) + b - 1
        return ProgramLaw(
            normal=4 / 3 * young,
            hertz=True,
            tangential=8 * shear,
            grows=True,
            friction=friction[place] if len(friction) > place else friction[0],
            keeps=DISPLACEMENT,
            moves=MIDDLE,
            turns=MIDDLE,
        )

    return law_of


def walls_of(
    wall: str | None, script: Script, units: Units
) -> tuple[tuple[float, float], dict[int, int]]:
    """z of both walls, m, NaN for none, and their types by their codes, where these are said.

    From --wall "type N zplane LOW HIGH", or from the log's fixes, each of one plane; a single one
    is the floor.
    """
    planes = {SOURCE_WALL: np.nan, RECEIVER_WALL: np.nan}
    types: dict[int, int] = {}
    if wall:
        words = wall.split()
        try:
            at = words.index("zplane")
            for code, word in zip(planes, words[at + 1 : at + 3], strict=True):
                planes[code] = np.nan if word.upper() == "NULL" else units.length * float(word)
            if "type" in words:
                types = dict.fromkeys(planes, int(words[words.index("type") + 1]))
        except (ValueError, IndexError):
            raise InputError(
                '--wall: for LIGGGHTS give "type N zplane LOW HIGH" (a number or NULL)'
            ) from None
        return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types
    found = sorted(_plane(name, words, units) for name, words in script.walls.items())
    if len(found) > len(planes):
        raise InputError(f"{script.where}: {len(found)} walls zplane; give two, {TYPED_WALL}")
    for code, (z, kind) in zip(planes, found, strict=False):
        planes[code], types[code] = z, kind
    return (planes[SOURCE_WALL], planes[RECEIVER_WALL]), types


def _plane(name: str, words: Sequence[str], units: Units) -> tuple[float, int]:
    """z, m, and type of one flat wall."""
    try:
        z, kind = (words[words.index(key) + 1] for key in ("zplane", "type"))
        return units.length * float(z), int(kind)
    except (ValueError, IndexError):
        raise InputError(
            f"fix {name} wall/gran: only primitive walls zplane are known; give {TYPED_WALL}"
        ) from None
