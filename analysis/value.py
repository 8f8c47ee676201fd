"""A measured value with its error, the parts of that error, and what to know before quoting it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.display import plain, quantity, scaled

FEW = 3
"""Numbers over frequency that are all told; of more the first and the last."""
COMMON = "length"
"""The part of an error that all packings share, as that they are short: no mean makes it less."""


@dataclass(frozen=True)
class Value:
    """What was measured, in SI units; NaN where it is not known, and then a caveat says why.

    Attributes
    ----------
    value : float or ndarray (n,)
        In `unit`; an array over `at`.
    unit : str
        In SI.
    parts : dict
        Contributions to the error, in the same unit: `fit`, scatter about a fit or what is left of
        a solver's residual; `chain`, which chain of spheres, or part of a record, is taken;
        `resolution`, widths of lines; `length`, that the packing is short; `digits`, overlaps that
        few digits of positions tell; `samples`, how samples of one state differ.
    caveats : tuple of str
        Whole sentences for people.
    at : ndarray (n,), Hz, or None
        Frequencies of an array.
    scatter : float, ndarray (n,) or None
        Standard deviation of samples, of a mean over them.

    Examples
    --------
    >>> Value(776.4, "m/s", {"fit": 3.0, "chain": 4.0}).error
    5.0
    """

    value: Any
    unit: str
    parts: Mapping[str, Any] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()
    at: Floats | None = None
    scatter: float | Floats | None = None

    @property
    def error(self) -> Any:
        """Standard error, in the unit of the value; 0 where the value is exact for its packing.

        The root of the squares of `fit`, `chain`, `resolution`, `digits` and `length`; where
        samples scatter by more, they have the rest in them, and that scatter.

        >>> Value(1.0, "m/s", {"fit": 3.0, "chain": 4.0, "samples": 6.0}).error
        6.0
        """
        squares = [np.square(part) for name, part in self.parts.items() if name != "samples"]
        error = np.sqrt(sum(squares, np.zeros(np.shape(self.value))))
        if "samples" in self.parts:
            error = np.fmax(error, self.parts["samples"])
        return error if np.ndim(error) else float(error)

    @property
    def known(self) -> bool:
        """Whether there is any number."""
        return bool(np.isfinite(self.value).any())

    @property
    def common_error(self) -> float:
        """The part of the error that no mean over packings makes less; 0 where there is none."""
        return float(self.parts.get(COMMON, 0.0))

    def with_caveats(self, *caveats: str) -> Value:
        """The same with more to know, each said once."""
        return replace(self, caveats=tuple(dict.fromkeys((*self.caveats, *caveats))))

    def as_json(self) -> dict[str, Any]:
        """value, error, unit, caveats; where they are, `at`, Hz, and `scatter`."""
        told: dict[str, Any] = {"value": plain(self.value), "error": plain(self.error)}
        told |= {"unit": self.unit, "caveats": list(self.caveats)}
        more = {"at": self.at, "scatter": self.scatter}
        return told | {name: plain(own) for name, own in more.items() if own is not None}

    def text(self) -> str:
        """For people: the number, its error and its unit; of an array its range and frequencies.

        >>> Value(776.4, "m/s", {"fit": float("nan")}).text()
        '776.4 m/s, error not known'
        """
        value, error = np.asarray(self.value), np.asarray(self.error)
        if not self.known:
            return "not known"
        if value.ndim:
            seen = np.isfinite(value)
            ends = f"{value[seen][0]:.3g} to {value[seen][-1]:.3g}"
            if self.at is None:
                first, last = (quantity(v, self.unit, 4) for v in value[seen][[0, -1]])
                return f"{first} to {last}, {seen.sum()} of them"
            if seen.sum() <= FEW:
                each = zip(self.at[seen], value[seen], error[seen], strict=True)
                texts = [
                    f"{Value(v, self.unit, {'fit': e}).text()} at {hertz(f)}" for f, v, e in each
                ]
                return "; ".join(texts)
            low, high = (hertz(f) for f in self.at[seen][[0, -1]])
            return f"{ends} {self.unit} from {low} to {high}".replace(" 1 from", " from")
        unit = "" if self.unit == "1" else self.unit
        # As many digits as show two of the error's; six say that it is very small.
        share = abs(value) / error if error > 0 and value else 100
        digits = int(np.clip(np.floor(np.log10(share)) + 2, 2, 6))
        told = error > 1e-6 * abs(value)
        unsure = ", error not known" if np.isnan(error) else ""
        if not unit and not told:
            return f"{float(value):.{digits}g}{unsure}"
        numbers = [float(value), float(error)] if told else [float(value)]
        texts, unit = scaled(numbers, unit, digits, prefixed=unit in ("Hz", "Pa"))
        return f"{' ± '.join(texts)} {unit}".strip() + unsure


def unknown(unit: str, *caveats: str) -> Value:
    """No value, and why."""
    return Value(np.nan, unit, {"fit": np.nan}, caveats)


def estimate(value: float, error: float = np.nan, common: float = 0.0) -> Value:
    """Return a number of a case, whose columns say the units, with its error where that is known.

    `common` is the part of the error that all packings of the kind share.

    >>> estimate(1.0, 5.0, 4.0).parts
    {'fit': 3.0, 'length': 4.0}
    """
    if not common:
        return Value(float(value), "", {"fit": error})
    own = float(np.sqrt(max(error**2 - common**2, 0.0)))
    return Value(float(value), "", {"fit": own, COMMON: float(common)})


def hertz(frequency: float) -> str:
    """A frequency in a caveat.

    >>> hertz(10490.0)
    '10.5 kHz'
    """
    return quantity(float(frequency), "Hz", 3)
