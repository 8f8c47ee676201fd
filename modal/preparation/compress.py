"""The compression of spheres with friction from a cloud to each stress, in modal's own loop.

The same protocol, stages, files and checkpoints as in YADE (`yade_scripts/compress.py`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from modal.dem.motion import Dynamics
from modal.packing.sample import Sample, validate
from modal.preparation import protocol
from modal.preparation.cloud import cloud
from modal.preparation.compression import compress_to_stresses, cost
from modal.preparation.durations import REFERENCE, steps_of
from modal.preparation.protocol import Stage, Study
from modal.preparation.strain_control import ConstantRate, Servo
from modal.tools.display import duration
from modal.tools.progress import Minute, progress


class Pace:
    """Steps of a motion whose strain rates are set every so often; `steps` counts them."""

    def __init__(self, motion: Dynamics, control: ConstantRate | Servo) -> None:
        self.motion, self.control = motion, control
        self.steps = self._set_at = 0

    def advance(self, count: int, dt: float, every: int) -> None:
        """`count` steps of `dt`, s, with the rates set `every` so many of them."""
        for _ in range(count):
            due = self.steps - self._set_at >= every
            self.motion.step(dt, self.control.follow if due else None)
            if due:
                self._set_at = self.steps
            self.steps += 1


def compacted(study: Study) -> Sample:
    """The cloud compacted to LOOSE and put to rest."""
    started = time.perf_counter()
    motion = Dynamics(cloud(study))
    dt, rate = (
        study.time_step(protocol.COMPACTION_STRESS * study.hardness),
        protocol.COMPACTION_RATE * study.tempo,
    )
    pace = Pace(motion, ConstantRate(rate))
    growth = math.log(protocol.LOOSE / protocol.CLOUD) / 3
    steps = int(growth / rate / dt)
    interval = study.duration(protocol.CONTROL, REFERENCE * study.hardness)
    every = steps_of(interval, dt)
    for _ in progress(steps, f"friction {study.mu_comp:g}, cloud"):
        pace.advance(1, dt, every)
    sample = motion.sample(moving=False)
    spent = {"steps": steps, "seconds": time.perf_counter() - started}
    sample.study = study.attributes | {"stage": "approach", "stage_time": 0.0}
    sample.study |= cost({}, "cloud", **spent, contacts=motion.contacts.touching)
    return sample


def run_to_checkpoint(
    sample: Sample, study: Study, say: Callable[[str], None]
) -> tuple[Sample, bool]:
    """The sample at the next checkpoint after `sample`, and whether the stage is over."""
    started, before = time.perf_counter(), dict(sample.study)
    stage, motion = Stage(before["stage"], study), Dynamics(sample)
    stage.control.stress, motion.damping = motion.stress(), stage.damping
    pace, seconds, ended = Pace(motion, stage.control), float(before["stage_time"]), False
    begun, minute = seconds, Minute()
    for _ in range(protocol.CHECKS):
        dt = stage.time_step()
        count = steps_of(stage.check, dt)
        pace.advance(count, dt, steps_of(stage.interval, dt))
        seconds += count * dt
        settled = stage.settled(motion.unbalanced())
        ended = settled or stage.impatient(seconds)
        if ended:
            break
        if minute.passed():
            pace_of_stage = (time.perf_counter() - started) / (seconds - begun)
            say(f"{_at(study, stage, motion)}; {_to_go(stage, seconds, pace_of_stage)}")
    reached: dict[str, Any] = {
        "stage_time": seconds,
        "unbalanced": motion.unbalanced(),
        "void_ratio": motion.void_ratio(),
        "coordination_number": motion.coordination_number(),
    }
    reached |= zip(("stress_xx", "stress_yy", "stress_zz"), stage.control.stress, strict=True)
    if stage.is_state:
        reached |= {"settled": settled, "stress_error": stage.control.error()}
    after = motion.sample(moving=True)
    validate(after, f"friction {study.mu_comp:g}, {stage.name}")
    spent = {"steps": pace.steps, "seconds": time.perf_counter() - started}
    so_far = cost(before, stage.name, **spent, contacts=motion.contacts.touching)
    after.study = before | reached | so_far
    say(f"{_at(study, stage, motion)}, {pace.steps} steps, {so_far['seconds']:.0f} s")
    return after, ended


def _at(study: Study, stage: Stage, motion: Dynamics) -> str:
    return (
        f"friction {study.mu_comp:g}, {stage.name}: stress {stage.control.stress.mean():.4g} Pa, "
        f"e {motion.void_ratio():.4f}, Z {motion.coordination_number():.3f}, "
        f"unbalanced {motion.unbalanced():.1e}"
    )


def _to_go(stage: Stage, seconds: float, pace: float) -> str:
    """Where the stage ends, `seconds` after its start at `pace`, seconds of ours for one of it."""
    if math.isinf(stage.patience):
        return f"ends at {stage.study.hot_stress * stage.study.hardness:.4g} Pa"
    most = duration((stage.patience - seconds) * pace)
    error, residual = stage.limits
    if math.isinf(residual):
        return f"{most} left"
    return f"ends at unbalanced {residual:.1e} and stresses off by {error:.1e}, at most {most} left"


def compress(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """Compress to each stress, Pa, in modal's own motion, as `compress_to_stresses` says.

    Stresses on the way, so that no two are more than ten times apart, have their states as well.
    """
    way = [protocol.JAMMING_STRESS * study.hardness]
    for stress in stresses:
        way += protocol.by_tens(way[-1], stress)
    files = compress_to_stresses(
        folder,
        study,
        way[1:],
        study.provenance(command),
        lambda: compacted(study),
        lambda sample: run_to_checkpoint(sample, study, say),
        say,
    )
    return [(stress, path) for stress, path in files if stress in stresses]
