"""A compression from its cloud to each stress, whoever makes the steps; killed, it goes on.

One definition for YADE (`yade_scripts/compress.py`) and for modal's own loop. Each run starts from
the checkpoint that the one before has written, so that a compression that was killed takes the same
steps as one that was not.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from modal.formats.provenance import Provenance
from modal.packing.sample import Sample, read_sample, write_sample
from modal.preparation.protocol import CHECKPOINT, END, PREPARATION, Study
from modal.tools.errors import InputError


def compress_to_stresses(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    made: Provenance,
    begin: Callable[[], Sample],
    run: Callable[[Sample], tuple[Sample, bool]],
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """Compress to each stress, Pa; each with its file STRESSPa.sample.h5 in `folder`.

    Goes on from the checkpoint, or from what `begin` gives; states that are there stay. `run` takes
    the steps between two checkpoints and says whether the stage is over. InputError for stresses
    that do not rise, and where it is beyond one that it has not written.
    """
    if any(lower >= higher for lower, higher in zip(stresses, stresses[1:], strict=False)):
        raise InputError(
            f"stresses {', '.join(f'{stress:g}' for stress in stresses)} Pa: a compression only "
            "loads; give them in rising order"
        )
    checkpoint = folder / CHECKPOINT
    names = [f"{stress:g}" for stress in stresses]
    stages = [*PREPARATION, *names, END]
    files = {name: folder / f"{name}Pa.sample.h5" for name in names}

    def write(path: Path, sample: Sample) -> None:
        write_sample(path, replace(sample, provenance=made.attributes()))

    sample = resumed(checkpoint, files, study, made.command)
    if sample is None:
        sample = begin()
        write(checkpoint, sample)
    while sample.study["stage"] != END:
        name = sample.study["stage"]
        sample, ended = run(sample)
        if ended:
            if name in files:
                sample.study["stress"] = float(name)
                # What follows brings it to rest; the checkpoint keeps the motion.
                still = replace(sample, velocity=None, angular_velocity=None, strain_rate=None)
                write(files[name], still)
                say(f"{files[name]}: written" + _short_of(sample.study))
            following = stages[stages.index(name) + 1]
            sample.study |= {"stage": following, "stage_time": 0.0}
        write(checkpoint, sample)
    return [(float(name), path) for name, path in files.items()]


def cost(before: dict[str, Any], stage: str, **spent: float) -> dict[str, Any]:
    """What a stage and the compression have cost so far, by the names of the format.

    `before` are the attributes at the start of the run; `spent` its steps and seconds, which add
    up, and its contacts, which do not.
    """
    found: dict[str, Any] = {}
    for name, value in spent.items():
        adds_up = name != "contacts"
        found[f"{name}_{stage}"] = value + (before.get(f"{name}_{stage}", 0) if adds_up else 0)
        if adds_up:
            found[name] = value + before.get(name, 0)
    return found


def _short_of(study: dict[str, Any]) -> str:
    if study["settled"]:
        return ""
    return (
        f", not settled: unbalanced {study['unbalanced']:.1e}, stresses off by "
        f"{study['stress_error']:.1e}"
    )


def goes_on(study: dict[str, Any], files: dict[str, Path], checkpoint: Path) -> str:
    """The stage that it goes on with; InputError if it has passed a stress, or heads elsewhere.

    A compression that was at its end, or on its way to a stress, may be given higher ones later.
    """
    stage = str(study["stage"])
    if stage in PREPARATION:
        return stage
    done = float(study.get("stress", -math.inf))
    for name, path in files.items():
        if float(name) <= done and not path.exists():
            raise InputError(
                f"{checkpoint}: {name} Pa lies below its present stress of {done:g} Pa; take "
                "another folder"
            )
    ahead = [name for name in files if float(name) > done]
    if stage == END:
        return ahead[0] if ahead else END
    if stage not in ahead[:1]:
        raise InputError(
            f"{checkpoint}: the compression is on its way to {stage} Pa; make this the next stress "
            "that it has not reached, or take another folder"
        )
    return stage


def resumed(checkpoint: Path, files: dict[str, Path], study: Study, command: str) -> Sample | None:
    """The state that it goes on from, its stage in `study`; None where it is to begin.

    `files` are those of the stresses by their names. InputError where the checkpoint or one of them
    is of another study or was made by another `command` (one program's steps are not the other's),
    or it is beyond a stress that it has not written.
    """
    if not checkpoint.exists():
        return None
    sample = _of_study(checkpoint, study, command)
    sample.study["stage"] = goes_on(sample.study, files, checkpoint)
    for path in filter(Path.exists, files.values()):
        _of_study(path, study, command)
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
