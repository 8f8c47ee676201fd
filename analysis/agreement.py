"""Compare a YADE run, or a non-linear wave, with the linear wave of its network, cause by cause.

The linear wave is computed with the time step of the DEM run (`modal.waves.integrators`) and the
exact tangent, so that the remaining difference is the packing's non-linearity and the run's noise.
To split the difference by cause, one effect at a time is left out, or runs of another amplitude,
sign or friction are compared. All displacements are divided by the amplitude of the source;
differences are relative L2 norms.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np

from analysis.estimators.source_motion import recorded_motion
from analysis.table import Table
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.system.contacts import PreStress
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.propagate import propagate
from modal.waves.signals import Direction, Signals

OTHER_RUNS = {
    "reverse": "run with the wall's motion reversed",
    "tenth": "run with a tenth of the amplitude",
    "small": "run with a smaller amplitude",
    "small_reverse": "run with the smaller amplitude reversed",
    "no_slip": "run with sliding suppressed",
    "half_step": "run with half the time step, recorded at the first run's times too",
}
"""Further runs of the same sample, which show how much each cause adds to the difference."""
MAX_RELATIVE_MOTION_DIFFERENCE = 1e-3
"""Largest difference of two motions of the source that are equal but for their size."""
MAX_TIME_ERROR_IN_STEPS = 1e-6
"""Largest distance between two times that count as equal, in time steps."""
STORED_MOTIONS = 4
"""Number of motions that are kept for the next comparisons; one with every particle takes GB."""
PRE_STRESS_OF_WAVES: dict[str, PreStress] = {
    "linear": "full",
    "exact": "full",
    "none": "none",
    "normal": "normal",
}
"""Pre-stress of the linear waves that are compared, by their names; "exact" is the wave that is
exact in time, the others have the time step of the run."""
RUNS_OF_ODD_PARTS = {"odd": ("run", "reverse"), "small_odd": ("small", "small_reverse")}
"""Pairs of runs with opposite motions of the wall. The mean of both motions, each divided by its
amplitude with the sign, is the odd part: terms of even order in the amplitude cancel."""

Motion = dict[str, Floats]
"""Displacements along the source's motion, divided by its amplitude, at the same times (nt,).

