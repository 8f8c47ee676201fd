"""What each digit of a sample's state costs in YADE: strain rate, stop criterion, friction.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. How far the state depends on
the strain rate, on the random start, and on the longer way of the study's own chain, is measured by
runs of their own.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks import diagram, yade_job
from benchmarks.report import Finding
from modal.minimiser import minimise
from modal.random_packing import cloud
from modal.sample import Sample, read_sample, write_sample
from modal.storage import InputError

TITLE = "Sample preparation in YADE: error of the state against steps"
SPHERES = {True: 120, False: 500}
STEPS = {True: 3000, False: 8000}
"""Steps once the packing is jammed: the last state is what the earlier ones are compared with."""
INERTIAL_NUMBERS = {True: (0.1,), False: (0.1, 0.03, 0.01, 0.003)}
FRICTIONS = {True: (0.4, 0.1), False: (0.4, 0.2, 0.05)}
SEEDS = {True: (1,), False: (1, 2, 3)}
RATE = {True: 0.1, False: 0.01}
"""Inertial number of the sweeps over something else."""
AT_REST = {True: 1000, False: 5000}
"""Steps after all velocities have been set to zero."""
STRESS = 1e5
ASPECT = 2.5
CHAIN_FRACTION = 0.6
"""Solid fraction at which the chain's length follows from its width."""
DEFAULT = 1e-3
"""Residual at which `yade_scripts/chain.py` takes a state as settled."""
UNBALANCED = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
"""Stop criteria: mean residual force over mean contact force; stresses to three times that."""
CHAIN = "the study's chain, "
AGAIN = ", put to rest"
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}


def loose_spheres(spheres: int, friction: float, seed: int) -> Sample:
    """Random spheres that do not touch: points pushed apart, then stretched until none overlap."""
    sample, _ = minimise(cloud(spheres, ASPECT, seed), None, tolerance=0.1, max_steps=500)
    contact = sample.contacts()
    diameter = np.where(contact.particle_j < 0, sample.radius, 2 * sample.radius)
    stretch = 1.001 / (1 - (contact.overlap / diameter).max(initial=0.0))
    return replace(
        sample,
        position=stretch * sample.position,
        side=stretch * sample.side,
        walls=stretch * sample.walls,
        friction=friction,
    )


def compress(
    folder: Path, sample: Sample, inertial_number: float, steps: int
) -> tuple[dict[str, np.ndarray], float]:
    """How one run's state changed, by column, and its peak memory, MB; compressed.sample.h5."""
    write_sample(folder / "start.sample.h5", sample)
    run = yade_job.measured(
        "compress",
        folder,
        sample=str(folder / "start.sample.h5"),
        output=str(folder / "compressed.sample.h5"),
        stress=STRESS,
        inertial_number=inertial_number,
        steps=steps,
    )
    return {name: np.array(column) for name, column in run.value.items()}, run.peak_mb


def chain_row(folder: Path, spheres: int, friction: float, seed: int) -> dict[str, Any]:
    """The same packing by `yade_scripts/chain.py`, up to the same stress; seconds of the whole."""
    width = (spheres * np.pi / 6 / CHAIN_FRACTION / ASPECT) ** (1 / 3)
    table = f"mu_comp spheres width seed highest\n{friction} {spheres} {width} {seed} {STRESS:g}\n"
    own = folder / f"chain_of_start{seed}"
    own.mkdir(exist_ok=True)
    _, seconds, peak = yade_job.run_script("chain", table, own)
    study = read_sample(own / f"chain_mu{friction:g}" / f"{STRESS:g}Pa.sample.h5").study
    stresses = np.array([study[f"stress_{axis}"] for axis in ("xx", "yy", "zz")])
    return {
        "method": CHAIN + label(friction, seed),
        "inertial_number": None,
        "friction": friction,
        "seed": seed,
        "stop_unbalanced": DEFAULT,
        "steps": int(study["steps"]),
        "e": float(study["void_ratio"]),
        "Z": float(study["coordination_number"]),
        "stress_error": float(abs(stresses / STRESS - 1).max()),
        "unbalanced": float(study["unbalanced"]),
        "seconds": seconds,
        "peak_mb": peak,
    }


