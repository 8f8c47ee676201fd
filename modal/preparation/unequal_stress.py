"""Unequal stresses: a packing at rest under one pressure, loaded further along z.

Either the lateral stresses go to a share of the axial one, which stays ("triaxial"), or the walls
approach while nothing moves sideways ("oedometric", one-dimensional compression): the ratio of
lateral to axial stress that then comes about is K0, the earth pressure at rest. Both begin where
`modal.preparation.compress` ends, with the friction of the compression.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from modal.dem.motion import Dynamics
from modal.formats.provenance import STATE, Provenance, Source, is_current
from modal.packing.sample import Sample, read_sample, write_sample
from modal.preparation import protocol
from modal.preparation.compress import Pace
from modal.preparation.durations import steps_of
from modal.preparation.protocol import Study
from modal.preparation.strain_control import Servo
from modal.tools.errors import InputError
from modal.tools.progress import Minute

SLOWNESS = 0.1
"""Largest strain rate, over that of the isotropic compression: an inertial number of 1e-3."""
FAILED = 0.15
"""Strain along any axis from which on a packing that has not reached its stresses flows: dense ones
fail at some per cent, loose ones come near their final strength at 0.1."""
RATIOS = 0.05, 20.0
"""Ratios of lateral to axial stress that are tried at all."""


def check_ratio(ratio: float) -> None:
    """Refuse a ratio of lateral to axial stress that no packing holds."""
    if not RATIOS[0] <= ratio <= RATIOS[1]:
        raise InputError(
            f"stress ratio {ratio:g}: lateral over axial stress, {RATIOS[0]:g} to {RATIOS[1]:g}; "
            "few packings hold less than 0.3"
        )


def load_further(
    folder: Path,
    study: Study,
    isotropic: Sequence[tuple[float, Path]],
    stresses: Sequence[float],
    ratio: float,
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """From isotropic states to each axial stress, Pa: files, kept where they are there already.

    To lateral stresses of `ratio` times the axial one, from the state of that stress; with NaN at
    constant width, from the first state to each stress in turn.
    """
    kind, files = "oedometric" if math.isnan(ratio) else f"K{ratio:g}", list[tuple[float, Path]]()
    starts = dict(isotropic)
    _, before = isotropic[0]
    for stress in stresses:
        before = before if math.isnan(ratio) else starts[stress]
        path = folder / f"{stress:g}Pa_{kind}.sample.h5"
        settings = study.attributes | {"stress": stress, "loading": kind}
        made = Provenance(command, settings, (Source.of(STATE, before),))
        if not (path.exists() and is_current(path, made, say)):
            sample = loaded(read_sample(before), study, stress, (ratio, ratio, 1.0), say)
            write_sample(path, replace(sample, provenance=made.attributes()))
            say(f"{path}: written, lateral over axial stress {sample.study['stress_ratio']:.3f}")
        files.append((stress, path))
        before = path
    return files


def loaded(
    sample: Sample,
    study: Study,
    stress: float,
    shares: Sequence[float],
    say: Callable[[str], None] = lambda text: None,
) -> Sample:
    """The sample at the shares (3,) of `stress`, Pa; NaN is an axis that is not strained.

    Its notes tell `stress_ratio`, the mean lateral over the axial stress, the `strain` (3,) that it
    took, and whether it has `settled`. InputError where the packing flows before.
    """
    started, motion, minute = time.perf_counter(), Dynamics(sample), Minute()
    motion.damping = study.damping
    slow = SLOWNESS * study.inertial_number
    control = Servo(stress, slow, study.sphere[1], study.material, shares)
    pace, start, seconds, settled = Pace(motion, control), motion.contacts.lengths, 0.0, False
    largest = stress * max(1.0, float(np.nanmax(shares)))
    dt = study.time_step(protocol.ABOVE * largest)
    check, every = study.duration(protocol.CHECK, stress), study.duration(protocol.CONTROL, stress)
    patience = study.duration(protocol.PATIENCE, stress) + FAILED / control.limit
    while not settled and seconds < patience:
        count = steps_of(check, dt)
        pace.advance(count, dt, steps_of(every, dt))
        seconds += count * dt
        strain = np.log(start / motion.contacts.lengths)
        near = control.error() < protocol.SETTLED[0]
        settled = near and motion.unbalanced() < study.residual
        if abs(strain).max() > FAILED and not near:
            raise InputError(
                f"the packing fails on its way to {stress:g} Pa along z: at a strain of "
                f"{abs(strain).max():.2f} its lateral over axial stress is "
                f"{_ratio(control.stress):.3f}; take a ratio nearer to 1, or more friction"
            )
        if minute.passed():
            say(f"lateral over axial stress {_ratio(control.stress):.3f}, strain {strain[2]:.4f}")
    found = motion.sample(moving=False)
    reached: dict[str, Any] = {
        "stress": stress,
        "stress_ratio": _ratio(control.stress),
        "strain": strain,
        "unbalanced": motion.unbalanced(),
        "stress_error": control.error(),
        "void_ratio": motion.void_ratio(),
        "coordination_number": motion.coordination_number(),
        "settled": settled,
        "steps": pace.steps,
        "seconds": time.perf_counter() - started,
    }
    reached |= zip(("stress_xx", "stress_yy", "stress_zz"), control.stress, strict=True)
    found.study = sample.study | reached
    return found


def _ratio(stress: np.ndarray) -> float:
    """Mean lateral over axial stress."""
    return float(stress[:2].mean() / stress[2]) if stress[2] > 0 else math.nan
