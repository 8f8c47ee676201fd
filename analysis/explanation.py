"""Explain how a value was obtained: the steps that led to it, and the parts of its error.

A step is a window over a record, a fit, or a limit, with its numbers and the code of its outcome.
The sentences are made from these where they are printed: `OUTCOMES` and `NUMBERS` hold the texts of
steps, `ERROR_PARTS` those of errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from analysis.caveats import Caveat
from modal.tools.display import plain, quantity
from modal.tools.errors import UnavailableError

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

StepKind = Literal["window", "fit", "limit"]
"""A window over a record, a fit to numbers, or a limit that a number must keep."""

OUTCOMES: Final[Mapping[str, str]] = {
    # Windows.
    "read": "read",
    "none_left": "no frequency is left to be read",
    "crossed": "the attenuation rises through the level at which the wave has faded",
    "no_wave": "no coherent wave at any frequency",
    "does_not_travel": "no wave travels at this frequency",
    "starts_above": "the wave has faded already at the lowest frequency",
    "ends_below": "the wave ends before it has faded",
    # Fits.
    "fitted": "fitted",
    "too_few": "too few frequencies for a fit",
    "stands": "the first peak does not move on along the chain",
    "converged": "the solver has converged",
    "waves_compared": "waves of both signs and the linear wave, at the same times",
    # Limits.
    "kept": "the limit is kept",
    "exceeded": "above the limit",
    "fallen_short": "below the limit",
    "not_known": "one of the two numbers is not known",
    "reached": "the limit is reached",
    "not_reached": "the limit is reached at no frequency",
    "starts_beyond": "beyond the limit already at the lowest frequency",
    "no_maximum": "largest at the lowest frequency that can be read",
    "digits": "the digits of the packing limit the value",
    # Lists of modes.
    "complete": "the list has every mode",
    "ends_early": "the list ends before the highest mode",
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


class NumberMeaning(NamedTuple):
    """The meaning of a number in a step, and its SI unit; no unit for a pure number."""

    text: str
    unit: str = ""


NUMBERS: Final[Mapping[str, NumberMeaning]] = {
    # Windows over a record, and what is read in them.
    "damping": NumberMeaning("damping over the record, eta T"),
    "passages": NumberMeaning("length of the record in passages of the wave"),
    "record_end": NumberMeaning("the record is cut at", "s"),
    "stretch_start": NumberMeaning("read along the packing from", "m"),
    "stretch_end": NumberMeaning("to", "m"),
    "threshold": NumberMeaning("amplitude that counts as faded, divided by the largest"),
    "lowest": NumberMeaning("from", "Hz"),
    "highest": NumberMeaning("to", "Hz"),
    "resolution": NumberMeaning("width of a line", "Hz"),
    "end_frequency": NumberMeaning("the coherent wave ends at", "Hz"),
    "left_at_end": NumberMeaning("share of the amplitude left at the last frequency"),
    "sent_at_end": NumberMeaning("amplitude of the source there, divided by its largest"),
    "first_crossing": NumberMeaning("first crossing", "Hz"),
    "fitted_crossing": NumberMeaning("crossing of the rising fit", "Hz"),
    "last_crossing": NumberMeaning("last crossing", "Hz"),
    "waves": NumberMeaning("standing waves"),
    "cubes": NumberMeaning("cubes away from walls and surfaces"),
    "periods": NumberMeaning("largest number of periods in the cell"),
    "lines": NumberMeaning("lines with a width"),
    "maxima": NumberMeaning("maxima of the gain"),
    "first_gain": NumberMeaning("the first of them"),
    "first_gain_frequency": NumberMeaning("at", "Hz"),
    "layers": NumberMeaning("layers that no wall orders"),
    "all_layers": NumberMeaning("of"),
    "samples": NumberMeaning("times that both records have"),
    "wavelength": NumberMeaning("wavelength in diameters"),
    # Lists of modes.
    "modes": NumberMeaning("modes"),
    "all_modes": NumberMeaning("of"),
    # Fits and solvers.
    "velocity": NumberMeaning("velocity", "m/s"),
    "error": NumberMeaning("its standard error", "m/s"),
    "frequency": NumberMeaning("frequency", "Hz"),
    "band_edge": NumberMeaning("band edge", "Hz"),
    "order": NumberMeaning("order of the fit"),
    "residual": NumberMeaning("relative residual of the solver"),
    "scatter": NumberMeaning("scatter between columns", "m/s"),
    "packing_length": NumberMeaning("length of the packing", "m"),
    "side": NumberMeaning("period of the cell along the wave", "m"),
    "exponent": NumberMeaning("exponent"),
    "exponent_error": NumberMeaning("its standard error"),
    "amplitude": NumberMeaning("amplitude of the source", "m"),
    "time_step": NumberMeaning("time step", "s"),
    "step_error": NumberMeaning("error from the time steps"),
    "noise": NumberMeaning("motion without a wave, divided by that of the wave"),
    "overlap_error": NumberMeaning("relative error of the overlaps"),
    "relative_error": NumberMeaning("relative error that it makes"),
    # Numbers that are compared with a limit.
    "limit": NumberMeaning("limit"),
    "needed": NumberMeaning("needed"),
    "frequencies": NumberMeaning("frequencies"),
    "all_frequencies": NumberMeaning("of"),
    "particles_with_value": NumberMeaning("particles with a value"),
    "particles": NumberMeaning("of"),
    "columns_with_value": NumberMeaning("columns with a value"),
    "columns": NumberMeaning("of"),
    "length": NumberMeaning("length in diameters"),
    "spread": NumberMeaning("spread of crossings and windows, divided by the frequency"),
    "change": NumberMeaning("relative change on the stretches beside"),
    "source_end": NumberMeaning("the source sends enough up to", "Hz"),
    "least_source_share": NumberMeaning("least amplitude of the source, divided by its largest"),
    "nepers": NumberMeaning("largest decay over the stretch, as an exponent"),
    "attenuation_in_errors": NumberMeaning("largest attenuation in its errors"),
    "largest_velocity": NumberMeaning("largest velocity of a wave in the crystal", "m/s"),
    "least_velocity": NumberMeaning("least velocity that is not round-off", "m/s"),
    "scattering_ratio": NumberMeaning("largest pi times the width of a line over its frequency"),
    "peak": NumberMeaning("largest value at", "Hz"),
    "modes_below": NumberMeaning("modes below the largest value"),
    "asymmetry": NumberMeaning("asymmetry of the stiffness of the bulk"),
    "radius_difference": NumberMeaning("largest relative difference of two radii"),
    "share": NumberMeaning("largest share of the next standing wave that one mode has"),
    "last_pure": NumberMeaning("last mode with so large a chi_z at", "Hz"),
    "resonance_distance": NumberMeaning("distance of two resonances", "Hz"),
    "list_end": NumberMeaning("the list of modes ends at", "Hz"),
    "least_list_end": NumberMeaning("it must reach", "Hz"),
}
"""Meanings and units of the numbers of steps, by their names."""

DIRECT = "directly from the packing or its files, without a window, fit or limit"
"""Text for a known value that has no steps."""
NOT_BEGUN = "no step was reached; the caveats say why"
"""Text for a value that is not known and has no steps."""
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
        Numbers of the step by their names, keys of `NUMBERS`, in the units there; NaN if not known.
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
    ended_by: str = ""

    def __post_init__(self) -> None:
        """Refuse an outcome or a number without a meaning, which is a mistake of the program."""
        if self.outcome not in OUTCOMES:
            raise RuntimeError(f"outcome {self.outcome!r} of a step has no meaning in OUTCOMES")
        unexplained = self.numbers.keys() - NUMBERS.keys()
        if unexplained:
            raise RuntimeError(f"numbers of a step without a meaning: {sorted(unexplained)}")

    @property
    def units(self) -> dict[str, str]:
        """Return the unit of each number that has one."""
        units = {name: NUMBERS[name].unit for name in self.numbers}
        return {name: unit for name, unit in units.items() if unit}

    def as_json(self) -> dict[str, Any]:
        """Return all fields; numbers that are not known are None."""
        return {
            "kind": self.kind,
            "outcome": self.outcome,
            "numbers": plain(self.numbers),
            "units": self.units,
            "ended_by": self.ended_by,
        }

    def __str__(self) -> str:
        texts = [f"{self.kind}: {OUTCOMES[self.outcome]}"]
        for name, number in self.numbers.items():
            if np.isfinite(number):
                meaning = NUMBERS[name]
                texts.append(f"{meaning.text} {_number_text(number, meaning.unit, STEP_DIGITS)}")
        if self.ended_by:
            texts.append(WAVE_ENDS[self.ended_by])
        return "; ".join(texts)


def limit_step(
    numbers: Mapping[str, float], number: str, limit: str, *, least: bool = False
) -> Step:
    """Return a step that compares two of its numbers: `number` must be at most `limit`.

    With `least`, `number` must be at least `limit`. Both are keys of `numbers`.

    >>> limit_step({"change": 0.2, "limit": 0.1}, "change", "limit").outcome
    'exceeded'
    """
    value = numbers[number]
    bound = numbers[limit]
    outcome = "kept"
    if np.isnan(value) or np.isnan(bound):
        outcome = "not_known"
    elif least and value < bound:
        outcome = "fallen_short"
    elif not least and value > bound:
        outcome = "exceeded"
    return Step("limit", outcome, numbers)


class UnreadableError(UnavailableError):
    """Raised if a number cannot be read from a record or spectrum; it has the steps so far."""

    def __init__(self, code: str, problem: str, steps: Sequence[Step]) -> None:
        super().__init__(code, problem)
        self.steps = tuple(steps)


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
    """Return a number with its unit, with `digits` significant digits."""
    if unit in ("", "1"):
        return f"{number:.{digits}g}"
    return quantity(number, unit, digits)
