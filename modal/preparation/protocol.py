"""Define the protocol from a cloud to a packing with friction: stages, durations, rates, limits.

Both YADE (`yade_scripts/compress.py`) and modal's own loop follow this protocol. Durations are
times, not numbers of steps. Stages that agitate spheres last a fixed number of inertial times;
stages in which they settle are counted in vibrations (`modal.preparation.durations`).

While spheres move freely, almost only friction dissipates energy (Otsubo et al. 2017, section 2,
use friction alone), because damping makes the packing looser. The agitated packing then comes to
rest at a constant volume: under a servo it would expand until the agitation carries the stress.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Protocol

from modal.packing.sample import Sample
from modal.preparation.durations import REFERENCE_PRESSURE, inertial_time
from modal.preparation.strain_control import ConstantRate, Servo
from modal.preparation.study import HOT_STRESS, RESIDUAL, Study
from modal.tools.arrays import Floats


class SettlingLimits(NamedTuple):
    """Deviations below which a stage has settled.

    Attributes
    ----------
    stress_error : float
        Largest relative deviation of a principal stress from its target.
    residual : float
        Mean net force on a sphere divided by the mean contact force.
    """

    stress_error: float
    residual: float


CONTROL_INTERVAL = 0.0127
"""Time between two settings of the strain rates, in inertial times at `REFERENCE_PRESSURE`: 5 steps
of `STABLE_FRACTION` at the target stress."""
CHECK_INTERVAL = 0.2542
"""Time between two checks of stress and balance, in inertial times at `REFERENCE_PRESSURE`: 100
steps of `STABLE_FRACTION`."""
CHECKS_PER_CHECKPOINT = 30
"""Number of checks between two checkpoints: 3,000 steps of `STABLE_FRACTION`, in YADE some four
minutes at full size."""
PATIENCE = 30.5
"""Inertial times at `REFERENCE_PRESSURE` after which a packing that does not settle is accepted as
it is, and marked: 12,000 steps of `STABLE_FRACTION`. At 1 kPa these are 6.6 inertial times, at 10
MPa 142."""

CHECKPOINT = "path.checkpoint"
"""File of the current state; its name does not match `*.h5`, which means finished states."""
OLD_CHECKPOINT = "checkpoint.h5"
"""File of the current state of paths that were begun by earlier versions, which can continue."""
END = "end"
"""Name of the stage after the last."""
APPROACH = "approach"
"""Name of the stage that compresses agitated spheres at a constant rate."""
COOL = "cool"
"""Name of the stage in which agitated spheres come to rest at a constant volume."""
JAM = "jam"
"""Name of the stage in which a servo brings spheres at rest to `JAMMING_STRESS`."""
PREPARATION: Final = (APPROACH, COOL, JAM)
"""Names of the stages from the compacted cloud to the first stress, with friction."""
CLOUD_STAGE = "cloud"
"""Name of the stage before the stages of `PREPARATION`; it has no checkpoint."""
STIR = "stir"
"""Name of the stage that replaces the cloud if the spheres have been packed densely before."""
SQUEEZE = "peak"
"""Name of the stage before all states without friction."""
STRESSES = (1e3, 1e4, 1e5, 1e6, 1e7)
"""Stresses of the study's states with friction, Pa."""
LOOSE_FRACTION = 0.5
"""Solid fraction at which the compaction of the cloud ends, at rest."""
COMPACTION_RATE = 400.0
"""Strain rate, 1/s, from `CLOUD_FRACTION` to `LOOSE_FRACTION`."""
COMPACTION_STRESS = 1e6
"""Mean stress, Pa, that the time step of the compaction allows for."""
COOLING_TIME = 36.5
"""Time at constant volume after which the agitation is over, in inertial times at `HOT_STRESS`:
6,000 steps of a packing whose contacts have opened."""
JAMMING_STRESS = 1e4
"""Stress, Pa, that a jammed packing keeps before the first state: without a stress it would fly
apart."""
JAMMED: Final = SettlingLimits(stress_error=0.1, residual=1e-2)
"""Limits at which jamming is over."""
SETTLED: Final = SettlingLimits(stress_error=3e-3, residual=RESIDUAL)
"""Limits at which a state is reached."""
NEVER: Final = SettlingLimits(-math.inf, -math.inf)
"""Limits that no packing reaches, of stages that end by stress or time."""
STIRRING_TIME = 50.0
"""Duration of stirring in units of the time that a sphere takes to cross the mean gap; stirring
four times as long leaves the same contacts."""
STRESS_MARGIN = 1.5
"""Stress that the time step allows for, divided by the present mean."""
MAX_STRESS_FACTOR = 10
"""Largest ratio of two successive stresses: packings settle faster in smaller steps of stress."""


def list_intermediate_stresses(before: float, stress: float) -> list[float]:
    """Return stresses, Pa, between two others, in steps of at most a factor of ten.

    >>> list_intermediate_stresses(1e4, 1e5), list_intermediate_stresses(2e8, 1e6)
    ([], [20000000.0, 2000000.0])
    """
    intermediate = []
    ratio = stress / before
    while not 1 / MAX_STRESS_FACTOR <= ratio <= MAX_STRESS_FACTOR:
        before = before * MAX_STRESS_FACTOR if ratio > 1 else before / MAX_STRESS_FACTOR
        intermediate.append(before)
        ratio = stress / before
    return intermediate


