"""Waves through a crystal in YADE and LAMMPS: time step, amplitude and recording interval.

f_low-pass, V_P and the dispersion curve are read from the chain by the project's estimator and
compared with Eqs. 6, 9 and 10. The signals are compared with the converged wave of the law's
tangent, and with its leapfrog of the same time step, which leaves the contact law's non-linearity.
"""

from typing import Any

import numpy as np

from analysis.estimators.damped_transform import chain_dispersion, rms_deviation
from analysis.estimators.layer_lattice import LayerLattice
from benchmarks.harness.lammps import Lammps
from benchmarks.harness.measure import Measured
from benchmarks.harness.report import Rows
from benchmarks.harness.yade import Yade, in_yades_order
from modal.packing import crystal as gallery
from modal.packing.network import Network
from modal.packing.state import affine_velocity
from modal.waves.motions import AMPLITUDE, RECORDING_INTERVAL, Pulse
from modal.waves.propagate import propagate
from modal.waves.signals import Signals

WIDTH = 3
"""Spheres a side; a planar wave does not see the width, and three are the least that YADE takes."""
LAYERS = {True: 40, False: 200}
SMALL = 1e-2 * AMPLITUDE
FRACTIONS = {
    True: {AMPLITUDE: (0.5, 0.1), SMALL: (0.5, 0.1)},
    False: {AMPLITUDE: (0.9, 0.5, 0.2, 0.1, 0.05, 0.025), SMALL: (0.9, 0.5, 0.2, 0.1, 0.025)},
}
"""Time steps over their limit, for each A of A (1 - cos): the wall moves by 2A = 5 and 0.05 nm."""
INTERVALS = {True: (2e-7, 2e-6), False: (1e-7, 1e-6, 3e-6, 4e-6)}
RECORDING = "recording interval"
FRACTION = 0.1
"""Time step over its limit, of the sweeps over something else."""
REFERENCE = 1e-13
"""Tolerance of the wave that the others are compared with."""
DECAY = 12.0
"""Damping of the estimator at the end of the record. These records are short and have no noise, for
which the default is made; on exact signals it is then right to 1e-6 from 20 layers up."""
MAX_UNCHANGED_RATIO = 1.02
"""Error divided by the least one up to which it counts as unchanged."""
ERRORS = {
    "error_f_low_pass": "error of f_low-pass (-)",
    "error_velocity": "error of V_P (-)",
    "error_dispersion": "RMS error of omega(kappa) (-)",
}


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Return the relative L2 difference of a from b at the times that both have."""
    count = min(len(a), len(b))
    a = a[:count]
    b = b[:count]
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def compare_chains(signals: Signals, expected: Signals) -> float:
    """Return the relative L2 difference of chains of a crystal, which all carry one wave."""
    order = np.argsort(signals.chain_position)
    expected_order = np.argsort(expected.chain_position)
    return relative(
        signals.chain_displacement[:, order], expected.chain_displacement[:, expected_order]
    )


def errors(signals: Signals, lattice: LayerLattice) -> dict[str, float]:
    """Return the relative errors of what the estimator measures in a record."""
    dispersion = chain_dispersion(signals, decay=DECAY)
    return {
        "error_f_low_pass": abs(dispersion.low_pass_frequency / lattice.low_pass_frequency - 1),
        "error_velocity": abs(dispersion.velocity / lattice.velocity - 1),
        "error_dispersion": rms_deviation(dispersion, lattice.velocity, lattice.low_pass_frequency),
    }


def linear_wave(
    network: Network, signals: Signals, pre_stress: str, tolerance: float | None = None
) -> Signals:
    """Return the linear wave with the pulse and the records of a run.

    It is integrated with the time step of the run, or to a tolerance if one is given.
    """
    step = signals.time_step
    interval = step * round(float(signals.time[1]) / step)
    scheme = {"time_step": step} if tolerance is None else {"tolerance": tolerance}
    return propagate(
        network,
        interval * (len(signals.time) - 1),
        interval=interval,
        motion=Pulse(signals.amplitude, signals.input_frequency),
        pre_stress=pre_stress,
        **scheme,
    ).signals


class Crystal:
    """An FCC crystal at 100 kPa, 3 x 3 x `layers`, and the wave that crosses it once."""

    def __init__(self, layers: int) -> None:
        self.network = in_yades_order(gallery.fcc(cells=(WIDTH, WIDTH, layers)))
        self.lattice = LayerLattice.of_network(self.network)
        self.duration = self.network.length / affine_velocity(self.network)

    def rows(self, program: Yade | Lammps, quick: bool) -> Rows:
        """Return a row for each time step and amplitude, and for each interval of YADE."""
        runs = []
        for amplitude, fractions in FRACTIONS[quick].items():
            method = name_sweep(program.name, amplitude)
            runs += [(method, fraction, amplitude, RECORDING_INTERVAL) for fraction in fractions]
        if isinstance(program, Yade):
            runs += [(RECORDING, FRACTION, SMALL, interval) for interval in INTERVALS[quick]]
        rows = []
        for method, fraction, amplitude, interval in runs:
            signals, cost = program.wave(
                fraction=fraction,
                amplitude=amplitude,
                duration=self.duration,
                interval=interval,
            )
            rows.append(self.row(method, fraction, signals, cost))
        return rows

    def row(self, method: str, fraction: float, signals: Signals, cost: Measured) -> dict[str, Any]:
        """Return the errors of a run's signals, and of the linear waves with its step.

        `dispersion_linear` is the error of the springs' leapfrog with this step, thus of the step;
        `velocity_tangent` that of V_P with pre-stress, which the theory of springs leaves out.
        """
        tangent = linear_wave(self.network, signals, "full")
        springs = linear_wave(self.network, signals, "none")
        converged = linear_wave(self.network, signals, "full", tolerance=REFERENCE)
        return {
            "method": method,
            "setting": f"{fraction:g} of the limit",
            "error": compare_chains(signals, converged),
            **cost.cost,
            "apart_from_tangent": compare_chains(signals, tangent),
            **errors(signals, self.lattice),
            "dispersion_linear": errors(springs, self.lattice)["error_dispersion"],
            "velocity_tangent": errors(tangent, self.lattice)["error_velocity"],
            "time_step_over_limit": fraction,
            "two_A_nm": 2e9 * signals.amplitude,
            "interval_us": 1e6 * float(signals.time[1]),
        }


def name_sweep(program: str, amplitude: float) -> str:
    """Return the column `method` of a program's sweep of the time step at an amplitude A, m."""
    return f"{program}, 2A = {2e9 * amplitude:g} nm"


