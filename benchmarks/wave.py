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

from benchmarks import diagram, lammps_job, yade_job
from benchmarks.measure import Measured, measured
from benchmarks.report import Finding
from modal import gallery
from modal.eigenproblem import Eigenproblem
from modal.leapfrog import leapfrog
from modal.modes import highest_modes
from modal.network import Network, read_network, write_network
from modal.source import AMPLITUDE, INPUT_FREQUENCY, Pulse
from modal.wave import propagate

TITLE = "The same wave by linear propagation, leapfrog, YADE and LAMMPS"
CRYSTAL = {True: (3, 40, 8e-5), False: (4, 200, 3.7e-4)}
"""Spheres a side, layers, duration, s."""
TOLERANCES = {True: (1e-1, 1e-5, 1e-9), False: (1e-1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 1e-12)}
STEPS = {True: (0.5, 0.1), False: (0.9, 0.5, 0.2, 0.1, 0.05, 0.02)}
"""Time steps of the leapfrog over the limit 2 / omega_max."""
DEM_STEPS = {True: (0.5, 0.1), False: (0.5, 0.2, 0.1, 0.05)}
AMPLITUDES = (AMPLITUDE, 1e-2 * AMPLITUDE)
INTERVAL = 1e-6
DEFAULT = 1e-9
"""Tolerance of `modal wave` that nobody has asked for."""
REFERENCE = 1e-14
"""Tolerance of the wave that the others are compared with."""


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 difference of a from b at the times that both have."""
    count = min(len(a), len(b))
    a, b = a[:count], b[:count]
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def by_layers(displacement: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Columns along z: every chain of the crystal carries the same wave, layer by layer."""
    return displacement[:, np.argsort(position)]


def exact(network: Network, duration: float, interval: float) -> np.ndarray:
    """Converged linear wave for unit amplitude, (nt, nc), along z."""
    wave = propagate(
        network, duration, motion=Pulse(1.0), interval=interval, tolerance=REFERENCE
    ).signals
    return by_layers(wave.chain_displacement, wave.chain_position)


def chebyshev(path: str, duration: float, tolerance: float) -> Callable[[], dict[str, Any]]:
    """Task: the linear wave; its error is found afterwards and not part of the time."""
    network = read_network(path)
    propagate(network, 1e-5, interval=INTERVAL)  # compiles the loop
    return lambda: propagate(network, duration, interval=INTERVAL, tolerance=tolerance).products


def stepped(path: str, duration: float, time_step: float, every: int) -> Callable[[], None]:
    """Task: the linear leapfrog."""
    network = read_network(path)
    leapfrog(network, 10 * time_step, time_step)  # compiles the loop
    return lambda: leapfrog(network, duration, time_step, every=every).run_time


def leapfrog_wave(
    network: Network, duration: float, time_step: float, every: int, pre_stress: str = "none"
) -> np.ndarray:
    """Leapfrog for unit amplitude, (nt, nc), along z."""
    wave = leapfrog(
        network, duration, time_step, motion=Pulse(1.0), every=every, pre_stress=pre_stress
    )
    return by_layers(wave.chain_displacement, wave.chain_position)


def dem_errors(
    have: np.ndarray, network: Network, duration: float, time_step: float, every: int
) -> dict[str, float]:
    """A DEM wave of unit amplitude against the converged one and two of the same time step."""
    step = (network, duration, time_step, every)
    return {
        "error": relative(have, exact(network, duration, time_step * every)),
        "apart_from_same_step": relative(have, leapfrog_wave(*step)),
        "apart_from_tangent": relative(have, leapfrog_wave(*step, "full")),
    }


def step_and_records(highest: float, fraction: float) -> tuple[float, int]:
    """Time step, s, that divides the pulse, at most `fraction` of its limit; steps a record."""
    steps = math.ceil(math.pi * highest / (fraction * INPUT_FREQUENCY))
    return 1 / (INPUT_FREQUENCY * steps), max(1, steps // 20)


def cost(task: str, path: Path, duration: float, times: int = 1, **setting: Any) -> Measured:
    """What one of the tasks above costs."""
    return measured(
        f"benchmarks.wave:{task}", times=times, path=str(path), duration=duration, **setting
    )


def linear_row(
    method: str, setting: str, products: int, error: float, spent: Measured
) -> dict[str, Any]:
    """One line of the table without a contact law."""
    return {
        "method": method,
        "setting": setting,
        "products": products,
        "error": error,
        "seconds": spent.seconds,
        "peak_mb": spent.peak_mb,
    }


def linear_rows(network: Network, path: Path, quick: bool, duration: float) -> list[dict[str, Any]]:
    """Chebyshev tolerances and leapfrog steps."""
    times, rows = 1 if quick else 3, []
    reference = exact(network, duration, INTERVAL)
    for tolerance in TOLERANCES[quick]:
        spent = cost("chebyshev", path, duration, times, tolerance=tolerance)
        found = propagate(
            network, duration, motion=Pulse(1.0), interval=INTERVAL, tolerance=tolerance
        ).signals
        error = relative(by_layers(found.chain_displacement, found.chain_position), reference)
        setting = f"tolerance {tolerance:g}"
        rows.append(linear_row("linear, Chebyshev", setting, spent.value, error, spent))
    highest = highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1]
    for fraction in STEPS[quick]:
        step, every = step_and_records(highest, fraction)
        spent = cost("stepped", path, duration, times, time_step=step, every=every)
        have = leapfrog_wave(network, duration, step, every)
        error = relative(have, exact(network, duration, step * every))
        products, setting = round(duration / step) + 1, f"{fraction:g} of the limit"
        rows.append(linear_row("linear, leapfrog", setting, products, error, spent))
    return rows