def name_stages(study: Study, stresses: Sequence[float]) -> list[str]:
    """Return the names of the stages that lead to each stress, Pa, in turn.

    Intermediate stresses, at most a factor of ten apart, make the packing settle faster; their
    names have the form "10000 for 100000".
    """
    if study.mu_comp == 0:
        names = [SQUEEZE]
        before = study.peak * study.mixture.hardness
    else:
        names = [JAM] if study.dilate else [*PREPARATION]
        before = JAMMING_STRESS * study.mixture.hardness
    for stress in stresses:
        for intermediate in list_intermediate_stresses(before, stress):
            names.append(f"{intermediate:g} for {stress:g}")
        names.append(f"{stress:g}")
        before = stress
    return names


def read_target_stress(name: str) -> float:
    """Return the stress, Pa, at the end of a stage, from the stage's name."""
    return float(name.partition(" ")[0])


class MovingPacking(Protocol):
    """Spheres in motion under a stage's control."""

    steps: int

    def advance(self, count: int, dt: float, every: int) -> None:
        """Take `count` steps of `dt`, s; set strain rates every `every` steps."""

    def stress(self) -> Floats:
        """Return the principal stresses (3,), Pa, compression positive."""

    def unbalanced(self) -> float:
        """Return the mean net force on a sphere divided by the mean contact force."""

    def sample(self, *, moving: bool) -> Sample:
        """Return the present sample; with velocities and strain rate if `moving`."""


class Stage:
    """Control, damping and durations of one stage of a study.

    Attributes
    ----------
    checks : int or None
        Checks between two checkpoints; None for a stage without checkpoints.
    control : ConstantRate or Servo
        The control that sets the strain rates.
    damping : float
        Local damping.
    limits : SettlingLimits
        Deviations below which the stage has settled.
    check, interval, patience : float
        Times between two checks, between two settings of the strain rates, and after which the
        stage ends in any case, s.
    """

    checks: int | None = CHECKS_PER_CHECKPOINT

    def __init__(self, name: str, study: Study) -> None:
        self.name = name
        self.study = study
        self.damping = study.damping
        self.limits = NEVER
        self.patience = math.inf
        self.control: ConstantRate | Servo
        mixture = study.mixture
        if name == CLOUD_STAGE:
            self.damping = 0.0
            self.control = self._constant_rate(COMPACTION_RATE)
        elif name == STIR:
            self.damping = 0.0
            self.control = self._constant_rate(0.0)
        elif name == APPROACH:
            self.damping = study.agitated_damping
            self.control = self._constant_rate(study.approach_rate)
        elif name == COOL:
            self.control = self._constant_rate(0.0)
            hot_stress = HOT_STRESS * mixture.hardness
            self.patience = COOLING_TIME * inertial_time(hot_stress, mixture.radius, mixture.mean)
        else:
            if name == JAM:
                target = JAMMING_STRESS * mixture.hardness
                self.limits = JAMMED
            else:
                target = read_target_stress(name)
                self.limits = SettlingLimits(SETTLED.stress_error, study.residual)
            self.control = Servo(target, study.inertial_number, mixture.radius, mixture.mean)
            self.patience = study.vibration_duration(PATIENCE, target)
        self.check = study.vibration_duration(CHECK_INTERVAL, self.control.target)
        self.interval = study.vibration_duration(CONTROL_INTERVAL, self.control.target)

    def _constant_rate(self, rate: float) -> ConstantRate:
        """Return a control at a strain rate, 1/s, for glass, scaled to the study's spheres."""
        mixture = self.study.mixture
        return ConstantRate(rate * mixture.tempo, REFERENCE_PRESSURE * mixture.hardness)

    @property
    def is_state(self) -> bool:
        """Whether the state at the end of the stage is written to a file."""
        return self.name[0].isdigit() and " " not in self.name

    def time_step(self) -> float:
        """Return a time step, s, stable at the target and at the present stress."""
        stress = max(self.control.target, STRESS_MARGIN * self.control.stress.mean())
        return self.study.time_step(stress)

    def settled(self, unbalanced: float) -> bool:
        """Return whether stresses and balance are within the limits.

        `unbalanced` is the mean net force divided by the mean contact force. The approach ends when
        the mean stress exceeds the study's `hot_stress`.
        """
        if self.name == APPROACH:
            hot_stress = self.study.hot_stress * self.study.mixture.hardness
            return bool(self.control.stress.mean() > hot_stress)
        return self.control.error() < self.limits.stress_error and unbalanced < self.limits.residual

    def refuse_failure(self, packing: Any) -> None:
        """Raise InputError if the packing cannot continue; called at each check of a stage."""

    def impatient(self, seconds: float) -> bool:
        """Return whether the longest time of the stage is over, to half a check interval."""
        return seconds > self.patience - self.check / 2
