"""What each digit of a sample's state costs in YADE, and what the way to it changes.

A small packing is compressed to 100 kPa by the study's servo, and its void ratio, coordination
number, stresses and residual forces are written down as it settles. Every stop criterion is read
from the same run; how far the state still moves after it is its error. The study's own compression,
which first agitates the spheres, is run with one choice changed at a time, and its states are
brought to rest with the friction of the wave. Without friction the minimiser stands beside YADE.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import diagram, yade
from benchmarks.harness.report import Page, Rows
from modal.formats.hdf5 import InputError
from modal.packing.sample import Sample, read_sample, write_sample
from modal.packing.state import summary
from modal.preparation import protocol
from modal.preparation.frictionless import minimise
from modal.preparation.random_packing import cloud, random_sample
from modal.preparation.relax import balance_of, relax
from modal.stiffness.static_load import static_velocity

TITLE = "Sample preparation in YADE: error of the state against steps, and the way to it"
SPHERES = {True: 120, False: 500}
ASPECT = 2.5
"""Length over width."""
STRESS, PEAK = 1e5, 1e6
"""Pa; the second is where a packing without friction comes from."""
STEPS = {True: 3000, False: 8000}
"""Steps once the packing is jammed: the last state is what the earlier ones are compared with."""
RUNS = {
    True: ((0.1, 0.4, 1), (0.1, 0.1, 1)),
    False: (
        *((number, 0.4, 1) for number in (0.1, 0.03, 0.01, 0.003)),
        *((0.01, friction, 1) for friction in (0.2, 0.05)),
        *((0.01, 0.4, seed) for seed in (2, 3)),
    ),
}
"""Inertial number of the largest strain rate, friction, and random start of each run."""
UNBALANCED = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
"""Stop criteria: mean residual force over mean contact force; stresses to `STRESS_ERROR` times."""
STRESS_ERROR = 3.0
END = "end of the run"
BUYS = 1.5
"""A criterion three times tighter that lowers the error by less than this buys nothing."""
MU, MU_WAVE = 0.4, 0.5
REST = 1e-5
"""Residual of a state at rest: enough for e, Z and V_P, and small packings may not come nearer."""
OWN = "the study's compression"
RATES = {
    "approach_rate": protocol.APPROACH_RATE,
    "inertial_number": protocol.INERTIAL_NUMBER,
}
COMPRESSIONS = {
    OWN: (4, {}),
    "half the time step": (3, {"fraction": 0.5 * protocol.STABILITY}),
    "half the rates": (1, {name: 0.5 * rate for name, rate in RATES.items()}),
    "twice the rates": (1, {name: 2.0 * rate for name, rate in RATES.items()}),
    "no damping until hot": (1, {"agitated_damping": 0.0}),
    "damping 0.1 until hot": (1, {"agitated_damping": 0.1}),
}
"""Random starts of each compression, and the columns of its table that are changed."""
AT_ONCE = 2
"""Chains that run at the same time: their states count, not their seconds."""
BY_MINIMISER = "no friction, 1 MPa to 100 kPa by the minimiser"
BY_YADE = "no friction, the same by YADE"
COMPARED = {"e": ".4f", "Z": ".3f", "V_P_m_s": ".1f"}
"""What is compared between the ways, and its digits."""
ERRORS = {
    "error_e": "error of e (-)",
    "error_Z": "error of Z (-)",
    "stress_error": "stress error (-)",
}
Trace = dict[str, np.ndarray]


def loose_spheres(spheres: int, friction: float, seed: int) -> Sample:
    """Random spheres that do not touch: points pushed apart, then stretched until none overlap."""
    sample, _ = minimise(cloud(spheres, ASPECT, seed), None, tolerance=0.1, max_steps=500)
    contact = sample.contacts()
    diameter = np.where(contact.particle_j < 0, sample.radius, 2 * sample.radius)
    stretch = 1.001 / (1 - (contact.overlap / diameter).max(initial=0.0))
    places = {name: stretch * getattr(sample, name) for name in ("position", "side", "walls")}
    return replace(sample, **places, friction=friction)


def compress(
    folder: Path, start: Sample, inertial_number: float, steps: int
) -> tuple[Trace, Sample, float]:
    """How one run's state changed, by column; its end; and its peak memory, MB."""
    before, end = folder / "start.sample.h5", folder / "end.sample.h5"
    write_sample(before, start)
    setting = {"stress": STRESS, "inertial_number": inertial_number, "steps": steps}
    run = yade.measured("compress", folder, sample=str(before), output=str(end), **setting)
    trace = {name: np.array(column) for name, column in run.value.items()}
    return trace, read_sample(end), run.peak_mb


