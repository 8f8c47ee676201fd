"""Hold the steps that lead to a value: windows, fits, limits and samples, with their numbers.

A step has the code of its outcome and its numbers by name. The sentences are made from these where
they are printed: `OUTCOMES`, `WAVE_ENDS` and `NUMBERS` hold the texts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from modal.tools.display import plain, quantity
from modal.tools.errors import UnavailableError

StepKind = Literal["window", "fit", "limit", "sample", "mean"]
"""A window over a record, a fit to numbers, a limit that a number must keep, one of the samples
that are averaged, or their mean."""
OF_VALUE: Final = "unit of the value"
"""Stands for the unit of the value to which the step leads."""

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
    "no_reversal": "the sense in which wave numbers turn is reversed at none of them clearly",
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
    # Means over samples.
    "averaged": "averaged",
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
    "edge_wavelength": NumberMeaning("wavelength at the band edge", "m"),
    "diameter": NumberMeaning("mean diameter", "m"),
    "stress_x": NumberMeaning("stress along x", "Pa"),
    "stress_y": NumberMeaning("along y", "Pa"),
    "stress_z": NumberMeaning("along z", "Pa"),
    "stated_stress": NumberMeaning("stated stress", "Pa"),
    "standing_wave": NumberMeaning("order of the standing wave"),
    "grid_frequency": NumberMeaning("largest power on the grid at", "Hz"),
    "grid_step": NumberMeaning("step of the grid", "Hz"),
    "power_before": NumberMeaning("power a step before, divided by the largest"),
    "power_behind": NumberMeaning("power a step behind"),
    # Means over samples.
    "sample": NumberMeaning("number"),
    "sample_value": NumberMeaning("value", OF_VALUE),
    "sample_error": NumberMeaning("error of its own", OF_VALUE),
    "shared_error": NumberMeaning("error that all samples share", OF_VALUE),
    "values": NumberMeaning("values"),
    "averaged_samples": NumberMeaning("samples"),
    "sample_scatter": NumberMeaning("standard deviation between samples", OF_VALUE),
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
    "scan_tolerance": NumberMeaning("gap below which spheres count as touching", "m"),
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
    "short_excess": NumberMeaning("share by which a velocity may be too high in short packings"),
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

STEP_DIGITS = 5
"""Digits of the numbers of steps: their differences, which are the error, can be checked."""


@dataclass(frozen=True)
class Step:
    """One window, fit, limit or sample on the path to a value.

    Attributes
    ----------
    kind : str
        A `StepKind`.
    outcome : str
        A key of `OUTCOMES`: which rule ended the step.
    numbers : mapping
        Numbers of the step by their names, keys of `NUMBERS`, in the units there; NaN if not known.
    ended_by : str
        A key of `WAVE_ENDS` if the step reads a coherent wave, else empty.
    value_unit : str
        Unit of the value, for numbers that are in it.

    Examples
    --------
    >>> print(Step("limit", "fallen_short", {"length": 8.25, "limit": 15.0}))
    limit: below the limit; length in diameters 8.25; limit 15
    """

    kind: StepKind
    outcome: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    ended_by: str = ""
    value_unit: str = ""

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
        units = {name: self._unit_of(name) for name in self.numbers}
        return {name: unit for name, unit in units.items() if unit}

    def _unit_of(self, name: str) -> str:
        """Return the unit of a number; empty for a pure number."""
        unit = NUMBERS[name].unit
        if unit == OF_VALUE:
            return self.value_unit
        return unit

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
                text = number_text(number, self._unit_of(name), STEP_DIGITS)
                texts.append(f"{NUMBERS[name].text} {text}")
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


def number_text(number: float, unit: str, digits: int) -> str:
    """Return a number with its unit, with `digits` significant digits."""
    if unit in ("", "1"):
        return f"{number:.{digits}g}"
    return quantity(number, unit, digits)
