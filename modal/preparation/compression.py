"""A loading path from its cloud to each stress, whoever makes the steps; killed, it goes on.

One definition with friction, for YADE (`yade_scripts/compress.py`) and for modal's own loop, and
without (`modal.preparation.frictionless`). Each run starts from the checkpoint that the one before
has written, so that a path that was killed takes the same steps as one that was not.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from modal.dem.motion import Dynamics
from modal.formats.attributes import number_noted
from modal.formats.provenance import Provenance
from modal.packing.sample import Sample, read_sample, validate, void_ratio, write_sample
from modal.preparation import protocol
from modal.preparation.cloud import cloud
from modal.preparation.durations import steps_of
from modal.preparation.protocol import CHECKPOINT, END, OLD_CHECKPOINT, Stage, Study, stages_of
from modal.tools.arrays import Floats
from modal.tools.display import duration
from modal.tools.errors import InputError
from modal.tools.progress import Minute, progress

AXES = "stress_xx", "stress_yy", "stress_zz"
WAY = "; "
"""Between the stages that a checkpoint names as its way."""


class Packing(Protocol):
    """Spheres in motion under a stage's control."""

    steps: int

    def advance(self, count: int, dt: float, every: int) -> None:
        """`count` steps of `dt`, s, with the rates set `every` so many of them."""

    def stress(self) -> Floats:
        """Principal stresses (3,), Pa, compression positive."""

    def unbalanced(self) -> float:
        """Mean residual force on a sphere over the mean contact force."""

    def sample(self, *, moving: bool) -> Sample:
        """The sample as it is now; with its velocities and strain rate if it is `moving`."""


Begin = Callable[[Sample, Any], Packing]
"""Sets a sample in motion under a stage."""
Say = Callable[[str], None]


def in_motion(sample: Sample, stage: Stage) -> Dynamics:
    """A sample in modal's own motion, whose strain rates a stage's control sets."""
    return Dynamics(sample, stage.damping, control=stage.control.follow)


def compacted(study: Study, begin: Begin) -> Sample:
    """The cloud compacted to LOOSE and put to rest."""
    started, stage = time.perf_counter(), Stage(protocol.CLOUD_STAGE, study)
    packing = begin(cloud(study), stage)
    dt = study.time_step(protocol.COMPACTION_STRESS * study.mixture.hardness)
    rate = protocol.COMPACTION_RATE * study.mixture.tempo
    steps = int(math.log(protocol.LOOSE / protocol.CLOUD) / 3 / rate / dt)
    parts = min(steps, protocol.CHECKS)
    for part in progress(parts, f"friction {study.mu_comp:g}, cloud"):
        more = (part + 1) * steps // parts - packing.steps
        packing.advance(more, dt, steps_of(stage.interval, dt))
    sample = packing.sample(moving=False)
    sample.study = study.attributes | _cost({}, stage.name, packing, sample, started)
    return sample


def stirred(dense: Sample, study: Study, begin: Begin) -> Sample:
    """A packing at rest, its spheres drawn apart and stirred: all contacts it had are forgotten.

    At random velocities, with which they push the cell by the stress of agitated ones, and without
    friction or damping, that none of them comes to rest before its neighbours.
    """
    started, stage, mixture = time.perf_counter(), Stage(protocol.STIR, study), study.mixture
    stress, grown = study.hot_stress * mixture.hardness, 1 + study.dilate
    solid = 1 / (1 + void_ratio(len(dense.position), dense.sizes, dense.side, dense.length))
    # Hard spheres push by their kinetic energy over the gap, as a share of the diameter.
    speed = math.sqrt(study.dilate * stress / (solid * mixture.mean.density))
    velocity = np.random.default_rng(study.seed).normal(0.0, speed, dense.position.shape)
    apart = replace(
        dense,
        position=grown * dense.position,
        side=grown * dense.side,
        walls=grown * dense.walls,
        friction=0.0,
        velocity=velocity - velocity.mean(axis=0),
    )
    packing, dt = begin(apart, stage), study.time_step(protocol.ABOVE * stress)
    steps = steps_of(protocol.STIRRED * study.dilate * 2 * mixture.radius / speed, dt)
    packing.advance(steps, dt, steps)
    sample = replace(packing.sample(moving=True), friction=study.mu_comp, shear=None)
    sample.study = study.attributes | _cost({}, stage.name, packing, sample, started)
    return sample


def reach(packing: Packing, stage: Stage, seconds: float, say: Say) -> tuple[float, bool, bool]:
    """The time of the stage, s, at its next checkpoint; whether it has settled; is over.

    `seconds` of it have gone already.
    """
    started, begun, minute = time.perf_counter(), seconds, Minute()
    stage.control.stress = packing.stress()
    for _ in count() if stage.checks is None else range(stage.checks):
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


def run_to_checkpoint(sample: Sample, stage: Stage, begin: Begin, say: Say) -> tuple[Sample, bool]:
    """The sample at the next checkpoint after `sample`, and whether the stage is over."""
    started, before = time.perf_counter(), dict(sample.study)
    packing = begin(sample, stage)
    seconds, settled, ended = reach(packing, stage, number_noted(before, "stage_time") or 0.0, say)
    found: dict[str, Any] = {"stage_time": seconds, "unbalanced": packing.unbalanced()}
    found |= zip(AXES, stage.control.stress, strict=True)
    if stage.is_state:
        found |= {"settled": settled, "stress_error": stage.control.error()}
    after = packing.sample(moving=stage.checks is not None)
    validate(after, f"friction {stage.study.mu_comp:g}, {stage.name}")
    cost = _cost(before, stage.name, packing, after, started)
    after.study = before | found | cost
    say(
        f"{_at(stage, packing)}, e {cost['void_ratio']:.4f}, Z {cost['coordination_number']:.3f}, "
        f"{packing.steps} steps, {cost['seconds']:.0f} s"
    )
    return after, ended