`chain` (nt, nc); `layers` (nt, nl) and `particles` (nt, n), force-bearing ones only, if the run has
recorded them.
"""


class Difference(NamedTuple):
    """The difference of two motions: relative L2 norms over all times.

    cause: why the motions differ, as text. chain, layers, particles: differences of the chain, of
    means over layers, of all particles; median: difference of the median particle. names: names of
    both motions, as in `Comparison`.
    """

    cause: str
    chain: float
    layers: float | None = None
    particles: float | None = None
    median: float | None = None
    names: tuple[str, str] = ("", "")


def relative(motion: Floats, reference: Floats) -> float:
    """Compute |motion - reference| / |reference|."""
    return float(np.linalg.norm(motion - reference) / np.linalg.norm(reference))


def compare(cause: str, motion: Motion, reference: Motion) -> Difference:
    """Compute the difference of two motions, for all parts that both have recorded."""
    difference = Difference(cause, relative(motion["chain"], reference["chain"]))
    if "layers" in motion and "layers" in reference:
        layers = relative(motion["layers"], reference["layers"])
        difference = difference._replace(layers=layers)
    if "particles" in motion and "particles" in reference:
        particles = relative(motion["particles"], reference["particles"])
        size = np.linalg.norm(reference["particles"], axis=0)
        distance = np.linalg.norm(motion["particles"] - reference["particles"], axis=0)
        median = float(np.median(distance[size > 0] / size[size > 0]))
        difference = difference._replace(particles=particles, median=median)
    return difference


class Agreement:
    """A YADE run and the linear waves that belong to it.

    Parameters
    ----------
    network : Network
        The network of the run's sample.
    run : Signals

    Raises
    ------
    InputError
        If the run does not belong to the network, or if its records are not evenly spaced in time
        steps.
    """

    def __init__(self, network: Network, run: Signals) -> None:
        _refuse_other_network(network, run)
        self.network = network
        self.run = run
        self.source = recorded_motion(run)
        self.every = max(1, round(float(run.time[1] - run.time[0]) / run.time_step))
        expected = run.time_step * self.every * np.arange(len(run.time))
        if abs(run.time - expected).max() > MAX_TIME_ERROR_IN_STEPS * run.time_step:
            raise InputError(
                "uneven_times",
                "the records are not equally many time steps apart",
                remedy="record them so",
            )
        self._bearing = force_bearing(network)
        self._layers = Layers(network)

    def measured(self, run: Signals) -> Motion:
        """Return the motion of a run at the times of the first run.

        Raises InputError if the run lacks any of these times, recorded another chain, or has
        another motion of the source than a multiple of the first run's.
        """
        if not np.array_equal(run.chain_particle, self.run.chain_particle):
            raise InputError(
                "other_chain",
                "the runs recorded different chains",
                remedy="they are of different samples",
            )
        rows = self._rows_at_common_times(run)
        source = run.source_displacement[rows]
        factor = self._factor_of_source(source)
        motion = self._motion(run.chain_displacement, run, 1 / factor / self.run.amplitude)
        return {name: field[rows] for name, field in motion.items()}

    def _rows_at_common_times(self, run: Signals) -> np.ndarray:
        """Return the rows (nt,) of a run at the first run's times; InputError if any is missing."""
        step = self.run.time_step
        rows = np.searchsorted(run.time, self.run.time - 1e-3 * step)
        rows = np.minimum(rows, len(run.time) - 1)
        if (abs(run.time[rows] - self.run.time) > MAX_TIME_ERROR_IN_STEPS * step).any():
            raise InputError(
                "other_times",
                "the runs were recorded at different times",
                remedy="repeat them alike",
            )
        return rows

    def _factor_of_source(self, source: Floats) -> float:
        """Return the ratio of a source's motion (nt,), m, to that of the first run."""
        first = self.run.source_displacement
        factor = float(source @ first / (first @ first))
        largest = abs(source).max()
        if (
            factor == 0
            or abs(source - factor * first).max() > MAX_RELATIVE_MOTION_DIFFERENCE * largest
        ):
            raise InputError(
                "other_source",
                "the runs' sources move differently",
                remedy="repeat them with one motion",
            )
        return factor

    def linear(self, pre_stress: PreStress = "full", *, exact_in_time: bool = False) -> Motion:
        """Compute the linear wave at the run's times, with the run's time step or exact in time."""
        run = self.run
        interval = run.time_step * self.every
        time_step = None
        if not exact_in_time:
            time_step = run.time_step
        wave = propagate(
            self.network,
            interval * (len(run.time) - 1),
            motion=self.source,
            pre_stress=pre_stress,
            direction=cast(Direction, run.direction),
            interval=interval,
            time_step=time_step,
            # GB at full size: only if there is something to compare them with.
            particles=run.particle_displacement is not None,
        ).signals
        chain = wave.chain_displacement
        if wave.particle_displacement is not None:
            chain = wave.particle_displacement[:, run.chain_particle]
        elif not np.array_equal(wave.chain_particle, run.chain_particle):
            raise InputError(
                "other_chain",
                "the run's chain is not the network's own",
                remedy="record every particle (WAVE_PARTICLES=1)",
            )
        return self._motion(chain, wave, 1 / run.amplitude)

    def _motion(self, chain: Floats, signals: Signals, factor: float) -> Motion:
        """Return the displacements of chain, layers and particles times a factor."""
        motion = {"chain": factor * chain}
        particles = signals.particle_displacement
        layers = signals.layer_displacement
        if particles is not None:
            layers = np.array([self._layers.means(row) for row in particles])
            motion["particles"] = factor * particles[:, self._bearing]
        if layers is not None:
            motion["layers"] = factor * layers
        return motion


