"""The same wave by the linear solver, by leapfrog, by YADE and by LAMMPS: run time against error.

The error is the relative L2 difference of all chain displacements from the converged wave, of the
springs or, for YADE and LAMMPS, of their law's tangent. These have a non-linear contact law: they
run at two amplitudes, the larger one that of the study, and their difference from a linear leapfrog
with the same step is given as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import diagram, lammps, yade
from benchmarks.harness.measure import Measured, measured
from benchmarks.harness.report import Page, Rows
from modal.modes.highest import highest_modes
from modal.modes.problem import Eigenproblem
from modal.packing import examples as gallery
from modal.packing.network import Network
from modal.packing.network_file import read_network, write_network
from modal.waves.leapfrog import leapfrog
from modal.waves.propagate import propagate
from modal.waves.signals import Signals
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Pulse

TITLE = "The same wave by linear propagation, leapfrog, YADE and LAMMPS"
CRYSTAL = {True: (3, 40, 8e-5), False: (3, 200, 3.7e-4)}
"""Spheres a side, layers, duration, s."""
TOLERANCES = {True: (1e-1, 1e-5, 1e-9), False: (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12)}
STEPS = {True: (0.5, 0.1), False: (0.9, 0.5, 0.2, 0.1, 0.05, 0.02)}
"""Time steps of the leapfrog over the limit 2 / omega_max."""
DEM_STEPS = {
    True: {AMPLITUDE: (0.5, 0.1), 1e-2 * AMPLITUDE: (0.5, 0.1)},
    False: {AMPLITUDE: (0.5, 0.1, 0.05), 1e-2 * AMPLITUDE: (0.5, 0.1, 0.02)},
}
"""The same of the DEM, for each A of A (1 - cos)."""
INTERVAL = 1e-6
REFERENCE = 1e-14
"""Tolerance of the wave that the others are compared with."""
LITTLE_MORE = 1.1
"""Work over the least at which a tighter tolerance counts as free."""


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 difference of a from b at the times that both have."""
    count = min(len(a), len(b))
    a, b = a[:count], b[:count]
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def along_z(signals: Signals) -> np.ndarray:
    """Displacements (nt, nc): every chain of a crystal carries the same wave, layer by layer."""
    return signals.chain_displacement[:, np.argsort(signals.chain_position)]


def linear_twin(network: Network, signals: Signals, pre_stress: str) -> Signals:
    """The linear leapfrog with the step, the pulse and the records of a run."""
    return leapfrog(
        network,
        float(signals.time[-1]),
        signals.time_step,
        motion=Pulse(signals.amplitude, signals.input_frequency),
        every=round(float(signals.time[1]) / signals.time_step),
        pre_stress=pre_stress,
    )


def chebyshev_task(path: str, duration: float, tolerance: float) -> Callable[[], int]:
    """Task: the linear wave; returns its products."""
    network = read_network(path)
    propagate(network, 1e-5, interval=INTERVAL)  # compiles the loop
    return lambda: propagate(network, duration, interval=INTERVAL, tolerance=tolerance).products


def leapfrog_task(path: str, duration: float, time_step: float, every: int) -> Callable[[], int]:
    """Task: the linear leapfrog; returns its steps."""
    network = read_network(path)
    leapfrog(network, 10 * time_step, time_step)  # compiles the loop

    def action() -> int:
        leapfrog(network, duration, time_step, every=every)
        return round(duration / time_step) + 1

    return action


def highest_frequency(network: Network) -> float:
    """Hz, by this program."""
    return float(highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1])


