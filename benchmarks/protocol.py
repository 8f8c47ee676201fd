"""The study's way to a sample: what its rates, damping, time step, start and short cuts change.

Each row is one small packing at 100 kPa, brought to rest with the friction of the wave. Rows of the
chain walk from the cloud with one choice changed; the others start from a state of it, or, without
friction, from one of the minimiser.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import yade_job
from benchmarks.measure import Measured
from benchmarks.report import Finding
from modal.equilibrium import balance_of, relax
from modal.minimiser import minimise
from modal.random_packing import random_sample
from modal.sample import Sample, read_sample, write_sample
from modal.statics import static_velocity
from modal.statistics import summary
from modal.storage import InputError

TITLE = "Random samples: what the protocol and its short cuts change"
SPHERES, WIDTH = {True: 200, False: 1000}, {True: 4.0, False: 6.0}
STRESS, PEAK = 1e5, 1e6
MU, MU_WAVE = 0.4, 0.5
SETTLING = {True: 2000, False: 20_000}
"""Steps of YADE with real masses, twice what the long waves of the full size would need."""
FRICTIONLESS = {True: 2000, False: 20_000}
OWN, HALF = "the study's chain", "half the time step"
BY_MINIMISER = "no friction, 1 MPa to 100 kPa by the minimiser"
STARTS = {OWN: 6, HALF: 3}
"""Random starts of these chains; the others have one."""
CHAINS = {
    OWN: {},
    HALF: {"fraction": 0.35},
    "half the rates": {"approach_rate": 4.0, "inertial_number": 0.005},
    "twice the rates": {"approach_rate": 16.0, "inertial_number": 0.02},
    "no damping until hot": {"agitated_damping": 0.0},
    "damping 0.1 until hot": {"agitated_damping": 0.1},
}
SETTLED = "the study's chain, settled in YADE with real masses"
BY_YADE = "no friction, the same by YADE"
PAIRS = {SETTLED: OWN, BY_YADE: BY_MINIMISER}
"""Samples that come from the same state."""
COLUMNS = {"e": ".4f", "Z": ".3f", "V_P_m_s": ".1f"}
"""What is compared, and its digits."""


def state_row(what: str, sample: Sample, steps: int, seconds: float) -> dict[str, Any]:
    """Density, contacts and velocity of a sample as it is; V_P is that of its springs."""
    network = sample.network()
    found = summary(network, sample.friction)
    _, balance = balance_of(sample, network)
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
        "beyond_friction": balance.sliding if sample.friction > 0 else 0,
        "steps": steps,
        "seconds": seconds,
    }


def chain(folder: Path, what: str, quick: bool, changed: dict[str, float]) -> tuple[Sample, Any]:
    """The 100 kPa state of a chain with some choices changed, not yet at rest; its study."""
    columns = {"mu_comp": MU, "spheres": SPHERES[quick], "width": WIDTH[quick], "highest": STRESS}
    columns |= changed
    own = folder / f"{what} {changed['seed']}".replace(" ", "_").replace("'", "")
    own.mkdir()
    table = f"{' '.join(columns)}\n{' '.join(f'{value:g}' for value in columns.values())}\n"
    yade_job.run_script("chain", table, own)
    sample = read_sample(own / f"chain_mu{MU:g}" / f"{STRESS:g}Pa.sample.h5")
    return replace(sample, friction=MU_WAVE), sample.study


def at_rest(what: str, sample: Sample, before: tuple[int, float]) -> dict[str, Any]:
    """Row of a sample brought to rest by `modal relax`."""
    start = time.process_time()
    rested, balance = relax(sample)
    seconds = time.process_time() - start
    return state_row(what, rested, before[0] + balance.steps, before[1] + seconds)


def by_yade(script: str, folder: Path, start: Sample, **given: float) -> tuple[Sample, Measured]:
    """What a script of benchmarks/yade makes of a sample, and what that cost."""
    paths = folder / "start.sample.h5", folder / "end.sample.h5"
    write_sample(paths[0], start)
    run = yade_job.measured(script, folder, sample=str(paths[0]), output=str(paths[1]), **given)
    return read_sample(paths[1]), run


def frictionless(folder: Path, quick: bool) -> list[dict[str, Any]]:
    """Unloading from 1 MPa without friction: by the minimiser, and by YADE's dynamics."""
    start = replace(random_sample(SPHERES[quick], PEAK, aspect=4.0, tolerance=1e-4), friction=0.0)
    begun = time.process_time()
    low, rest = minimise(start, STRESS, tolerance=1e-5)
    seconds = time.process_time() - begun
    rows = [state_row(BY_MINIMISER, low, rest.steps, seconds)]
    moved, run = by_yade(
        "compress",
        folder,
        start,
        stress=STRESS,
        inertial_number=0.01,
        steps=FRICTIONLESS[quick],
    )
    rows.append(state_row(BY_YADE, moved, int(run.value["step"][-1]), run.seconds))
    return rows


def run(quick: bool, folder: Path) -> Finding:
    """One row for each way."""
    if not yade_job.available():
        raise InputError("protocol: YADE is not installed; apt-get install yade")
    rows, own = [], None
    for what, seed in [
        (name, seed) for name in CHAINS for seed in range(1, 1 + STARTS.get(name, 1))
    ]:
        if quick and (seed > 1 or what not in STARTS):
            continue
        sample, study = chain(folder, what, quick, CHAINS[what] | {"seed": seed})
        own = own or (sample, study)
        cost = int(study["steps"]), float(study["seconds"])
        rows.append(at_rest(what, sample, cost) | {"start": seed})
    sample, study = own
    cost = int(study["steps"]), float(study["seconds"])
    steps = SETTLING[quick]
    settled, spent = by_yade("settle", folder, sample, steps=steps, damping=0.5)
    rows.append(state_row(SETTLED, settled, cost[0] + steps, cost[1] + spent.seconds))
    rows += frictionless(folder, quick)
    task = (
        f"{SPHERES[quick]} spheres, friction {MU:g} in compression and {MU_WAVE:g} at rest, "
        f"{STRESS / 1e3:g} kPa; V_P from the springs' response to a steady push. Seconds of the "
        "chain are those of the clock."
    )
    return Finding(TITLE, task, rows, notes(rows))


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Mean and scatter of the starts, single runs against that mean, and pairs from one state."""
    said = []
    for what in CHAINS:
        own = [row for row in rows if row["sample"] == what and row["V_P_m_s"] is not None]
        values = [
            (name, np.array([row[name] for row in own]), form) for name, form in COLUMNS.items()
        ]
        if len(own) > 1:
            text = (
                f"{name} {x.mean():{form}} ± {x.std(ddof=1):{form}}" for name, x, form in values
            )
            said.append(f"{what}, {len(own)} starts, mean and deviation: {', '.join(text)}.")
        elif own:
            text = (f"{name} {x[0]:{form}}" for name, x, form in values)
            said.append(f"{what}, one start: {', '.join(text)}.")
    for what, base in PAIRS.items():
        one, other = (next(row for row in rows if row["sample"] == name) for name in (what, base))
        text = (
            f"{name} {one[name] - other[name]:+{form}}"
            for name, form in COLUMNS.items()
            if one[name] is not None
        )
        said.append(f"{what}, against {base}: {', '.join(text)}; residual {one['residual']:.1e}.")
    return said
