"""Time step of a wave: the crystal in YADE against theory, a random packing against the exact wave.

In the crystal f_low-pass, V_P and the dispersion curve are read from the chain by the project's
estimator and compared with Eqs. 6, 9 and 10; the signals themselves with the exact chain. The same
estimator on a linear leapfrog of the same time step says where an error comes from. In the packing
the error of the DEM's time step is that of a linear leapfrog with the same step, with no contact
law in the way: single spheres carry waves up to the highest frequencies, means over layers only the
coherent ones, from which velocities are read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from analysis.estimators.damped_transform import chain_dispersion, rms_deviation
from analysis.estimators.layer_lattice import LayerLattice, exact_twin
from benchmarks.harness import diagram, yade
from benchmarks.harness.packing import resized, sample_or_small
from benchmarks.harness.report import Page, Rows
from benchmarks.wave import along_z, leapfrog_rows, linear_twin, relative
from modal.packing import examples as gallery
from modal.packing.network_file import write_network
from modal.waves.signals import Signals
from modal.waves.source import AMPLITUDE

TITLE = "Time step, amplitude and recording of a wave"
WIDTH = 3
"""Spheres a side; a planar wave does not see the width, and three are the least that YADE takes."""
LAYERS = {True: 40, False: 200}
SMALL = 1e-2 * AMPLITUDE
FRACTIONS = {
    True: {AMPLITUDE: (0.8, 0.4, 0.1), SMALL: (0.8, 0.4, 0.1)},
    False: {
        AMPLITUDE: (0.9, 0.5, 0.2, 0.1, 0.05, 0.025),
        SMALL: (0.9, 0.5, 0.2, 0.1),
    },
}
"""Time steps over their limit, for each A of A (1 - cos): the wall moves by 2A = 5 and 0.05 nm."""
INTERVALS = {True: (2e-7, 2e-6), False: (1e-7, 1e-6, 3e-6, 4e-6)}
FRACTION, INTERVAL = 0.1, 5e-7
"""Time step over its limit, and recording interval, s, of the sweeps over something else."""
DECAY = 12.0
"""Damping of the estimator at the end of the record. These records are short and have no noise, for
which the default is made; on exact signals it is then right to 1e-6 from 20 layers up."""
SAME = 1.02
"""Error over the least that counts as unchanged."""
PACKING = {True: (300, 5e-5), False: (9000, 2e-4)}
"""Spheres (the lower part of case 6; with --quick a packing made on the spot), duration, s."""
PACKING_FRACTIONS = {True: (0.9, 0.5, 0.35, 0.2), False: (0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05)}
NON_LINEAR = 0.02
"""The time step needs to be below what the contact law does at the study's amplitude, not far.
Over their records YADE differs from linear by 3.4 % (case 6) and 7.5 % (case 30) in the layers'
means, contacts that slide included; in small samples where none does, by less than 1 %."""
ERRORS = {
    "error_f_low_pass": "error of f_low-pass (-)",
    "error_velocity": "error of V_P (-)",
    "error_dispersion": "RMS error of omega(kappa) (-)",
}
PACKING_ERRORS = {
    "error": "error of single spheres (-)",
    "error_of_layers": "error of the layers' means (-)",
}


def errors(signals: Signals, chain: LayerLattice) -> dict[str, float]:
    """Relative errors of what the estimators say of a record, and of the record itself."""
    found = chain_dispersion(signals, decay=DECAY)
    return {
        "error_f_low_pass": abs(found.low_pass_frequency / chain.low_pass_frequency - 1),
        "error_velocity": abs(found.velocity / chain.velocity - 1),
        "error_dispersion": rms_deviation(found, chain.velocity, chain.low_pass_frequency),
        "error_signals": relative(along_z(signals), exact_twin(signals, chain).chain_displacement),
    }


class Column:
    """A crystal of some length, prepared for YADE; `times` to repeat a short run."""

    def __init__(self, layers: int, folder: Path, times: int) -> None:
        self.layers, self.folder, self.times = layers, folder, times
        self.network = yade.in_yades_order(gallery.fcc(cells=(WIDTH, WIDTH, layers)))
        self.chain = LayerLattice.of_network(self.network)
        yade.prepare_wave(self.network, self.folder)
        self.start = yade.wave_start(self.folder, times)

    def row(
        self, method: str, fraction: float, amplitude: float, interval: float = INTERVAL
    ) -> dict[str, Any]:
        """One YADE run and its errors; seconds are those of the steps."""
        setting = {"fraction": fraction, "amplitude": amplitude, "interval": interval}
        signals, spent = yade.wave(self.folder, times=self.times, **setting)
        tangent = linear_twin(self.network, signals, "full")
        springs = errors(linear_twin(self.network, signals, "none"), self.chain)
        return {
            "method": method,
            "time_step_over_limit": fraction,
            "two_A_nm": 2e9 * amplitude,
            "interval_us": 1e6 * float(signals.time[1]),
            "layers": self.layers,
            **errors(signals, self.chain),
            "dispersion_linear": springs["error_dispersion"],
            "velocity_tangent": errors(tangent, self.chain)["error_velocity"],
            "apart_from_tangent": relative(signals.chain_displacement, tangent.chain_displacement),
            **yade.steps_alone(spent, self.start).cost,
        }


def crystal_rows(quick: bool, folder: Path) -> Rows:
    """Time step at two amplitudes, and recording interval."""
    column, rows = Column(LAYERS[quick], folder, 1 if quick else 3), []
    for amplitude, fractions in FRACTIONS[quick].items():
        name = f"time step, 2A = {2e9 * amplitude:g} nm"
        rows += [column.row(name, fraction, amplitude) for fraction in fractions]
    for each in INTERVALS[quick]:
        rows.append(column.row("recording interval", FRACTION, SMALL, each))
    return rows


def run(quick: bool, folder: Path) -> Page:
    """The crystal in YADE, and the packing."""
    yade.need("time_step")
    spheres, duration = PACKING[quick]
    path = folder / "packing.network.h5"
    network = resized(sample_or_small(spheres, quick, aspect=10.05), spheres)
    write_network(path, network)
    crystal = crystal_rows(quick, folder)
    packing = leapfrog_rows(network, path, quick, duration, PACKING_FRACTIONS[quick])
    task = (
        f"Crystal of {WIDTH} x {WIDTH} x {LAYERS[quick]} spheres at 100 kPa, pulse of 100 kHz; "
        "seconds are those of YADE's steps, without its start. `..._linear` is the error of the "
        "springs' linear leapfrog with the same step (time step), `velocity_tangent` that of the "
        "tangent with pre-stress, `apart_from_tangent` the difference of the signals from the "
        "linear wave of the tangent with the same step (non-linear contact law). Random packing of "
        f"{spheres} spheres without friction, {1e3 * duration:g} ms, springs only: relative L2 "
        "errors over all times."
    )
    return Page(
        TITLE,
        task,
        {"fcc_time_step": crystal, "random_time_step": packing},
        notes(crystal) + packing_notes(packing),
        {
            "fcc_time_step": diagram.work_precision(crystal, ERRORS, ["seconds"]),
            "random_time_step": diagram.work_precision(packing, PACKING_ERRORS, ["seconds"]),
        },
    )


def steps_of(rows: Rows, amplitude: float = AMPLITUDE) -> Rows:
    """Sweep over the time step at one amplitude A, m."""
    return [row for row in rows if row["method"] == f"time step, 2A = {2e9 * amplitude:g} nm"]


def crystal_knee(rows: Rows) -> dict[str, Any] | None:
    """The largest step whose own share of the dispersion's error is below what no step mends.

    That is the error of V_P at the smallest step, from non-linearity and pre-stress, at the
    study's amplitude. None if no step is small enough.
    """
    own = steps_of(rows)
    floor = own[-1]["error_velocity"]
    enough = [row for row in own if row["dispersion_linear"] <= floor]
    return max(enough, key=lambda row: row["time_step_over_limit"]) if enough else None


def packing_knee(rows: Rows, error: str = "error") -> dict[str, Any] | None:
    """The largest step whose error is below the non-linear one, None if there is none."""
    enough = [row for row in rows if row[error] < NON_LINEAR]
    return max(enough, key=lambda row: row["time_step_over_limit"]) if enough else None


def interval_knee(rows: Rows) -> dict[str, Any]:
    """The longest recording interval up to which the error of the dispersion is unchanged."""
    own = [row for row in rows if row["method"] == "recording interval"]
    least = min(row["error_dispersion"] for row in own)
    changed = [row["interval_us"] for row in own if row["error_dispersion"] > SAME * least]
    same = [row for row in own if row["interval_us"] < min(changed, default=np.inf)]
    return max(same or own[:1], key=lambda row: row["interval_us"])


def notes(rows: Rows) -> list[str]:
    """What no step mends."""
    less = steps_of(rows, SMALL)[-1]
    step = less["time_step_over_limit"]
    large = next(row for row in steps_of(rows) if row["time_step_over_limit"] == step)
    return [
        f"Amplitude {large['two_A_nm'] / less['two_A_nm']:.3g} times smaller, {step:g} of the "
        "limit: the difference from the linear wave with the same step goes from "
        f"{large['apart_from_tangent']:.1e} to {less['apart_from_tangent']:.1e} (the contact law's "
        f"non-linearity), the error of V_P from {large['error_velocity']:.1e} to "
        f"{less['error_velocity']:.1e}, where the linear wave with pre-stress, which the theory of "
        f"springs leaves out, has {less['velocity_tangent']:.1e}.",
    ]


def packing_notes(rows: Rows) -> list[str]:
    """The largest step that does for means over layers."""
    best = packing_knee(rows, "error_of_layers")
    step = f"{best['time_step_over_limit']:g} of the limit" if best else "no step tried"
    return [f"Packing, means over layers: error below {NON_LINEAR:g} with {step}."]
