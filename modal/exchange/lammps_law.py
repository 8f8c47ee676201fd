"""LAMMPS' own words for a law of contact, as they stand after pair_style and pair_coeff.

`granular` with hooke, hertz and hertz/material, tangential linear_history, mindlin and their like,
rolling sds, twisting sds and marshall; gran/hooke, gran/hooke/history and gran/hertz/history; `fix
wall/gran` in the same words. Cohesion is refused by name: no spring of this project does that.

As in LAMMPS a type of pair_coeff is a number or a range (`*`, `n*`, `*n`, `m*n`), a range stands
for pairs of rising types alone, the last line that covers a pair holds, and a pair that none covers
is mixed from those of its two types.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from modal.exchange.input_script import Script
from modal.exchange.law import (
    DISPLACEMENT,
    FORCE,
    MIDDLE,
    ONE_SIDED,
    RADIUS,
    SI,
    ProgramLaw,
    Units,
)
from modal.exchange.particles_and_contacts import LawOf
from modal.packing.contact_law import YOUNG, Elasticity
from modal.tools.errors import InputError

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
COHESIVE = ("dmt", "jkr", "mdr")
LAST = sys.maxsize
"""The highest type, whatever it is."""


@dataclass(frozen=True)
class Coefficients:
    """One line of coefficients: the law among spheres of one type, and what it was made of."""

    law: ProgramLaw
    material: Elasticity | None = None
    own_tangential: bool = True


def granular(
    words: Sequence[str], where: str, arms: tuple[str, str], units: Units = SI
) -> Coefficients:
    """The law of `pair_style granular`, from its words after the types.

    `where` says in a message whose words these are; `arms` of motion and torque.
    """
    left = list(words)
    model = _next(left, where, "a normal model")
    if model in COHESIVE:
        raise InputError(
            f"{where}: {model} is cohesive; only hooke, hertz, hertz/material are read"
        )
    if model not in NORMAL:
        raise InputError(f"{where}: {model!r} is no normal model; give {', '.join(NORMAL)}")
    normal = [_number(left, where, model) for _ in range(NORMAL[model])]
    material = None
    if model == "hertz/material":
        material = material_of(units.pressure * normal[0], normal[2], where)
    tangential, friction, grows, keeps, own = 0.0, 0.0, False, FORCE, True
    resists, marshall = {"rolling": 0.0, "twisting": 0.0}, False
    while left:
        option = left.pop(0)
        if option == "tangential":
            name = _next(left, where, "a tangential model")
            if name not in TANGENTIAL:
                raise InputError(
                    f"{where}: tangential {name!r} is not known; give {', '.join(TANGENTIAL)}"
                )
            count, grows, keeps = TANGENTIAL[name]
            own = not (left and left[0].upper() == "NULL")
            if not own:
                left[0] = "0"
            numbers = [_number(left, where, name) for _ in range(count)]
            tangential, friction = numbers[0] if count == 3 else 0.0, numbers[-1]
            if not own and material is None:
                raise InputError(
                    f"{where}: tangential {name} NULL needs hertz/material; give its stiffness"
                )
        elif option in ("rolling", "twisting"):
            name = _next(left, where, option)
            if name == "sds":
                stiffness, _, limit = (_number(left, where, f"{option} sds") for _ in range(3))
                resists[option] = stiffness if limit > 0 else min(stiffness, 0.0)
            elif (option, name) == ("twisting", "marshall"):
                marshall = True
            elif name != "none":
                raise InputError(
                    f"{where}: {option} {name!r} is not known; give none, sds, or twisting marshall"
                )
        elif option in ("damping", "cutoff"):
            _next(left, where, option)
        elif option == "limit_damping":
            continue
        else:
            raise InputError(f"{where}: {option!r} is not known; leave it out or mend it")
    unit = units.stiffness if model == "hooke" else units.pressure
    stiff = 4 / 3 * material.effective_young if material else unit * normal[0]
    tangential *= units.pressure if grows else units.stiffness
    if material and not own:
        tangential = 8 * material.effective_shear
    # LAMMPS takes the coefficient as it is, also one in units of pressure.
    half = 0.5 * (units.length if grows else 1.0) * marshall
    law = ProgramLaw(
        stiff,
        model != "hooke",
        tangential,
        grows,
        friction,
        keeps,
        *arms,
        rolling=units.stiffness * resists["rolling"],
        twisting=units.moment * resists["twisting"],
        marshall=half,
    )
    _check(law, where)
    return Coefficients(law, material, own)


def gran(style: str, words: Sequence[str], where: str, units: Units = SI) -> Coefficients:
    """The law of gran/hooke, gran/hooke/history and gran/hertz/history: Kn Kt gn gt mu dampflag."""
    left = list(words)
    kind = style.removeprefix("gran/").split("/")
    hertz, history = kind[0] == "hertz", "history" in kind[1:]
    if kind[0] not in ("hooke", "hertz") or (hertz and not history):
        raise InputError(f"{where}: {style} is not known; gran/hooke, gran/hertz/history are")
    unit = units.pressure if hertz else units.stiffness
    kn = unit * _number(left, where, "Kn")
    if left and left[0].upper() == "NULL":
        left.pop(0)
        kt = 2 / 7 * kn
    else:
        kt = unit * _number(left, where, "Kt")
    rest = left[:3]
    if len(rest) < 3:
        raise InputError(f"{where}: {style} needs Kn Kt gamma_n gamma_t xmu dampflag; give all six")
    friction = _number([rest[2]], where, "xmu")
    kept = DISPLACEMENT if history else FORCE
    law = ProgramLaw(
        kn, hertz, kt if history else 0.0, hertz, friction, kept, moves=RADIUS, turns=RADIUS
    )
    _check(law, where)
    return Coefficients(law)


def without_suffix(style: str) -> str:
    """A style without that of an accelerated variant, such as /omp."""
    for suffix in ("/omp", "/kk", "/intel", "/opt", "/gpu"):
        style = style.removesuffix(suffix)
    return style


def coefficients(
    style: str, words: Sequence[str], where: str, units: Units = SI, *, wall: bool = False
) -> Coefficients:
    """The law that a style and its words say."""
    base = without_suffix(style)
    if base == "granular":
        return granular(words, where, (RADIUS, RADIUS if wall else MIDDLE), units)
    if wall and base in ("hooke", "hooke/history", "hertz/history"):
        base = f"gran/{base}"
    if base.startswith("gran/"):
        return gran(base, words, where, units)
    raise InputError(
        f"{where}: {style!r} is no law of contact that is known here; give granular, gran/hooke, "
        "gran/hooke/history or gran/hertz/history"
    )


def mixed(first: Coefficients, second: Coefficients) -> ProgramLaw:
    """The law between two types that have none of their own, as LAMMPS mixes them.

    Materials as two bodies in contact; other coefficients by their geometric mean.
    """
    a, b = first.law, second.law
    same = (a.hertz, a.grows, a.keeps, a.marshall) == (b.hertz, b.grows, b.keeps, b.marshall)
    if not same or (first.material is None) != (second.material is None):
        raise InputError("pair_coeff: two types have different models; give their own pair_coeff")

    def mean(x: float, y: float) -> float:
        return float((x * y) ** 0.5)

    normal, tangential = mean(a.normal, b.normal), mean(a.tangential, b.tangential)
    if first.material is not None and second.material is not None:
        young, shear = first.material.against(second.material)
        normal = 4 / 3 * young
        if not first.own_tangential:
            tangential = 8 * shear
    names = ("friction", "rolling", "twisting")
    means: dict[str, Any] = {name: mean(getattr(a, name), getattr(b, name)) for name in names}
    return replace(a, normal=normal, tangential=tangential, **means)


def material_of(young: float, poisson: float, where: str) -> Elasticity:
    """Young's modulus, Pa, and Poisson's ratio; InputError where no material has them."""
    if not YOUNG[0] <= young <= YOUNG[1]:
        raise InputError(
            f"{where}: Young's modulus {young:g} Pa is that of no material; write it in Pa "
            f"({YOUNG[0]:g} to {YOUNG[1]:g}), or give --scales where the units are not SI"
        )
    if not -1 < poisson < 0.5:
        raise InputError(f"{where}: Poisson's ratio {poisson:g} is outside -1 to 0.5; mend it")
    return Elasticity(young, poisson)


def _next(left: list[str], where: str, what: str) -> str:
    if not left:
        raise InputError(f"{where}: ends where {what} should stand; give the whole line")
    return left.pop(0)


def _number(left: list[str], where: str, what: str) -> float:
    word = _next(left, where, f"a coefficient of {what}")
    try:
        return float(word)
    except ValueError:
        raise InputError(
            f"{where}: {word!r} is no number, as a coefficient of {what} is; put its value there"
        ) from None


def _check(law: ProgramLaw, where: str) -> None:
    if not law.normal > 0 or min(law.tangential, law.friction, law.rolling, law.twisting) < 0:
        raise InputError(
            f"{where}: stiffness {law.normal:g} must be positive, tangential {law.tangential:g}, "
            f"friction {law.friction:g}, rolling and twisting not negative; mend the line"
        )


def law_of_pairs(script: Script, units: Units) -> LawOf:
    """The law between any two types of sphere."""
    said = script.said
    style, *shared = script.style
    if style.startswith("hybrid"):
        raise InputError(
            f"{said}: pair_style hybrid is not known; give the granular part by --pair"
        )
    lines: list[tuple[range, range, Coefficients]] = []
    if style.startswith("gran/"):
        everywhere = coefficients(style, shared, said, units)
        lines.append((types_of("*", said), types_of("*", said), everywhere))
    for one, two, *words in script.pair:
        where = f"{said}: pair_coeff {one} {two}"
        first, second = types_of(one, where), types_of(two, where)
        if "*" not in one + two and second[0] < first[0]:
            first, second = second, first
        if second[-1] < first[0]:
            raise InputError(
                f"{where}: covers no pair, ranges stand for pairs of rising types alone; "
                "exchange the two"
            )
        lines.append((first, second, coefficients(style, words or shared, said, units)))

    def told(a: int, b: int) -> Coefficients | None:
        covering = (law for first, second, law in reversed(lines) if a in first and b in second)
        return next(covering, None)

    def law_of(a: int, b: int) -> ProgramLaw:
        a, b = min(a, b), max(a, b)
        own, one, two = told(a, b), told(a, a), told(b, b)
        if own is not None:
            return own.law
        if one is None or two is None:
            raise InputError(f"{said}: no pair_coeff for types {a} and {b}; give one")
        return mixed(one, two)

    return law_of


def types_of(word: str, where: str) -> range:
    """The types that a word of pair_coeff stands for; InputError where it is no range."""
    found = re.fullmatch(r"([0-9]*)(\*?)([0-9]*)", word)
    low = int(found[1] or 1) if found else 0
    high = 0 if found is None else int(found[3] or LAST) if found[2] else low
    if not 1 <= low <= high:
        raise InputError(
            f"{where}: {word!r} is no type; give numbers or ranges of them (n, *, n*, *n, m*n)"
        )
    return range(low, high + 1)
