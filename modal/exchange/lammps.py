"""Read features of LAMMPS alone: its laws of contact, and its columns of contacts and walls.

The known laws are `granular` with hooke, hertz, hertz/material, dmt and jkr, tangential
linear_history, mindlin and their variants, rolling sds, twisting sds and marshall; gran/hooke,
gran/hooke/history and gran/hertz/history; `fix wall/gran` with the same styles. Other models of
cohesion are refused.

As in LAMMPS a type of pair_coeff is a number or a range (`*`, `n*`, `*n`, `m*n`), a range stands
for pairs of rising types alone, and the last line that covers a pair holds. A pair that no line
covers is refused: how LAMMPS mixes the laws of its two types depends on the version.
"""

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from modal.exchange.dump import TYPED_WALL, DumpedContacts, Frame, WallLaw, Walls
from modal.exchange.input_script import Script
from modal.exchange.law import (
    DISPLACEMENT,
    FORCE,
    MIDDLE_ARM,
    RADIUS_ARM,
    SHRINKING_DISPLACEMENT,
    LeverArm,
    ProgramLaw,
    ShearMemory,
    Units,
)
from modal.exchange.particles_and_contacts import WALLS, Contacts, Packing, PairLaw
from modal.exchange.refusals import refuse
from modal.exchange.rows import Rows
from modal.exchange.words import Words
from modal.packing.contact_law import YOUNG_RANGE_PA, Elasticity
from modal.tools.arrays import Floats, Ints


class TangentialModel(NamedTuple):
    """A tangential model: number of coefficients, whether its stiffness grows with a, history.

    a is the radius of the circle of contact.
    """

    coefficients: int
    grows: bool
    memory: ShearMemory


TANGENTIAL = {
    "linear_nohistory": TangentialModel(2, False, FORCE),
    "linear_history": TangentialModel(3, False, DISPLACEMENT),
    "linear_history_classic": TangentialModel(3, False, DISPLACEMENT),
    "mindlin": TangentialModel(3, True, DISPLACEMENT),
    "mindlin_classic": TangentialModel(3, True, DISPLACEMENT),
    "mindlin/force": TangentialModel(3, True, FORCE),
    "mindlin_rescale": TangentialModel(3, True, SHRINKING_DISPLACEMENT),
    "mindlin_rescale/force": TangentialModel(3, True, SHRINKING_DISPLACEMENT),
}
"""Tangential models of `granular`."""
NORMAL = {"hooke": 2, "hertz": 2, "hertz/material": 3, "dmt": 4, "jkr": 4}
"""Normal models of `granular`, and the number of coefficients of each."""
ADHESIVE = ("dmt", "jkr")
"""Normal models whose last coefficient is the cohesion, half the work of adhesion."""
MATERIAL = ("hertz/material", *ADHESIVE)
"""Normal models whose coefficients are Young's modulus, damping and Poisson's ratio."""


class OlderStyle(NamedTuple):
    """An older style of LAMMPS: the normal and tangential model of `granular` that it equals."""

    normal: str
    tangential: str


OLDER_STYLES = {
    "gran/hooke": OlderStyle("hooke", "linear_nohistory"),
    "gran/hooke/history": OlderStyle("hooke", "linear_history"),
    "gran/hertz/history": OlderStyle("hertz", "mindlin"),
}
"""Older styles by their names."""
TANGENTIAL_OVER_NORMAL = 2 / 7
"""Tangential stiffness of the older styles divided by the normal one, if it is NULL."""
OPTIONS = ("tangential", "rolling", "twisting", "damping", "cutoff", "limit_damping")
"""Words of `granular` after the normal model."""
ROLLING_MODELS = ("none", "sds")
"""Rolling models of `granular` that are known."""
TWISTING_MODELS = ("none", "sds", "marshall")
"""Twisting models of `granular` that are known."""
EXAMPLE = '--pair "granular hertz/material 6e10 0 0.2 tangential mindlin NULL 0 0.3"'
"""Example of a law that a message shows."""
DEFAULT_UNITS = "lj"
"""Name of the units if a log names none."""
PLANES_PER_FIX = 2
"""Number of planes of one fix wall/gran."""
END_COLUMNS = ("patom1", "patom2")
"""Columns of the two ends of a contact."""
MAX_TYPE = sys.maxsize
"""Highest type where a range does not name its upper end."""


