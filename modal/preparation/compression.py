"""Follow a loading path from a cloud to each stress, in any program, resumable after a kill.

With friction, the spheres move in YADE (`yade_scripts/compress.py`) or in modal's own loop; without
friction, in `modal.preparation.frictionless`. Each run starts from the last checkpoint, so that a
path that was killed takes the same steps as one that was not.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from modal.dem.motion import Dynamics
from modal.formats.attributes import number_noted
from modal.formats.provenance import Provenance
from modal.packing.sample import Sample, read_sample, validate, write_sample
from modal.preparation import protocol
from modal.preparation.cloud import make_cloud
from modal.preparation.durations import count_steps
from modal.preparation.protocol import (
    CHECKPOINT,
    END,
    OLD_CHECKPOINT,
    MovingPacking,
    Stage,
    name_stages,
)
from modal.preparation.study import Study
from modal.tools.display import duration
from modal.tools.errors import InputError
from modal.tools.progress import Minute, progress

AXES = "stress_xx", "stress_yy", "stress_zz"
STAGE_SEPARATOR = "; "
"""Text between the names of stages in a checkpoint's attribute `way`, which lists the stages that
the path has gone through."""


StartMotion = Callable[[Sample, Any], MovingPacking]
"""Function that sets a sample in motion under the control of a stage."""
Say = Callable[[str], None]
"""Function that shows a line of progress."""


class Simulation(NamedTuple):
    """The program that moves the spheres along a path.

    start_motion: function that starts the motion of a sample under a stage. make_stage: function
    that makes a stage from its name and the study.
    """

    start_motion: StartMotion
    make_stage: Callable[[str, Study], Stage] = Stage


class StageProgress(NamedTuple):
    """Time of a stage so far, s; whether the packing has settled; whether the stage is over."""

    seconds: float
    has_settled: bool
    has_ended: bool


def start_dynamics(sample: Sample, stage: Stage) -> Dynamics:
    """Start modal's own motion of a sample, with strain rates from the control of a stage."""
    return Dynamics(sample, stage.damping, control=stage.control.follow)


WITH_FRICTION = Simulation(start_dynamics)
"""Spheres with friction, moved by modal's own loop."""


def compact_cloud(study: Study, start_motion: StartMotion) -> Sample:
    """Return the cloud of a study after compaction to `LOOSE_FRACTION`, at rest."""
    started = time.perf_counter()
    stage = Stage(protocol.CLOUD_STAGE, study)
    packing = start_motion(make_cloud(study), stage)
    dt = study.time_step(protocol.COMPACTION_STRESS * study.mixture.hardness)
    rate = protocol.COMPACTION_RATE * study.mixture.tempo
    strain = math.log(protocol.LOOSE_FRACTION / study.cloud_fraction) / 3
    steps = int(strain / rate / dt)
    parts = min(steps, protocol.CHECKS_PER_CHECKPOINT)
    for part in progress(parts, f"friction {study.mu_comp:g}, cloud"):
        next_steps = (part + 1) * steps // parts - packing.steps
        packing.advance(next_steps, dt, count_steps(stage.interval, dt))
    sample = packing.sample(moving=False)
    sample.study = study.attributes | _describe_cost({}, stage.name, packing, sample, started)
    return sample


def stir(dense: Sample, study: Study, start_motion: StartMotion) -> Sample:
    """Return a packing at rest after its spheres were drawn apart and stirred.

    All lengths grow by the share `dilate` of the study. The spheres get random velocities, with
    which they exert the stress of agitated spheres. They move without friction and damping, so that
    none comes to rest before its neighbours. All contacts of the dense packing are lost.
    """
    started = time.perf_counter()
    stage = Stage(protocol.STIR, study)
    mixture = study.mixture
    stress = study.hot_stress * mixture.hardness
    expansion = 1 + study.dilate
    solid_fraction = 1 / (1 + dense.void_ratio)
    # Hard spheres push by their kinetic energy over the gap, as a share of the diameter.
    speed = math.sqrt(study.dilate * stress / (solid_fraction * mixture.mean.density))
    velocity = np.random.default_rng(study.seed).normal(0.0, speed, dense.position.shape)
    apart = replace(
        dense,
        position=expansion * dense.position,
        side=expansion * dense.side,
        walls=expansion * dense.walls,
        friction=0.0,
        velocity=velocity - velocity.mean(axis=0),
    )
    packing = start_motion(apart, stage)
    dt = study.time_step(protocol.STRESS_MARGIN * stress)
    stirring_time = protocol.STIRRING_TIME * study.dilate * 2 * mixture.radius / speed
    steps = count_steps(stirring_time, dt)
    packing.advance(steps, dt, steps)
    sample = replace(
        packing.sample(moving=True),
        friction=study.mu_comp,
        shear=None,
        rolling=study.rolling,
        twisting=study.twisting,
    )
    sample.study = study.attributes | _describe_cost({}, stage.name, packing, sample, started)
    return sample