def first_met(trace: Trace, unbalanced: float) -> int | None:
    """Index at which both criteria are first met, None if they never are."""
    met = (trace["unbalanced"] < unbalanced) & (trace["stress_error"] < STRESS_ERROR * unbalanced)
    return int(np.argmax(met)) if met.any() else None


def stop_rows(trace: Trace, peak_mb: float, what: dict[str, Any]) -> Rows:
    """A row for each stop criterion that the run has met, and one for its end."""
    end = len(trace["step"]) - 1
    rows = []
    for unbalanced in (*UNBALANCED, None):
        k = end if unbalanced is None else first_met(trace, unbalanced)
        if k is None or (unbalanced and k == end):
            continue
        row = {**what, "stop_unbalanced": unbalanced or END, "steps": int(trace["step"][k])}
        row |= {name: float(trace[name][k]) for name in ("e", "Z", "stress_error", "unbalanced")}
        for name in ("e", "Z"):
            moved = abs(float(trace[name][k] / trace[name][-1] - 1))
            row[f"error_{name}"] = moved if unbalanced else None
        rows.append(row | {"seconds": float(trace["seconds"][k]), "peak_mb": peak_mb})
    return rows


def state_row(
    what: str, sample: Sample, steps: int, seconds: float, start: int | None = None
) -> dict[str, Any]:
    """Density, contacts and velocity of a sample as it is; V_P is that of its springs."""
    network = sample.network()
    found, (_, balance) = summary(network, sample.friction), balance_of(sample, network)
    try:
        velocity = static_velocity(network)[0]
    except InputError:
        velocity = None  # a packing of --quick has no bulk
    return {
        "sample": what,
        "e": found["void_ratio"],
        "Z": found["coordination_number"],
        "Z_of_force_bearing": found["coordination_number_without_rattlers"],
        "V_P_m_s": velocity,
        "residual": balance.residual,
        "steps": steps,
        "seconds": seconds,
        "start": start,
    }


def compressed_state(folder: Path, what: str, spheres: int, seed: int) -> Sample:
    """The last state of a compression with the choices of `COMPRESSIONS`, not yet at rest."""
    width = (spheres * np.pi / 6 / protocol.NOMINAL_FRACTION / ASPECT) ** (1 / 3)
    columns = {"mu_comp": MU, "spheres": spheres, "width": width, "highest": STRESS}
    columns |= COMPRESSIONS[what][1] | {"seed": seed}
    own = folder / f"{list(COMPRESSIONS).index(what)}_{seed}"
    own.mkdir()
    table = f"{' '.join(columns)}\n{' '.join(f'{value:.8g}' for value in columns.values())}\n"
    yade.run_script("compress", table, own)
    return read_sample(own / f"compression_mu{MU:g}" / f"{STRESS:g}Pa.sample.h5")


def frictionless_rows(quick: bool, folder: Path) -> Rows:
    """Unloading from 1 MPa without friction: by the minimiser, and by YADE's dynamics."""
    dense = random_sample(2 * SPHERES[quick], PEAK, aspect=4.0, tolerance=1e-4)
    start = replace(dense, friction=0.0)
    begun = time.process_time()
    low, rest = minimise(start, STRESS, tolerance=1e-5)
    rows = [state_row(BY_MINIMISER, low, rest.steps, time.process_time() - begun)]
    trace, moved, _ = compress(folder, start, 0.01, STEPS[quick])
    rows.append(state_row(BY_YADE, moved, int(trace["step"][-1]), float(trace["seconds"][-1])))
    return rows


def protocol_rows(quick: bool, folder: Path) -> Rows:
    """States at rest; steps and seconds, of the clock, are those of the compression."""
    spheres = 2 * SPHERES[True] if quick else SPHERES[False]
    jobs = [(what, 1 + k) for what, (starts, _) in COMPRESSIONS.items() for k in range(starts)]
    jobs, rows = jobs[:1] if quick else jobs, []
    with ThreadPoolExecutor(AT_ONCE) as pool:
        states = list(pool.map(lambda job: compressed_state(folder, job[0], spheres, job[1]), jobs))
    for (what, seed), state in zip(jobs, states, strict=True):
        rested, _ = relax(replace(state, friction=MU_WAVE), tolerance=REST)
        steps, seconds = int(state.study["steps"]), float(state.study["seconds"])
        rows.append(state_row(what, rested, steps, seconds, seed))
    return rows + frictionless_rows(quick, folder)