class LeverArms(NamedTuple):
    """The lever arms of the motion and of the torque at a contact."""

    motion: LeverArm
    torque: LeverArm


@dataclass
class _GranularOptions:
    """The options of `pair_style granular`, stiffnesses in the units of the file.

    The tangential stiffness is NaN if it follows from the material.
    """

    tangential: float = 0.0
    friction: float = 0.0
    grows: bool = False
    memory: ShearMemory = FORCE
    rolling: float = 0.0
    twisting: float = 0.0
    marshall: bool = False


def parse_granular(words: Sequence[str], place: str, arms: LeverArms, units: Units) -> ProgramLaw:
    """Return the law of `pair_style granular`, from its words after the types.

    `place` names the file and line in messages. Raises InputError for an unknown law.
    """
    line = Words(words, place, "give the whole line, with values")
    model = line.take("the normal model", NORMAL)
    is_hooke = model == "hooke"
    coefficients = line.take_numbers(model, NORMAL[model], null=True)
    normal = coefficients[0]
    poisson = coefficients[min(2, len(coefficients) - 1)]
    cohesion = 0.0
    if model in ADHESIVE:
        cohesion = units.stiffness * coefficients[3]
    normal = (units.stiffness if is_hooke else units.pressure) * normal
    material = None
    if model in MATERIAL:
        material = check_material(normal, poisson, place)
        normal = 4 / 3 * material.effective_young
    options = _parse_options(line)
    tangential = options.tangential * (units.pressure if options.grows else units.stiffness)
    if math.isnan(tangential):
        if material is None:
            problem = f"tangential NULL needs {', '.join(MATERIAL)}"
            line.refuse("no_stiffness", problem, remedy="give its stiffness")
        tangential = 8 * material.moduli.effective_shear
    rolling = units.stiffness * options.rolling
    twisting = units.moment * options.twisting
    marshall = 0.0
    if options.marshall:
        # LAMMPS takes the coefficient as it is, also one in units of pressure.
        marshall = 0.5 * (units.length if options.grows else 1.0)
    springs = (tangential, options.friction, rolling, twisting, cohesion)
    if not (normal > 0 and all(number >= 0 for number in springs)):
        line.refuse(
            "not_positive",
            f"stiffness {normal:g} must be positive, tangential {tangential:g}, friction "
            f"{options.friction:g}, rolling, twisting and cohesion not negative",
            remedy="mend the line",
        )
    return ProgramLaw(
        normal=normal,
        hertz=not is_hooke,
        tangential=tangential,
        grows=options.grows,
        friction=options.friction,
        shear_memory=options.memory,
        motion_arm=arms.motion,
        torque_arm=arms.torque,
        rolling=rolling,
        twisting=twisting,
        marshall=marshall,
        cohesion=cohesion,
        acts_across_gaps=model == "jkr",
    )


def _parse_options(line: Words) -> _GranularOptions:
    """Return the options of `pair_style granular`, and remove all words from `line`."""
    options = _GranularOptions()
    while line.remaining:
        match line.take("an option", OPTIONS):
            case "tangential":
                model = TANGENTIAL[line.take("tangential", TANGENTIAL)]
                coefficients = line.take_numbers("tangential", model.coefficients, null=True)
                options.grows = model.grows
                options.memory = model.memory
                options.friction = coefficients[-1]
                has_stiffness = model.coefficients == 3
                options.tangential = coefficients[0] if has_stiffness else 0.0
            case "rolling":
                if line.take("rolling", ROLLING_MODELS) == "sds":
                    options.rolling = _take_sds_stiffness(line, "rolling sds")
            case "twisting":
                model_name = line.take("twisting", TWISTING_MODELS)
                options.marshall = options.marshall or model_name == "marshall"
                if model_name == "sds":
                    options.twisting = _take_sds_stiffness(line, "twisting sds")
            case "limit_damping":
                pass
            case option:
                line.take(f"the word of {option}")
    return options