def step_and_records(highest: float, fraction: float) -> tuple[float, int]:
    """Time step, s, that divides the pulse, at most `fraction` of its limit; steps a record."""
    steps = math.ceil(math.pi * highest / (fraction * INPUT_FREQUENCY))
    return 1 / (INPUT_FREQUENCY * steps), max(1, steps // 20)


def chebyshev_rows(network: Network, path: Path, quick: bool, duration: float) -> Rows:
    """The wave of the springs at each tolerance, against the tightest."""

    def displacement(tolerance: float) -> np.ndarray:
        found = propagate(network, duration, interval=INTERVAL, tolerance=tolerance)
        return found.signals.chain_displacement

    exact, rows = displacement(REFERENCE), []
    for tolerance in TOLERANCES[quick]:
        setting = {"path": str(path), "duration": duration, "tolerance": tolerance}
        spent = measured("benchmarks.wave:chebyshev_task", times=1 if quick else 3, **setting)
        what = {"method": "linear, Chebyshev", "setting": f"tolerance {tolerance:g}"}
        error = relative(displacement(tolerance), exact)
        rows.append({**what, "products": spent.value, "error": error, **spent.cost})
    return rows


def leapfrog_rows(
    network: Network, path: Path, quick: bool, duration: float, fractions: Sequence[float]
) -> Rows:
    """The linear leapfrog at each time step, against the wave without one."""
    highest, rows = highest_frequency(network), []
    for fraction in fractions:
        step, every = step_and_records(highest, fraction)
        setting = {"duration": duration, "time_step": step, "every": every}
        times = 1 if quick else 3
        spent = measured("benchmarks.wave:leapfrog_task", times=times, path=str(path), **setting)
        found = leapfrog(network, **setting)
        exact = propagate(network, duration, interval=step * every, tolerance=REFERENCE).signals
        rows.append(
            {
                "method": "linear, leapfrog",
                "setting": f"{fraction:g} of the limit",
                "time_step_over_limit": fraction,
                "products": spent.value,
                "error": relative(found.chain_displacement, exact.chain_displacement),
                "error_of_layers": relative(found.layer_displacement, exact.layer_displacement),
                **spent.cost,
            }
        )
    return rows


def dem_row(
    program: str, fraction: float, network: Network, have: Signals, spent: Measured
) -> dict[str, Any]:
    """A DEM wave against that of the tangent, converged and with the same time step."""
    exact = propagate(
        network,
        float(have.time[-1]),
        motion=Pulse(have.amplitude, have.input_frequency),
        interval=float(have.time[1]),
        tolerance=REFERENCE,
        pre_stress="full",
    ).signals
    return {
        "method": f"{program}, 2A = {2e9 * have.amplitude:g} nm",
        "setting": f"{fraction:g} of the limit",
        "error": relative(along_z(have), along_z(exact)),
        **spent.cost,
        "apart_from_tangent": relative(along_z(have), along_z(linear_twin(network, have, "full"))),
    }


def yade_rows(network: Network, folder: Path, quick: bool, duration: float) -> Rows:
    """YADE at both amplitudes; seconds are those of the steps."""
    yade.prepare_wave(network, folder)
    times, rows = 1 if quick else 3, []
    start = yade.wave_start(folder, times)
    for amplitude, fractions in DEM_STEPS[quick].items():
        for fraction in fractions:
            setting = {"fraction": fraction, "amplitude": amplitude, "duration": duration}
            found, spent = yade.wave(folder, times=times, **setting)
            spent = yade.steps_alone(spent, start)
            rows.append(dem_row("YADE", fraction, network, found, spent))
    return rows


def lammps_rows(network: Network, folder: Path, quick: bool, duration: float) -> Rows:
    """LAMMPS at both amplitudes; seconds include its start, which is short."""
    highest, rows = highest_frequency(network), []
    for amplitude, fractions in DEM_STEPS[quick].items():
        for fraction in fractions:
            step, every = step_and_records(highest, fraction)
            setting = {"duration": duration, "time_step": step, "every": every}
            found, spent = lammps.wave(
                folder, network, amplitude=amplitude, times=1 if quick else 3, **setting
            )
            same = leapfrog(network, motion=Pulse(amplitude), **setting)
            have = replace(same, chain_displacement=found[: len(same.time)])
            rows.append(dem_row("LAMMPS", fraction, network, have, spent))
    return rows


def run(quick: bool, folder: Path) -> Page:
    """All programs that are installed, on one crystal."""
    width, layers, duration = CRYSTAL[quick]
    network = yade.in_yades_order(gallery.fcc(cells=(width, width, layers)))
    path = folder / "crystal.network.h5"
    write_network(path, network)
    rows = chebyshev_rows(network, path, quick, duration)
    rows += leapfrog_rows(network, path, quick, duration, STEPS[quick])
    missing = []
    for name, program, its_rows in (("YADE", yade, yade_rows), ("LAMMPS", lammps, lammps_rows)):
        if program.available():
            rows += its_rows(network, folder, quick, duration)
        else:
            missing.append(f"{name}, which is optional, is not installed here.")
    task = (
        f"FCC crystal of {width} x {width} x {layers} spheres at 100 kPa, pulse of 100 kHz, "
        f"{1e3 * duration:g} ms. YADE and LAMMPS are compared with the wave of the tangent, "
        "pre-stress included; `apart_from_tangent` is the difference from its leapfrog with the "
        "same step, which leaves the contact law's non-linearity. Seconds of YADE are those of "
        "its steps, those of LAMMPS include its short start."
    )
    figure = diagram.work_precision(rows, {"error": "relative error of the signals (-)"})
    return Page(TITLE, task, {"wave": rows}, notes(rows) + missing, {"wave": figure})


def knee(rows: Rows) -> dict[str, Any]:
    """The tightest tolerance of the linear wave that costs hardly more than the loosest."""
    tight = [row for row in rows if row["method"] == "linear, Chebyshev"]
    least = min(row["products"] for row in tight)
    free = [row for row in tight if row["products"] <= LITTLE_MORE * least]
    return min(free, key=lambda row: row["error"])


def at_equal_error(rows: Rows, program: str) -> tuple[float, float]:
    """Seconds of a DEM over those of the linear wave, and the error that both keep.

    The DEM's most accurate run beside the fastest linear one that is at least as accurate.
    """
    dem = [row for row in rows if row["method"].startswith(f"{program}, ")]
    best = min(dem, key=lambda row: row["error"])
    enough = [r for r in rows if r["method"].startswith("linear") and r["error"] <= best["error"]]
    return best["seconds"] / min(row["seconds"] for row in enough), best["error"]


def notes(rows: Rows) -> list[str]:
    """Orders, floors and factors from the rows."""

    def of(name: str) -> Rows:
        return [row for row in rows if row["method"].startswith(name)]

    tight, steps, best = of("linear, Chebyshev"), of("linear, leapfrog"), knee(rows)
    first, last = steps[0], steps[-1]
    order = math.log(first["error"] / last["error"])
    order /= math.log(last["products"] / first["products"])
    said = [
        f"Chebyshev: errors of {tight[0]['error']:.1e} to {tight[-1]['error']:.1e} take "
        f"{tight[0]['products']:.0f} to {tight[-1]['products']:.0f} products.",
        f"Leapfrog: order {order:.2f}, {last['error']:.1e} in {last['seconds']:.3g} s, "
        f"{last['seconds'] / best['seconds']:.2g} times Chebyshev with {best['setting']}.",
    ]
    for program in filter(of, ("YADE", "LAMMPS")):
        times, error = at_equal_error(rows, program)
        apart = [of(f"{program}, 2A = {2e9 * a:g} nm")[-1] for a in DEM_STEPS[False]]
        large, small = (row["apart_from_tangent"] for row in apart)
        said.append(
            f"The linear wave against {program} at equal error, {error:.1e}: {times:.3g} times "
            "faster. A hundredth of the amplitude takes the difference from the tangent of the "
            f"same step from {large:.1e} to {small:.1e}."
        )
    return said
