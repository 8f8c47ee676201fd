"""The way from a cloud to a packing with friction: its stages, durations, rates and limits.

One definition for YADE (`yade_scripts/compress.py`) and for modal's own loop. Durations are times,
not numbers of steps: half the step takes twice as many. What agitates spheres takes a fixed number
of the packing's own times; what settles it are vibrations (`modal.preparation.durations`).

While spheres still move freely hardly anything but friction dissipates (Otsubo et al. 2017,
section 2, have friction alone): damping makes the packing looser. The agitated packing then comes
to rest at a constant volume: a servo would let it expand until the agitation carries the stress.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from modal.formats.provenance import Provenance, versions
from modal.packing.neighbours import refuse_more_than_fit
from modal.preparation.durations import STABILITY, duration, inertial_time, time_step
from modal.preparation.sizes import MIXTURE, Mixture
from modal.preparation.strain_control import INERTIAL_NUMBER, ConstantRate, Servo
from modal.tools.errors import InputError

CONTROL = 0.0127
"""Between two settings of the strain rates; 5 steps of `STABILITY` at the target stress."""
CHECK = 0.2542
"""Between two looks at stress and balance; 100 such steps."""
CHECKS = 30
"""Checks between two checkpoints; 3,000 such steps, in YADE some four minutes at full size."""
PATIENCE = 30.5
"""After which a packing that does not settle is taken as it is, and marked; 12,000 such steps. At
1 kPa these are 6.6 of its own times, at 10 MPa 142."""

CHECKPOINT = "path.checkpoint"
"""Name of the state under way, which is none of the states that `*.h5` in its folder means."""
OLD_CHECKPOINT = "checkpoint.h5"
"""The same of paths that were begun before; they go on from there."""
END = "end"
"""Name of the stage after the last."""
PREPARATION = "approach", "cool", "jam"
CLOUD_STAGE, STIR, SQUEEZE = "cloud", "stir", "peak"
"""Names of the stage before these, which has no checkpoint; of the one that stands in its place for
spheres that have been dense before; and of that before all states without friction."""
STRESSES = (1e3, 1e4, 1e5, 1e6, 1e7)
CLOUD, LOOSE = 0.2, 0.5
"""Solid fractions of the cloud (no overlaps) and of its compaction at rest."""
COMPACTION_RATE = 400.0
"""Strain rate, 1/s, from CLOUD to LOOSE."""
COMPACTION_STRESS = 1e6
"""Mean stress, Pa, that the time step of the compaction allows for."""
HOT = 5e5
"""Mean stress, Pa, of the agitated spheres at which the compaction ends; without agitation and
unloading, below the first stress of the study."""
APPROACH_RATE, AGITATED_DAMPING = 8.0, 0.02
"""Strain rate, 1/s, from LOOSE to HOT, and local damping until then, which decides how dense the
packing jams."""
DAMPING = 0.2
"""Local damping once the compaction is over."""
COOLING = 36.5
"""Own times at HOT, at constant volume, after which the agitation is over; 6,000 steps of a packing
whose contacts have parted."""
JAMMING_STRESS = 1e4
"""Stress, Pa, before the first state: a jammed packing that is let go at once flies apart."""
JAMMED = 0.1, 1e-2
SETTLED = 3e-3, 1e-3
"""When jamming is over, when a state is reached: largest relative error of a principal stress, mean
residual over contact force."""
STIRRED = 50.0
"""Times in which a stirred sphere, on average, goes as far as the gap between two; four times as
long leave the same contacts."""
PEAK = 2e8
"""Pressure, Pa, under which spheres without friction are packed before they are unloaded."""
NOMINAL_FRACTION = 0.6
"""Solid fraction at which `width` and the number of spheres fix the length."""
ABOVE = 1.5
"""Stress that the time step allows for, over the present mean."""


def by_tens(before: float, stress: float) -> list[float]:
    """The way from one stress, Pa, to another: each at most ten times the one before, or a tenth.

    >>> by_tens(1e4, 1e5), by_tens(2e8, 1e6), by_tens(1e4, 5e5)
    ([100000.0], [20000000.0, 2000000.0, 1000000.0], [100000.0, 500000.0])
    """
    way = []
    while not 1 / 10 <= (ratio := stress / before) <= 10:
        before = before * 10 if ratio > 1 else before / 10
        way.append(before)
    return [*way, stress]


OF_CLOUD = "approach_rate", "agitated_damping"
OF_FRICTION = *OF_CLOUD, "inertial_number", "fraction", "hot_stress", "damping"
"""Numbers of a study that say nothing of a descent without friction; the first ones say nothing of
spheres that were dense before, either."""


def unused(friction: float, dilate: float) -> tuple[str, ...]:
    """Names of a study's numbers that say nothing of such a path.

    >>> unused(0.3, 0.0), unused(0.3, 0.005)
    (('peak',), ('approach_rate', 'agitated_damping'))
    """
    if friction == 0:
        return *OF_FRICTION, "dilate"
    return OF_CLOUD if dilate else ("peak",)


UNSAID = dict[str, Any](dict.fromkeys((*MIXTURE, "solid"), "")) | {"dilate": 0.0}
"""What attributes leave out where it stands like this."""


@dataclass
class Study:
    """What tells one compression from another; the defaults are the study's own at friction 0.4.

    width: diameters; approach_rate: 1/s; fraction: time step over its limit; hot_stress: Pa, see
    `HOT`; damping: local, after it; residual: mean residual over contact force of a settled state;
    peak: Pa, of spheres without friction, of whose path the other numbers but residual say nothing;
    dilate: share by which all lengths of spheres that are dense, as without friction, grow before
    these are stirred and jam with friction; 0 is the path from a cloud;
    sizes, densities, walls: words as `modal.preparation.sizes` has them, none for equal spheres, of
    glass between walls of glass; walls are `NO_WALLS` of a cell that is periodic along z. `solid`
    has words as `solid_of`, none for the study's glass: stresses of the protocol, `hot_stress`
    and `peak` among them, then grow with E*, rates with (E* / density)^(1/2) / R, so that the same
    packing comes about at a stress that is the same share of E*.
    """

    mu_comp: float = 0.4
    spheres: int = 35201
    width: float = 14.65
    seed: int = 1
    approach_rate: float = APPROACH_RATE
    agitated_damping: float = AGITATED_DAMPING
    inertial_number: float = INERTIAL_NUMBER
    fraction: float = STABILITY
    hot_stress: float = HOT
    damping: float = DAMPING
    residual: float = SETTLED[1]
    peak: float = PEAK
    dilate: float = 0.0
    sizes: str = ""
    densities: str = ""
    walls: str = ""
    solid: str = ""

    def __post_init__(self) -> None:
        for name, kind in Study.__annotations__.items():
            setattr(self, name, kind(getattr(self, name)))
            if kind is float and not math.isfinite(getattr(self, name)):
                raise InputError(
                    "input",
                    f"{name} {getattr(self, name)}: not a finite number",
                    remedy="give another",
                )
        fewest, narrowest = (100, 4) if self.mu_comp else (8, 2)
        enough = self.spheres >= fewest and self.width >= narrowest
        if not 0 <= self.mu_comp <= 1:
            raise InputError(
                "input", f"friction (mu_comp) {self.mu_comp:g}", remedy="give a number from 0 to 1"
            )
        if not enough:
            raise InputError(
                "input",
                f"{self.spheres} spheres in a cell {self.width:.3g} diameters wide",
                "too few",
                "take "
                f"at least {fewest} spheres and a width of {narrowest} diameters, by more spheres "
                "or a smaller aspect (length over width)",
            )
        refuse_more_than_fit(self.spheres)
        _ = self.mixture  # refuses unknown words
        if not (0 < self.fraction <= 1 and 0 < self.inertial_number < 1):
            raise InputError(
                "input",
                f"fraction {self.fraction:g}, inertial number {self.inertial_number:g}",
                "both must lie between 0 and 1",
                f"{STABILITY:g} and {INERTIAL_NUMBER:g} are usual",
            )
        if not (self.approach_rate > 0 and 0 <= self.agitated_damping < 1 > self.damping > 0):
            raise InputError(
                "input",
                f"approach rate {self.approach_rate:g}, damping {self.agitated_damping:g} while "
                f"agitated and {self.damping:g} later",
                "the rate must be positive, each damping below 1, the later one above 0",
            )
        if not (0 <= self.dilate <= 0.1 and (self.mu_comp or not self.dilate)):
            raise InputError(
                "input",
                f"dilate {self.dilate:g}",
                "the share by which lengths grow before spheres jam with friction, 0 to 0.1",
                "0.005 leaves them nearly as dense as they are without",
            )
        if not (100 <= self.hot_stress <= 1e8 and 0 < self.residual < 1):
            raise InputError(
                "input",
                f"hot stress {self.hot_stress:g} Pa, residual {self.residual:g}",
                "the stress must lie between 100 Pa and 1e8 Pa, the residual between 0 and 1",
            )

    @cached_property
    def mixture(self) -> Mixture:
        """Spheres and walls."""
        words = self.sizes, self.densities, self.walls, self.solid
        return Mixture.of(self.spheres, self.seed, *words)

    def time_step(self, stress: float) -> float:
        """Stable time step of statics at `stress` (Pa), s."""
        mixture = self.mixture
        return time_step(stress, self.fraction, mixture.smallest, mixture.mean)

    def duration(self, number: float, stress: float) -> float:
        """Seconds of a vibration's duration, as the function `duration` has it."""
        return duration(number, stress, self.mixture.radius, self.mixture.mean)

    @property
    def attributes(self) -> dict[str, float | int | str]:
        """The study as a file's attributes; `protocol` 2 counts times, 1 counted steps."""
        none = unused(self.mu_comp, self.dilate)
        own = {name: getattr(self, name) for name in Study.__annotations__ if name not in none}
        # Equal spheres of glass from a cloud say nothing of others, as earlier files do not.
        said = {name: value for name, value in own.items() if value != UNSAID.get(name)}
        return said | {"protocol": 2}

    def provenance(self, command: str, **programs: str) -> Provenance:
        """What a state is made from: the study alone; `programs` with their versions."""
        return Provenance(command, self.attributes, versions=versions(**programs))

    def refuse_other(self, found: dict[str, Any], path: object) -> None:
        """InputError if a checkpoint's attributes are those of another study."""
        own = {name: getattr(self, name) for name in UNSAID}
        found = UNSAID | found
        for name, value in (own | self.attributes).items():
            if not np.array_equal(np.asarray(found.get(name)), np.asarray(value)):
                raise InputError(
                    "other_study",
                    f"{path}: it belongs to another study ({name} is {found.get(name)}, not "
                    f"{value})",
                    remedy="move it away or take another folder",
                )


