"""The command `relax`: a sample to static equilibrium under its contact model."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from typing import Any

from modal.cli.options import add_command, add_output, add_value, say
from modal.formats.provenance import Provenance
from modal.packing.sample import read_sample, write_sample
from modal.packing.summary import summary
from modal.preparation.relax import MAX_STEPS, TOLERANCE, Equilibrium, relax
from modal.tools.errors import InputError
from modal.tools.progress import Minute

read_product = read_sample


def add(commands: Any) -> None:
    """The options of `relax`."""
    text = "bring a sample to static equilibrium under its contact model"
    example = "relax mine.sample.h5 --friction 0.5 -o rested.sample.h5"
    command = add_command(commands, "relax", text, example)
    command.add_argument("sample", help="*.sample.h5")
    text = "of the wave that will follow (default: the sample's)"
    add_value(command, "--friction", "MU", text)
    text = "mean net force over mean contact force at rest"
    add_value(command, "--tolerance", "T", text, TOLERANCE)
    add_output(command, "the sample at rest, *.sample.h5", required=True, skip=True)


def kept(options: argparse.Namespace) -> dict[str, Any]:
    """What a sample that is kept fell short of: its exit status stays."""
    return {"at_rest": bool(read_sample(options.output).study.get("at_rest", True))}


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Bring one sample to rest; its residuals before and after, and its reserve of friction."""
    sample = read_sample(options.sample)
    if options.friction is not None:
        sample = replace(sample, friction=options.friction)
    if not options.tolerance > 0:
        raise InputError(
            f"--tolerance {options.tolerance:g}: must be positive; {TOLERANCE:g} is usual"
        )
    history: list[Equilibrium] = []
    minute = Minute()

    def watch(state: Equilibrium) -> None:
        history.append(replace(state))
        if state.steps % 1000 and not minute.passed():
            return
        say(
            f"step {state.steps} of at most {MAX_STEPS}: residual {state.residual:.1e}, at rest at "
            f"{options.tolerance:.1e}; {state.contacts} contacts, {state.sliding} sliding"
        )

    rested, state = relax(sample, tolerance=options.tolerance, watch=watch)
    if not state.at_rest:
        say(
            f"tolerance not reached: residual {state.residual:.1e}, of a single sphere "
            f"{state.largest:.1e}, after {state.steps} steps, {state.tolerance:g} was asked for"
        )
    elif state.residual > state.tolerance:
        say(
            f"residual {state.residual:.1e}: round-off of the positions allows no less than "
            f"{state.attainable:.1e}, {state.tolerance:g} was asked for"
        )
    measured = summary(rested.network(), rested.friction)
    found = {"residual": state.residual, "unbalanced": state.residual, "mu_wave": rested.friction}
    found |= {name: getattr(state, name) for name in ("tolerance", "attainable", "at_rest")}
    found |= zip(("stress_xx", "stress_yy", "stress_zz"), measured["stress_pa"], strict=True)
    rested = replace(
        rested,
        study=sample.study | measured | found,
        provenance=_with_parent(options.made, sample.provenance),
    )
    write_sample(options.output, rested)
    return {"residual_before": history[0].residual} | asdict(state) | measured


def _with_parent(made: Provenance, parent: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a moved sample: its state is seldom kept, so what that said stays."""
    (state,) = made.sources
    kept = {f"parent_{k}": value for k, value in parent.items() if not k.startswith("parent")}
    return made.attributes() | kept | {"parent": state.name, "parent_sha256": state.sha256}
