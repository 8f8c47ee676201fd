"""The same wave by the linear solver, by leapfrog, by YADE and by LAMMPS: run time against error.

The error is the relative L2 difference of all chain displacements from the converged linear wave.
YADE and LAMMPS have the non-linear contact law: they run at two amplitudes, the larger one that of
the study, and their difference from a linear leapfrog with the same step is given as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
from modal.waves.source import AMPLITUDE, INPUT_FREQUENCY, Pulse

TITLE = "The same wave by linear propagation, leapfrog, YADE and LAMMPS"
CRYSTAL = {True: (3, 40, 8e-5), False: (3, 200, 3.7e-4)}
"""Spheres a side, layers, duration, s."""
TOLERANCES = {True: (1e-1, 1e-5, 1e-9), False: (1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12)}
STEPS = {True: (0.5, 0.1), False: (0.9, 0.5, 0.2, 0.1, 0.05, 0.02)}
"""Time steps of the leapfrog over the limit 2 / omega_max."""
DEM_STEPS = {True: (0.5, 0.1), False: (0.5, 0.2, 0.1, 0.05)}
AMPLITUDES = (AMPLITUDE, 1e-2 * AMPLITUDE)
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


def by_layers(displacement: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Columns along z: every chain of the crystal carries the same wave, layer by layer."""
    return displacement[:, np.argsort(position)]


def linear(network: Network, duration: float, interval: float, tolerance: float) -> np.ndarray:
    """Linear wave for unit amplitude, (nt, nc), along z."""
    found = propagate(
        network, duration, motion=Pulse(1.0), interval=interval, tolerance=tolerance
    ).signals
    return by_layers(found.chain_displacement, found.chain_position)


def stepped(
    network: Network, duration: float, time_step: float, every: int, pre_stress: str = "none"
) -> np.ndarray:
    """Leapfrog for unit amplitude, (nt, nc), along z."""
    wave = leapfrog(
        network, duration, time_step, motion=Pulse(1.0), every=every, pre_stress=pre_stress
    )
    return by_layers(wave.chain_displacement, wave.chain_position)


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


def step_and_records(highest: float, fraction: float) -> tuple[float, int]:
    """Time step, s, that divides the pulse, at most `fraction` of its limit; steps a record."""
    steps = math.ceil(math.pi * highest / (fraction * INPUT_FREQUENCY))
    return 1 / (INPUT_FREQUENCY * steps), max(1, steps // 20)


def row(method: str, setting: str, error: float, spent: Measured, **more: Any) -> dict[str, Any]:
    """One line of the table; the value of a linear task is its number of products."""
    what = {"method": method, "setting": setting, "products": spent.value, "error": error}
    return what | spent.cost | more


def linear_rows(network: Network, path: Path, quick: bool, duration: float) -> Rows:
    """Chebyshev tolerances and leapfrog steps."""
    same: dict[str, Any] = {"times": 1 if quick else 3, "path": str(path), "duration": duration}
    exact, rows = linear(network, duration, INTERVAL, REFERENCE), []
    for tolerance in TOLERANCES[quick]:
        spent = measured("benchmarks.wave:chebyshev_task", **same, tolerance=tolerance)
        error = relative(linear(network, duration, INTERVAL, tolerance), exact)
        rows.append(row("linear, Chebyshev", f"tolerance {tolerance:g}", error, spent))
    highest = highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1]
    for fraction in STEPS[quick]:
        step, every = step_and_records(highest, fraction)
        spent = measured("benchmarks.wave:leapfrog_task", **same, time_step=step, every=every)
        reference = linear(network, duration, step * every, REFERENCE)
        error = relative(stepped(network, duration, step, every), reference)
        rows.append(row("linear, leapfrog", f"{fraction:g} of the limit", error, spent))
    return rows


