"""A compression from its cloud to each stress, whoever makes the steps; killed, it goes on.

One definition for YADE (`yade_scripts/compress.py`) and for modal's own loop. Each run starts from
the checkpoint that the one before has written, so that a compression that was killed takes the same
steps as one that was not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from modal.formats.provenance import Provenance
from modal.packing.sample import Sample, read_sample, validate, write_sample
from modal.preparation import protocol
from modal.preparation.cloud import cloud
from modal.preparation.durations import REFERENCE, steps_of
from modal.preparation.protocol import CHECKPOINT, END, PREPARATION, Stage, Study
from modal.preparation.strain_control import ConstantRate, Servo
from modal.tools.arrays import Floats
from modal.tools.display import duration
from modal.tools.errors import InputError
from modal.tools.progress import Minute, progress

AXES = "stress_xx", "stress_yy", "stress_zz"


class Packing(Protocol):
    """Spheres in motion under a control of their strain rates."""

    steps: int

    def advance(self, count: int, dt: float, every: int) -> None:
        """`count` steps of `dt`, s, with the rates set `every` so many of them."""

    def stress(self) -> Floats:
        """Principal stresses (3,), Pa, compression positive."""

    def unbalanced(self) -> float:
        """Mean residual force on a sphere over the mean contact force."""

    def void_ratio(self) -> float:
        """Volume of voids over volume of spheres, wall to wall."""

    def coordination_number(self) -> float:
        """Mean number of contacts of a sphere, walls included."""

    def contact_count(self) -> int:
        """Contacts that there are."""

    def sample(self, *, moving: bool) -> Sample:
        """The sample as it is now; with its velocities and strain rate if it is `moving`."""


Begin = Callable[[Sample, ConstantRate | Servo, float], Packing]
"""Sets a sample in motion under a control, with a local damping."""
Say = Callable[[str], None]


def compacted(study: Study, begin: Begin) -> Sample:
    """The cloud compacted to LOOSE and put to rest."""
    started = time.perf_counter()
    rate = protocol.COMPACTION_RATE * study.mixture.tempo
    packing = begin(cloud(study), ConstantRate(rate), 0.0)
    dt = study.time_step(protocol.COMPACTION_STRESS * study.mixture.hardness)
    steps = int(math.log(protocol.LOOSE / protocol.CLOUD) / 3 / rate / dt)
    every = steps_of(study.duration(protocol.CONTROL, REFERENCE * study.mixture.hardness), dt)
    parts = min(steps, protocol.CHECKS)
    for part in progress(parts, f"friction {study.mu_comp:g}, cloud"):
        packing.advance((part + 1) * steps // parts - packing.steps, dt, every)
    sample = packing.sample(moving=False)
    sample.study = study.attributes | {"stage": "approach", "stage_time": 0.0}
    sample.study |= _cost({}, "cloud", packing, started)
    return sample


def reach(
    packing: Packing, stage: Stage, seconds: float, checks: int | None, say: Say
) -> tuple[float, bool, bool]:
    """The time of the stage, s, after so many `checks`, or all; whether it has settled; is over.

    `seconds` of it have gone already.
    """
    started, begun, minute = time.perf_counter(), seconds, Minute()
    stage.control.stress = packing.stress()
    for _ in count() if checks is None else range(checks):
        dt = stage.time_step()
        steps = steps_of(stage.check, dt)
        packing.advance(steps, dt, steps_of(stage.interval, dt))
        seconds += steps * dt
        settled = stage.settled(packing.unbalanced())
        ended = settled or stage.impatient(seconds)
        if ended:
            break
        stage.look(packing)
        if minute.passed():
            pace = (time.perf_counter() - started) / (seconds - begun)
            say(f"{_at(stage, packing)}; {_to_go(stage, seconds, pace)}")
    return seconds, settled, ended


def reached(packing: Packing, stage: Stage, settled: bool) -> dict[str, Any]:
    """What a stage has come to, by the names of the format."""
    found: dict[str, Any] = {
        "unbalanced": packing.unbalanced(),
        "void_ratio": packing.void_ratio(),
        "coordination_number": packing.coordination_number(),
    }
    found |= zip(AXES, stage.control.stress, strict=True)
    if stage.is_state:
        found |= {"settled": settled, "stress_error": stage.control.error()}
    return found


def run_to_checkpoint(sample: Sample, study: Study, begin: Begin, say: Say) -> tuple[Sample, bool]:
    """The sample at the next checkpoint after `sample`, and whether the stage is over."""
    started, before = time.perf_counter(), dict(sample.study)
    stage = Stage(before["stage"], study)
    packing = begin(sample, stage.control, stage.damping)
    so_far = float(before["stage_time"])
    seconds, settled, ended = reach(packing, stage, so_far, protocol.CHECKS, say)
    found = {"stage_time": seconds} | reached(packing, stage, settled)
    after = packing.sample(moving=True)
    validate(after, f"friction {study.mu_comp:g}, {stage.name}")
    after.study = before | found | _cost(before, stage.name, packing, started)
    say(f"{_at(stage, packing)}, {packing.steps} steps, {after.study['seconds']:.0f} s")
    return after, ended


def _at(stage: Stage, packing: Packing) -> str:
    return (
        f"friction {stage.study.mu_comp:g}, {stage.name}: stress {stage.control.stress.mean():.4g} "
        f"Pa, e {packing.void_ratio():.4f}, Z {packing.coordination_number():.3f}, "
        f"unbalanced {packing.unbalanced():.1e}"
    )


def _to_go(stage: Stage, seconds: float, pace: float) -> str:
    """Where the stage ends, `seconds` after its start at `pace`, seconds of ours for one of it."""
    if math.isinf(stage.patience):
        return f"ends at {stage.study.hot_stress * stage.study.mixture.hardness:.4g} Pa"
    most = duration((stage.patience - seconds) * pace)
    error, residual = stage.limits
    if math.isinf(residual):
        return f"{most} left"
    return f"ends at unbalanced {residual:.1e} and stresses off by {error:.1e}, at most {most} left"


def compress_to_stresses(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    made: Provenance,
    begin: Begin,
    say: Say,
) -> list[tuple[float, Path]]:
    """Compress to each stress, Pa; each with its file STRESSPa.sample.h5 in `folder`.

    Goes on from the checkpoint, or from the cloud; states that are there stay. InputError for
    stresses that do not rise, and where it is beyond one that it has not written.
    """
    if any(lower >= higher for lower, higher in zip(stresses, stresses[1:], strict=False)):
        raise InputError(
            f"stresses {', '.join(f'{stress:g}' for stress in stresses)} Pa: a compression only "
            "loads; give them in rising order"
        )
    checkpoint = folder / CHECKPOINT
    files = {f"{stress:g}": folder / f"{stress:g}Pa.sample.h5" for stress in stresses}
    stages = [*PREPARATION, *files, END]

    def write(path: Path, sample: Sample) -> None:
        write_sample(path, replace(sample, provenance=made.attributes()))

    sample = resumed(checkpoint, files, study, made.command)
    if sample is None:
        sample = compacted(study, begin)
        write(checkpoint, sample)
    while (name := sample.study["stage"]) != END:
        sample, ended = run_to_checkpoint(sample, study, begin, say)
        if ended:
            if name in files:
                sample.study["stress"] = float(name)
                # What follows brings it to rest; the checkpoint keeps the motion.
                still = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write(files[name], still)
                say(f"{files[name]}: written" + _short_of(sample.study))
            sample.study |= {"stage": stages[stages.index(name) + 1], "stage_time": 0.0}
        write(checkpoint, sample)
    return [(float(name), path) for name, path in files.items()]


def _cost(before: dict[str, Any], stage: str, packing: Packing, started: float) -> dict[str, Any]:
    """What a stage and the compression have cost so far, by the names of the format.

    `before` are the attributes at the start of the run, which began when the clock said `started`.
    """
    found: dict[str, Any] = {f"contacts_{stage}": packing.contact_count()}
    spent = {"steps": packing.steps, "seconds": time.perf_counter() - started}
    for name, value in spent.items():
        for key in (f"{name}_{stage}", name):
            found[key] = value + before.get(key, 0)
    return found


def _short_of(study: dict[str, Any]) -> str:
    if study["settled"]:
        return ""
    return (
        f", not settled: unbalanced {study['unbalanced']:.1e}, stresses off by "
        f"{study['stress_error']:.1e}"
    )


def resumed(checkpoint: Path, files: dict[str, Path], study: Study, command: str) -> Sample | None:
    """The state that it goes on from, its stage in `study`; None where it is to begin.

    `files` are those of the stresses by their names. A compression that was at its end, or on its
    way to a stress, may be given higher ones later. InputError where the checkpoint or one of the
    files is of another study or was made by another `command` (one program's steps are not the
    other's), where it is beyond a stress that it has not written, or heads elsewhere.
    """
    if not checkpoint.exists():
        return None
    there = (checkpoint, *filter(Path.exists, files.values()))
    sample, *_ = [_of_study(path, study, command) for path in there]
    stage, done = sample.study["stage"], float(sample.study.get("stress", -math.inf))
    for name, path in files.items():
        if float(name) <= done and not path.exists():
            raise InputError(
                f"{checkpoint}: {name} Pa lies below its present stress of {done:g} Pa; take "
                "another folder"
            )
    ahead = [name for name in files if float(name) > done]
    if stage not in (*PREPARATION, END, *ahead[:1]):
        raise InputError(
            f"{checkpoint}: the compression is on its way to {stage} Pa; make this the next stress "
            "that it has not reached, or take another folder"
        )
    if stage == END and ahead:
        sample.study["stage"] = ahead[0]
    return sample


def _of_study(path: Path, study: Study, command: str) -> Sample:
    """A state of this compression; InputError for one of another."""
    sample = read_sample(path)
    study.refuse_other(sample.study, path)
    by = sample.provenance.get("command", command)
    if by != command:
        raise InputError(
            f"{path}: made by {by}, not by {command}; go on with that, or take another folder"
        )
    return sample