def steps_of(rows: Rows, amplitude: float = AMPLITUDE, program: str = "YADE") -> Rows:
    """Return the rows of a program's sweep of the time step at an amplitude, m."""
    method = name_sweep(program, amplitude)
    return [row for row in rows if row["method"] == method]


def step_knee(rows: Rows) -> dict[str, Any] | None:
    """Return the row of the largest step whose share of the error is below what no step mends.

    The share is that of the dispersion's error; what no step mends is the error of V_P at the
    smallest step, from non-linearity and pre-stress, at the study's amplitude. None if no step is
    small enough.
    """
    sweep = steps_of(rows)
    floor = sweep[-1]["error_velocity"]
    accurate = [row for row in sweep if row["dispersion_linear"] <= floor]
    return max(accurate, key=lambda row: row["time_step_over_limit"], default=None)


def interval_knee(rows: Rows) -> dict[str, Any]:
    """Return the row of the longest interval up to which the dispersion's error is unchanged."""
    sweep = [row for row in rows if row["method"] == RECORDING]
    least = min(row["error_dispersion"] for row in sweep)
    changed = [
        row["interval_us"] for row in sweep if row["error_dispersion"] > MAX_UNCHANGED_RATIO * least
    ]
    unchanged = [row for row in sweep if row["interval_us"] < min(changed, default=np.inf)]
    return max(unchanged or sweep[:1], key=lambda row: row["interval_us"])


def at_equal_error(rows: Rows, program: str) -> tuple[float, float]:
    """Return the seconds of a DEM divided by those of the linear wave, and the error of both.

    The DEM's most accurate run is compared with the fastest linear one that is as accurate.
    """
    dem_rows = [row for row in rows if row["method"].startswith(f"{program}, ")]
    best = min(dem_rows, key=lambda row: row["error"])
    linear_rows = [row for row in rows if row["method"].startswith("linear")]
    seconds = [row["seconds"] for row in linear_rows if row["error"] <= best["error"]]
    return best["seconds"] / min(seconds), best["error"]


def notes(rows: Rows) -> list[str]:
    """Return a line for each program: its time against the linear wave, and remaining errors."""
    lines = []
    for program in ("YADE", "LAMMPS"):
        last_steps = zip(
            steps_of(rows, AMPLITUDE, program)[-1:],
            steps_of(rows, SMALL, program)[-1:],
            strict=True,
        )
        for large, small in last_steps:
            times, error = at_equal_error(rows, program)
            lines.append(
                f"The linear wave against {program} at equal error, {error:.1e}: {times:.3g} times "
                f"faster. 2A of {large['two_A_nm']:g} and {small['two_A_nm']:g} nm: the difference "
                f"from the tangent with the same step is {large['apart_from_tangent']:.1e} and "
                f"{small['apart_from_tangent']:.1e}, the error of V_P "
                f"{large['error_velocity']:.1e} and {small['error_velocity']:.1e}, that of the "
                f"tangent {small['velocity_tangent']:.1e}."
            )
    return lines
