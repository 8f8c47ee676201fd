"""Parameters of one compression, from a cloud to packings under stress, and their checks.

The stages that follow from them are in `modal.preparation.protocol`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

from modal.formats.provenance import Provenance, versions
from modal.packing.clumps import ClumpTemplate, parse_template
from modal.packing.neighbours import refuse_more_than_fit
from modal.packing.sphere_sample import TURNING
from modal.preparation.durations import STABLE_FRACTION, time_step, vibration_duration
from modal.preparation.mixture import MIXTURE, Mixture
from modal.preparation.strain_control import INERTIAL_NUMBER
from modal.tools.errors import InputError

CLOUD_FRACTION = 0.2
"""Solid fraction of the cloud, in which no spheres overlap."""
HOT_STRESS = 5e5
"""Mean stress, Pa, of the agitated spheres at which the approach ends; once the agitation is over,
the stress of the packing is below the first stress of the study."""
APPROACH_RATE = 8.0
"""Strain rate, 1/s, from `LOOSE_FRACTION` to `HOT_STRESS`."""
AGITATED_DAMPING = 0.02
"""Local damping during the approach, which decides how dense the packing jams."""
LOCAL_DAMPING = 0.2
"""Local damping once the approach is over."""
PEAK = 2e8
"""Pressure, Pa, under which spheres without friction are packed before they are unloaded."""
NOMINAL_FRACTION = 0.6
"""Solid fraction at which `width` and the number of spheres fix the length."""
RESIDUAL = 1e-3
"""Mean net force on a sphere divided by the mean contact force at which a state is reached."""
MAX_SEED = 2**63 - 1
"""Largest seed that an attribute of a file holds."""
MAX_DILATION = 0.1
"""Largest `dilate` of a study; spheres drawn farther apart are a cloud."""
HOT_STRESS_RANGE = (100.0, 1e8)
"""Range of stresses, Pa, at which the approach of agitated spheres may end."""

CLOUD_PARAMETERS: Final = ("approach_rate", "agitated_damping")
"""Parameters of a study that have no meaning if the spheres were dense before."""
FRICTION_PARAMETERS: Final = (
    *CLOUD_PARAMETERS,
    "inertial_number",
    "fraction",
    "hot_stress",
    "damping",
)
"""Parameters of a study that have no meaning for a descent without friction."""


def unused_parameters(friction: float, dilate: float) -> tuple[str, ...]:
    """Return the names of the study's parameters that a path does not use.

    `friction` and `dilate` characterise the path.

    >>> unused_parameters(0.3, 0.0), unused_parameters(0.3, 0.005)
    (('peak',), ('approach_rate', 'agitated_damping'))
    """
    if friction == 0:
        return *FRICTION_PARAMETERS, "dilate"
    if dilate:
        return CLOUD_PARAMETERS
    return ("peak",)


IMPLICIT: Final[Mapping[str, Any]] = {
    **dict.fromkeys(MIXTURE, ""),
    "solid": "",
    "dilate": 0.0,
    **dict.fromkeys(TURNING, 0.0),
    "clump": "",
}
"""Values of parameters that are not written as attributes: those of equal glass spheres from a
cloud, as in earlier files."""


@dataclass(frozen=True)
class Study:
    """Parameters of one compression; the defaults are those of the study at friction 0.4.

    Attributes
    ----------
    mu_comp : float
        Coefficient of friction of the compression.
    spheres : int
        Number of spheres.
    width : float
        Width of the cell at `NOMINAL_FRACTION`, mean diameters.
    seed : int
        Seed of the random numbers.
    approach_rate : float
        Strain rate of the agitated spheres, 1/s.
    agitated_damping : float
        Local damping of the agitated spheres.
    inertial_number : float
        Largest strain rate of the servo multiplied by the inertial time.
    fraction : float
        Time step divided by its limit.
    hot_stress : float
        Mean stress at which the approach ends, Pa.
    damping : float
        Local damping after the approach.
    residual : float
        Mean net force divided by the mean contact force of a settled state.
    peak : float
        Peak pressure of spheres without friction, Pa. Of the other parameters of the protocol, only
        `residual` has a meaning for them.
    dilate : float
        Share by which all lengths of a dense packing (without friction) grow before its spheres are
        stirred and jam with friction; 0 is a path from a cloud.
    rolling, twisting : float
        Coefficients against turns of the contacts, as in `modal.packing.sample.Sample`; they need
        friction.
    sizes, densities, walls : str
        Words of `modal.preparation.mixture`, empty for equal spheres of glass between walls of
        glass; walls are `NO_WALLS` if the cell is periodic along z.
    solid : str
        Words of `parse_solid`, empty for the study's glass. Stresses of the protocol, `hot_stress`
        and `peak` among them, then grow with E*, rates with (E* / density)^(1/2) / R, so that the
        packing is the one of glass at a stress that is an equal share of E*.
    clump : str
        Numbers x y z radius of the spheres of a clump's template, empty for spheres. `spheres` is
        then the number of clumps, each of the volume of a sphere of the mean radius.

    Raises
    ------
    InputError
        If a parameter is outside its range, or words are unknown.
    """

    mu_comp: float = 0.4
    spheres: int = 35201
    width: float = 14.65
    seed: int = 1
    approach_rate: float = APPROACH_RATE
    agitated_damping: float = AGITATED_DAMPING
    inertial_number: float = INERTIAL_NUMBER
    fraction: float = STABLE_FRACTION
    hot_stress: float = HOT_STRESS
    damping: float = LOCAL_DAMPING
    residual: float = RESIDUAL
    peak: float = PEAK
    dilate: float = 0.0
    rolling: float = 0.0
    twisting: float = 0.0
    sizes: str = ""
    densities: str = ""
    walls: str = ""
    solid: str = ""
    clump: str = ""

    def __post_init__(self) -> None:
        self._convert_types()
        self._check_spheres()
        refuse_more_than_fit(self.spheres)
        _ = self.mixture  # refuses unknown words
        self._check_protocol()
        self._check_clumps()

    def _convert_types(self) -> None:
        """Convert each parameter to the type of its default: tables have numbers of any type."""
        for name, default in PARAMETER_DEFAULTS.items():
            value = type(default)(getattr(self, name))
            object.__setattr__(self, name, value)
            if isinstance(value, float) and not math.isfinite(value):
                raise InputError(
                    "not_finite", f"{name} {value}", "not a finite number", "give another"
                )

    def _check_spheres(self) -> None:
        """Raise InputError for an impossible friction, cell, seed or number of spheres."""
        if not 0 <= self.mu_comp <= 1:
            raise InputError(
                "friction",
                f"friction (mu_comp) {self.mu_comp:g}",
                remedy="give a number from 0 to 1",
            )
        min_spheres = 8
        min_width = 2
        if self.mu_comp:
            min_spheres = 100
            min_width = 4
        if self.spheres < min_spheres or self.width < min_width:
            raise InputError(
                "too_few_spheres",
                f"{self.spheres} spheres in a cell {self.width:.3g} diameters wide",
                "too few",
                f"take at least {min_spheres} spheres and a width of {min_width} diameters, by "
                "more spheres or a smaller aspect (length over width)",
            )
        if not 0 <= self.seed <= MAX_SEED:
            raise InputError(
                "seed", f"seed {self.seed}", "outside 0 to 2^63 - 1", "give 0, 1, 2 ..."
            )

    def _check_clumps(self) -> None:
        """Raise InputError for clumps without friction, with `dilate`, or in a mixture."""
        if not self.clump:
            return
        mixed = self.sizes or self.densities
        if not self.mu_comp or self.dilate or mixed:
            raise InputError(
                "clumps",
                "clumps without friction, dilated, or of several sizes or densities",
                "they are packed from a cloud of equal clumps with friction alone",
                "leave the others out",
            )
        _ = self.template  # refuses an impossible one

    def _check_protocol(self) -> None:
        """Raise InputError for a number of the protocol outside its range."""
        if not (0 < self.fraction <= 1 and 0 < self.inertial_number < 1):
            raise InputError(
                "fraction",
                f"fraction {self.fraction:g}, inertial number {self.inertial_number:g}",
                "both must lie between 0 and 1",
                f"{STABLE_FRACTION:g} and {INERTIAL_NUMBER:g} are usual",
            )
        if not (self.approach_rate > 0 and 0 <= self.agitated_damping < 1 > self.damping > 0):
            raise InputError(
                "rate_or_damping",
                f"approach rate {self.approach_rate:g}, damping {self.agitated_damping:g} while "
                f"agitated and {self.damping:g} later",
                "the rate must be positive, each damping below 1, the later one above 0",
            )
        if not 0 <= self.dilate <= MAX_DILATION or (self.dilate and not self.mu_comp):
            raise InputError(
                "dilate",
                f"dilate {self.dilate:g}",
                "the share by which lengths grow before spheres jam with friction, 0 to "
                f"{MAX_DILATION:g}",
                "0.005 leaves them nearly as dense as they are without",
            )
        for name in TURNING:
            coefficient = getattr(self, name)
            if not 0 <= coefficient <= 1 or (coefficient and not self.mu_comp):
                raise InputError(
                    "rolling_or_twisting",
                    f"{name} {coefficient:g}",
                    "contacts resist turns by a coefficient from 0 to 1, and only with friction",
                )
        lowest, highest = HOT_STRESS_RANGE
        if not (lowest <= self.hot_stress <= highest and 0 < self.residual < 1):
            raise InputError(
                "hot_stress_or_residual",
                f"hot stress {self.hot_stress:g} Pa, residual {self.residual:g}",
                f"the stress must lie between {lowest:g} Pa and {highest:g} Pa, the residual "
                "between 0 and 1",
            )

    @cached_property
    def mixture(self) -> Mixture:
        """Spheres and walls that the words of the study describe."""
        return Mixture.parse(
            self.spheres, self.seed, self.sizes, self.densities, self.walls, self.solid
        )

    @cached_property
    def template(self) -> ClumpTemplate | None:
        """Template of the clumps, scaled to their size; None for spheres."""
        if not self.clump:
            return None
        return parse_template(self.clump.split()).scaled(self.mixture.radius)

    @property
    def cloud_fraction(self) -> float:
        """Solid fraction of the cloud; spheres that enclose clumps are as dense as single ones."""
        if self.template is None:
            return CLOUD_FRACTION
        around = 4 / 3 * math.pi * self.template.reach**3
        return CLOUD_FRACTION * self.template.volume / around

    def time_step(self, stress: float) -> float:
        """Return the stable time step, s, of a packing at rest at `stress`, Pa."""
        mixture = self.mixture
        smallest = mixture.smallest
        if self.template is not None:
            smallest = float(self.template.radius.min())
        return time_step(stress, self.fraction, smallest, mixture.mean)

    def vibration_duration(self, number: float, stress: float) -> float:
        """Return the seconds, at `stress` (Pa), of a duration stated at the reference pressure."""
        return vibration_duration(number, stress, self.mixture.radius, self.mixture.mean)

    @property
    def attributes(self) -> dict[str, float | int | str]:
        """Parameters as attributes of a file; `protocol` 2 has durations in times, 1 in steps.

        Parameters that the path does not use, and `IMPLICIT` values, are left out.
        """
        unused = unused_parameters(self.mu_comp, self.dilate)
        attributes: dict[str, float | int | str] = {}
        for name, value in asdict(self).items():
            if name not in unused and value != IMPLICIT.get(name):
                attributes[name] = value
        attributes["protocol"] = 2
        return attributes

    def provenance(self, command: str, **programs: str) -> Provenance:
        """Return the provenance of a state: only the study, and versions of `programs`."""
        return Provenance(command, self.attributes, versions=versions(**programs))

    def refuse_other(self, attributes: Mapping[str, Any], path: object) -> None:
        """Raise InputError if the attributes of the checkpoint at `path` are of another study."""
        expected = {name: getattr(self, name) for name in IMPLICIT} | self.attributes
        actual = {**IMPLICIT, **attributes}
        for name, value in expected.items():
            if not np.array_equal(np.asarray(actual.get(name)), np.asarray(value)):
                raise InputError(
                    "other_study",
                    f"{path}",
                    f"it belongs to another study ({name} is {actual.get(name)}, not {value})",
                    "move it away or take another folder",
                )


PARAMETER_DEFAULTS: Final[Mapping[str, Any]] = {
    name: field.default for name, field in Study.__dataclass_fields__.items()
}
"""Parameters of a study with their defaults."""
