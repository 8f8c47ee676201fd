"""A run by YADE, or a non-linear wave, against the linear wave of its network, and where they part.

The linear wave is computed with the DEM's own time step (`modal.waves.integrators`) and the exact
tangent, so what is left is the packing's non-linearity and the run's noise. Leaving out one thing
at a time, or adding runs of other amplitude, sign or friction, splits the difference by cause. All
displacements are divided by the amplitude of the source; differences are relative L2 norms.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from analysis.estimators.source_motion import recorded_motion
from analysis.table import Table
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import Signals

OTHER_RUNS = {
    "reverse": "run with the wall's motion reversed",
    "tenth": "run with a tenth of the amplitude",
    "small": "run with a smaller amplitude",
    "small_reverse": "run with the smaller amplitude reversed",
    "no_slip": "run with sliding suppressed",
    "half_step": "run with half the time step, recorded at the first run's times too",
}
"""Further runs of the same sample that split the difference."""

SAME = 1e-3
"""Largest difference of two motions of the source that are one but for their size."""


Motion = dict[str, Floats]
"""Displacements per amplitude of the source, along its motion, at the same times (nt,).

`chain` (nt, nc); `layers` (nt, nl) and `particles` (nt, n), force-bearing ones only, where the run
has recorded them.
"""


class Difference(NamedTuple):
    """Relative L2 norms over all times: chain, layer means, particles; and the median particle."""

    cause: str
    chain: float
    layers: float | None = None
    particles: float | None = None
    median: float | None = None


def relative(a: Floats, b: Floats) -> float:
    """|a - b| / |b|."""
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


def compare(cause: str, found: Motion, reference: Motion) -> Difference:
    """The difference of two motions under the name of its cause, as far as both are recorded."""
    each = {name: relative(found[name], reference[name]) for name in found if name in reference}
    if "particles" in each:
        size = np.linalg.norm(reference["particles"], axis=0)
        apart = np.linalg.norm(found["particles"] - reference["particles"], axis=0)
        each["median"] = float(np.median(apart[size > 0] / size[size > 0]))
    return Difference(cause, **each)


class Agreement:
    """One YADE run and the linear waves that belong to it.

    InputError where the run does not belong to the network or its records are not equally many
    steps apart.
    """

    def __init__(self, network: Network, run: Signals) -> None:
        n, every = network.n_particles, run.particle_displacement
        wrong = every is not None and every.shape[1] != n
        if wrong or run.chain_particle.max(initial=-1) >= n:
            raise InputError(
                "input", "the signals are not of this network", remedy="give the network of the run"
            )
        self.network, self.run, self.source = network, run, recorded_motion(run)
        self.every = max(1, round(float(run.time[1] - run.time[0]) / run.time_step))
        steps = run.time_step * self.every * np.arange(len(run.time))
        if abs(run.time - steps).max() > 1e-6 * run.time_step:
            raise InputError(
                "input",
                "the records are not equally many time steps apart",
                remedy="record them so",
            )
        self._bearing, self._layers = force_bearing(network), Layers(network)

    def measured(self, run: Signals) -> Motion:
        """What a YADE run recorded at the first run's times, per amplitude.

        It must have all of them, and may have others.
        """
        if not np.array_equal(run.chain_particle, self.run.chain_particle):
            raise InputError(
                "input",
                "the runs recorded different chains",
                remedy="they are of different samples",
            )
        wanted = self.run.time - 1e-3 * self.run.time_step
        near = np.minimum(np.searchsorted(run.time, wanted), len(run.time) - 1)
        if (abs(run.time[near] - self.run.time) > 1e-6 * self.run.time_step).any():
            raise InputError(
                "input", "the runs were recorded at different times", remedy="repeat them alike"
            )
        moved, first = run.source_displacement[near], self.run.source_displacement
        times = float(moved @ first / (first @ first))
        if times == 0 or abs(moved - times * first).max() > SAME * abs(moved).max():
            raise InputError(
                "input", "the runs' sources move differently", remedy="repeat them with one motion"
            )
        motion = self._motion(run.chain_displacement, run, 1 / times / self.run.amplitude)
        return {name: field[near] for name, field in motion.items()}

    def linear(self, pre_stress: str = "full", *, exact_in_time: bool = False) -> Motion:
        """The linear wave at the run's times, with its time step or exact in time."""
        run, interval = self.run, self.run.time_step * self.every
        settings: dict[str, Any] = {"motion": self.source, "pre_stress": pre_stress}
        settings |= {"direction": run.direction, "interval": interval}
        settings["time_step"] = None if exact_in_time else run.time_step
        # At full size some GB, where nothing is held against it.
        settings["particles"] = run.particle_displacement is not None
        wave = propagate(self.network, interval * (len(run.time) - 1), **settings).signals
        chain = wave.chain_displacement
        if wave.particle_displacement is not None:
            chain = wave.particle_displacement[:, run.chain_particle]
        elif not np.array_equal(wave.chain_particle, run.chain_particle):
            raise InputError(
                "input",
                "the run's chain is not the network's own",
                remedy="record every particle (WAVE_PARTICLES=1)",
            )
        return self._motion(chain, wave, 1 / run.amplitude)

    def _motion(self, chain: np.ndarray, signals: Signals, factor: float) -> Motion:
        everything, layers = signals.particle_displacement, signals.layer_displacement
        found = {"chain": factor * chain}
        if everything is not None:
            layers = np.array([self._layers.means(row) for row in everything])
            found["particles"] = factor * everything[:, self._bearing]
        if layers is not None:
            found["layers"] = factor * layers
        return found


