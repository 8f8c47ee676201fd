"""Which pairs of types each line of pair_coeff covers, and the law that is left for a pair.

As in LAMMPS: a type is a number or a range (`*`, `n*`, `*n`, `m*n`), a range stands for pairs of
rising types alone, the last line that covers a pair holds, and a pair that none covers is mixed
from those of its two types.
"""

from __future__ import annotations

import re
import sys

from modal.exchange.bodies import LawOf
from modal.exchange.lammps_law import Coefficients, coefficients, mixed
from modal.exchange.lammps_script import Script
from modal.exchange.program_law import ProgramLaw, Units
from modal.tools.errors import InputError

LAST = sys.maxsize
"""The highest type, whatever it is."""


def law_of_pairs(script: Script, units: Units, said: str) -> LawOf:
    """The law between any two types; `said` tells in a message whose words these are."""
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
