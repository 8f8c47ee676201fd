"""Sentences with numbers of a study's cases in them: captions, and what is said of the whole.

`{{ value('case06', 'void_ratio') }}` in a sentence is that number with its error: what stands in
double braces is an expression (`analysis.expressions`) that calls one of a few functions. So no
number is typed, and none survives the results that it came from.
"""

import re

import numpy as np
import pandas as pd

from analysis.estimators.fits import power_law, straight_line
from analysis.expressions import evaluate, short
from analysis.frame import numbers, powers, select, spreads
from analysis.study.fields import number_format
from analysis.table import number
from modal.tools.errors import InputError

UNKNOWN = "(not measured)"
RANDOM = "kind == 'random'"
PLACE = re.compile(r"{{(.*?)}}", re.DOTALL)
"""Where a sentence has a number."""


class Captions:
    """What a sentence may ask of the cases; what no case has is `UNKNOWN`."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self.frame = frame[frame["there"]]
        names = "value", "span", "power", "powers", "count", "trends"
        self._known = {name: getattr(self, name) for name in names}

    def __call__(self, text: str) -> str:
        """Return the sentence with its numbers."""
        rest = PLACE.sub("", text)
        if any(mark in rest for mark in ("{{", "}}", "{%", "{#")):
            raise InputError(
                "sentence",
                f"{short(text)}",
                remedy="write numbers as {{ value('case06', 'void_ratio') }}",
            )
        return PLACE.sub(self._number, text).removesuffix("\n")

    def _number(self, place: re.Match[str]) -> str:
        """Return what stands in the place of one expression."""
        return str(evaluate(place[1], {}, self._known))

    def value(self, case: str, quantity: str) -> str:
        """A number of one case, with its error where that is known."""
        one = self.frame.loc[self.frame.index == case]
        pairs = zip(numbers(one, quantity), spreads(one, quantity), strict=True)
        return next((number(*pair) for pair in pairs), "") or UNKNOWN

    def span(self, quantity: str, which: str = RANDOM, form: str = ".3g") -> str:
        """Smallest to largest of a quantity, or of an expression of several."""
        found = numbers(select(self.frame, which), quantity).dropna()
        if found.empty:
            return UNKNOWN
        low, high = (format(end, number_format(form)) for end in (found.min(), found.max()))
        return low if low == high else f"{low} to {high}"

    def power(self, x: str, y: str, which: str) -> str:
        """The exponent of y over x through all cases of a selection, with its error."""
        some = select(self.frame, which)
        law = power_law(numbers(some, x), numbers(some, y))
        return number(law.exponent, law.error) or UNKNOWN

    def powers(self, x: str, y: str, which: str = RANDOM) -> str:
        """Smallest to largest exponent of y over x within the groups of a selection."""
        found = powers(select(self.frame, which), x, y).table
        ends = found["power"].min(), found["power"].max()
        return UNKNOWN if found.empty else "{:.2f} to {:.2f}".format(*ends)

    def count(self, test: str, which: str = RANDOM) -> str:
        """Of how many cases of a selection a comparison of their numbers is true."""
        some = select(self.frame, which)
        return f"{len(select(some, test))} of {len(some)}"

    def trends(self, quantity: str, x: str, through: str, to: str) -> str:
        """At each stress the line of a quantity over x through some cases, carried on to others.

        With its standard error, beside where the line of the logarithm ends, how much the form
        decides, and what the others have.
        """
        texts = []
        for stress, members in self.frame.groupby("stress"):
            some, others = select(members, through), select(members, to)
            at, there = (numbers(others, text).mean() for text in (x, quantity))
            along, y = numbers(some, x), numbers(some, quantity)
            line, error = straight_line(along, y).at(at)
            if np.isfinite([line, there]).all():
                curve = np.exp(straight_line(along, np.log(y)).at(at)[0])
                text = f"{line:.0f} ± {error:.0f} (line of its logarithm: {curve:.0f})"
                texts.append(f"{stress / 1e3:g} kPa: {text}, crystal {there:.0f}")
        return "; ".join(texts) or UNKNOWN