def dem_row(
    program: str,
    amplitude: float,
    fraction: float,
    have: np.ndarray,
    step: tuple[Network, float, float, int],
    spent: Measured,
) -> dict[str, Any]:
    """A DEM wave (nt, nc) against the converged one and the tangent's of the same time step.

    step: network, duration and time step, s, steps a record.
    """
    network, duration, time_step, every = step
    have = have / amplitude
    exact = linear(network, duration, time_step * every, REFERENCE)
    return row(
        f"{program}, 2A = {2e9 * amplitude:g} nm",
        f"{fraction:g} of the limit",
        relative(have, exact),
        spent,
        apart_from_tangent=relative(have, stepped(*step, "full")),
    )


def yade_rows(network: Network, folder: Path, quick: bool, duration: float) -> Rows:
    """YADE at both amplitudes; seconds are those of the steps."""
    yade.prepare_wave(network, folder)
    times, rows = 1 if quick else 3, []
    start = yade.wave_start(folder, times)
    for amplitude in AMPLITUDES:
        for fraction in DEM_STEPS[quick]:
            found, spent = yade.wave(
                folder, fraction=fraction, amplitude=amplitude, duration=duration, times=times
            )
            have = by_layers(found.chain_displacement, found.chain_position)
            every = round(float(found.time[1]) / found.time_step)
            step = network, float(found.time[-1]), found.time_step, every
            spent = yade.steps_alone(spent, start)
            rows.append(dem_row("YADE", amplitude, fraction, have, step, spent))
    return rows


def lammps_rows(network: Network, folder: Path, quick: bool, duration: float) -> Rows:
    """LAMMPS at both amplitudes; seconds include its start, which is short."""
    highest, rows = highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1], []
    for amplitude in AMPLITUDES:
        for fraction in DEM_STEPS[quick]:
            time_step, every = step_and_records(highest, fraction)
            motion, spent = lammps.wave(
                folder,
                network,
                amplitude=amplitude,
                time_step=time_step,
                duration=duration,
                every=every,
                times=1 if quick else 3,
            )
            step = network, duration, time_step, every
            rows.append(dem_row("LAMMPS", amplitude, fraction, motion, step, spent))
    return rows


def run(quick: bool, folder: Path) -> Page:
    """All programs that are installed, on one crystal."""
    width, layers, duration = CRYSTAL[quick]
    network = yade.in_yades_order(gallery.fcc(cells=(width, width, layers)))
    path = folder / "crystal.network.h5"
    write_network(path, network)
    rows = linear_rows(network, path, quick, duration)
    missing = []
    for name, program, its_rows in (("YADE", yade, yade_rows), ("LAMMPS", lammps, lammps_rows)):
        if program.available():
            rows += its_rows(network, folder, quick, duration)
        else:
            missing.append(f"{name}, which is optional, is not installed here.")
    task = (
        f"FCC crystal of {width} x {width} x {layers} spheres at 100 kPa, pulse of 100 kHz, "
        f"{1e3 * duration:g} ms. `apart_from_tangent` is the difference from a linear leapfrog "
        "with the same step and pre-stress, which leaves the contact law's non-linearity. Seconds "
        "of YADE are those of its steps, those of LAMMPS include its short start."
    )
    figure = diagram.work_precision(rows, {"error": "relative error of the signals (-)"})
    return Page(TITLE, task, {"wave": rows}, notes(rows) + missing, {"wave": figure})


def knee(rows: Rows) -> dict[str, Any]:
    """The tightest tolerance of the linear wave that costs hardly more than the loosest."""
    tight = [row for row in rows if row["method"] == "linear, Chebyshev"]
    least = min(row["products"] for row in tight)
    free = [row for row in tight if row["products"] <= LITTLE_MORE * least]
    return min(free, key=lambda row: row["error"])


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
        large, small = (of(f"{program}, 2A = {2e9 * a:g} nm")[-1] for a in AMPLITUDES)
        said.append(
            f"{program} at its smallest step: {large['error']:.1e} in {large['seconds']:.3g} s, "
            f"{large['seconds'] / best['seconds']:.0f} times Chebyshev. A hundredth of the "
            "amplitude takes the difference from the tangent of the same step from "
            f"{large['apart_from_tangent']:.1e} to {small['apart_from_tangent']:.1e}."
        )
    return said
