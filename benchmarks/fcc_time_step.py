"""FCC in YADE against theory: time step, amplitude, recording interval and length of the column.

f_low-pass, V_P and the dispersion curve are read from the chain by the project's estimator and
compared with Eqs. 6, 9 and 10; the signals themselves with the exact chain. The same estimator on
the exact signals, and on a linear leapfrog of the same time step, say where an error comes from.
"""

from __future__ import annotations

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
FRACTIONS = {
    True: {2.5e-9: (0.8, 0.4, 0.1), 2.5e-11: (0.8, 0.4, 0.1)},
    False: {
        2.5e-9: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05, 0.025),
        2.5e-10: (0.9, 0.5, 0.2, 0.05),
        2.5e-11: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05),
    },
}
"""Time steps over their limit, for each A of A (1 - cos): the wall moves by 2A = 5 to 0.05 nm."""
INTERVALS = {True: (2e-7, 2e-6), False: (1e-7, 1e-6, 2e-6, 3e-6, 4e-6)}
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
    """Crystals of several lengths, each prepared once for YADE; `times` to repeat a short run."""

    def __init__(self, folder: Path, times: int) -> None:
        self.folder, self.times = folder, times
        self.ready: dict[int, tuple[Network, Chain, float]] = {}

    def __call__(self, layers: int) -> tuple[Path, Network, Chain, float]:
        """Folder, network, exact chain, and processor time of a start, s."""
        folder = self.folder / f"layers{layers}"
        if layers not in self.ready:
            network = yade_job.in_yades_order(gallery.fcc(WIDTH, layers))
            yade_job.prepare_wave(network, folder)
            start = yade_job.wave_start(folder, self.times)
            self.ready[layers] = network, Chain.of_network(network), start
        return folder, *self.ready[layers]


