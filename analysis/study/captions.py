"""Fill numbers of a study's cases into sentences: captions, and statements about the whole study.

`{{ value('case06', 'void_ratio') }}` in a sentence is that number with its error: the double braces
contain an expression (`analysis.expressions`) that calls one of a few functions. Thus no number is
typed by hand, and all numbers agree with the present results.
"""

import re

import numpy as np
import pandas as pd

from analysis.estimators.fits import power_law, straight_line
from analysis.expressions import evaluate, short
from analysis.frame import numbers, powers, select, spreads
from analysis.study.fields import file_below_here, number_format
from analysis.table import number
from modal.tools.errors import InputError

UNKNOWN = "(not measured)"
RANDOM = "kind == 'random'"
PLACE = re.compile(r"{{(.*?)}}", re.DOTALL)
"""A place in a sentence that holds an expression."""
FUNCTIONS = ("value", "span", "power", "powers", "count", "trends", "entry")
"""Methods of `Captions` that an expression may call."""
OTHER_MARKS = ("{{", "}}", "{%", "{#")
"""Marks of a template language that a sentence must not have outside its expressions."""


class Captions:
    """The functions that a sentence may call on the cases of a frame.

    `UNKNOWN` is printed for a number that is not known for any case.
    """

    def __init__(self, frame: pd.DataFrame) -> None:
        self.frame = frame[frame["there"]]
        self._functions = {name: getattr(self, name) for name in FUNCTIONS}

    def __call__(self, text: str) -> str:
        """Return the sentence with its numbers filled in.

        Raises InputError if the text in double braces is not an expression.
        """
        rest = PLACE.sub("", text)
        if any(mark in rest for mark in OTHER_MARKS):
            raise InputError(
                "sentence",
                short(text),
                remedy="write numbers as {{ value('case06', 'void_ratio') }}",
            )
        return PLACE.sub(self._evaluate, text).removesuffix("\n")

    def _evaluate(self, place: re.Match[str]) -> str:
        """Return the text for one expression in double braces, a match of a pattern."""
        return str(evaluate(place[1], {}, self._functions))

    def value(self, case: str, quantity: str) -> str:
        """Return a quantity of one case as text, with its error if that is known."""
        line = self.frame.loc[self.frame.index == case]
        values = numbers(line, quantity)
        errors = spreads(line, quantity)
        if line.empty:
            return UNKNOWN
        return number(values.iloc[0], errors.iloc[0]) or UNKNOWN

    def span(self, quantity: str, which: str = RANDOM, form: str = ".3g") -> str:
        """Return the range of a quantity, or of an expression, over a selection of cases."""
        values = numbers(select(self.frame, which), quantity).dropna()
        if values.empty:
            return UNKNOWN
        low = format(values.min(), number_format(form))
        high = format(values.max(), number_format(form))
        if low == high:
            return low
        return f"{low} to {high}"

    def power(self, x: str, y: str, which: str) -> str:
        """Return the exponent, with its error, of a power law y(x) through a selection of cases."""
        cases = select(self.frame, which)
        law = power_law(numbers(cases, x), numbers(cases, y))
        return number(law.exponent, law.error) or UNKNOWN

    def powers(self, x: str, y: str, which: str = RANDOM) -> str:
        """Return the range of the exponents of power laws y(x) within each group of a selection."""
        exponents = powers(select(self.frame, which), x, y).table["power"]
        if exponents.empty:
            return UNKNOWN
        return f"{exponents.min():.2f} to {exponents.max():.2f}"

    def count(self, test: str, which: str = RANDOM) -> str:
        """Return the number of cases in a selection for which a comparison is true."""
        cases = select(self.frame, which)
        return f"{len(select(cases, test))} of {len(cases)}"

    def entry(self, file: str, line: str, column: str, form: str = ".3g") -> str:
        """Return a number of a CSV file below the working folder, in the line with this name.

        The names of the lines are in the first column.
        """
        path = file_below_here(file)
        if not path.is_file():
            return UNKNOWN
        try:
            table = pd.read_csv(path, index_col=0)
            entry = float(table.set_axis(table.index.map(str)).loc[line, column])
        except (KeyError, TypeError, ValueError):
            raise InputError(
                "no_table", f"{short(file)}: no number {short(column)} of {short(line)}"
            ) from None
        return format(entry, number_format(form))

    def trends(self, quantity: str, x: str, through: str, to: str) -> str:
        """Extrapolate a quantity linearly in x, at each stress, from cases `through` to cases `to`.

        The text has the value of the straight line with its standard error, the value of a line
        through the quantity's logarithm, which shows how much the form of the curve matters, and
        the mean of the cases `to`.
        """
        texts = []
        for stress, members in self.frame.groupby("stress"):
            fitted = select(members, through)
            others = select(members, to)
            x_of_others = numbers(others, x).mean()
            mean = numbers(others, quantity).mean()
            x_fitted = numbers(fitted, x)
            y_fitted = numbers(fitted, quantity)
            line, error = straight_line(x_fitted, y_fitted).at(x_of_others)
            if np.isfinite([line, mean]).all():
                logarithm = straight_line(x_fitted, np.log(y_fitted)).at(x_of_others)[0]
                text = f"{line:.0f} ± {error:.0f} (line of its logarithm: {np.exp(logarithm):.0f})"
                texts.append(f"{stress / 1e3:g} kPa: {text}, crystal {mean:.0f}")
        return "; ".join(texts) or UNKNOWN