def advance_to_checkpoint(
    packing: MovingPacking, stage: Stage, seconds: float, say: Say
) -> StageProgress:
    """Advance a packing to the next checkpoint of its stage, which began `seconds` ago."""
    started = time.perf_counter()
    seconds_before = seconds
    minute = Minute()
    stage.control.stress = packing.stress()
    checks = count() if stage.checks is None else range(stage.checks)
    for _ in checks:
        dt = stage.time_step()
        steps = count_steps(stage.check, dt)
        packing.advance(steps, dt, count_steps(stage.interval, dt))
        seconds += steps * dt
        has_settled = stage.settled(packing.unbalanced())
        has_ended = has_settled or stage.impatient(seconds)
        if has_ended:
            break
        stage.refuse_failure(packing)
        if minute.passed():
            pace = (time.perf_counter() - started) / (seconds - seconds_before)
            say(f"{_describe_state(stage, packing)}; {_describe_rest(stage, seconds, pace)}")
    return StageProgress(seconds, has_settled, has_ended)


def run_to_checkpoint(
    sample: Sample, stage: Stage, start_motion: StartMotion, say: Say
) -> tuple[Sample, bool]:
    """Return the sample at the next checkpoint after `sample`, and whether the stage is over."""
    started = time.perf_counter()
    before = dict(sample.study)
    packing = start_motion(sample, stage)
    seconds_before = number_noted(before, "stage_time") or 0.0
    progress_of_stage = advance_to_checkpoint(packing, stage, seconds_before, say)
    attributes: dict[str, Any] = {
        "stage_time": progress_of_stage.seconds,
        "unbalanced": packing.unbalanced(),
    }
    attributes |= zip(AXES, stage.control.stress, strict=True)
    if stage.is_state:
        attributes["settled"] = progress_of_stage.has_settled
        attributes["stress_error"] = stage.control.error()
    after = packing.sample(moving=stage.checks is not None)
    validate(after, f"friction {stage.study.mu_comp:g}, {stage.name}")
    cost = _describe_cost(before, stage.name, packing, after, started)
    after.study = before | attributes | cost
    say(
        f"{_describe_state(stage, packing)}, e {cost['void_ratio']:.4f}, "
        f"Z {cost['coordination_number']:.3f}, {packing.steps} steps, {cost['seconds']:.0f} s"
    )
    return after, progress_of_stage.has_ended


def _describe_state(stage: Stage, packing: MovingPacking) -> str:
    """Return a line with the stress and the balance of a packing."""
    return (
        f"friction {stage.study.mu_comp:g}, {stage.name}: stress {stage.control.stress.mean():.4g} "
        f"Pa, unbalanced {packing.unbalanced():.1e}"
    )


def _describe_rest(stage: Stage, seconds: float, pace: float) -> str:
    """Return a text on the end condition of a stage, and on its longest remaining time.

    `seconds` of the stage have passed; `pace` is the computing time per simulated time.
    """
    if math.isinf(stage.patience):
        hot_stress = stage.study.hot_stress * stage.study.mixture.hardness
        return f"ends at {hot_stress:.4g} Pa"
    time_left = duration((stage.patience - seconds) * pace)
    limits = stage.limits
    if math.isinf(limits.residual):
        return f"{time_left} left"
    return (
        f"ends at unbalanced {limits.residual:.1e} and stresses off by "
        f"{limits.stress_error:.1e}, at most {time_left} left"
    )


