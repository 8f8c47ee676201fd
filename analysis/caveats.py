"""Describe caveats on a number: a code with its numbers, and one table of texts.

Programs and tests compare codes and numbers. The sentence for people is made from them where it is
printed, so that a text can be improved without changing what a program does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from modal.tools.display import plain
from modal.tools.errors import InputError

TEXTS: Final[Mapping[str, str]] = {
    # The packing.
    "one_sample": "one sample: how samples differ is not in the error; measure further seeds",
    "unsettled": "not in equilibrium: {excess}",
    "sliding": (
        "{share:.1%} of the contacts slide: they count with their tangential springs, as if the "
        "wave held them; `moduli --sliding slip` leaves these springs out, a lower bound"
    ),
    "crystalline": "crystalline: {share:.0%} of the bulk; no random packing",
    "no_solid": "density of no solid, {density:.4g} kg/m^3: mass in kg, radius in m?",
    "narrow": "narrow: {width:.1f} D wide; waves longer than that feel their images",
    "short": "short: {length:.1f} D long; below {needed:g} D it may be {too_high:.0%} too high",
    "too_short": "too short: {length:.1f} D long, the rule needs {needed:g} D and reads too high",
    "few_digits": "overlaps are known to {error:.2g} by the digits of positions",
    "scanned": (
        "from a scan: gaps below {tolerance:.3g} m count as contacts, whose mean force follows "
        "from {stress:.3g} Pa; where few of them bear the stress, as in sheared packings, "
        "velocities are too high by more than the error"
    ),
    "free_surface": "free surface at {ends}: of {cubes} cubes away from walls and surfaces",
    "contacts_missing": (
        "contacts missing: {pairs} pairs of spheres and {with_wall} spheres at a wall overlap "
        "without one"
    ),
    "no_order": "{reason}: order is not told",
    "no_bulk": "too short: no layer is far from both walls",
    "no_stated_stress": "the packing does not say for which stress it was made",
    # Waves.
    "wavelength_above_width": (
        "wavelength above the width: {wavelength:.0f} D at {frequency}, the packing is {width:.1f} "
        "D wide"
    ),
    "no_walls": "by the elastic moduli: there are no walls",
    "wave_lost": "no coherent wave goes through enough of the packing to be read",
    "first_arrival_stands": "what comes first does not move on along the chain",
    "no_stiffness": "nothing resists this motion: do spheres slide along the walls?",
    "faint_source": "faint source: above {frequency} it sends less than {share:.0%}",
    # Travel times between transducers.
    "near_field": (
        "near field: {wavelengths:.2g} wavelengths between the transducers; below {needed:g} P- "
        "and S-motion of the source overlap"
    ),
    "side_reflections": (
        "sides: waves by way of the sides, or from a disc's images, arrive {periods:.2g} periods "
        "after the direct one"
    ),
    "end_reflections": (
        "ends: waves by way of an end, or round a period, arrive {periods:.2g} periods after the "
        "direct one"
    ),
    "free_sides": "free sides: waves longer than the width are those of a bar",
    "wavelength_near_grains": (
        "short waves: {wavelength:.1f} D, where the packing disperses and scatters them"
    ),
    "ambiguous_cycle": "cycle not certain: the next maximum is {ratio:.0%} of the largest",
    "no_such_point": "{rule}: source or receiver has no such point",
    # Low-pass frequency.
    "no_plateau": "no plateau: it changes by {change:.0%} with the place along the packing",
    "no_plateau_beside": "no plateau: it is not known on the stretches beside",
    "slow_rise": "no plateau: attenuation rises through it from {first} to {last}",
    "never_fades": (
        "no frequency where the coherent wave fades to {left:.0%} over {length:g} D in {failed} of "
        "{windows} windows: {reasons}"
    ),
    "few_particles": "seen at {seen} of {particles} particles: too few",
    "few_columns": "{known} of {columns} columns have a value",
    "source_too_weak": "above {frequency} the source sends too little",
    # Attenuation and scattering.
    "no_attenuation": "attenuation is not told from zero at any frequency",
    "crystal": "a crystal does not scatter its waves",
    "no_short_free_path": "no standing wave that could be read has so short a mean free path",
    "beyond_limit": (
        "the longest standing wave that could be read has a shorter mean free path already: the "
        "limit lies below {lowest:.4g} Hz"
    ),
    "walls": "walls: plane waves need a cell that is periodic all round",
    "narrow_for_waves": "the cell is narrower than the shortest waves that are read",
    "no_line": "no line of a plane wave stands out",
    # Modes.
    "no_soft_modes": "a crystal has no soft modes beside its waves",
    "no_peak": "resolution: no peak above {frequency}, below which lines of zero modes are",
    "few_modes": (
        "resolution: fewer than {needed:g} modes lie below the largest value, at {frequency}: the "
        "packing is too small to tell a peak"
    ),
    "no_standing_wave": "no mode bears a standing wave",
    "missing_modes": "{missing} modes are missing",
    "incomplete_list": "list not complete: {count} of {all} modes, up to {frequency}",
    # Gain and amplitudes.
    "gain_resolution": "resolution: heights of resonances are those of lines {width} wide",
    "amplitudes": "at amplitudes of {sizes} m",
    # Means and studies.
    "mean": "mean of {known} of {packings} packings",
    "common_frequencies": "known where all of the packings have it",
    "unlike": "no samples of one state, which alone have a mean: they differ in {properties}",
    "absent": "what it is read from is not among the packing's files",
    "not_kept": "not kept: {reason}",
}
"""Text of each code; the names in braces stand for the values of the caveat."""


@dataclass(frozen=True)
class Caveat:
    """A caveat: a fact to know before a number is quoted.

    `str()` of it is its sentence.

    Attributes
    ----------
    code : str
        A key of `TEXTS`, or the code of a refusal.
    values : mapping
        Numbers and names in the text. The text of an error, or of a remark from elsewhere, has the
        key "text".

    Examples
    --------
    >>> str(Caveat("narrow", {"width": 7.06}))
    'narrow: 7.1 D wide; waves longer than that feel their images'
    """

    code: str
    values: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse a code without a text, which is a mistake of the program."""
        if "text" not in self.values and self.code not in TEXTS:
            raise RuntimeError(f"caveat {self.code!r} has no text in TEXTS")

    def __str__(self) -> str:
        if "text" in self.values:
            return str(self.values["text"])
        return TEXTS[self.code].format(**self.values)

    def as_json(self) -> dict[str, Any]:
        """Return the code, the numbers and names, and the sentence, for JSON."""
        values = {name: value for name, value in self.values.items() if name != "text"}
        return {"code": self.code, "values": plain(values), "text": str(self)}

    def __hash__(self) -> int:
        return hash((self.code, tuple(sorted(self.values.items()))))


def refusal(error: InputError) -> Caveat:
    """Return an error as the caveat of the number that it prevented."""
    return Caveat(error.code, {"text": str(error)})
