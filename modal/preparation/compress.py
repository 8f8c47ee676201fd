"""The walk of spheres with friction from a cloud to each stress, in modal's own loop.

The same protocol, stages, files and checkpoints as in YADE (`yade_scripts/compress.py`). Each leg
starts from the file that the leg before has written, so that a walk that was killed takes the same
steps as one that was not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from modal.formats.hdf5 import InputError
from modal.packing.sample import Sample, validate, write_sample
from modal.preparation import protocol
from modal.preparation.cloud import cloud
from modal.preparation.dynamics import Dynamics
from modal.preparation.protocol import (
    END,
    ConstantRate,
    Servo,
    Stage,
    Study,
    resumed,
    stages,
    steps_of,
)


class Pace:
    """Steps of a motion whose strain rates are set every so often; `steps` counts them."""

    def __init__(self, motion: Dynamics, control: ConstantRate | Servo) -> None:
        self.motion, self.control = motion, control
        self.steps = self._set_at = 0

    def walk(self, count: int, dt: float, every: int) -> None:
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
    dt = protocol.time_step(protocol.COMPACTION_STRESS, study.fraction, study.smallest)
    pace = Pace(motion, ConstantRate(protocol.COMPACTION_RATE))
    growth = math.log(protocol.LOOSE / protocol.CLOUD) / 3
    steps = int(growth / protocol.COMPACTION_RATE / dt)
    interval = protocol.duration(protocol.CONTROL, protocol.REFERENCE)
    pace.walk(steps, dt, steps_of(interval, dt))
    sample = motion.sample(moving=False)
    cost = {"steps": steps, "seconds": time.perf_counter() - started}
    of_stage = cost | {"contacts": motion.contacts.touching}
    sample.study = study.attributes | {"stage": "approach", "stage_time": 0.0} | cost
    sample.study |= _of("cloud", of_stage)
    return sample


def leg(sample: Sample, study: Study, say: Callable[[str], None]) -> tuple[Sample, bool]:
    """One leg from `sample`; the sample at its end, and whether the stage is over."""
    started, before = time.perf_counter(), dict(sample.study)
    stage, motion = Stage(before["stage"], study), Dynamics(sample)
    stage.control.stress, motion.damping = motion.stress(), stage.damping
    pace, seconds, ended = Pace(motion, stage.control), float(before["stage_time"]), False
    for _ in range(protocol.LEG):
        dt = stage.time_step()
        count = steps_of(stage.check, dt)
        pace.walk(count, dt, steps_of(stage.interval, dt))
        seconds += count * dt
        settled = stage.settled(motion.unbalanced())
        ended = settled or stage.impatient(seconds)
        if ended:
            break
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
    took = time.perf_counter() - started
    of_stage = {"steps": before.get(f"steps_{stage.name}", 0) + pace.steps}
    of_stage["contacts"] = motion.contacts.touching
    of_stage["seconds"] = before.get(f"seconds_{stage.name}", 0.0) + took
    cost = {"steps": before["steps"] + pace.steps, "seconds": before["seconds"] + took}
    after.study = before | reached | cost | _of(stage.name, of_stage)
    say(
        f"friction {study.mu_comp:g}, {stage.name}: {pace.steps} steps, "
        f"stress {stage.control.stress.mean():.4g} Pa, e {reached['void_ratio']:.4f}, "
        f"Z {reached['coordination_number']:.3f}, unbalanced {reached['unbalanced']:.1e}, "
        f"{cost['seconds']:.0f} s"
    )
    return after, ended


def _of(stage: str, cost: dict[str, Any]) -> dict[str, Any]:
    """What a stage has cost, by the names of the format."""
    return {f"{name}_{stage}": value for name, value in cost.items()}


def walk(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """Walk to each stress, Pa; each with its file STRESSPa.sample.h5 in `folder`.

    Goes on from the checkpoint, or from the cloud; states that are there stay. InputError for
    stresses that do not rise, and where the walk is beyond one that it has not written.
    """
    if any(lower >= higher for lower, higher in zip(stresses, stresses[1:], strict=False)):
        raise InputError(
            f"stresses {', '.join(f'{stress:g}' for stress in stresses)} Pa: the walk only loads; "
            "give them in rising order"
        )
    checkpoint = folder / "checkpoint.sample.h5"
    names = stages(tuple(stresses))
    files = {name: folder / f"{name}Pa.sample.h5" for name in names[len(protocol.PREPARATION) :]}
    sample = resumed(checkpoint, files, study)
    if sample is None:
        sample = compacted(study)
        sample.provenance = study.provenance(command).attributes()
        write_sample(checkpoint, sample)
    while sample.study["stage"] != END:
        name = sample.study["stage"]
        sample, ended = leg(sample, study, say)
        sample.provenance = study.provenance(command).attributes()
        if ended:
            if name in files:
                sample.study["stress"] = float(name)
                # What follows brings it to rest; the checkpoint keeps the motion.
                state = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write_sample(files[name], state)
                say(f"{files[name]}: written" + _short_of(sample.study))
            following = [*names, END][names.index(name) + 1]
            sample.study |= {"stage": following, "stage_time": 0.0}
        write_sample(checkpoint, sample)
    return [(float(name), path) for name, path in files.items()]


def _short_of(study: dict[str, Any]) -> str:
    if study["settled"]:
        return ""
    return (
        f", not settled: unbalanced {study['unbalanced']:.1e}, stresses off by "
        f"{study['stress_error']:.1e}"
    )
