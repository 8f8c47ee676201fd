"""Sentences with numbers of a study's cases in them: captions, and what is said of the whole.

A sentence is a Jinja template: `{{ value('case06', 'void_ratio') }}` is that number with its error.
So no number is typed, and none survives the results that it came from.
"""

from __future__ import annotations

import jinja2
import numpy as np
import pandas as pd

from analysis.estimators.power_law import power_law, straight_to
from analysis.study.powers import powers
from analysis.study.selection import numbers, select, spreads
from analysis.table import number

UNKNOWN = "(not measured)"
RANDOM = "kind == 'random'"


def lines_to(frame: pd.DataFrame, name: str, x: str, through: str, to: str) -> pd.DataFrame:
    """At each stress, Pa, the line of a quantity over x through some cases, at the x of others.

    Columns `line`, its standard error `error`, `curve` by the line of the logarithm, and `there`,
    the quantity of the others.
    """
    found = {}
    for stress, members in frame.groupby("stress"):
        some, others = select(members, through), select(members, to)
        at, there = (numbers(others, text).mean() for text in (x, name))
        along, y = numbers(some, x), numbers(some, name)
        line, error = straight_to(along, y, at)
        curve = np.exp(straight_to(along, np.log(y), at)[0])
        found[stress] = {"line": line, "error": error, "curve": curve, "there": there}
    return pd.DataFrame.from_dict(found, orient="index").dropna(subset=["line", "there"])


class Words:
    """What a sentence may ask of the cases; what no case has is `UNKNOWN`."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self.frame = frame[frame["there"]]
        names = "value", "span", "power", "powers", "count", "trends"
        self._known = {name: getattr(self, name) for name in names}

    def __call__(self, text: str) -> str:
        """The sentence."""
        return jinja2.Environment().from_string(text).render(self._known)

    def value(self, case: str, quantity: str) -> str:
        """A number of one case, with its error where that is known."""
        one = self.frame.loc[self.frame.index == case]
        found = [
            number(v, e)
            for v, e in zip(numbers(one, quantity), spreads(one, quantity), strict=True)
        ]
        return (found or [""])[0] or UNKNOWN

    def span(self, quantity: str, which: str = RANDOM, form: str = ".3g") -> str:
        """Smallest to largest of a quantity, or of an expression of several."""
        found = numbers(select(self.frame, which), quantity).dropna()
        if found.empty:
            return UNKNOWN
        low, high = f"{found.min():{form}}", f"{found.max():{form}}"
        return low if low == high else f"{low} to {high}"

    def power(self, x: str, y: str, which: str) -> str:
        """The exponent of y over x through all cases of a selection, with its error."""
        some = select(self.frame, which)
        law = power_law(numbers(some, x), numbers(some, y))
        return number(law.exponent, law.error) or UNKNOWN

    def powers(self, x: str, y: str, which: str = RANDOM) -> str:
        """Smallest to largest exponent of y over x within the groups of a selection."""
        found = powers(select(self.frame, which), x, y)
        return UNKNOWN if found is None else f"{found.power.min():.2f} to {found.power.max():.2f}"

    def count(self, test: str, which: str = RANDOM) -> str:
        """Of how many cases of a selection a comparison of their numbers is true."""
        some = select(self.frame, which)
        return f"{len(select(some, test))} of {len(some)}"

    def trends(self, quantity: str, x: str, through: str, to: str) -> str:
        """Where `lines_to` end, beside what is there."""
        found = lines_to(self.frame, quantity, x, through, to)
        texts = [
            f"{one['line']:.0f} ± {one['error']:.0f} for {one['there']:.0f} at {stress / 1e3:g} kPa"
            for stress, one in found.iterrows()
        ]
        return ", ".join(texts) or UNKNOWN
