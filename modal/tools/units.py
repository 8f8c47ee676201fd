"""Units in words: whether a text says the unit that numbers must be in, and arrays that have one.

All numbers are plain SI. A text that says anything else, or nothing that is known, is refused: a
list of forbidden words would let all others pass.
"""

import re
from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from modal.tools.arrays import Array
from modal.tools.errors import InputError

Dimensions = Counter[str]
"""Powers of kg, m, s, turn (rad) and cycle (of Hz); those that are zero left out."""

NEWTON = {"kg": 1, "m": 1, "s": -2}
SYMBOLS: dict[str, Mapping[str, int]] = {
    **{"kg": {"kg": 1}, "Kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "rad": {"turn": 1}},
    **{"N": NEWTON, "J": NEWTON | {"m": 2}, "Pa": NEWTON | {"m": -1}},
    **{"Hz": {"cycle": 1, "s": -1}, "1": {}, "1.0": {}},
}
"""Units without prefix, by their symbols."""
WORDS = {
    **{"kilogram": "kg", "kilogramme": "kg", "meter": "m", "metre": "m"},
    **{"second": "s", "sec": "s", "radian": "rad", "newton": "N", "joule": "J"},
    **{"pascal": "Pa", "hertz": "Hz"},
}
"""Symbols by names, in small letters; with or without an s at the end."""
NOTHING_SAID = {"", "-", "none", "si", "si units"}
"""In small letters: the unit is that of SI."""
DIMENSIONLESS = {"dimensionless", "unitless"}
"""In small letters: the unit is 1."""
FREE = ("turn", "cycle")
"""What a text may leave out: N m for N m/rad, 1/s for Hz. Each is no word for the other."""
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
FACTOR = re.compile(r"([A-Za-z]+|1(?:\.0)?(?![\d.]))(?:\^?\(?([+-]?\d+(?:\.\d+|/\d+)?)\)?)?")
"""A unit and its power: m, m2, m^2, kg^-1/2, kg^(-1/2)."""


def says(text: str, unit: str) -> bool:
    """Return whether a text says this unit, in one of the spellings that are known.

    >>> says("N m^-1", "N/m"), says("kg*m**2", "kg m^2"), says("kg/s^2", "N/m"), says("", "m")
    (True, True, True, True)
    >>> says("N/mm", "N/m"), says("micron", "m"), says("rad/s", "Hz")
    (False, False, False)
    """
    text = " ".join(text.split())
    if text.lower() in NOTHING_SAID:
        return True
    if text.lower() in DIMENSIONLESS:
        text = "1"
    wanted = _dimensions(unit)
    told = _dimensions(text)
    if wanted is None or told is None:
        return False
    bare = Counter({name: power for name, power in wanted.items() if name not in FREE})
    return told in (wanted, bare)


def _dimensions(text: str) -> Dimensions | None:
    """Return the powers of a product of units; None where the text is none that is known."""
    text = text.translate(SUPERSCRIPTS).replace("**", "^")
    text = re.sub(r"\bper\b", "/", text)
    text = re.sub(r"\s*\^\s*", "^", text)
    # Of a denominator in brackets each factor divides.
    text = re.sub(r"/\s*\(([^()]*)\)(?!\s*[\^\d])", lambda bracket: _divided(bracket[1]), text)
    powers = Dimensions()
    sign, place = 1, 0
    while place < len(text):
        factor = FACTOR.match(text, place)
        if factor:
            own = _factor(factor[1])
            if own is None:
                return None
            for name, power in own.items():
                powers[name] += sign * power * Fraction(factor[2] or 1)  # type: ignore[assignment]
            sign, place = 1, factor.end()
        elif text[place] in " */.·⋅×":
            sign = -1 if text[place] == "/" else sign
            place += 1
        else:
            return None
    return Counter({name: power for name, power in powers.items() if power})


def _divided(factors: str) -> str:
    """Return the factors of a denominator, each behind a stroke of its own."""
    return "".join(f"/{factor}" for factor in re.split(r"[\s*.·⋅×]+", factors) if factor)


def _factor(word: str) -> Mapping[str, int] | None:
    """Return the dimensions of one unit without prefix; None where it is not known."""
    name = word.lower()
    symbol = WORDS.get(name, WORDS.get(name.removesuffix("s"), word))
    return SYMBOLS.get(symbol)


def plain_numbers(given: Any, name: str, unit: str) -> Any:
    """Return what is `given` without the unit that it has with it, if that is `unit`.

    InputError for another unit, and for masked arrays of which a value is masked.
    """
    _refuse_masked(given, name)
    told = getattr(given, "units", getattr(given, "unit", None))
    if told is not None and not callable(told) and type(told) not in (int, float, np.ndarray):
        if not says(str(told), unit):
            raise InputError(
                "unit", f"{name} is in {told}, not in {_named(unit)}", remedy="convert it"
            )
        return getattr(given, "magnitude", getattr(given, "value", given))
    if isinstance(given, list | tuple):
        return [plain_numbers(each, name, unit) if _is_object(each) else each for each in given]
    return given


def _is_object(value: Any) -> bool:
    """Return whether a member of a list may have a unit or a mask: plain numbers have none."""
    return not isinstance(value, int | float | np.generic | str | bytes)


def _refuse_masked(given: Any, name: str) -> None:
    """InputError for a masked value, and for an array that has one."""
    if isinstance(given, np.ma.MaskedArray):
        mask: Array = np.ma.getmaskarray(given)
        if mask.any():
            row = int(np.argwhere(np.atleast_1d(mask))[0, 0])
            raise InputError(
                "masked",
                f"{name} is masked in row {row}",
                remedy="give a number there, or leave the column out",
            )


def _named(unit: str) -> str:
    """Return a unit as a message says it."""
    return "plain numbers" if unit == "1" else unit
