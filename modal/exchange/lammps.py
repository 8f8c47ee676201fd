"""What LAMMPS says in its own way: laws of contact, and the columns of contacts and walls.

`granular` with hooke, hertz and hertz/material, tangential linear_history, mindlin and their like,
rolling sds, twisting sds and marshall; gran/hooke, gran/hooke/history and gran/hertz/history; `fix
wall/gran` in the same words. Cohesion is refused by name: no spring of this project does that.

As in LAMMPS a type of pair_coeff is a number or a range (`*`, `n*`, `*n`, `m*n`), a range stands
for pairs of rising types alone, and the last line that covers a pair holds. A pair that none covers
is refused: how LAMMPS mixes the laws of its two types depends on its version.
"""

import math
import re
import sys
from collections.abc import Sequence

import numpy as np

from modal.exchange.dump import TYPED, Frame, OfKind, Told, Walls
from modal.exchange.input_script import Script
from modal.exchange.law import DISPLACEMENT, FORCE, MIDDLE, ONE_SIDED, RADIUS, ProgramLaw, Units
from modal.exchange.particles_and_contacts import WALLS, Contacts, LawOf, Packing
from modal.exchange.text import Words, fault
from modal.packing.contact_law import YOUNG_RANGE_PA, Elasticity
from modal.tools.arrays import Floats, Ints

TANGENTIAL = {
    "linear_nohistory": (2, False, FORCE),
    "linear_history": (3, False, DISPLACEMENT),
    "linear_history/classic": (3, False, DISPLACEMENT),
    "mindlin": (3, True, DISPLACEMENT),
    "mindlin/classic": (3, True, DISPLACEMENT),
    "mindlin/force": (3, True, FORCE),
    "mindlin_rescale": (3, True, ONE_SIDED),
    "mindlin_rescale/force": (3, True, ONE_SIDED),
}
"""Model: its number of coefficients, whether its stiffness grows with a, what it keeps."""
NORMAL = {"hooke": 2, "hertz": 2, "hertz/material": 3}
"""Model: its number of coefficients."""
GRAN = {
    "gran/hooke": ("hooke", "linear_nohistory"),
    "gran/hooke/history": ("hooke", "linear_history"),
    "gran/hertz/history": ("hertz", "mindlin"),
}
"""Older style: its normal and its tangential model."""
OPTIONS = ("tangential", "rolling", "twisting", "damping", "cutoff", "limit_damping")
EXAMPLE = '--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"'
UNITS, PLANES, ENDS = "lj", 2, ("patom1", "patom2")
"""Units where a log names none, planes of a fix wall/gran, columns of the two ends of a contact."""
LAST = sys.maxsize
"""The highest type, whatever it is."""


def granular(words: Sequence[str], where: str, arms: tuple[str, str], units: Units) -> ProgramLaw:
    """The law of `pair_style granular`, from its words after the types.

    `where` says in a message whose words these are; `arms` of motion and torque.
    """
    said = Words(words, where, "give the whole line, with values")
    model = said.next("the normal model", NORMAL)
    unit = units.stiffness if model == "hooke" else units.pressure
    normal, *_, poisson = said.in_turn(model, NORMAL[model], null=True)
    stiff, material = unit * normal, None
    if model == "hertz/material":
        material = material_of(stiff, poisson, where)
        stiff = 4 / 3 * material.effective_young
    across, friction, grows, keeps = 0.0, 0.0, False, FORCE
    resists, marshall = {"rolling": 0.0, "twisting": 0.0}, False
    while said.left:
        option = said.next("an option", OPTIONS)
        if option == "tangential":
            count, grows, keeps = TANGENTIAL[said.next("tangential", TANGENTIAL)]
            across, *_, friction = said.in_turn(option, count, null=True)
            across = across if count == 3 else 0.0
        elif option in resists:
            name = said.next(option, ("none", "sds", "marshall")[: 2 + (option == "twisting")])
            marshall = marshall or name == "marshall"
            if name == "sds":
                stiffness, _, limit = said.in_turn(f"{option} sds", 3, null=True)
                resists[option] = stiffness if limit > 0 else min(stiffness, 0.0)
        elif option != "limit_damping":
            said.next(f"the word of {option}")
    across *= units.pressure if grows else units.stiffness
    if math.isnan(across):
        if material is None:
            said.refuse("tangential NULL needs hertz/material", "give its stiffness")
        across = 8 * material.moduli.effective_shear
    rolling, twisting = units.stiffness * resists["rolling"], units.moment * resists["twisting"]
    # LAMMPS takes the coefficient as it is, also one in units of pressure.
    half = 0.5 * (units.length if grows else 1.0) * marshall
    if not (stiff > 0 and all(each >= 0 for each in (across, friction, rolling, twisting))):
        said.refuse(
            f"stiffness {stiff:g} must be positive, tangential {across:g}, friction {friction:g}, "
            "rolling and twisting not negative",
            "mend the line",
        )
    turning = (rolling, twisting, half)
    return ProgramLaw(stiff, model != "hooke", across, grows, friction, keeps, *arms, *turning)