def label(friction: float, seed: int) -> str:
    """Friction, and which of several random starts."""
    return f"friction {friction:g}" + f", start {seed}" * (seed > 1)


def first_met(trace: dict[str, np.ndarray], unbalanced: float) -> int | None:
    """Index at which both criteria are first met, None if they never are."""
    met = (trace["unbalanced"] < unbalanced) & (trace["stress_error"] < 3 * unbalanced)
    return int(np.argmax(met)) if met.any() else None


def stop_rows(
    trace: dict[str, np.ndarray], peak_mb: float, what: dict[str, Any]
) -> list[dict[str, Any]]:
    """A row for each stop criterion that the run has met, and one for its end."""
    rows = []
    for unbalanced in (*UNBALANCED, None):
        k = len(trace["step"]) - 1 if unbalanced is None else first_met(trace, unbalanced)
        if k is None or (unbalanced and k == len(trace["step"]) - 1):
            continue
        last = {name: column[-1] for name, column in trace.items()}
        rows.append(
            {
                **what,
                "stop_unbalanced": unbalanced if unbalanced else "end of the run",
                "steps": int(trace["step"][k]),
                "e": float(trace["e"][k]),
                "Z": float(trace["Z"][k]),
                "stress_error": float(trace["stress_error"][k]),
                "unbalanced": float(trace["unbalanced"][k]),
                "error_e": abs(float(trace["e"][k] / last["e"] - 1)) if unbalanced else None,
                "error_Z": abs(float(trace["Z"][k] / last["Z"] - 1)) if unbalanced else None,
                "seconds": float(trace["seconds"][k]),
                "peak_mb": peak_mb,
            }
        )
    return rows


def run(quick: bool, folder: Path) -> Finding:
    """Strain rates, frictions and random starts."""
    if not yade_job.available():
        raise InputError("preparation: YADE is not installed; apt-get install yade")
    rate, first = RATE[quick], FRICTIONS[quick][0]
    cases = [(number, first, 1) for number in INERTIAL_NUMBERS[quick]]
    cases += [(rate, friction, 1) for friction in FRICTIONS[quick][1:]]
    cases += [(rate, first, seed) for seed in SEEDS[quick][1:]]
    rows, traces = [], {}
    for number, friction, seed in cases:
        name = f"I = {number:g}, " + label(friction, seed)
        what = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        cloud_of_case = loose_spheres(SPHERES[quick], friction, seed)
        traces[name], peak = compress(folder, cloud_of_case, number, STEPS[quick])
        rows += stop_rows(traces[name], peak, what)
        if (number, friction, seed) == (rate, first, 1):
            # Written without velocities: what still moved has come to rest.
            settled = read_sample(folder / "compressed.sample.h5")
            trace, peak = compress(folder, settled, number, AT_REST[quick])
            trace["step"] += traces[name]["step"][-1]
            rows += stop_rows(trace, peak, what | {"method": name + AGAIN})[-1:]
            traces[name + AGAIN] = trace
    # The chain takes some 30,000 steps and a width of four spheres.
    for friction, seed in dict.fromkeys(case[1:] for case in cases if not quick):
        rows.append(chain_row(folder, SPHERES[quick], friction, seed))
    task = (
        f"{SPHERES[quick]} spheres from a cloud without contacts to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to three "
        "times the residual. I is the inertial number of the largest strain rate. The servo drives "
        "these packings straight to the stress. The study's chain first drives the cloud, at a "
        "constant rate and hardly damped, to 500 kPa, lets the agitation die at constant volume, "
        "and walks over 10, 1 and 10 kPa to the stress; its rows give its end. What its rates, "
        "damping and time step change: `python -m benchmarks protocol`."
    )
    shown = [row for row in rows if not row["method"].startswith(CHAIN)]
    figures = {"preparation": diagram.work_precision(shown, ERRORS), "settling": settling(traces)}
    return Finding(TITLE, task, rows, notes(rows), figures)