def compress_to_stresses(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    provenance: Provenance,
    simulation: Simulation,
    say: Say,
    dense: Path | None = None,
) -> list[tuple[float, Path]]:
    """Follow the path of a study to each stress, and return the (stress, file) pairs of its states.

    The path continues from the checkpoint in `folder`. Without one it begins at the cloud, or at a
    `dense` packing, which is dilated. Existing files of states are kept.

    Parameters
    ----------
    folder : Path
        Folder of the checkpoint and of the states, STRESSPa.sample.h5.
    study : Study
        Parameters of the path.
    stresses : sequence of float
        Stresses, Pa, in rising order if there is friction.
    provenance : Provenance
        Command and study, written into each file.
    simulation : Simulation
        How the spheres move: with or without friction, in modal or in YADE.
    say : callable
        Function that shows a line of progress.
    dense : Path, optional
        Sample of a packing without friction.

    Raises
    ------
    InputError
        If stresses are repeated or, with friction, do not rise; if the checkpoint or a state
        belongs to another study or command (YADE and modal do not take the same steps); or if the
        checkpoint has gone through other stages.
    """
    if study.mu_comp and any(lower >= higher for lower, higher in pairwise(stresses)):
        raise InputError(
            "stress_order",
            f"stresses {_list_stresses(stresses)} Pa",
            "a compression only loads",
            "give them in rising order",
        )
    stages = name_stages(study, stresses)
    if len(set(stages)) < len(stages):
        raise InputError(
            "repeated_stress",
            f"stresses {_list_stresses(stresses)} Pa",
            "one comes twice",
            "give each once",
        )
    files = {f"{stress:g}": folder / f"{stress:g}Pa.sample.h5" for stress in stresses}

    def write(path: Path, sample: Sample) -> None:
        write_sample(path, replace(sample, provenance=provenance.attributes()))

    def write_checkpoint(sample: Sample) -> None:
        attributes = sample.study | {"way": STAGE_SEPARATOR.join(passed_stages)}
        write(folder / CHECKPOINT, replace(sample, study=attributes))
        (folder / OLD_CHECKPOINT).unlink(missing_ok=True)

    checkpoint = folder / CHECKPOINT
    if not checkpoint.exists():
        checkpoint = folder / OLD_CHECKPOINT
    if checkpoint.exists():
        sample = _read_sample_of_study(checkpoint, study, provenance.command)
        for path in files.values():
            if path.exists():
                _read_sample_of_study(path, study, provenance.command)
        passed_stages = _resume(checkpoint, sample, stages)
    else:
        if dense:
            sample = stir(read_sample(dense), study, simulation.start_motion)
        elif study.mu_comp:
            sample = compact_cloud(study, simulation.start_motion)
        else:
            sample = make_cloud(study)
        passed_stages = stages[:1]
        sample.study = study.attributes | sample.study | {"stage": stages[0], "stage_time": 0.0}
        write_checkpoint(sample)
    while (name := sample.study["stage"]) != END:
        if name not in passed_stages:
            passed_stages.append(name)
        stage = simulation.make_stage(name, study)
        sample, has_ended = run_to_checkpoint(sample, stage, simulation.start_motion, say)
        if has_ended:
            if name in files:
                sample.study["stress"] = float(name)
                # What follows brings it to rest; the checkpoint keeps the motion.
                still = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write(files[name], still)
                say(f"{files[name]}: written{_describe_shortfall(sample.study)}")
            following = [*stages, END][stages.index(name) + 1]
            sample.study |= {"stage": following, "stage_time": 0.0}
        write_checkpoint(sample)
    return list(zip(stresses, files.values(), strict=True))


def _describe_shortfall(attributes: dict[str, Any]) -> str:
    """Return how far a state is from its limits, or an empty text for a settled state."""
    if attributes["settled"]:
        return ""
    return (
        f", not settled: unbalanced {attributes['unbalanced']:.1e}, stresses off by "
        f"{attributes['stress_error']:.1e}"
    )


def _list_stresses(stresses: Sequence[float]) -> str:
    """Return stresses, Pa, as a text."""
    return ", ".join(f"{stress:g}" for stress in stresses)


def _describe_cost(
    before: dict[str, Any], stage: str, packing: MovingPacking, sample: Sample, started: float
) -> dict[str, Any]:
    """Return attributes of the present packing, and steps and seconds of stage and path so far.

    `before` are the attributes at the start of the run, `started` its time on the clock, s.
    """
    contacts = sample.contacts()
    with_wall = int((contacts.particle_j < 0).sum())
    ends = 2 * len(contacts.overlap) - with_wall
    attributes: dict[str, Any] = {
        f"contacts_{stage}": len(contacts.overlap),
        "coordination_number": ends / sample.grains,
        "void_ratio": sample.void_ratio,
    }
    costs = {"steps": packing.steps, "seconds": time.perf_counter() - started}
    for name, cost in costs.items():
        for key in (f"{name}_{stage}", name):
            attributes[key] = cost
            if number_noted(before, key) is not None:
                attributes[key] = cost + before[key]
    return attributes


def _resume(checkpoint: Path, sample: Sample, stages: list[str]) -> list[str]:
    """Start the stage at which a checkpoint continues, and return the stages before this one.

    Further stresses may be added to a path at any time. Raises InputError if the stages of the
    checkpoint, finished or begun, are not those of `stages`.
    """
    stage = sample.study.get("stage")
    passed = str(sample.study.pop("way", "")).split(STAGE_SEPARATOR)
    if not isinstance(stage, str):
        raise InputError(
            "incomplete",
            f"{checkpoint}",
            "it does not say at which stage it is",
            "move it away, and begin anew",
        )
    known = [name for name in stages if name in passed]
    ahead = stages[len(known) :]
    is_prefix = known == stages[: len(known)]
    is_in_order = known == [name for name in passed if name in known]
    goes_on = bool(ahead) or stage in passed
    is_elsewhere = goes_on and passed[-1] not in known
    if not (is_prefix and is_in_order) or is_elsewhere:
        raise InputError(
            "other_path",
            f"{checkpoint}",
            f"it has gone by way of {STAGE_SEPARATOR.join(passed)} (Pa)",
            "give stresses that go on from there, or take another folder",
        )
    if stage not in passed:
        sample.study["stage"] = ahead[0] if ahead else END
    return passed


def _read_sample_of_study(path: Path, study: Study, command: str) -> Sample:
    """Read a state of this path; raise InputError for another study or command."""
    sample = read_sample(path)
    study.refuse_other(sample.study, path)
    maker = sample.provenance.get("command", command)
    if maker != command:
        raise InputError(
            "other_command",
            f"{path}",
            f"made by {maker}, not by {command}",
            "go on with that, or take another folder",
        )
    return sample
