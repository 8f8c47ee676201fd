"""FCC in YADE against theory: time step, amplitude, recording interval and length of the column.

f_low-pass, V_P and the dispersion curve are read from the chain by the project's estimator and
compared with Eqs. 6, 9 and 10; the signals themselves with the exact chain. The same estimator on
the exact signals, and on a linear leapfrog of the same time step, say where an error comes from.
"""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

import numpy as np

from analysis.dispersion import chain_dispersion, rms_deviation
from analysis.exact_chain import Chain, exact_twin
from benchmarks import diagram, yade_job
from benchmarks.report import Finding
from modal import gallery
from modal.leapfrog import leapfrog
from modal.network import Network
from modal.signals import Signals
from modal.source import Pulse

TITLE = "FCC waves in YADE against theory: time step, amplitude, recording, length"
WIDTH = 3
"""Spheres a side; a planar wave does not see the width, and three are the least that YADE takes."""
LAYERS = {True: 40, False: 200}
FRACTIONS = {True: (0.8, 0.4, 0.1), False: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05)}
AMPLITUDES = {True: (2.5e-9, 2.5e-11), False: (2.5e-9, 2.5e-10, 2.5e-11)}
"""A of A (1 - cos): the wall moves by 2A = 5, 0.5 and 0.05 nm."""
INTERVALS = {True: (2e-6,), False: (1e-7, 1e-6, 2e-6, 3e-6, 4e-6)}
LENGTHS = {True: (20,), False: (40, 80, 120)}
FRACTION = {True: 0.1, False: 0.05}
"""Time step of the sweeps over something else."""
DECAY = 12.0
"""Damping of the estimator at the end of the record. These records are short and have no noise, for
which the default is made; on exact signals it is then right to 1e-6 from 20 layers up."""
ERRORS = {
    "error_f_low_pass": "error of f_low-pass (-)",
    "error_velocity": "error of V_P (-)",
    "error_dispersion": "RMS error of omega(kappa) (-)",
}


def errors(signals: Signals, chain: Chain) -> dict[str, float]:
    """Relative errors of what the estimators say of a record, and of the record itself."""
    found = chain_dispersion(signals, decay=DECAY)
    exact = exact_twin(signals, chain).chain_displacement
    upwards = np.argsort(signals.chain_position)
    apart = np.linalg.norm(signals.chain_displacement[:, upwards] - exact)
    return {
        "error_f_low_pass": abs(found.low_pass_frequency / chain.low_pass_frequency - 1),
        "error_velocity": abs(found.velocity / chain.velocity - 1),
        "error_dispersion": rms_deviation(found, chain.velocity, chain.low_pass_frequency),
        "error_signals": float(apart / np.linalg.norm(exact)),
    }


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