def run(quick: bool, folder: Path) -> Page:
    """Strain rates, frictions and random starts; then the ways to a sample."""
    yade.need("preparation")
    rows: Rows = []
    for number, friction, seed in RUNS[quick]:
        name = f"I = {number:g}, friction {friction:g}, start {seed}"
        what = {"method": name, "inertial_number": number, "friction": friction, "seed": seed}
        start = loose_spheres(SPHERES[quick], friction, seed)
        trace, _, peak = compress(folder, start, number, STEPS[quick])
        rows += stop_rows(trace, peak, what)
    ways = protocol_rows(quick, folder)
    task = (
        f"{SPHERES[quick]} spheres from a cloud without contacts straight to {STRESS / 1e3:g} kPa. "
        "Errors of e and Z are relative to the end of the same run; stresses must be met to "
        f"{STRESS_ERROR:g} times the residual. I is the inertial number of the largest strain "
        f"rate. `protocol.csv`: the study's compression, friction {MU:g}, brought to rest with "
        f"{MU_WAVE:g}; V_P from the springs' response to a steady push; seconds are those of the "
        f"clock, {AT_ONCE} compressions at a time."
    )
    figures = {"preparation": diagram.work_precision(rows, ERRORS, ["seconds"])}
    tables = {"preparation": rows, "protocol": ways}
    return Page(TITLE, task, tables, notes(rows) + protocol_notes(ways), figures)


def stops(rows: Rows) -> dict[float, Rows]:
    """Rows of each stop criterion, from the loosest on."""
    known = [row for row in rows if row.get("error_e") is not None]
    criteria = sorted({row["stop_unbalanced"] for row in known}, reverse=True)
    return {c: [row for row in known if row["stop_unbalanced"] == c] for c in criteria}


def knee(rows: Rows) -> float:
    """The loosest criterion after which the next one hardly lowers the error of e.

    The error is the largest of all runs; only criteria that as many runs as ever have met count.
    """
    met = stops(rows)
    most = max(map(len, met.values()))
    error = {c: max(row["error_e"] for row in own) for c, own in met.items() if len(own) == most}
    for loose, tight in pairwise(error):
        if error[loose] < BUYS * error[tight]:
            return loose
    return min(error)


def notes(rows: Rows) -> list[str]:
    """What each criterion leaves of the error."""
    runs = len({row["method"] for row in rows if row["stop_unbalanced"] == END})
    return [
        f"Residual {criterion:g}: met by {len(own)} of {runs} runs; e then moves by at most "
        f"{max(row['error_e'] for row in own):.1e}, Z by {max(row['error_Z'] for row in own):.1e}; "
        f"{np.mean([row['seconds'] for row in own]):.3g} s a run."
        for criterion, own in stops(rows).items()
    ]


def values(rows: Rows, sample: str, name: str) -> np.ndarray:
    """One quantity of all starts of a sample, where it is known."""
    found = [row[name] for row in rows if row["sample"] == sample]
    return np.array([value for value in found if value is not None], float)


def differences(rows: Rows, what: str) -> str:
    """Means of a changed compression less those of the study's, and standard errors; "" if unknown.

    The errors are those of two means of so many starts with the scatter of the study's own.
    """
    found = []
    for name, form in COMPARED.items():
        own, other = values(rows, OWN, name), values(rows, what, name)
        if own.size > 1 and other.size:
            error = own.std(ddof=1) * np.sqrt(1 / own.size + 1 / other.size)
            label = name.removesuffix("_m_s")
            found.append(f"{label} by {other.mean() - own.mean():+{form}} ± {error:{form}}")
    return ", ".join(found)


def protocol_notes(rows: Rows) -> list[str]:
    """The study's own states, what each change does to them, and the minimiser against YADE."""
    said = []
    for name, form in COMPARED.items():
        own = values(rows, OWN, name)
        if own.size > 1:
            said.append(f"{name} {own.mean():{form}} ± {own.std(ddof=1):{form}}")
    said = [f"{OWN}, mean and scatter of its starts: {', '.join(said)}."] if said else []
    for what in list(COMPRESSIONS)[1:]:
        if text := differences(rows, what):
            said.append(f"{what} changes, with standard errors, {text}.")
    low, moved = (next(r for r in rows if r["sample"] == name) for name in (BY_MINIMISER, BY_YADE))
    return [
        *said,
        f"No friction: e {moved['e']:.5f} by YADE in {moved['seconds']:.3g} s, {low['e']:.5f} by "
        f"the minimiser in {low['seconds']:.3g} s; Z {moved['Z']:.3f} and {low['Z']:.3f}; "
        f"residuals {moved['residual']:.0e} and {low['residual']:.0e}.",
    ]