def _at(stage: Stage, packing: Packing) -> str:
    return (
        f"friction {stage.study.mu_comp:g}, {stage.name}: stress {stage.control.stress.mean():.4g} "
        f"Pa, unbalanced {packing.unbalanced():.1e}"
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
    stage_of: Callable[[str, Study], Stage] = Stage,
    dense: Path | None = None,
) -> list[tuple[float, Path]]:
    """Follow the path to each stress, Pa; each with its file STRESSPa.sample.h5 in `folder`.

    Goes on from the checkpoint, or from the cloud, or from a `dense` packing to dilate; states that
    are there stay. InputError for a stress that comes twice or, with friction, does not rise, and
    where the checkpoint or one of the files is of another study or was made by another command (one
    program's steps are not the other's), or the checkpoint has gone another way.
    """
    if any(lower >= higher for lower, higher in pairwise(stresses)) and study.mu_comp:
        raise InputError(
            "input",
            f"stresses {_listed(stresses)} Pa",
            "a compression only loads",
            "give them in rising order",
        )
    stages, checkpoint = stages_of(study, stresses), folder / CHECKPOINT
    if len(set(stages)) < len(stages):
        raise InputError(
            "input", f"stresses {_listed(stresses)} Pa", "one comes twice", "give each once"
        )
    files = {f"{stress:g}": folder / f"{stress:g}Pa.sample.h5" for stress in stresses}

    def write(path: Path, sample: Sample) -> None:
        write_sample(path, replace(sample, provenance=made.attributes()))

    def keep(sample: Sample) -> None:
        write(folder / CHECKPOINT, replace(sample, study=sample.study | {"way": WAY.join(way)}))
        (folder / OLD_CHECKPOINT).unlink(missing_ok=True)

    if not checkpoint.exists():
        checkpoint = folder / OLD_CHECKPOINT
    if checkpoint.exists():
        there = (checkpoint, *filter(Path.exists, files.values()))
        sample, *_ = [_of_study(path, study, made.command) for path in there]
        way = _way_so_far(checkpoint, sample, stages)
    else:
        if dense:
            sample = stirred(read_sample(dense), study, begin)
        else:
            sample = compacted(study, begin) if study.mu_comp else cloud(study)
        way = stages[:1]
        sample.study = study.attributes | sample.study | {"stage": stages[0], "stage_time": 0.0}
        keep(sample)
    while (name := sample.study["stage"]) != END:
        way += [name] * (name not in way)
        sample, ended = run_to_checkpoint(sample, stage_of(name, study), begin, say)
        if ended:
            if name in files:
                sample.study["stress"] = float(name)
                # What follows brings it to rest; the checkpoint keeps the motion.
                still = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write(files[name], still)
                found = "unbalanced {unbalanced:.1e}, stresses off by {stress_error:.1e}"
                short = "" if sample.study["settled"] else f", not settled: {found}"
                say(f"{files[name]}: written{short.format(**sample.study)}")
            after = [*stages, END][stages.index(name) + 1]
            sample.study |= {"stage": after, "stage_time": 0.0}
        keep(sample)
    return list(zip(stresses, files.values(), strict=True))


def _listed(stresses: Sequence[float]) -> str:
    return ", ".join(f"{stress:g}" for stress in stresses)


def _cost(
    before: dict[str, Any], stage: str, packing: Packing, sample: Sample, started: float
) -> dict[str, Any]:
    """What a stage and the path have come to and cost so far, by the names of the format.

    `before` are the attributes at the start of the run, which began when the clock said `started`.
    """
    contact, n = sample.contacts(), len(sample.position)
    ends = 2 * len(contact.overlap) - int((contact.particle_j < 0).sum())
    found: dict[str, Any] = {
        f"contacts_{stage}": len(contact.overlap),
        "coordination_number": ends / n,
        "void_ratio": void_ratio(n, sample.sizes, sample.side, sample.length),
    }
    spent = {"steps": packing.steps, "seconds": time.perf_counter() - started}
    for name, value in spent.items():
        for key in (f"{name}_{stage}", name):
            known = number_noted(before, key) is not None
            found[key] = value + (before[key] if known else 0)
    return found


def _way_so_far(checkpoint: Path, sample: Sample, stages: list[str]) -> list[str]:
    """The stages that a checkpoint has gone through; its `study` then says where it goes on.

    A path that was at its end, or on its way to a stress, may be given further ones later.
    InputError where it has come another way than the `stages`, or is on its way elsewhere.
    """
    stage, way = sample.study.get("stage"), str(sample.study.pop("way", "")).split(WAY)
    if not isinstance(stage, str):
        raise InputError(
            "incomplete",
            f"{checkpoint}: it does not say at which stage it is",
            remedy="move it away, and begin anew",
        )
    known = [name for name in stages if name in way]
    ahead = stages[len(known) :]
    straight = known == stages[: len(known)] == [name for name in way if name in known]
    if not straight or ((ahead or stage in way) and way[-1] not in known):
        raise InputError(
            "input",
            f"{checkpoint}: it has gone by way of {WAY.join(way)} (Pa)",
            remedy=("give stresses that go on from there, or take another folder"),
        )
    if stage not in way:
        sample.study["stage"] = ahead[0] if ahead else END
    return way


def _of_study(path: Path, study: Study, command: str) -> Sample:
    """A state of this path; InputError for one of another."""
    sample = read_sample(path)
    study.refuse_other(sample.study, path)
    by = sample.provenance.get("command", command)
    if by != command:
        raise InputError(
            "input",
            f"{path}: made by {by}, not by {command}",
            remedy="go on with that, or take another folder",
        )
    return sample