def yade_rows(network: Network, folder: Path, quick: bool, duration: float) -> list[dict[str, Any]]:
    """YADE at both amplitudes; seconds are those of the steps."""
    yade_job.prepare_wave(network, folder)
    times = 1 if quick else 3
    start = yade_job.wave_start(folder, times)
    rows = []
    for amplitude in AMPLITUDES:
        for fraction in DEM_STEPS[quick]:
            signals, seconds, peak = yade_job.wave(
                folder,
                fraction=fraction,
                amplitude=amplitude,
                duration=duration,
                times=times,
            )
            have = by_layers(signals.chain_displacement, signals.chain_position) / amplitude
            last = float(signals.time[-1])
            every = round(float(signals.time[1]) / signals.time_step)
            rows.append(
                {
                    "method": f"YADE, 2A = {2e9 * amplitude:g} nm",
                    "setting": f"{fraction:g} of the limit",
                    **dem_errors(have, network, last, signals.time_step, every),
                    "seconds": max(seconds - start, 1e-2),
                    "peak_mb": peak,
                }
            )
    return rows


def lammps_rows(
    network: Network, folder: Path, quick: bool, duration: float
) -> list[dict[str, Any]]:
    """LAMMPS at both amplitudes; seconds include its start, which is short."""
    highest = highest_modes(Eigenproblem.of(network), 1, certify=False).frequency[-1]
    rows = []
    for amplitude in AMPLITUDES:
        for fraction in DEM_STEPS[quick]:
            step, every = step_and_records(highest, fraction)
            motion, seconds, peak = lammps_job.wave(
                folder,
                network,
                amplitude=amplitude,
                time_step=step,
                duration=duration,
                every=every,
                times=1 if quick else 3,
            )
            rows.append(
                {
                    "method": f"LAMMPS, 2A = {2e9 * amplitude:g} nm",
                    "setting": f"{fraction:g} of the limit",
                    **dem_errors(motion / amplitude, network, duration, step, every),
                    "seconds": seconds,
                    "peak_mb": peak,
                }
            )
    return rows


def run(quick: bool, folder: Path) -> Finding:
    """All programs that are installed, on one crystal."""
    width, layers, duration = CRYSTAL[quick]
    network = yade_job.in_yades_order(gallery.fcc(width, layers))
    path = folder / "crystal.network.h5"
    write_network(path, network)
    rows = linear_rows(network, path, quick, duration)
    if yade_job.available():
        rows += yade_rows(network, folder, quick, duration)
    if lammps_job.available():
        rows += lammps_rows(network, folder, quick, duration)
    task = (
        f"FCC crystal of {width} x {width} x {layers} spheres at 100 kPa, pulse of 100 kHz, "
        f"{1e3 * duration:g} ms. `apart_from_same_step` is the difference from a linear leapfrog "
        "with the same step, `apart_from_tangent` from one whose springs carry the pre-stress. "
        "Seconds of YADE are those of its steps, those of LAMMPS include its short start."
    )
    figure = diagram.work_precision(rows, {"error": "relative error of the signals (-)"})
    return Finding(TITLE, task, rows, notes(rows), {"wave": figure})


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Orders, floors and factors from the numbers of this run."""

    def of(name: str) -> list[dict[str, Any]]:
        return [row for row in rows if row["method"].startswith(name)]

    tight = of("linear, Chebyshev")
    best = next(row for row in tight if row["setting"] == f"tolerance {DEFAULT:g}")
    first, last = of("linear, leapfrog")[0], of("linear, leapfrog")[-1]
    order = math.log(first["error"] / last["error"]) / math.log(
        last["products"] / first["products"]
    )
    said = [
        f"Chebyshev: {best['error']:.1e} in {best['seconds']:.3g} s with {best['products']} "
        f"products; leapfrog: order {order:.2f}, {last['error']:.1e} in {last['seconds']:.3g} s.",
        f"Chebyshev has no knee: errors of {tight[0]['error']:.1e} to {tight[-1]['error']:.1e} "
        f"take {tight[0]['products']} to {tight[-1]['products']} products. The default, "
        f"{best['setting']}, is far below every other error here and costs next to nothing.",
    ]
    for program in ("YADE", "LAMMPS"):
        large, small = (of(f"{program}, 2A = {2e9 * amplitude:g} nm") for amplitude in AMPLITUDES)
        if not large:
            said.append(f"{program} is not installed here.")
            continue
        said.append(
            f"{program} at its smallest step: {large[-1]['error']:.1e} in "
            f"{large[-1]['seconds']:.3g} s, {large[-1]['seconds'] / best['seconds']:.0f} times "
            f"Chebyshev. From the linear leapfrog with the same step it differs by "
            f"{large[-1]['apart_from_same_step']:.1e}, with a hundredth of the amplitude by "
            f"{small[-1]['apart_from_same_step']:.1e}: what falls is the non-linear contact law, "
            "the floor at the study's amplitude. Most of the rest is pre-stress: with it in the "
            f"leapfrog {small[-1]['apart_from_tangent']:.1e} remains, "
            f"{large[-1]['apart_from_tangent'] / small[-1]['apart_from_tangent']:.0f} times less "
            "than at the study's amplitude."
        )
    return said