class Columns:
    """Crystals of several lengths, each prepared once for YADE."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.ready: dict[int, tuple[Network, Chain, float]] = {}

    def __call__(self, layers: int) -> tuple[Path, Network, Chain, float]:
        """Folder, network, exact chain, and processor time of a start, s."""
        folder = self.folder / f"layers{layers}"
        if layers not in self.ready:
            network = yade_job.in_yades_order(gallery.fcc(WIDTH, layers))
            yade_job.prepare_wave(network, folder)
            starts = [yade_job.wave_start(folder)[0] for _ in range(3)]
            self.ready[layers] = network, Chain.of_network(network), statistics.median(starts)
        return folder, *self.ready[layers]


def one(
    columns: Columns, method: str, layers: int, fraction: float, amplitude: float, interval: float
) -> dict[str, Any]:
    """One YADE run and its errors."""
    folder, network, chain, start = columns(layers)
    signals, seconds, peak = yade_job.wave(
        folder, fraction=fraction, amplitude=amplitude, interval=interval
    )
    tangent = linear_twin(network, signals, "full")
    springs = linear_twin(network, signals, "none")
    count = min(len(tangent.time), len(signals.time))
    rest = (signals.chain_displacement - tangent.chain_displacement[:count])[:count]
    return {
        "method": method,
        "time_step_over_limit": fraction,
        "two_A_nm": 2e9 * amplitude,
        "interval_us": 1e6 * float(signals.time[1]),
        "layers": layers,
        **errors(signals, chain),
        "dispersion_linear": errors(springs, chain)["error_dispersion"],
        "velocity_linear": errors(springs, chain)["error_velocity"],
        "velocity_tangent": errors(tangent, chain)["error_velocity"],
        "dispersion_exact": errors(exact_twin(signals, chain), chain)["error_dispersion"],
        "apart_from_tangent": float(
            np.linalg.norm(rest) / np.linalg.norm(tangent.chain_displacement)
        ),
        "seconds": max(seconds - start, 1e-2),
        "peak_mb": peak,
    }


def run(quick: bool, folder: Path) -> Finding:
    """All four sweeps."""
    columns, layers, small = Columns(folder), LAYERS[quick], AMPLITUDES[quick][-1]
    fine, interval = FRACTION[quick], 5e-7
    rows = []
    for amplitude in AMPLITUDES[quick]:
        name = f"time step, 2A = {2e9 * amplitude:g} nm"
        for fraction in FRACTIONS[quick]:
            rows.append(one(columns, name, layers, fraction, amplitude, interval))
    for each in INTERVALS[quick]:
        rows.append(one(columns, "recording interval", layers, fine, small, each))
    for each in LENGTHS[quick]:
        rows.append(one(columns, "length", each, fine, small, interval))
    task = (
        f"Crystal of {WIDTH} x {WIDTH} x {layers} spheres at 100 kPa, pulse of 100 kHz. Seconds "
        "are those of the steps, without YADE's start. The evidence for where an error comes from: "
        "`..._linear` is the error of the springs' linear leapfrog with the same step (time step), "
        "`velocity_tangent` that of the tangent with pre-stress, `dispersion_exact` that of the "
        "estimator on exact signals, `apart_from_tangent` the difference of the signals from the "
        "linear wave of the tangent with the same step (non-linear contact law)."
    )
    figure = diagram.work_precision(rows, ERRORS)
    return Finding(TITLE, task, rows, notes(rows), {"fcc_time_step": figure})


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Order, floor and knee of each amplitude, from the numbers of this run."""
    said = []
    sweeps = [name for name in dict.fromkeys(r["method"] for r in rows) if "time step" in name]
    for name in sweeps:
        own = [row for row in rows if row["method"] == name]
        best = diagram.knee(own, "error_dispersion")
        signal = diagram.knee(own, "error_signals")
        said.append(
            f"{name}: the dispersion's error falls to {min(r['error_dispersion'] for r in own):.1e}"
            f"; knee at {best['time_step_over_limit']:g} of the limit for the dispersion "
            f"({best['error_dispersion']:.1e}), at {signal['time_step_over_limit']:g} for the "
            f"signals ({signal['error_signals']:.1e})."
        )
    fine = [[row for row in rows if row["method"] == name][-1] for name in sweeps]
    for large, small in zip(fine, fine[1:], strict=False):
        said.append(
            f"Amplitude {large['two_A_nm'] / small['two_A_nm']:.3g} times smaller (2A = "
            f"{small['two_A_nm']:g} nm): the difference from the linear wave with the same step "
            f"falls from {large['apart_from_tangent']:.1e} to {small['apart_from_tangent']:.1e}, "
            f"the error of V_P from {large['error_velocity']:.1e} to {small['error_velocity']:.1e}"
            ": what falls with the amplitude is the non-linear contact law."
        )
    last = fine[-1]
    said.append(
        f"V_P at the smallest amplitude stops at {last['error_velocity']:.1e} whatever the step: "
        f"pre-stress, which the theory of springs leaves out. The linear wave has "
        f"{last['velocity_tangent']:.1e} with it, {last['velocity_linear']:.1e} without."
    )
    said.append(
        f"Estimator alone, on exact signals at the same times: {last['dispersion_exact']:.1e}; "
        "below that no record can say more."
    )
    return said