def gran(style: str, words: Sequence[str], where: str, units: Units) -> ProgramLaw:
    """The law of one of `GRAN`: Kn Kt gn gt mu dampflag.

    It is that of granular in other words, with arms as long as the radii.
    """
    said = Words(words, where, "give Kn Kt gamma_n gamma_t xmu dampflag")
    kn, kt, _, _, friction = said.in_turn(style, 5, null=True)
    model, tangential = GRAN[style]
    kt = 2 / 7 * kn if math.isnan(kt) else kt
    own = [] if tangential == "linear_nohistory" else [repr(kt)]
    same = [model, repr(kn), "0", "tangential", tangential, *own, "0", repr(friction)]
    return granular(same, where, (RADIUS, RADIUS), units)


def coefficients(
    style: str, words: Sequence[str], where: str, units: Units, *, wall: bool = False
) -> ProgramLaw:
    """The law that a style and its words say; accelerated variants, such as /omp, have the same."""
    base = re.sub("/(omp|kk|intel|opt|gpu)$", "", style)
    if base == "granular":
        return granular(words, where, (RADIUS, RADIUS if wall else MIDDLE), units)
    base = base if base in GRAN or not wall else f"gran/{base}"
    if base in GRAN:
        return gran(base, words, where, units)
    known = ", ".join(("granular", *GRAN))
    fault(where, f"{style!r} is no law of contact that is known", f"give {known}")


def material_of(young: float, poisson: float, where: str) -> Elasticity:
    """Young's modulus, Pa, and Poisson's ratio; InputError where no material has them."""
    low, high = YOUNG_RANGE_PA
    if not low <= young <= high:
        do = f"write it in Pa ({low:g} to {high:g}), or, of other units, import --scales"
        fault(where, f"Young's modulus {young:g} Pa is that of no material", do)
    if not -1 < poisson < 0.5:
        fault(where, f"Poisson's ratio {poisson:g} is outside -1 to 0.5", "mend it")
    return Elasticity(young, poisson)


def law_of_types(script: Script, units: Units) -> LawOf:
    """The law between any two types of sphere."""
    said = script.said
    style, *shared = script.style
    lines: list[tuple[range, range, ProgramLaw]] = []
    everywhere = [("*", "*")] if shared and style.startswith("gran/") else []
    for one, two, *words in (*everywhere, *script.pair):
        where = f"{said}: pair_coeff {one} {two}"
        first, second = types_of(one, where), types_of(two, where)
        if "*" not in one + two and second[0] < first[0]:
            first, second = second, first
        if second[-1] < first[0]:
            what = "covers no pair, ranges stand for pairs of rising types alone"
            fault(where, what, "exchange the two")
        lines.append((first, second, coefficients(style, words or shared, said, units)))

    def law_of(a: int, b: int) -> ProgramLaw:
        a, b = min(a, b), max(a, b)
        for first, second, law in reversed(lines):
            if a in first and b in second:
                return law
        fault(said, f"no pair_coeff for types {a} and {b}", "give one")

    return law_of


def law_of_wall(said: Words, script: Script, units: Units, of_types: LawOf) -> OfKind:
    """The law of a wall, which stands before its zplane: the same for all types."""
    style, *rest = said.left
    law = coefficients(style, rest[: rest.index("zplane")], said.where, units, wall=True)
    return lambda kind: law


def types_of(word: str, where: str) -> range:
    """The types that a word of pair_coeff stands for; InputError where it is no range."""
    found = re.fullmatch(r"([0-9]*)(\*?)([0-9]*)", word)
    low = int(found[1] or 1) if found else 0
    high = 0 if found is None else int(found[3] or LAST) if found[2] else low
    if not 1 <= low <= high:
        fault(where, f"{word!r} is no type", "give numbers or ranges of them (n, *, n*, *n, m*n)")
    return range(low, high + 1)


def contacts_of(told: Told, packing: Packing, units: Units) -> Contacts:
    """What `pair/local` tells of the contacts between spheres."""
    force, shear = units.force * told.values["force"][:, 0], told.values.get("shear")
    shear = None if shear is None else units.force * shear
    return Contacts(told.i, told.j, force, shear, told.values.get("line"), listed=told.rows)


def at_walls(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
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
        packing.refuse(absent, what, f"mend {TYPED}, or bring the packing to rest")
        parts.append((at, code, push, force))
    at, code, push, rub = (np.concatenate(part) for part in zip(*parts, strict=True))
    return at.astype(np.int32), code.astype(np.int32), push, rub