def _take_sds_stiffness(line: Words, name: str) -> float:
    """Remove stiffness, damping and limit of an sds model from the line; return its stiffness.

    The stiffness is 0 if the limit is not above 0: the spring then bears no force. A negative
    stiffness is returned unchanged, so that the caller refuses it.
    """
    stiffness, _, limit = line.take_numbers(name, 3, null=True)
    if limit > 0:
        return stiffness
    return min(stiffness, 0.0)


def parse_older_style(style: str, words: Sequence[str], place: str, units: Units) -> ProgramLaw:
    """Return the law of one of `OLDER_STYLES`, from its words Kn Kt gn gt mu dampflag.

    The law equals one of `granular`, except that its lever arms are as long as the radii.
    """
    line = Words(words, place, "give Kn Kt gamma_n gamma_t xmu dampflag")
    normal, tangential, _, _, friction = line.take_numbers(style, 5, null=True)
    models = OLDER_STYLES[style]
    if math.isnan(tangential):
        tangential = TANGENTIAL_OVER_NORMAL * normal
    same_words = [models.normal, repr(normal), "0", "tangential", models.tangential]
    if models.tangential != "linear_nohistory":
        same_words.append(repr(tangential))
    same_words += ["0", repr(friction)]
    return parse_granular(same_words, place, LeverArms(RADIUS_ARM, RADIUS_ARM), units)


def parse_law(
    style: str, words: Sequence[str], place: str, units: Units, *, is_wall: bool = False
) -> ProgramLaw:
    """Return the law of a style and its words; accelerated variants, as /omp, have the same law.

    Raises InputError for an unknown style.
    """
    base = re.sub("/(omp|kk|intel|opt|gpu)$", "", style)
    if base == "granular":
        arms = LeverArms(RADIUS_ARM, RADIUS_ARM if is_wall else MIDDLE_ARM)
        return parse_granular(words, place, arms, units)
    if is_wall and base not in OLDER_STYLES:
        base = f"gran/{base}"
    if base in OLDER_STYLES:
        return parse_older_style(base, words, place, units)
    known = ", ".join(("granular", *OLDER_STYLES))
    problem = f"{style!r} is no law of contact that is known"
    refuse(place, "unknown_law", problem, remedy=f"give {known}")


def check_material(young: float, poisson: float, place: str) -> Elasticity:
    """Return a material of Young's modulus, Pa, and Poisson's ratio.

    Raises InputError if the values are physically impossible.
    """
    low, high = YOUNG_RANGE_PA
    if not low <= young <= high:
        problem = f"Young's modulus {young:g} Pa is that of no material"
        remedy = f"write it in Pa ({low:g} to {high:g}), or, of other units, import --scales"
        refuse(place, "material", problem, remedy=remedy)
    if not -1 < poisson < 0.5:
        problem = f"Poisson's ratio {poisson:g} is outside -1 to 0.5"
        refuse(place, "material", problem, remedy="mend it")
    return Elasticity(young, poisson)


class TypedPair(NamedTuple):
    """A typed law: the words of pair_style, and of pair_coeff with its two types."""

    style: tuple[str, ...]
    coefficients: tuple[str, ...]


