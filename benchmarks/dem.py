"""The wave through a crystal in YADE and LAMMPS: time step, amplitude and recording.

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
SAME = 1.02
"""Error over the least that counts as unchanged."""
ERRORS = {
    "error_f_low_pass": "error of f_low-pass (-)",
    "error_velocity": "error of V_P (-)",
    "error_dispersion": "RMS error of omega(kappa) (-)",
}


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """Relative L2 difference of a from b at the times that both have."""
    count = min(len(a), len(b))
    a, b = a[:count], b[:count]
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def apart(a: Signals, b: Signals) -> float:
    """`relative`, layer by layer: every chain of a crystal carries the same wave."""
    one, other = (s.chain_displacement[:, np.argsort(s.chain_position)] for s in (a, b))
    return relative(one, other)


def errors(signals: Signals, lattice: LayerLattice) -> dict[str, float]:
    """Relative errors of what the estimator says of a record."""
    found = chain_dispersion(signals, decay=DECAY)
    return {
        "error_f_low_pass": abs(found.low_pass_frequency / lattice.low_pass_frequency - 1),
        "error_velocity": abs(found.velocity / lattice.velocity - 1),
        "error_dispersion": rms_deviation(found, lattice.velocity, lattice.low_pass_frequency),
    }


def linear_twin(network: Network, signals: Signals, pre_stress: str, **how: float) -> Signals:
    """The linear wave with the pulse and the records of a run; without `how`, with its step."""
    step = signals.time_step
    interval = step * round(float(signals.time[1]) / step)
    return propagate(
        network,
        interval * (len(signals.time) - 1),
        interval=interval,
        motion=Pulse(signals.amplitude, signals.input_frequency),
        pre_stress=pre_stress,
        **(how or {"time_step": step}),
    ).signals


class Crystal:
    """FCC at 100 kPa, 3 x 3 x `layers`, and the wave that crosses it once."""

    def __init__(self, layers: int) -> None:
        self.network = in_yades_order(gallery.fcc(cells=(WIDTH, WIDTH, layers)))
        self.lattice = LayerLattice.of_network(self.network)
        self.duration = self.network.length / affine_velocity(self.network)

    def rows(self, program: Yade | Lammps, quick: bool) -> Rows:
        """A program's sweep of the time step at two amplitudes; YADE's of the recording too."""
        runs = [
            (named(program.name, amplitude), fraction, amplitude, RECORDING_INTERVAL)
            for amplitude, fractions in FRACTIONS[quick].items()
            for fraction in fractions
        ]
        if isinstance(program, Yade):
            runs += [(RECORDING, FRACTION, SMALL, interval) for interval in INTERVALS[quick]]
        rows = []
        for method, fraction, amplitude, interval in runs:
            setting = {"fraction": fraction, "amplitude": amplitude, "interval": interval}
            found, spent = program.wave(duration=self.duration, **setting)
            rows.append(self.row(method, fraction, found, spent))
        return rows

    def row(self, method: str, fraction: float, found: Signals, spent: Measured) -> dict[str, Any]:
        """A run's signals and what is read from them; those of the linear waves beside it.

        `dispersion_linear`: error of the springs' leapfrog with the same step, thus of the step;
        `velocity_tangent`: that of V_P with pre-stress, which the theory of springs leaves out.
        """
        tangent, springs = (linear_twin(self.network, found, kind) for kind in ("full", "none"))
        converged = linear_twin(self.network, found, "full", tolerance=REFERENCE)
        row = {"method": method, "setting": f"{fraction:g} of the limit"}
        row |= {"error": apart(found, converged), **spent.cost}
        row |= {"apart_from_tangent": apart(found, tangent), **errors(found, self.lattice)}
        row |= {"dispersion_linear": errors(springs, self.lattice)["error_dispersion"]}
        row |= {"velocity_tangent": errors(tangent, self.lattice)["error_velocity"]}
        row |= {"time_step_over_limit": fraction, "two_A_nm": 2e9 * found.amplitude}
        return row | {"interval_us": 1e6 * float(found.time[1])}


def named(program: str, amplitude: float) -> str:
    """Column `method` of a program's sweep over the time step at one amplitude A, m."""
    return f"{program}, 2A = {2e9 * amplitude:g} nm"


def steps_of(rows: Rows, amplitude: float = AMPLITUDE, program: str = "YADE") -> Rows:
    """The rows of that sweep."""
    return [row for row in rows if row["method"] == named(program, amplitude)]


def step_knee(rows: Rows) -> dict[str, Any] | None:
    """The largest step whose own share of the dispersion's error is below what no step mends.

    That is the error of V_P at the smallest step, from non-linearity and pre-stress, at the
    study's amplitude. None if no step is small enough.
    """
    own = steps_of(rows)
    floor = own[-1]["error_velocity"]
    enough = [row for row in own if row["dispersion_linear"] <= floor]
    return max(enough, key=lambda row: row["time_step_over_limit"], default=None)


def interval_knee(rows: Rows) -> dict[str, Any]:
    """The longest recording interval up to which the error of the dispersion is unchanged."""
    own = [row for row in rows if row["method"] == RECORDING]
    least = min(row["error_dispersion"] for row in own)
    changed = [row["interval_us"] for row in own if row["error_dispersion"] > SAME * least]
    same = [row for row in own if row["interval_us"] < min(changed, default=np.inf)]
    return max(same or own[:1], key=lambda row: row["interval_us"])


def at_equal_error(rows: Rows, program: str) -> tuple[float, float]:
    """Seconds of a DEM over those of the linear wave, and the error that both keep.

    The DEM's most accurate run beside the fastest linear one that is at least as accurate.
    """
    dem = [row for row in rows if row["method"].startswith(f"{program}, ")]
    best = min(dem, key=lambda row: row["error"])
    enough = [r for r in rows if r["method"].startswith("linear") and r["error"] <= best["error"]]
    return best["seconds"] / min(row["seconds"] for row in enough), best["error"]


def notes(rows: Rows) -> list[str]:
    """Each program beside the linear wave, and what no time step mends."""
    said = []
    for program in ("YADE", "LAMMPS"):
        large, small = (steps_of(rows, amplitude, program)[-1:] for amplitude in (AMPLITUDE, SMALL))
        for a, b in zip(large, small, strict=True):
            times, error = at_equal_error(rows, program)
            said.append(
                f"The linear wave against {program} at equal error, {error:.1e}: {times:.3g} times "
                f"faster. 2A of {a['two_A_nm']:g} and {b['two_A_nm']:g} nm: the difference from "
                f"the tangent with the same step is {a['apart_from_tangent']:.1e} and "
                f"{b['apart_from_tangent']:.1e}, the error of V_P {a['error_velocity']:.1e} and "
                f"{b['error_velocity']:.1e}, that of the tangent {b['velocity_tangent']:.1e}."
            )
    return said
