"""The same wave by the linear solver, by leapfrog, by YADE and by LAMMPS: run time against error.

The error is the relative L2 difference of all chain displacements from the converged wave, of the
springs or, for YADE and LAMMPS, of their law's tangent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import dem
from benchmarks.harness import diagram
from benchmarks.harness.lammps import Lammps
from benchmarks.harness.measure import measured
from benchmarks.harness.packing import step_and_records
from benchmarks.harness.report import Page, Rows
from benchmarks.harness.yade import Yade
from modal.packing.network import Network, read_network, write_network
from modal.waves.propagate import propagate

TITLE = "The same wave by linear propagation, leapfrog, YADE and LAMMPS"
TOLERANCES = {True: (1e-1, 1e-5, 1e-9), False: (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12)}
STEPS = {True: (0.5, 0.1), False: (0.9, 0.5, 0.2, 0.1, 0.05, 0.02)}
"""Time steps of the leapfrog over the limit 2 / omega_max."""
LITTLE_MORE = 1.1
"""Work over the least at which a tighter tolerance counts as free."""


def chebyshev_task(path: str, duration: float, tolerance: float) -> Callable[[], int]:
    """Task: the linear wave; returns its products."""
    network = read_network(path)
    propagate(network, 1e-5, interval=dem.INTERVAL)  # compiles the loop
    return lambda: propagate(network, duration, interval=dem.INTERVAL, tolerance=tolerance).products


def leapfrog_task(path: str, duration: float, time_step: float, every: int) -> Callable[[], int]:
    """Task: the linear leapfrog; returns its products with K."""
    network = read_network(path)
    setting = {"interval": every * time_step, "time_step": time_step}
    propagate(network, setting["interval"], **setting)  # compiles the loop
    return lambda: propagate(network, duration, **setting).products


def chebyshev_rows(network: Network, path: Path, quick: bool, duration: float) -> Rows:
    """The wave of the springs at each tolerance, against the tightest."""

    def displacement(tolerance: float) -> np.ndarray:
        found = propagate(network, duration, interval=dem.INTERVAL, tolerance=tolerance)
        return found.signals.chain_displacement

    exact, rows = displacement(dem.REFERENCE), []
    for tolerance in TOLERANCES[quick]:
        setting = {"path": str(path), "duration": duration, "tolerance": tolerance}
        spent = measured("benchmarks.wave:chebyshev_task", times=1 if quick else 3, **setting)
        what = {"method": "linear, Chebyshev", "setting": f"tolerance {tolerance:g}"}
        error = dem.relative(displacement(tolerance), exact)
        rows.append({**what, "products": spent.value, "error": error, **spent.cost})
    return rows


def leapfrog_rows(
    network: Network, path: Path, quick: bool, duration: float, fractions: Sequence[float]
) -> Rows:
    """The linear leapfrog at each time step, against the wave without one."""
    rows = []
    for fraction in fractions:
        step, every = step_and_records(network, fraction, dem.INTERVAL)
        setting = {"duration": duration, "time_step": step, "every": every}
        times = 1 if quick else 3
        spent = measured("benchmarks.wave:leapfrog_task", times=times, path=str(path), **setting)
        interval = step * every
        found = propagate(network, duration, interval=interval, time_step=step).signals
        exact = propagate(network, duration, interval=interval, tolerance=dem.REFERENCE).signals
        rows.append(
            {
                "method": "linear, leapfrog",
                "setting": f"{fraction:g} of the limit",
                "time_step_over_limit": fraction,
                "products": spent.value,
                "error": dem.relative(found.chain_displacement, exact.chain_displacement),
                "error_of_layers": dem.relative(found.layer_displacement, exact.layer_displacement),
                **spent.cost,
            }
        )
    return rows


def run(quick: bool, folder: Path) -> Page:
    """All programs that are installed, on one crystal."""
    crystal, path = dem.Crystal(dem.LAYERS[quick]), folder / "crystal.network.h5"
    network, duration = crystal.network, crystal.duration
    write_network(path, network)
    linear = chebyshev_rows(network, path, quick, duration)
    linear += leapfrog_rows(network, path, quick, duration, STEPS[quick])
    programs: Rows = []
    missing = []
    for program in (Yade, Lammps):
        if program.available():
            programs += crystal.rows(program(folder, network, 1 if quick else 3), quick)
        else:
            missing.append(f"{program.name}, which is optional, is not installed here.")
    task = (
        f"FCC crystal of {dem.WIDTH} x {dem.WIDTH} x {dem.LAYERS[quick]} spheres at 100 kPa, pulse "
        f"of 100 kHz, {1e3 * duration:.3g} ms. The linear wave is computed in one of the columns "
        "of which the crystal consists, where that is exact to the tolerance. Seconds of YADE are "
        "those of its steps, those of LAMMPS include its short start. `apart_from_tangent`: "
        "difference from the leapfrog of the "
        "tangent with the same step, which leaves the contact law's non-linearity. "
        "`dispersion_linear`: error of the springs' leapfrog with the same step. "
        "`velocity_tangent`: error of V_P with pre-stress. The recording interval varies at "
        f"{dem.FRACTION:g} of the limit, 2A = {2e9 * dem.SMALL:g} nm."
    )
    rows = linear + programs
    shown = [row for row in rows if row["method"] != dem.RECORDING]
    figures = {
        "wave": diagram.work_precision(shown, {"error": "relative error of the signals (-)"})
    }
    if programs:
        figures["fcc_time_step"] = diagram.work_precision(programs, dem.ERRORS, ["seconds"])
    return Page(TITLE, task, {"wave": rows}, notes(rows) + missing, figures)


def knee(rows: Rows) -> dict[str, Any]:
    """The tightest tolerance of the linear wave that costs hardly more than the loosest."""
    tight = [row for row in rows if row["method"] == "linear, Chebyshev"]
    least = min(row["products"] for row in tight)
    free = [row for row in tight if row["products"] <= LITTLE_MORE * least]
    return min(free, key=lambda row: row["error"])


def notes(rows: Rows) -> list[str]:
    """Orders, floors and factors from the rows."""
    tight, steps = (
        [row for row in rows if row["method"] == name]
        for name in ("linear, Chebyshev", "linear, leapfrog")
    )
    first, last, best = steps[0], steps[-1], knee(rows)
    step = "time_step_over_limit"
    order = math.log(first["error"] / last["error"]) / math.log(first[step] / last[step])
    return [
        f"Chebyshev: errors of {tight[0]['error']:.1e} to {tight[-1]['error']:.1e} take "
        f"{tight[0]['products']:.0f} to {tight[-1]['products']:.0f} products.",
        f"Leapfrog, by the same expansion: order {order:.2f}, {last['error']:.1e} in "
        f"{last['seconds']:.3g} s, {last['seconds'] / best['seconds']:.2g} times Chebyshev with "
        f"{best['setting']}.",
        *dem.notes(rows),
    ]
