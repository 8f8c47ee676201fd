"""Check units of numbers: compare texts with the expected unit, and read arrays with units.

All numbers are in SI units without prefix. A text that states another unit, or an unknown one, is
refused.
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
"""Powers of kg, m, s, turn (rad) and cycle (in Hz) that are not zero."""

NEWTON = {"kg": 1, "m": 1, "s": -2}
SYMBOLS: dict[str, Mapping[str, int]] = {
    "kg": {"kg": 1},
    "Kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"turn": 1},
    "N": NEWTON,
    "J": NEWTON | {"m": 2},
    "Pa": NEWTON | {"m": -1},
    "Hz": {"cycle": 1, "s": -1},
    "1": {},
    "1.0": {},
}
"""Dimensions of units without prefix, by their symbols."""
UNIT_NAMES = {
    "kilogram": "kg",
    "kilogramme": "kg",
    "meter": "m",
    "metre": "m",
    "second": "s",
    "sec": "s",
    "radian": "rad",
    "newton": "N",
    "joule": "J",
    "pascal": "Pa",
    "hertz": "Hz",
}
"""Symbols by names in small letters, which may have an s at the end."""
SI_WORDS = {"", "-", "none", "si", "si units"}
"""Texts in small letters that stand for the unit of SI."""
DIMENSIONLESS = {"dimensionless", "unitless"}
"""Texts in small letters that stand for the unit 1."""
OPTIONAL_DIMENSIONS = ("turn", "cycle")
"""Dimensions that a text may leave out: N m for N m/rad, 1/s for Hz. Neither stands for the
other."""
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
SEPARATORS = " */.·⋅×"
"""Characters between the factors of a product of units."""
FACTOR = re.compile(r"([A-Za-z]+|1(?:\.0)?(?![\d.]))(?:\^?\(?([+-]?\d+(?:\.\d+|/\d+)?)\)?)?")
"""A unit and its power: m, m2, m^2, kg^-1/2, kg^(-1/2)."""


def says(text: str, unit: str) -> bool:
    """Return whether a text states this unit, in one of the known spellings.

    >>> says("N m^-1", "N/m"), says("kg*m**2", "kg m^2"), says("kg/s^2", "N/m"), says("", "m")
    (True, True, True, True)
    >>> says("N/mm", "N/m"), says("micron", "m"), says("rad/s", "Hz")
    (False, False, False)
    """
    text = " ".join(text.split())
    if text.lower() in SI_WORDS:
        return True
    if text.lower() in DIMENSIONLESS:
        text = "1"
    expected = _dimensions(unit)
    dimensions = _dimensions(text)
    if expected is None or dimensions is None:
        return False
    shortened = Dimensions()
    for name, power in expected.items():
        if name not in OPTIONAL_DIMENSIONS:
            shortened[name] = power
    return dimensions in (expected, shortened)


def _dimensions(text: str) -> Dimensions | None:
    """Return the dimensions of a product of units; None if it is not such a product."""
    text = text.translate(SUPERSCRIPTS).replace("**", "^")
    text = re.sub(r"\bper\b", "/", text)
    text = re.sub(r"\s*\^\s*", "^", text)
    # Each factor of a denominator in brackets divides.
    text = re.sub(r"/\s*\(([^()]*)\)(?!\s*[\^\d])", lambda bracket: _divided(bracket[1]), text)
    powers = Dimensions()
    sign = 1
    start = 0
    while start < len(text):
        factor = FACTOR.match(text, start)
        if factor:
            dimensions = _unit_dimensions(factor[1])
            if dimensions is None:
                return None
            for name, power in dimensions.items():
                powers[name] += sign * power * Fraction(factor[2] or 1)  # type: ignore[assignment]
            sign = 1
            start = factor.end()
        elif text[start] in SEPARATORS:
            if text[start] == "/":
                sign = -1
            start += 1
        else:
            return None
    return Counter({name: power for name, power in powers.items() if power})


def _divided(factors: str) -> str:
    """Return the factors of a denominator, each with its own slash before it."""
    return "".join(f"/{factor}" for factor in re.split(r"[\s*.·⋅×]+", factors) if factor)


def _unit_dimensions(word: str) -> Mapping[str, int] | None:
    """Return the dimensions of one unit without prefix; None if it is unknown."""
    name = word.lower()
    symbol = UNIT_NAMES.get(name, UNIT_NAMES.get(name.removesuffix("s"), word))
    return SYMBOLS.get(symbol)


def plain_numbers(values: Any, name: str, unit: str) -> Any:
    """Return `values` without their unit, if they carry this `unit` or none.

    Raises InputError for another unit, and for arrays with a masked value.
    """
    _refuse_masked(values, name)
    attached_unit = getattr(values, "units", getattr(values, "unit", None))
    if attached_unit is not None and _is_unit(attached_unit):
        if not says(str(attached_unit), unit):
            raise InputError(
                "unit",
                f"{name} is in {attached_unit}, not in {_name_of_unit(unit)}",
                remedy="convert it",
            )
        return getattr(values, "magnitude", getattr(values, "value", values))
    if isinstance(values, list | tuple):
        return [plain_numbers(each, name, unit) if _is_object(each) else each for each in values]
    return values


def _is_unit(attribute: Any) -> bool:
    """Return whether an attribute named unit or units is a unit, not a method, number or array."""
    return not callable(attribute) and type(attribute) not in (int, float, np.ndarray)


def _is_object(value: Any) -> bool:
    """Return whether a member of a list may have a unit or a mask: plain numbers have none."""
    return not isinstance(value, int | float | np.generic | str | bytes)


def _refuse_masked(values: Any, name: str) -> None:
    """Raise InputError for a masked value, and for an array that has one."""
    if isinstance(values, np.ma.MaskedArray):
        mask: Array = np.ma.getmaskarray(values)
        if mask.any():
            row = int(np.argwhere(np.atleast_1d(mask))[0, 0])
            raise InputError(
                "masked",
                f"{name} is masked in row {row}",
                remedy="give a number there, or leave the column out",
            )


def _name_of_unit(unit: str) -> str:
    """Return a unit in the form used in messages."""
    if unit == "1":
        return "plain numbers"
    return unit
