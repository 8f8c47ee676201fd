"""Bring a sample to static equilibrium under its contact model."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from modal.cli.options import SKIP, Option, Options, Result, output, say
from modal.formats.provenance import Provenance
from modal.packing.sample import read_sample, write_sample
from modal.packing.summary import summary
from modal.preparation.relax import MAX_STEPS, TOLERANCE, Equilibrium, relax
from modal.tools.errors import InputError
from modal.tools.progress import Minute

EXAMPLE = "relax mine.sample.h5 --friction 0.5 -o rested.sample.h5"
OPTIONS = (
    Option("sample", "", "*.sample.h5", kind=str),
    Option("--friction", "MU", "of the wave that will follow (default: the sample's)"),
    Option("--tolerance", "T", "mean net force over mean contact force at rest", TOLERANCE),
    output("the sample at rest, *.sample.h5", (".sample.h5",), required=True),
    SKIP,
)
CREPT = 5e-3
"""Change of a stress at a fixed cell, over the largest, that is told: from there on the export from
YADE refuses a sample. Settled packings of 35,201 spheres change by up to 0.7 %."""

read_product = read_sample


def kept(options: Options) -> Result:
    """What a sample that is kept fell short of: its exit status stays."""
    return {"at_rest": bool(read_sample(options.output).study.get("at_rest", True))}


def run(options: Options) -> Result:
    """Bring one sample to rest; its residuals before and after, and its reserve of friction."""
    sample, tolerance = read_sample(options.sample), options.tolerance
    if options.friction is not None:
        sample = replace(sample, friction=options.friction)
    if not tolerance > 0:
        raise InputError(
            "input", f"--tolerance {tolerance:g}", "must be positive", f"{TOLERANCE:g} is usual"
        )
    before, minute = list[float](), Minute()

    def watch(state: Equilibrium) -> None:
        before.append(state.residual)
        if state.steps % 1000 == 0 or minute.passed():
            say(
                f"step {state.steps} of at most {MAX_STEPS}: residual {state.residual:.1e}, at "
                f"rest at {tolerance:.1e}; {state.contacts} contacts, {state.sliding} sliding"
            )

    rested, state = relax(sample, tolerance=tolerance, watch=watch)
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
    stress = np.array(summary(sample.network())["stress_pa"])
    crept = (measured["stress_pa"] - stress) / abs(stress).max()
    change = float(crept[abs(crept).argmax()])
    if abs(change) > CREPT:
        say(
            f"a stress changed by {100 * change:+.2g} % at the fixed cell: the packing was not yet "
            "at rest; `python -m modal pack` with a tenth of its --residual leaves less to creep"
        )
    found = {"residual": state.residual, "unbalanced": state.residual, "mu_wave": rested.friction}
    found |= {name: getattr(state, name) for name in ("tolerance", "attainable", "at_rest")}
    found |= zip(("stress_xx", "stress_yy", "stress_zz"), measured["stress_pa"], strict=True)
    made = _with_parent(options.made, sample.provenance)
    study = sample.study | measured | found
    write_sample(options.output, replace(rested, study=study, provenance=made))
    return {"residual_before": before[0], "stress_change": change} | asdict(state) | measured


def _with_parent(made: Provenance, parent: dict[str, Any]) -> dict[str, Any]:
    """The attributes of a moved sample: its state is seldom kept, so what that said stays."""
    (state,) = made.sources
    kept = {f"parent_{k}": value for k, value in parent.items() if not k.startswith("parent")}
    return made.attributes() | kept | {"parent": state.name, "parent_sha256": state.sha256}