def one(
    columns: Columns, method: str, layers: int, fraction: float, amplitude: float, interval: float
) -> dict[str, Any]:
    """One YADE run and its errors."""
    folder, network, chain, start = columns(layers)
    signals, seconds, peak = yade_job.wave(
        folder, fraction=fraction, amplitude=amplitude, interval=interval, times=columns.times
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
    columns, layers = Columns(folder, 1 if quick else 3), LAYERS[quick]
    fine, interval = FRACTION[quick], 5e-7
    rows = []
    for amplitude, fractions in FRACTIONS[quick].items():
        name = f"time step, 2A = {2e9 * amplitude:g} nm"
        for fraction in fractions:
            rows.append(one(columns, name, layers, fraction, amplitude, interval))
    small = min(FRACTIONS[quick])
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


def default_step(rows: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The largest step whose own share of the dispersion's error is below what no step mends.

    That is the error of V_P at the smallest step, from non-linearity and pre-stress. `rows` are
    those of one amplitude; None if no step is small enough.
    """
    floor = rows[-1]["error_velocity"]
    enough = [row for row in rows if row["dispersion_linear"] <= floor]
    return max(enough, key=lambda row: row["time_step_over_limit"]) if enough else None


def notes(rows: list[dict[str, Any]]) -> list[str]:
    """Knee, order and floor of each amplitude, from the numbers of this run."""
    sweeps: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        sweeps.setdefault(row["method"], []).append(row)
    steps = [own for name, own in sweeps.items() if "time step" in name]
    return [
        *_knee(steps[0]),
        *_floors(steps),
        *_recording(sweeps["recording interval"]),
        *_length([*sweeps["length"], steps[-1][-1]]),
    ]


def _knee(own: list[dict[str, Any]]) -> list[str]:
    """The default of the time step and its reason, at the study's amplitude."""
    best, last = default_step(own), own[-1]
    floor = f"{last['error_velocity']:.1e}"
    if best is None:
        return [f"No step tried has a smaller share of the error than the contact law's {floor}."]
    signals = diagram.knee(own, "error_signals")
    return [
        f"Knee: {best['time_step_over_limit']:g} of the limit, the default of "
        "`yade_scripts/wave.py`. There the time step's own share of the dispersion's error, "
        f"{best['dispersion_linear']:.1e}, is down to what the contact law does to V_P at the "
        f"study's amplitude, {floor}, which no step mends. {last['time_step_over_limit']:g} of the "
        f"limit takes {last['seconds'] / best['seconds']:.2g} times as long; V_P stays at {floor}, "
        f"the dispersion's error goes from {best['error_dispersion']:.1e} to "
        f"{last['error_dispersion']:.1e}.",
        f"The signals at this amplitude stop near {last['error_signals']:.1e}, within a factor of "
        f"two from {signals['time_step_over_limit']:g} of the limit on: non-linear contact law, "
        f"{last['apart_from_tangent']:.1e} from the linear wave with the same step.",
    ]


def _floors(steps: list[list[dict[str, Any]]]) -> list[str]:
    """What is left at the smallest steps: non-linearity, then pre-stress, then the estimator."""
    said, small = [], steps[-1]
    common = min(row["time_step_over_limit"] for row in small)
    fine = [row for own in steps for row in own if row["time_step_over_limit"] == common]
    for large, less in zip(fine, fine[1:], strict=False):
        said.append(
            f"Amplitude {large['two_A_nm'] / less['two_A_nm']:.3g} times smaller (2A = "
            f"{less['two_A_nm']:g} nm), {common:g} of the limit: the difference from the linear "
            f"wave with the same step falls from {large['apart_from_tangent']:.1e} to "
            f"{less['apart_from_tangent']:.1e}, the error of V_P from {large['error_velocity']:.1e}"
            f" to {less['error_velocity']:.1e}: what falls with the amplitude is the non-linear "
            "contact law."
        )
    last = small[-1]
    least = min(small, key=lambda row: row["error_velocity"])
    text = (
        f"V_P at the smallest amplitude stops at {last['error_velocity']:.1e}: pre-stress, which "
        f"the theory of springs leaves out. The linear wave has {last['velocity_tangent']:.1e} "
        f"with it, {last['velocity_linear']:.1e} without."
    )
    if least["error_velocity"] < 0.5 * last["error_velocity"]:
        text += (
            " A large step makes V_P larger, pre-stress makes it smaller: near "
            f"{least['time_step_over_limit']:g} of the limit they cancel "
            f"({least['velocity_linear']:.1e} without pre-stress, {least['velocity_tangent']:.1e} "
            "with it), hence the turn of those curves. It is no better step."
        )
    said.append(text)
    said.append(
        f"Estimator alone, on exact signals at the same times: {last['dispersion_exact']:.1e}; "
        "below that no record can say more."
    )
    return said


def _recording(own: list[dict[str, Any]]) -> list[str]:
    """Up to which interval nothing changes, and what a short one costs."""
    best = min(row["error_dispersion"] for row in own)
    same = [row for row in own if row["error_dispersion"] <= 1.02 * best]
    first, last, longest = same[0], same[-1], own[-1]
    said = (
        f"Recording interval: from {first['interval_us']:.2g} to {last['interval_us']:.2g} us the "
        f"dispersion's error stays at {best:.1e}"
    )
    if last is not longest:
        said += (
            f"; at {longest['interval_us']:.2g} us half the sampling rate is "
            f"{500 / longest['interval_us']:.0f} kHz, below f_low-pass, and the estimator errs by "
            f"{longest['dispersion_exact']:.1e} even on exact signals"
        )
    return [
        f"{said}. {first['interval_us']:.2g} us takes {first['seconds'] / last['seconds']:.2f} "
        f"times the time and {first['peak_mb'] / last['peak_mb']:.2f} times the memory of "
        f"{last['interval_us']:.2g} us; the default of 0.5 us lies between."
    ]


def _length(own: list[dict[str, Any]]) -> list[str]:
    """What the number of layers changes."""
    short, long = own[0], own[-1]
    return [
        f"Length, {short['layers']} to {long['layers']} layers: V_P's error is "
        f"{short['error_velocity']:.1e} and {long['error_velocity']:.1e}, the dispersion's "
        f"{short['error_dispersion']:.1e} and {long['error_dispersion']:.1e}: both belong to the "
        "medium. The signals' grows with the way that they travel, "
        f"{short['error_signals']:.1e} to {long['error_signals']:.1e}; the time with its square."
    ]