def settling(traces: dict[str, dict[str, np.ndarray]]) -> Figure:
    """State against steps of every run."""
    figure, axes = diagram.panels(2, 2, width=3.6)
    labels = {
        "e": "void ratio e (-)",
        "Z": "contacts a sphere Z (-)",
        "stress_error": "stress error (-)",
        "unbalanced": "residual over contact force (-)",
    }
    for ax, (name, label) in zip(axes.ravel(), labels.items(), strict=True):
        for k, (method, trace) in enumerate(traces.items()):
            style = diagram.look(k) | {"marker": None}
            ax.plot(trace["step"] / 1e3, trace[name], label=method, **style)
        ax.set(xlabel="steps (thousands)", ylabel=label)
        if name in ("stress_error", "unbalanced"):
            ax.set_yscale("log")
    diagram.legend_below(figure, axes[0, 0], len(traces))
    return figure


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Cost of the digits, and what rate, random start and the study's chain change."""
    chains = [row for row in rows if row["method"].startswith(CHAIN)]
    ends = [row for row in rows if row["stop_unbalanced"] == "end of the run"]
    rested = [row for row in ends if row["method"].endswith(AGAIN)]
    ends = [row for row in ends if row not in rested]
    said = []
    for end in ends:
        own = [row for row in rows if row["method"] == end["method"] and row is not end]
        said.append(_digits(end, own))
    stops = [row for row in rows if row["stop_unbalanced"] == DEFAULT and row not in chains]
    if stops:
        said.append(
            f"Knee and default: residual {DEFAULT:g}, stresses to {3 * DEFAULT:g}. Of "
            f"{len(ends)} runs {len(stops)} met it; e then moved by at most "
            f"{max(row['error_e'] for row in stops):.1e}, Z by at most "
            f"{max(row['error_Z'] for row in stops):.1e} until the end of the run."
        )
    for row in rested:
        before = next(end for end in ends if end["method"] + AGAIN == row["method"])
        said.append(
            f"The residual stops falling near {before['unbalanced']:.0e}: loose spheres still fly "
            "and hit the others, and local damping does not slow what no force acts on. With all "
            "velocities set to zero once, the same packing reached "
            f"{row['unbalanced']:.0e} in {row['steps'] - before['steps']} more steps."
        )
    first = ends[0]["friction"]
    rates = [row for row in ends if row["friction"] == first and row["seed"] == 1]
    if len(rates) > 1:
        spread = ", ".join(f"{row['e']:.4f} at I = {row['inertial_number']:g}" for row in rates)
        said.append(f"Strain rate, friction {first:g}: e = {spread}.")
    starts = [row for row in ends if row["friction"] == first]
    starts = [row for row in starts if row["inertial_number"] == starts[-1]["inertial_number"]]
    if len(starts) > 1:
        values = np.array([row["e"] for row in starts])
        said.append(
            f"{len(values)} random starts at I = {starts[0]['inertial_number']:g}: e scatters by "
            f"{values.std(ddof=1):.4f}. Digits below that belong to one packing of this size, not "
            "to the protocol: the floor of a small sample."
        )
    for row in chains:
        same = {"friction": row["friction"], "seed": row["seed"]}
        other = [end for end in ends if same.items() <= end.items()][-1]
        said.append(
            f"By {row['method']}: e = {row['e']:.4f}, Z = {row['Z']:.2f} in {row['steps']} steps "
            f"and {row['seconds']:.3g} s; straight to the stress at I = "
            f"{other['inertial_number']:g}: e = {other['e']:.4f}, Z = {other['Z']:.2f} in "
            f"{other['steps']} steps."
        )
    if chains:
        said.append("How dense a packing becomes the way decides, not the stop criterion.")
    return said


def _digits(end: dict[str, Any], own: list[dict[str, Any]]) -> str:
    """What each digit of e has cost in one run."""
    reached = min((row["stop_unbalanced"] for row in own), default=None)
    if reached is None:
        return f"{end['method']}: no stop criterion was met in {end['steps']} steps."
    digits = []
    for digit in (1e-2, 1e-3, 1e-4, 1e-5):
        within = [row for row in own if row["error_e"] < digit]
        if within:
            digits.append(f"{digit:g} after {within[0]['seconds']:.3g} s")
    return (
        f"{end['method']}: e = {end['e']:.4f}, Z = {end['Z']:.2f}; error of e below "
        + (", ".join(digits) or "1e-2 never")
        + f"; tightest residual met {reached:g}."
    )
