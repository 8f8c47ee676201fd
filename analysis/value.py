"""A measured value with its error, the parts of that error, and what to know before quoting it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.display import quantities, quantity


@dataclass(frozen=True)
class Value:
    """What was measured, in SI units; NaN where it is not known, and then a caveat says why.

    `value` and `error` are numbers, or arrays (nf,) at frequencies `at` (nf,), Hz. `parts` are the
    contributions to the error by name (fit, chain, resolution, samples); `error` is the root of the
    sum of their squares. `caveats` are whole sentences for people.
    """

    value: float | Floats
    unit: str
    parts: dict[str, Any] = field(default_factory=dict)
    caveats: tuple[str, ...] = ()
    at: Floats | None = None

    @property
    def error(self) -> float | Floats:
        """Standard error, in the unit of the value; 0 where the value is exact for its packing."""
        squares = np.zeros(np.shape(self.value))
        for part in self.parts.values():
            squares = squares + np.square(part)
        return np.sqrt(squares) if np.ndim(squares) else float(np.sqrt(squares))

    @property
    def known(self) -> bool:
        """Whether there is any number."""
        return bool(np.isfinite(self.value).any())

    def with_caveats(self, *caveats: str) -> Value:
        """The same with more to know, each said once."""
        return replace(self, caveats=tuple(dict.fromkeys((*self.caveats, *caveats))))

    def as_json(self) -> dict[str, Any]:
        """value, error, unit, caveats; of an array `at`, Hz, too. What is not known is None."""
        told: dict[str, Any] = {"value": _plain(self.value), "error": _plain(self.error)}
        told |= {"unit": self.unit, "caveats": list(self.caveats)}
        if self.at is not None:
            told["at"] = _plain(self.at)
        return told

    def text(self) -> str:
        """For people: the number, its error and its unit; of an array its range and frequencies."""
        value, error = np.asarray(self.value), np.asarray(self.error)
        if not self.known:
            return "not known"
        if self.at is not None:
            seen = np.isfinite(value)
            low, high = (quantity(f, "Hz", 3) for f in self.at[seen][[0, -1]])
            ends = f"{value[seen][0]:.3g} to {value[seen][-1]:.3g}"
            return f"{ends} {self.unit} from {low} to {high}".replace(" 1 from", " from")
        unit = "" if self.unit == "1" else self.unit
        # As many digits as show two of the error's; six say that it is very small.
        share = abs(value) / error if error > 0 and value else 100
        digits = int(np.clip(np.floor(np.log10(share)) + 2, 2, 6))
        told = error > 1e-6 * abs(value)
        numbers = [float(value), float(error)] if told else [float(value)]
        text = quantities(numbers, unit, digits, prefixed=unit in ("Hz", "Pa"))
        return text.replace(", ", " ± ").strip()


def unknown(unit: str, *caveats: str) -> Value:
    """No value, and why."""
    return Value(np.nan, unit, {"unknown": np.nan}, caveats)


def _plain(number: Any) -> Any:
    """Lists and numbers as JSON has them, None for what is not finite."""
    if np.ndim(number):
        return [_plain(one) for one in number]
    return float(number) if np.isfinite(number) else None
