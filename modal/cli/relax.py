"""Bring a sample, or the spheres of a scan, to static equilibrium under the contact model."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from modal.cli.options import SKIP, Option, Options, Result, flag, output, say
from modal.exchange.programs.own import is_sample
from modal.formats.provenance import Provenance
from modal.packing.network import read_network
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.summary import summary
from modal.preparation.relax import (
    CREEP_RESIDUAL,
    MAX_STEPS,
    TOLERANCE,
    Equilibrium,
    friction_at_rest,
    measure_equilibrium,
    relax,
)
from modal.preparation.scanned import bring_to_stress, sample_of_scan
from modal.tools.errors import InputError
from modal.tools.progress import Minute

STRESS_HELP = (
    "isotropic stress under which the spheres creep until they rest (a scan's with friction 0, too)"
)
EXAMPLE = "relax mine.sample.h5 --friction 0.5 -o rested.sample.h5"
OPTIONS = (
    Option("sample", "", "*.sample.h5; with --stress also a scan's *.network.h5", kind=str),
    Option("--friction", "MU", "of the wave that will follow (default: the sample's)"),
    flag("--mobilised", "keep contacts at the whole friction limit where they have slid to it"),
    Option("--stress", "PA", STRESS_HELP),
    Option("--tolerance", "T", "mean net force over mean contact force at rest", TOLERANCE),
    output("the sample at rest, *.sample.h5", (".sample.h5",), required=True),
    SKIP,
)
MIN_REPORTED_STRESS_CHANGE = 5e-3
"""Change of a stress at a fixed cell, divided by the largest stress, from which on the change is
reported: the export from YADE refuses a sample with a larger one. Settled packings of 35,201
spheres change by up to 0.7 %."""
MAX_CHANGE_OF_VOID_RATIO = 0.02
"""Largest change of the void ratio of a scan that is not reported: samples of one preparation that
differ in their seed differ by some 0.003."""
STEPS_BETWEEN_LINES = 1000
"""Number of steps after which a line says how far the sample has come."""

read_product = read_sample


def current_result(options: Options) -> Result:
    """Return whether a kept sample is at rest; the exit status depends on the answer."""
    return {"at_rest": bool(read_sample(options.output).study.get("at_rest", True))}


def run(options: Options) -> Result:
    """Bring a sample to rest; the result has its residuals and its reserve of friction."""
    if options.stress is not None and not is_sample(options.sample):
        return _bring_scan_to_rest(options)
    sample = read_sample(options.sample)
    tolerance = options.tolerance
    if options.friction is not None:
        sample = replace(sample, friction=options.friction)
    if not tolerance > 0:
        raise InputError(
            "tolerance",
            f"--tolerance {tolerance:g}",
            "must be positive",
            f"{TOLERANCE:g} is usual",
        )
    residuals = list[float]()
    minute = Minute()

    def watch(state: Equilibrium) -> None:
        residuals.append(state.residual)
        if state.steps % STEPS_BETWEEN_LINES == 0 or minute.passed():
            say(
                f"step {state.steps} of at most {MAX_STEPS}: residual {state.residual:.1e}, at "
                f"rest at {tolerance:.1e}; {state.contacts} contacts, {state.sliding} sliding"
            )

    if options.stress is not None:
        sample = _creep(sample, options.stress, mobilised=options.mobilised)
    rested, state = relax(sample, tolerance=tolerance, watch=watch, mobilised=options.mobilised)
    _say_residual(state)
    measured = summary(rested.network(), rested.friction)
    stress_change = _tell_change_of_stress(sample, measured["stress_pa"])
    notes = {
        "residual": state.residual,
        "unbalanced": state.residual,
        "mu_wave": rested.friction,
        "tolerance": state.tolerance,
        "attainable": state.attainable,
        "at_rest": state.at_rest,
        **dict(zip(("stress_xx", "stress_yy", "stress_zz"), measured["stress_pa"], strict=True)),
    }
    study = sample.study | measured | notes
    provenance = _with_parent(options.made, sample.provenance)
    write_sample(options.output, replace(rested, study=study, provenance=provenance))
    result: Result = {"residual_before": residuals[0], "stress_change": stress_change}
    return result | asdict(state) | measured


def _tell_change_of_stress(before: Sample, stress: Sequence[float]) -> float:
    """Return how much rest at a fixed cell has changed a stress, and say so if it is much.

    The result is the change with the largest size, divided by the largest stress before.
    """
    stress_before = np.array(summary(before.network())["stress_pa"])
    change = _largest_change(stress_before, stress)
    if abs(change) > MIN_REPORTED_STRESS_CHANGE:
        say(
            f"a stress changed by {100 * change:+.2g} % at the fixed cell: the packing was "
            "not yet at rest; with --stress it creeps under its stress first"
        )
    return change


def _tell_change_of_density(before: float, after: float) -> None:
    """Say by how much the void ratio of a scan has changed on the way to rest, if it is much."""
    if abs(after - before) > MAX_CHANGE_OF_VOID_RATIO:
        say(
            f"the void ratio went from {before:.3f} to {after:.3f}: the velocities are those of "
            "another density than the scan's; give the friction of the real grains"
        )


def _creep(sample: Sample, stress: float, *, mobilised: bool) -> Sample:
    """Return a sample after it has crept to rest under an isotropic stress, Pa.

    Its contacts slide at the same friction as in `relax`.
    """
    friction = friction_at_rest(sample, mobilised=mobilised)
    crept = bring_to_stress(replace(sample, friction=friction), stress, say, CREEP_RESIDUAL)
    if not crept.study["settled"]:
        say(f"the sample still creeps at {stress:g} Pa; it comes to rest at a fixed cell from here")
    return replace(crept, friction=sample.friction)


def _bring_scan_to_rest(options: Options) -> Result:
    """Bring the spheres of a scan to rest under a stress; return the numbers of the state."""
    network = read_network(options.sample)
    friction = options.friction
    if friction is None:
        friction = network.noted("mu_wave") or 0.0
    sample = sample_of_scan(network, friction)
    if friction:
        sample = _creep(sample, options.stress, mobilised=options.mobilised)
        rested, state = relax(sample, tolerance=options.tolerance, mobilised=options.mobilised)
        _say_residual(state)
        _tell_change_of_stress(sample, summary(rested.network())["stress_pa"])
        sample = rested
    else:
        sample = bring_to_stress(sample, options.stress, say)
        if not sample.study["settled"]:
            raise InputError(
                "not_at_rest",
                f"the spheres do not come to rest at {options.stress:g} Pa",
                remedy="give another stress, or check radii and cell",
            )
        state = measure_equilibrium(sample)
    measured = summary(sample.network(), sample.friction)
    _tell_change_of_density(summary(network)["void_ratio"], measured["void_ratio"])
    at_rest = state.at_rest or not friction
    notes = {"mu_comp": friction, "residual": state.residual, "at_rest": at_rest}
    study = sample.study | measured | notes
    provenance = _with_parent(options.made, network.provenance)
    write_sample(options.output, replace(sample, study=study, provenance=provenance))
    return {"residual": state.residual, "contacts": state.contacts} | measured


def _say_residual(state: Equilibrium) -> None:
    """Print the residual of the net forces if it is more than the tolerance."""
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


def _largest_change(before: Any, after: Any) -> float:
    """Return the largest change of a stress, with its sign, divided by the largest stress."""
    change = (after - before) / abs(before).max()
    return float(change[abs(change).argmax()])


def _with_parent(made: Provenance, parent: dict[str, Any]) -> dict[str, Any]:
    """Return the provenance of a relaxed sample, with that of the sample it was made from.

    The original sample is seldom kept as a file, so that its provenance must be copied.
    """
    (source,) = made.sources
    of_parent = {}
    for name, value in parent.items():
        if not name.startswith("parent"):
            of_parent[f"parent_{name}"] = value
    return made.attributes() | of_parent | {"parent": source.name, "parent_sha256": source.sha256}
