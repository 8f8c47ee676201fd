"""Explain how a value was obtained: the steps that led to it, and the parts of its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from analysis.caveats import Caveat
from analysis.steps import Step, number_text
from modal.tools.display import plain

ERROR_PARTS: Final[Mapping[str, str]] = {
    "fit": "scatter about a fit, change with the order of a fit, or residual of a solver",
    "chain": "choice of the chain of spheres along which the wave is read",
    "window": "choice of the window, or of the part of a record, that is read",
    "resolution": "width of a line, within which values are not independent",
    "length": "packing too short, or its two halves unlike: equal in all samples of one kind",
    "digits": "few digits of positions, from which overlaps follow, or gaps in place of overlaps",
    "threshold": "choice of the level at which a wave arrives",
    "distortion": "change of the shape of a pulse on its way",
    "sampling": "times between the samples of a record",
    "distance": "places of the spheres of which a transducer consists",
    "samples": "differences between samples of one state",
}
"""Parts of an error by name: what each of them stands for. All are in the unit of the value. The
error is the root of the sum of their squares without `samples`, or `samples` if that is larger."""

DIRECT = "directly from the packing or its files, without a window, fit or limit"
"""Text for a known value that has no steps."""
NOT_BEGUN = "no step was reached; the caveats say why"
"""Text for a value that is not known and has no steps."""
ERROR_DIGITS = 3
"""Digits of the parts of an error."""


@dataclass(frozen=True)
class Explanation:
    """A value with the parts of its error, the steps that led to it, and its caveats.

    `str()` of it is its text for people.

    Attributes
    ----------
    text : str
        The printed value, or "not known".
    value, error : float or ndarray (n,)
        In `unit`.
    unit : str
        SI unit, "1" for a number.
    parts : mapping
        Parts of the error, in `unit`, by the keys of `ERROR_PARTS`.
    steps : sequence of Step
        Windows, fits, limits and samples, in the order in which they are used.
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
        """Return all fields for JSON; parts and caveats come with their meanings."""
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
        lines += _lines("how it was read", self._step_texts())
        lines += _lines("to know before", [f"{caveat.code}: {caveat}" for caveat in self.caveats])
        return "\n".join(lines)

    def _step_texts(self) -> list[str]:
        """Return a line of text for each step; one line saying so if there are none."""
        if self.steps:
            return [str(step) for step in self.steps]
        if np.isfinite(self.value).any():
            return [DIRECT]
        return [NOT_BEGUN]

    def _part_texts(self) -> list[str]:
        """Return a line of text for each known part of the error.

        For an array the largest number is shown.
        """
        texts = []
        for name, part in self.parts.items():
            known = np.asarray(part, float)[np.isfinite(part)]
            if known.size:
                size = number_text(float(known.max()), self.unit, ERROR_DIGITS)
                if np.ndim(part):
                    size = f"up to {size}"
                texts.append(f"{name} {size}: {ERROR_PARTS[name]}")
        return texts


def _lines(title: str, texts: Sequence[str]) -> list[str]:
    """Return a title and a list under it; nothing for an empty list."""
    if not texts:
        return []
    return [f"  {title}", *(f"  - {text}" for text in texts)]