def stages_of(study: Study, stresses: Sequence[float]) -> list[str]:
    """Names of the stages that lead to each stress, Pa, in turn.

    From one to the next by way of others at most ten times apart, which settle faster.
    """
    loads = study.mu_comp > 0
    names = [SQUEEZE] if not loads else [PREPARATION[-1]] if study.dilate else [*PREPARATION]
    before = (JAMMING_STRESS if loads else study.peak) * study.mixture.hardness
    for stress in stresses:
        *way, _ = by_tens(before, stress)
        names += [*(f"{station:g} for {stress:g}" for station in way), f"{stress:g}"]
        before = stress
    return names


class Stage:
    """One stage's control, damping and durations, s; `settled`, `impatient` say when it is over."""

    checks: int | None = CHECKS
    """Between two checkpoints; None for a stage without any."""

    def __init__(self, name: str, study: Study) -> None:
        self.name, self.study, mixture = name, study, study.mixture
        self.damping, self.limits = study.damping, (-math.inf, -math.inf)
        hot = inertial_time(HOT * mixture.hardness, mixture.radius, mixture.mean)
        constant = {
            CLOUD_STAGE: (COMPACTION_RATE, 0.0, math.inf),
            STIR: (0.0, 0.0, math.inf),
            "approach": (study.approach_rate, study.agitated_damping, math.inf),
            "cool": (0.0, study.damping, COOLING * hot),
        }
        if name in constant:
            rate, self.damping, self.patience = constant[name]
            self.control: ConstantRate | Servo = ConstantRate(rate * mixture.tempo)
            self.control.target *= mixture.hardness
        else:
            jams = name == "jam"
            target = JAMMING_STRESS * mixture.hardness if jams else stress_of(name)
            self.limits = JAMMED if jams else (SETTLED[0], study.residual)
            self.control = Servo(target, study.inertial_number, mixture.radius, mixture.mean)
            self.patience = study.duration(PATIENCE, target)
        self.check = study.duration(CHECK, self.control.target)
        self.interval = study.duration(CONTROL, self.control.target)

    @property
    def is_state(self) -> bool:
        """Whether the stage's end is a state to be written."""
        return self.name[0].isdigit() and " " not in self.name

    def time_step(self) -> float:
        """Stable at the target and at the present stress, s."""
        stress = max(self.control.target, ABOVE * self.control.stress.mean())
        return self.study.time_step(stress)

    def settled(self, unbalanced: float) -> bool:
        """Whether stresses and balance (residual over contact force) are as near as wanted."""
        if self.name == "approach":
            return bool(
                self.control.stress.mean() > self.study.hot_stress * self.study.mixture.hardness
            )
        return self.control.error() < self.limits[0] and unbalanced < self.limits[1]

    def look(self, packing: Any) -> None:
        """See, at each check that does not end it, whether the packing can go on."""

    def impatient(self, seconds: float) -> bool:
        """Whether the time of the stage is over, to half a check."""
        return seconds > self.patience - self.check / 2


def stress_of(name: str) -> float:
    """The stress, Pa, that a stage of this name leads to."""
    return float(name.partition(" ")[0])
