"""Explain how a value comes about: the steps that led to it, and the parts of its error.

A step is a window over a record, a fit, or a limit, with its numbers and the code of its outcome.
The sentences are made from these where they are printed: `OUTCOMES` and `NUMBERS` hold the texts of
steps, `ERROR_PARTS` those of errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np

from analysis.caveats import Caveat
from modal.tools.display import plain, quantity

ERROR_PARTS: Final[Mapping[str, str]] = {
    "fit": "scatter about a fit, change with the order of a fit, or residual of a solver",
    "chain": "choice of the chain of spheres along which the wave is read",
    "window": "choice of the window, or of the part of a record, that is read",
    "resolution": "width of a line, within which values are not independent",
    "length": "packing too short, or its two halves unlike: equal in all samples of one kind",
    "digits": "few digits of positions, from which overlaps follow",
    "samples": "differences between samples of one state",
}
"""Parts of an error by name: what each of them stands for. All are in the unit of the value. The
error is the root of the sum of their squares without `samples`, or `samples` if that is larger."""

StepKind = Literal["window", "fit", "limit"]
"""A window over a record, a fit to numbers, or a limit that a number must keep."""

OUTCOMES: Final[Mapping[str, str]] = {
    "crossed": "the attenuation rises through the level at which the wave has faded",
    "no_wave": "no coherent wave at any frequency",
    "starts_above": "the wave has faded already at the lowest frequency",
    "ends_below": "the wave ends before it has faded",
    "fitted": "fitted",
    "too_few": "too few frequencies for a fit",
    "kept": "the limit is kept",
    "exceeded": "above the limit",
    "fallen_short": "below the limit",
}
"""Meanings of the outcomes of steps, by their codes."""

WAVE_ENDS: Final[Mapping[str, str]] = {
    "range": "no higher frequency is read",
    "incoherent": "neighbouring layers are no longer correlated above",
    "backward": "the wave number does not rise with frequency above",
    "few_layers": "the packing has too few layers",
}
"""Rules that end a coherent wave towards high frequencies, by their codes
(`analysis.estimators.coherent.WaveEnd`)."""

NUMBERS: Final[Mapping[str, str]] = {
    "damping": "damping over the record, eta T",
    "left_at_end": "share of the amplitude left at the last frequency",
    "sent_at_end": "amplitude of the source there, divided by its largest",
    "end_frequency": "the coherent wave ends at",
    "first_crossing": "first crossing",
    "fitted_crossing": "crossing of the rising fit",
    "last_crossing": "last crossing",
    "velocity": "velocity",
    "error": "its standard error",
    "lowest": "from",
    "highest": "to",
    "frequencies": "frequencies in the fit",
    "needed": "needed",
    "order": "order of the fit",
    "band_edge": "band edge",
    "length": "length in diameters",
    "spread": "spread of crossings and windows, divided by the frequency",
    "limit": "limit",
}
"""Meanings of the numbers of steps, by their names."""

STEP_DIGITS = 5
"""Digits of the numbers of steps: their differences, which are the error, can be checked."""
ERROR_DIGITS = 3
"""Digits of the parts of an error."""


@dataclass(frozen=True)
class Step:
    """One window, fit or limit on the path to a value.

    Attributes
    ----------
    kind : str
        "window", "fit" or "limit".
    outcome : str
        A key of `OUTCOMES`: which rule ended the step.
    numbers : mapping
        Numbers of the step by their names, keys of `NUMBERS`, in SI units; NaN if not known.
    units : mapping
        Unit of each number that has one.
    ended_by : str
        A key of `WAVE_ENDS` if the step reads a coherent wave, else empty.

    Examples
    --------
    >>> print(Step("limit", "fallen_short", {"length": 8.25, "limit": 15.0}))
    limit: below the limit; length in diameters 8.25; limit 15
    """

    kind: StepKind
    outcome: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    ended_by: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return all fields; numbers that are not known are None."""
        return {
            "kind": self.kind,
            "outcome": self.outcome,
            "numbers": plain(self.numbers),
            "units": dict(self.units),
            "ended_by": self.ended_by,
        }

    def __str__(self) -> str:
        texts = [f"{self.kind}: {OUTCOMES[self.outcome]}"]
        for name, number in self.numbers.items():
            if np.isfinite(number):
                unit = self.units.get(name, "")
                texts.append(f"{NUMBERS[name]} {_number_text(number, unit, STEP_DIGITS)}")
        if self.ended_by:
            texts.append(WAVE_ENDS[self.ended_by])
        return "; ".join(texts)


@dataclass(frozen=True)
class Explanation:
    """A value with the parts of its error, the steps that led to it, and its caveats.

    `str()` of it is its text for people.

    Attributes
    ----------
    text : str
        The value as it is printed, or "not known".
    value, error : float or ndarray (n,)
        In `unit`.
    unit : str
        SI unit, "1" for a number.
    parts : mapping
        Parts of the error, in `unit`, by the keys of `ERROR_PARTS`.
    steps : sequence of Step
        Windows, fits and limits, in the order in which they are used.
    caveats : sequence of Caveat
    """

    text: str
    value: Any
    error: Any
    unit: str
    parts: Mapping[str, Any]
    steps: Sequence[Step]
    caveats: Sequence[Caveat]

    def as_json(self) -> dict[str, Any]:
        """Return all fields as JSON has them; parts and caveats come with their meanings."""
        return {
            "value": plain(self.value),
            "error": plain(self.error),
            "unit": self.unit,
            "parts": [
                {"name": name, "meaning": ERROR_PARTS[name], "value": plain(part)}
                for name, part in self.parts.items()
            ],
            "steps": [step.as_json() for step in self.steps],
            "caveats": [caveat.as_json() for caveat in self.caveats],
        }

    def __str__(self) -> str:
        lines = [self.text, *_lines("parts of the error", self._part_texts())]
        lines += _lines("how it was read", [str(step) for step in self.steps])
        lines += _lines("to know before", [f"{caveat.code}: {caveat}" for caveat in self.caveats])
        return "\n".join(lines)

    def _part_texts(self) -> list[str]:
        """Return a line of text for each known part of the error.

        Of an array the largest number is shown.
        """
        texts = []
        for name, part in self.parts.items():
            known = np.asarray(part, float)[np.isfinite(part)]
            if known.size:
                size = _number_text(float(known.max()), self.unit)
                if np.ndim(part):
                    size = f"up to {size}"
                texts.append(f"{name} {size}: {ERROR_PARTS[name]}")
        return texts


def _lines(title: str, texts: Sequence[str]) -> list[str]:
    """Return a title and a list under it; nothing for an empty list."""
    if not texts:
        return []
    return [f"  {title}", *(f"  - {text}" for text in texts)]


def _number_text(number: float, unit: str, digits: int = ERROR_DIGITS) -> str:
    """Return a number with its unit, with this many significant digits."""
    if unit in ("", "1"):
        return f"{number:.{digits}g}"
    return quantity(number, unit, digits)