def parse_typed_pair(text: str) -> TypedPair:
    """Return the law of --pair: the words behind pair_style, or whole lines of a script.

    The words of a normal model alone are those of `granular`. Raises InputError for no words.

    >>> parse_typed_pair("hooke 1e5 0").style
    ('granular', 'hooke', '1e5', '0')
    >>> parse_typed_pair("pair_style granular; pair_coeff 1 * hooke 1e5 0")
    TypedPair(style=('granular',), coefficients=('1', '*', 'hooke', '1e5', '0'))
    """
    words = text.replace(";", " ").split()
    if words[:1] == ["pair_style"]:
        words.pop(0)
    if "pair_coeff" in words:
        place = words.index("pair_coeff")
        style = tuple(words[:place]) or ("granular",)
        coefficients = tuple(words[place + 1 :])
        if len(coefficients) > 1 and "pair_coeff" not in coefficients:
            return TypedPair(style, coefficients)
        problem = "one line of pair_coeff is understood, with its two types"
        refuse("--pair", "no_law", problem, remedy=f"give {EXAMPLE}, or the log (--log)")
    if not words:
        refuse("--pair", "no_law", "it is empty", remedy=f"give {EXAMPLE}")
    if words[0] in NORMAL:
        words.insert(0, "granular")
    return TypedPair(tuple(words), ("*", "*", *words[1:]))


class _PairCoefficients(NamedTuple):
    """One line of pair_coeff: the types on its two sides, and their law."""

    first: range
    second: range
    law: ProgramLaw


def read_pair_law(script: Script, units: Units) -> PairLaw:
    """Return the law between any two types of sphere."""
    lines = _read_pair_coefficients(script, units)

    def find_law(first: int, second: int) -> ProgramLaw:
        low = min(first, second)
        high = max(first, second)
        for line in reversed(lines):
            if low in line.first and high in line.second:
                return line.law
        problem = f"no pair_coeff for types {low} and {high}"
        refuse(script.place, "no_law", problem, remedy="give one")

    return find_law


def _read_pair_coefficients(script: Script, units: Units) -> list[_PairCoefficients]:
    """Return the lines of pair_coeff; an older style counts as a first line for all types."""
    style, *shared_words = script.style
    lines = list(script.pair_coefficients)
    if shared_words and style.startswith("gran/"):
        lines.insert(0, ("*", "*"))
    coefficients = []
    for first_word, second_word, *words in lines:
        place = f"{script.place}: pair_coeff {first_word} {second_word}"
        first = parse_types(first_word, place)
        second = parse_types(second_word, place)
        has_range = "*" in first_word + second_word
        if not has_range and second[0] < first[0]:
            first, second = second, first
        if second[-1] < first[0]:
            refuse(
                place,
                "no_pair",
                "covers no pair, ranges stand for pairs of rising types alone",
                remedy="exchange the two",
            )
        law = parse_law(style, words or shared_words, script.place, units)
        coefficients.append(_PairCoefficients(first, second, law))
    return coefficients


def read_wall_law(line: Words, script: Script, units: Units, pair_law: PairLaw) -> WallLaw:
    """Return the law of a wall from the words before `zplane`; it is the same for all types."""
    style, *words = line.remaining
    law = parse_law(style, words[: words.index("zplane")], line.place, units, is_wall=True)
    return lambda kind: law


def parse_types(word: str, place: str) -> range:
    """Return the types that a word of pair_coeff stands for; InputError if it is not a range."""
    match = re.fullmatch(r"([0-9]*)(\*?)([0-9]*)", word)
    low = 0
    high = 0
    if match:
        low = int(match[1] or 1)
        high = int(match[3] or MAX_TYPE) if match[2] else low
    if not 1 <= low <= high:
        remedy = "give numbers or ranges of them (n, *, n*, *n, m*n)"
        refuse(place, "type_range", f"{word!r} is no type", remedy=remedy)
    return range(low, high + 1)


def convert_contacts(dumped: DumpedContacts, packing: Packing, units: Units) -> Contacts:
    """Return the contacts between spheres that `pair/local` has written, in SI units."""
    force = units.force * dumped.values["force"][:, 0]
    shear = dumped.values.get("shear")
    if shear is not None:
        shear = units.force * shear
    line = dumped.values.get("line")
    return Contacts(dumped.i, dumped.j, force, shear, line, listed=dumped.rows)


class WallContacts(NamedTuple):
    """Contacts of k spheres with walls.

    i: indices (k,) of the spheres. j: codes (k,) of the walls. force: normal forces (k,), N, NaN
    where they follow from the law. shear: shear forces (k, 3) on the spheres, N, or None.
    """

    i: Ints
    j: Ints
    force: Floats
    shear: Floats | None