def _refuse_other_network(network: Network, run: Signals) -> None:
    """Raise InputError if a run does not have the particles of the network."""
    particles = run.particle_displacement
    other_count = particles is not None and particles.shape[1] != network.n_particles
    if other_count or run.chain_particle.max(initial=-1) >= network.n_particles:
        raise InputError(
            "other_network",
            "the signals are not of this network",
            remedy="give the network of the run",
        )


class Comparison(NamedTuple):
    """A cause, and the names of two motions that differ only by this cause.

    Motions are runs, linear waves (`PRE_STRESS_OF_WAVES`) and odd parts (`RUNS_OF_ODD_PARTS`);
    `{by}` stands for the program of the run.
    """

    cause: str
    motion: str
    reference: str


COMPARISONS = (
    Comparison("{by} to linear, all causes", "run", "linear"),
    Comparison("time step (linear leapfrog to exact)", "linear", "exact"),
    Comparison("pre-stress, all of it (linear)", "none", "linear"),
    Comparison("pre-stress of shear forces (linear)", "normal", "linear"),
    Comparison("time step ({by}, half of it)", "run", "half_step"),
    Comparison("opened and slipped contacts ({by}, friction)", "run", "no_slip"),
    Comparison("{by} without slip to linear", "no_slip", "linear"),
    Comparison("even part: quadratic terms and drift ({by})", "run", "odd"),
    Comparison("odd part to linear", "odd", "linear"),
    Comparison("non-linearity ({by}, a tenth of the amplitude)", "run", "tenth"),
    Comparison("a tenth of the amplitude to linear", "tenth", "linear"),
    Comparison("non-linearity ({by}, two amplitudes)", "run", "small"),
    Comparison("small amplitude to linear", "small", "linear"),
    Comparison("noise floor: even part, small amplitude", "small", "small_odd"),
    Comparison("odd part, small amplitude, to linear", "small_odd", "linear"),
)
"""Comparisons in the order of the table."""


def split_by_cause(pair: Agreement, **others: Signals) -> list[Difference]:
    """Compute the difference of a run to its linear wave, as a whole and by cause.

    The other runs are those of `OTHER_RUNS`, by name; causes whose run is absent are left out.
    """
    runs = {"run": pair.run, **others}
    motion = _stored_motions(pair, runs)
    by = "YADE"
    if pair.run.producer == "nonlinear":
        by = "non-linear wave"
    known = {*runs, *PRE_STRESS_OF_WAVES}
    for name, both in RUNS_OF_ODD_PARTS.items():
        if runs.keys() >= set(both):
            known.add(name)
    differences = []
    for comparison in COMPARISONS:
        if {comparison.motion, comparison.reference} <= known:
            cause = comparison.cause.format(by=by)
            names = comparison.motion, comparison.reference
            difference = compare(cause, *map(motion, names))
            differences.append(difference._replace(names=names))
    return differences


def _stored_motions(pair: Agreement, runs: Mapping[str, Signals]) -> Callable[[str], Motion]:
    """Return a function that computes a motion by its name and caches the last few."""

    @lru_cache(STORED_MOTIONS)
    def motion(name: str) -> Motion:
        if name in PRE_STRESS_OF_WAVES:
            return pair.linear(PRE_STRESS_OF_WAVES[name], exact_in_time=name == "exact")
        if name in RUNS_OF_ODD_PARTS:
            forward, reverse = map(motion, RUNS_OF_ODD_PARTS[name])
            common = [key for key in forward if key in reverse]
            return {key: 0.5 * forward[key] + 0.5 * reverse[key] for key in common}
        return pair.measured(runs[name])

    return motion


def report(pair: Agreement, **others: Signals) -> Table:
    """Return the difference by cause as a table, in per cent."""
    header = ["cause", "chain %", "layer means %", "particles %", "median particle %"]
    lines = []
    for each in split_by_cause(pair, **others):
        norms = each.chain, each.layers, each.particles, each.median
        cells = ["" if norm is None else f"{100 * norm:.4g}" for norm in norms]
        lines.append([each.cause, *cells])
    return Table("The difference by cause", header, lines)