CAUSES = (
    ("{by} to linear, all causes", "run", "linear"),
    ("time step (linear leapfrog to exact)", "linear", "exact"),
    ("pre-stress, all of it (linear)", "none", "linear"),
    ("pre-stress of shear forces (linear)", "normal", "linear"),
    ("time step ({by}, half of it)", "run", "half_step"),
    ("opened and slipped contacts ({by}, friction)", "run", "no_slip"),
    ("{by} without slip to linear", "no_slip", "linear"),
    ("even part: quadratic terms and drift ({by})", "run", "odd"),
    ("odd part to linear", "odd", "linear"),
    ("non-linearity ({by}, a tenth of the amplitude)", "run", "tenth"),
    ("a tenth of the amplitude to linear", "tenth", "linear"),
    ("non-linearity ({by}, two amplitudes)", "run", "small"),
    ("small amplitude to linear", "small", "linear"),
    ("noise floor: even part, small amplitude", "small", "small_odd"),
    ("odd part, small amplitude, to linear", "small_odd", "linear"),
)
"""Cause, and two motions that differ by it: run, linear waves, further runs, odd parts of two."""


def split_by_cause(pair: Agreement, **others: Signals) -> list[Difference]:
    """The difference of a run to its linear wave, whole and by cause.

    The other runs are those of `OTHER_RUNS`, by name; causes whose run is absent are left out.
    """
    runs = {"run": pair.run, **others}
    odd = {"odd": ("run", "reverse"), "small_odd": ("small", "small_reverse")}
    odd = {name: both for name, both in odd.items() if runs.keys() >= {*both}}
    waves = {"linear": "full", "exact": "full", "none": "none", "normal": "normal"}

    @lru_cache(4)  # of every particle each takes GB: those that are held against one another
    def motion(name: str) -> Motion:
        if name in waves:
            return pair.linear(waves[name], exact_in_time=name == "exact")
        if name in odd:
            one, two = map(motion, odd[name])
            return {key: 0.5 * one[key] + 0.5 * two[key] for key in one if key in two}
        return pair.measured(runs[name])

    by = "non-linear wave" if pair.run.producer == "nonlinear" else "YADE"
    known = {*runs, *waves, *odd}
    return [
        compare(cause.format(by=by), motion(found), motion(reference))
        for cause, found, reference in CAUSES
        if {found, reference} <= known
    ]


def report(pair: Agreement, **others: Signals) -> Table:
    """The difference by cause, as text."""
    header = ["cause", "chain %", "layer means %", "particles %", "median particle %"]
    causes = [
        [cause, *("" if share is None else f"{100 * share:.4g}" for share in shares)]
        for cause, *shares in split_by_cause(pair, **others)
    ]
    return Table("The difference by cause", header, causes)