def find_wall_contacts(
    frame: Frame, packing: Packing, units: Units, walls: Walls, fixes: Sequence[str]
) -> WallContacts:
    """Return the contacts with walls, from the columns f_ID[1] to f_ID[4] of the spheres.

    `fixes` are the IDs of the log's walls. If a dump lacks the columns of all these fixes, it is
    older than the end of the log, or the IDs are not known: then all columns of this form are used.
    Raises InputError for columns that are missing, or that do not belong to a wall.
    """
    order = np.argsort(frame.rows.read("id")[:, 0], kind="stable")
    parts = [
        _read_wall_contacts(frame.rows, order, name, packing, units, walls)
        for name in _choose_wall_fixes(frame.rows, fixes)
    ]
    shears = [part.shear for part in parts if part.shear is not None]
    return WallContacts(
        i=np.concatenate([part.i for part in parts]),
        j=np.concatenate([part.j for part in parts]),
        force=np.concatenate([part.force for part in parts]),
        shear=np.concatenate(shears),
    )


def _wall_columns(name: str) -> list[str]:
    """Return the columns of a fix wall/gran: whether the sphere touches, and the three forces."""
    return [f"f_{name}[{k}]" for k in (1, 2, 3, 4)]


def _choose_wall_fixes(rows: Rows, fixes: Sequence[str]) -> Sequence[str]:
    """Return the IDs of the fixes whose columns are used; see `find_wall_contacts`."""
    started = re.findall(r"f_(\w+)\[1\]", " ".join(rows.columns))
    complete = [name for name in started if rows.has(*_wall_columns(name))]
    if set(fixes) & set(complete):
        return fixes
    return complete or fixes or ["ID"]


def _read_wall_contacts(
    rows: Rows, order: Ints, name: str, packing: Packing, units: Units, walls: Walls
) -> WallContacts:
    """Return the contacts with the walls of one fix; `order` (n,) sorts the rows by number."""
    columns = _wall_columns(name)
    rows.require(
        columns, f"write fix {name} ... wall/gran ... contacts and dump {' '.join(columns)}"
    )
    table = rows.read(*columns)
    rows.refuse(
        ~np.isin(table[:, 0], (0, 1)),
        "no_wall_flag",
        "not 1 at a wall and 0 elsewhere",
        remedy="leave columns of other fixes out, or give the log that names the walls (--log)",
        column=columns[0],
    )
    (spheres,) = np.nonzero(table[order, 0])
    force = units.force * table[order][spheres, 1:]
    # The wall that pushes; a sphere between two walls of one fix would need two rows.
    code = np.where(force[:, 2] > 0, *WALLS)
    if any(wall.law(kind).cohesion for wall in walls.values() for kind in set(packing.kind)):
        code = _nearest_walls(packing.position[spheres, 2], walls)
    normal_force = np.where(code == WALLS[0], 1, -1) * force[:, 2]
    force[:, 2] = 0
    codes_of_fix = {code for code, wall in walls.items() if wall.name == name} or set(walls)
    pushed_by_absent_wall = spheres[~np.isin(code, list(codes_of_fix))]
    packing.refuse(
        np.isin(np.arange(len(order)), pushed_by_absent_wall),
        "no_wall",
        f"is pushed in f_{name} by a wall that is NULL in its zplane LOW HIGH",
        f"mend {TYPED_WALL}, or bring the packing to rest",
    )
    return WallContacts(spheres.astype(np.int32), code.astype(np.int32), normal_force, force)


def _nearest_walls(height: Floats, walls: Walls) -> Ints:
    """Return the codes (k,) of the walls that are nearest to z (k,): adhesive walls may pull."""
    codes = np.array(list(walls))
    planes = np.array([wall.z for wall in walls.values()])
    nearest: Ints = codes[abs(height[:, None] - planes).argmin(axis=1)]
    return nearest
