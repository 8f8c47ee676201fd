"""Hold a measured value with its error, the parts of that error, and its caveats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from analysis.caveats import Caveat
from analysis.explanation import ERROR_PARTS, Explanation
from analysis.steps import Step
from modal.formats.tables import html_table
from modal.tools.arrays import Floats
from modal.tools.display import plain, quantity, scaled

MAX_LISTED_NUMBERS = 3
"""Largest length of an array over frequency of which all numbers are printed; of longer arrays the
first and the last are."""
MIN_PRINTED_RELATIVE_ERROR = 1e-6
"""Smallest relative error that is printed."""
COMMON = "length"
"""Name of the part of an error that all packings share, such as that of their short length: a mean
over packings does not reduce it."""


@dataclass(frozen=True)
class Value:
    """A measured value, in SI units; NaN if it is not known, with a caveat that says why.

    Attributes
    ----------
    value : float or ndarray (n,)
        The value, in `unit`; an array has a value at each frequency of `at`.
    unit : str
        SI unit, "1" for a number.
    parts : dict
        Contributions to the error, in the same unit, by the keys of `ERROR_PARTS`, which explains
        each of them.
    caveats : tuple of Caveat
        Facts to know before the value is quoted; `str()` of each is its sentence.
    at : ndarray (n,), Hz, or None
        Frequencies of an array.
    scatter : float, ndarray (n,) or None
        Standard deviation over samples, for a mean over them.
    plateau : bool or None
        Whether the value of a threshold rule does not depend on the stretch where it is read; None
        for all other values.
    steps : tuple of Step
        Windows, fits, limits and samples that led to the value, or to not knowing it.

    Examples
    --------
    >>> Value(776.4, "m/s", {"fit": 3.0, "chain": 4.0}).error
    5.0
    """

    value: Any
    unit: str
    parts: Mapping[str, Any] = field(default_factory=dict)
    caveats: tuple[Caveat, ...] = ()
    at: Floats | None = None
    scatter: float | Floats | None = None
    plateau: bool | None = None
    steps: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        """Refuse a part of the error that is not a key of `ERROR_PARTS`."""
        unexplained = self.parts.keys() - ERROR_PARTS.keys()
        if unexplained:
            raise RuntimeError(f"parts of an error without a meaning: {sorted(unexplained)}")

    @property
    def error(self) -> Any:
        """Return the standard error, in the unit of the value; 0 for an exact value.

        The error is the root of the sum of squares of all parts except `samples`. If the scatter of
        samples is larger, it contains the other parts and is the error.

        >>> Value(1.0, "m/s", {"fit": 3.0, "chain": 4.0, "samples": 6.0}).error
        6.0
        """
        squares = [np.square(part) for name, part in self.parts.items() if name != "samples"]
        error = np.sqrt(sum(squares, np.zeros(np.shape(self.value))))
        if "samples" in self.parts:
            error = np.fmax(error, self.parts["samples"])
        if np.ndim(error):
            return error
        return float(error)

    @property
    def known(self) -> bool:
        """Tell whether the value, or any number of an array, is known."""
        return bool(np.isfinite(self.value).any())

    @property
    def common_error(self) -> float:
        """Return the part of the error that a mean over packings does not reduce; 0 without one."""
        return float(self.parts.get(COMMON, 0.0))

    @property
    def codes(self) -> list[str]:
        """Return the codes of the caveats."""
        return [caveat.code for caveat in self.caveats]

    def with_caveats(self, *caveats: Caveat) -> Value:
        """Return the value with further caveats, each of them once."""
        return replace(self, caveats=tuple(dict.fromkeys((*self.caveats, *caveats))))

    def explain(self) -> Explanation:
        """Return how the value was obtained, or why it is not known; `str()` gives a text.

        >>> print(Value(776.4, "m/s", {"fit": 3.0, "window": 4.0}).explain())
        776.4 ± 5.0 m/s
          parts of the error
          - fit 3 m/s: scatter about a fit, change with the order of a fit, or residual of a solver
          - window 4 m/s: choice of the window, or of the part of a record, that is read
          how it was read
          - directly from the packing or its files, without a window, fit or limit
        """
        return Explanation(
            self.text(), self.value, self.error, self.unit, self.parts, self.steps, self.caveats
        )

    def as_json(self) -> dict[str, Any]:
        """Return the value for JSON, in SI units; `value_of_json` reads it again.

        The keys are `value`, `error`, `unit`, `parts`, `caveats` (sentences) and `codes` (of the
        caveats); and `at`, Hz, `scatter` and `plateau`, if they exist. Unknown numbers are None.
        """
        fields: dict[str, Any] = {
            "value": plain(self.value),
            "error": plain(self.error),
            "unit": self.unit,
            "parts": plain(self.parts),
            "caveats": [str(caveat) for caveat in self.caveats],
            "codes": self.codes,
        }
        if self.at is not None:
            fields["at"] = plain(self.at)
        if self.scatter is not None:
            fields["scatter"] = plain(self.scatter)
        if self.plateau is not None:
            fields["plateau"] = self.plateau
        return fields

    def _repr_html_(self) -> str:
        """Return the value with its error and its caveats as a table, for a notebook."""
        return html_table(["value", "caveats"], [[self.text(), "; ".join(map(str, self.caveats))]])

    def text(self) -> str:
        """Return number, error and unit for people; range and frequencies of an array.

        >>> Value(776.4, "m/s", {"fit": float("nan")}).text()
        '776.4 m/s, error not known'
        """
        if not self.known:
            return "not known"
        if np.ndim(self.value):
            return self._text_of_array()
        return self._text_of_number()

    def _text_of_array(self) -> str:
        """Return the range of an array and its frequencies; for a short array all numbers."""
        value = np.asarray(self.value)
        known = np.isfinite(value)
        count = int(known.sum())
        first, last = value[known][[0, -1]]
        if self.at is None:
            ends = f"{quantity(first, self.unit, 4)} to {quantity(last, self.unit, 4)}"
            return f"{ends}, {count} of them"
        if count <= MAX_LISTED_NUMBERS:
            texts = []
            errors = np.asarray(self.error)[known]
            for frequency, number, error in zip(self.at[known], value[known], errors, strict=True):
                text = Value(number, self.unit, {"fit": error}).text()
                texts.append(f"{text} at {hertz(frequency)}")
            return "; ".join(texts)
        low, high = self.at[known][[0, -1]]
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{first:.3g} to {last:.3g}{unit} from {hertz(low)} to {hertz(high)}"

    def _text_of_number(self) -> str:
        """Return a number and its unit, rounded so that the error has two digits."""
        value = float(self.value)
        error = float(self.error)
        unit = "" if self.unit == "1" else self.unit
        ratio = 100.0
        if error > 0 and value:
            ratio = abs(value) / error
        # Six digits say that the error is very small.
        digits = int(np.clip(np.floor(np.log10(ratio)) + 2, 2, 6))
        ending = ""
        if np.isnan(error):
            ending = ", error not known"
        numbers = [value]
        if error > MIN_PRINTED_RELATIVE_ERROR * abs(value):
            numbers.append(error)
        elif not unit:
            return f"{value:.{digits}g}{ending}"
        texts, unit = scaled(numbers, unit, digits, prefixed=unit in ("Hz", "Pa", "s"))
        return f"{' ± '.join(texts)} {unit}".strip() + ending


def value_of_json(fields: Mapping[str, Any]) -> Value:
    """Return the value that `Value.as_json` has written; caveats keep their codes and sentences.

    >>> value_of_json(Value(776.4, "m/s", {"fit": 3.0}).as_json()).error
    3.0
    """
    codes = fields.get("codes", [])
    caveats = []
    for code, sentence in zip(codes, fields.get("caveats", []), strict=True):
        caveats.append(Caveat(code, {"text": sentence}))
    frequencies = fields.get("at")
    if frequencies is not None:
        frequencies = np.array(frequencies, float)
    return Value(
        _number_of_json(fields["value"]),
        fields["unit"],
        {name: _number_of_json(part) for name, part in fields["parts"].items()},
        tuple(caveats),
        frequencies,
        _number_of_json(fields["scatter"]) if "scatter" in fields else None,
        fields.get("plateau"),
    )


def _number_of_json(number: Any) -> Any:
    """Return a number, or an array of numbers, with NaN for null."""
    if np.ndim(number):
        return np.array(number, float)
    return float("nan" if number is None else number)


def unknown(unit: str, *caveats: Caveat, steps: tuple[Step, ...] = ()) -> Value:
    """Return a value that is not known, with the reasons and the steps that led there."""
    return Value(np.nan, unit, {"fit": np.nan}, caveats, steps=steps)


def estimate(
    value: float, error: float = np.nan, common: float = 0.0, steps: tuple[Step, ...] = ()
) -> Value:
    """Return a number of a case with its error if known; its unit is that of the column.

    `common` is the part of the error that all packings of the kind share; `steps` are the windows
    and fits that led to the value.

    >>> estimate(1.0, 5.0, 4.0).parts
    {'fit': 3.0, 'length': 4.0}
    """
    if not common:
        return Value(float(value), "", {"fit": error}, steps=steps)
    independent = float(np.sqrt(max(error**2 - common**2, 0.0)))
    return Value(float(value), "", {"fit": independent, COMMON: float(common)}, steps=steps)


def hertz(frequency: float) -> str:
    """Return a frequency as text, in the form that caveats use.

    >>> hertz(10490.0)
    '10.5 kHz'
    """
    return quantity(float(frequency), "Hz", 3)
