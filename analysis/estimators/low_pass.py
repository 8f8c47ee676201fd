"""Find the low-pass frequency of a packing by the paper's threshold rule and its variants.

The rule (section 5.1 of Otsubo et al. 2017) uses a map of frequency over distance from the source,
shaded by the amplitude of the displacement of one chain of particles. f_low-pass is the frequency
at which the amplitude falls to 2 % (or 1 %) of the maximum value, where it no longer varies with
distance; the record ends before the reflection. Here the map has the chain's force-bearing
particles, the maximum is that of the whole map, the record ends after `PASSAGES` of the measured
wave, and the value is the median over one stretch of the chain, equal for all thresholds. The free
choices of the rule are the displacement (of the chain or of layers), the maximum to which the
threshold is relative, and the length of the record: `Passband` varies each of them. The unbiased
band edge of a crystal is in `damped_transform`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.source_motion import sets_out
from analysis.explanation import Step, limit_step
from analysis.value import Value, hertz, unknown
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

Whose = Literal["chain", "layers"]
"""The displacement that the threshold rule takes: that of the chain or of layers."""
Reference = Literal["map", "own"]
"""The maximum that a threshold is relative to: that of the whole map ("map"), or that of each
particle's own spectrum ("own")."""
WHOSE: tuple[Whose, ...] = ("chain", "layers")
REFERENCES: tuple[Reference, ...] = ("map", "own")

THRESHOLDS = (0.02, 0.01, 0.03, 0.05)
"""Amplitudes at f_low-pass, divided by the maximum; the two that the paper uses come first."""
PASSAGES = 0.95
"""Longest record, in passages of the long waves from wall to wall: the front is then at 0.95 L."""
OTHER_PASSAGES = (0.7, 1.15, 1.73)
"""Lengths of record, in passages, that are tried beside `PASSAGES`."""
CRYSTAL_STRETCH = (0.05, 0.15)
"""Ends of the stretch of a crystal over which the median is taken, in parts of the length. The
value falls from the source on, because the waves of the band edge are slow and the record is short
(Otsubo et al. 2017, section 5.1)."""
STRETCH = (0.5, 0.6)
"""Ends of the stretch of other packings over which the median is taken, in parts of the length."""
NEAR_FIELD = 0.02
"""Length of the source wall's near field, which is never used, divided by the length of the
packing."""
MAX_PLATEAU_CHANGE = 0.1
"""Largest relative difference between the medians of a stretch and of its neighbours for which the
value counts as a plateau."""
CRYSTAL_RANGE_IN_V_PER_D = 0.7
"""Highest frequency that is computed for crystals, in V_P / D; their band ends at 0.45."""
RANGE_IN_V_PER_D = 0.4
"""Highest frequency that is computed for packings other than crystals, in V_P / D."""
SOURCE_THRESHOLDS = 3.0
"""Least amplitude of the source at f_low-pass, relative to the source's largest amplitude and in
thresholds. With less, the end of the source's own spectrum is seen."""
KNOWN_RANGE = 0.9
"""Part of the computed frequencies in which a crossing must lie: beyond it, the curve could rise
again where nothing was computed."""
OVERSAMPLING = 4
"""Number of computed frequencies per 1 / T, where T is the length of the record."""
PARTICLES_TOGETHER = 4096
"""Particles whose spectra are computed in one product, which bounds the memory."""
MIN_PARTICLES = 3
"""Fewest particles with a value from which the median of a stretch is taken."""
MIN_PARTICLES_OF_COLUMN = 5
"""Fewest particles in the stretch for which a column is used."""


def last_crossing(
    frequency: np.ndarray, amplitude: np.ndarray, level: np.ndarray | float
) -> np.ndarray:
    """Return the highest frequency (nc,), Hz, at which each column falls through its level.

    The logarithm of the amplitude is interpolated linearly. The result is NaN if a column is
    nowhere above its level, or still above it beyond `KNOWN_RANGE`.

    Parameters
    ----------
    frequency : ndarray (nf,)
        Frequencies, Hz, equally spaced.
    amplitude : ndarray (nf, nc)
    level : ndarray (nc,) or float
        Level of each column, in the unit of the amplitude.

    Examples
    --------
    >>> last_crossing(np.arange(4.0), np.array([[8.0], [8.0], [2.0], [0.1]]), 4.0)
    array([1.5])
    """
    count = len(frequency)
    if count < 2:  # the record is shorter than a period of the highest frequency
        return np.full(amplitude.shape[1], np.nan)
    above = amplitude > level
    last_above = np.minimum(count - 1 - np.argmax(above[::-1], axis=0), count - 2)
    column = np.arange(amplitude.shape[1])
    tiny = np.finfo(float).tiny
    log_above = np.log(np.maximum(amplitude[last_above, column], tiny))
    log_below = np.log(np.maximum(amplitude[last_above + 1, column], tiny))
    log_level = np.log(np.maximum(np.broadcast_to(level, log_above.shape), tiny))
    share = (log_above - log_level) / np.maximum(log_above - log_below, 1e-12)
    step = frequency[1] - frequency[0]
    crossing = frequency[last_above] + step * np.clip(share, 0, 1)
    known = above.any(axis=0) & (last_above <= KNOWN_RANGE * (count - 1))
    return np.where(known, crossing, np.nan)


def spectra(
    time: np.ndarray, displacement: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (nf,), Hz, up to `highest`, and amplitudes (nf, p) of a motion (nt, p).

    Amplitudes are in single precision, hence in units of the largest displacement.
    """
    largest = float(abs(displacement).max(initial=0.0)) or 1.0
    step = float(time[1] - time[0])
    frequency = np.arange(0, min(highest, 0.5 / step), 1 / (OVERSAMPLING * len(time) * step))
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time)
    amplitude = np.empty((len(frequency), displacement.shape[1]), np.float32)
    for start in range(0, displacement.shape[1], PARTICLES_TOGETHER):
        part = slice(start, start + PARTICLES_TOGETHER)
        u = displacement[:, part] / largest
        # Two real products are half of the work of a complex one.
        amplitude[:, part] = np.hypot(kernel.real @ u, kernel.imag @ u)
    return frequency, amplitude


def threshold_curves(
    frequency: np.ndarray, amplitude: np.ndarray, reference: Reference = "map"
) -> np.ndarray:
    """Return the last crossing (thresholds, p), Hz, of each of `THRESHOLDS` for each particle.

    `frequency` (nf,) is in Hz; the `amplitude` (nf, p) is divided by the maximum of the whole map
    ("map") or of each particle ("own").
    """
    maximum = amplitude.max(axis=0)
    if reference == "map":
        maximum = amplitude.max()
    return np.array([last_crossing(frequency, amplitude, t * maximum) for t in THRESHOLDS])


def at_stretch(
    distance: np.ndarray, values: np.ndarray, length: float, stretch: tuple[float, float]
) -> Value:
    """Return the median value, Hz, over a stretch of the chain, and whether there is a plateau.

    The error is half of the interquartile range. The median is unknown if fewer than
    `MIN_PARTICLES`, or less than half of the particles, have a value. There is a plateau if the
    stretches of equal width before and after this one have nearly the same median; otherwise the
    rule has no definite answer.

    Parameters
    ----------
    distance : ndarray (nc,)
        Distance from the source wall, m.
    values : ndarray (nc,)
        Values of the particles, Hz.
    length : float
        Distance from wall to wall, m.
    stretch : tuple of float
        Ends of the stretch, as fractions of the length.
    """
    low, high = stretch
    width = high - low
    known, particles = _known_values(distance, values, length, (low, high))
    ends = {"stretch_start": max(NEAR_FIELD, low) * length, "stretch_end": high * length}
    window = Step("window", "read", ends)
    steps: tuple[Step, ...] = (window, _step_of_particles(known, particles))
    if not _are_enough(known, particles):
        counts = {"seen": len(known), "particles": particles}
        return unknown("Hz", Caveat("few_particles", counts), steps=steps)
    value = float(np.median(known))
    upper_quartile, lower_quartile = np.percentile(known, [75, 25])
    error = float(upper_quartile - lower_quartile) / 2
    changes = []
    for beside in ((low - width, high - width), (low + width, high + width)):
        known, particles = _known_values(distance, values, length, beside)
        median = np.nan
        if _are_enough(known, particles):
            median = float(np.median(known))
        changes.append(abs(median / value - 1))
    change = float(np.max(changes))
    numbers = {"change": change, "limit": MAX_PLATEAU_CHANGE}
    steps += (limit_step(numbers, "change", "limit"),)
    if change <= MAX_PLATEAU_CHANGE:
        return Value(value, "Hz", {"fit": error}, plateau=True, steps=steps)
    caveat = Caveat("no_plateau_beside")
    if np.isfinite(change):
        caveat = Caveat("no_plateau", {"change": change})
    return Value(value, "Hz", {"fit": error}, (caveat,), plateau=False, steps=steps)


def _step_of_particles(known: np.ndarray, particles: int) -> Step:
    """Return the step that counts the known values (k,) of all `particles` on a stretch."""
    needed = max(MIN_PARTICLES, particles // 2 + 1)
    numbers = {"particles_with_value": len(known), "particles": particles, "needed": needed}
    return limit_step(numbers, "particles_with_value", "needed", least=True)


def _known_values(
    distance: np.ndarray, values: np.ndarray, length: float, stretch: tuple[float, float]
) -> tuple[np.ndarray, int]:
    """Return the finite values (k,) on a stretch, and the number of particles on the stretch.

    The ends of the `stretch` are in parts of `length`.
    """
    low, high = stretch
    inside = (distance >= max(NEAR_FIELD, low) * length) & (distance < high * length)
    return values[inside & np.isfinite(values)], int(inside.sum())


def _are_enough(known: np.ndarray, particles: int) -> bool:
    """Return whether `MIN_PARTICLES`, and over half of all `particles`, have values (k,)."""
    return len(known) >= MIN_PARTICLES and 2 * len(known) > particles


class Map(NamedTuple):
    """Amplitude of a motion as a function of distance from the source and of frequency.

    distance (nc,), m: from the source. frequency (nf,), Hz. amplitude (nf, nc): in units of the
    largest displacement.
    """

    distance: np.ndarray
    frequency: np.ndarray
    amplitude: np.ndarray


class StoredMap(NamedTuple):
    """A map and what it was computed from; records are compared by identity."""

    record: Signals
    whose: Whose
    passages: float
    map: Map


@dataclass
class Passband:
    """The threshold rule on the records of a packing.

    Attributes
    ----------
    network : Network
    wave : Signals
        The linear wave. If every particle was recorded, the rule is also applied along every column
        of the packing.
    run : Signals or None
        The run of YADE.
    velocity : float
        Velocity of the long waves, m/s.
    crystal : bool
        Whether the packing is a crystal, whose chain has one particle of each layer. In other
        packings layers are slabs a diameter thick.
    highest : float
        Highest frequency that is computed, Hz.
    stretch : tuple of float
        Ends, as fractions of the length, of the stretch over which the median is taken.
    """

    network: Network
    wave: Signals
    run: Signals | None
    velocity: float
    crystal: bool

    def __post_init__(self) -> None:
        self.stretch = STRETCH
        range_in_v_per_d = RANGE_IN_V_PER_D
        if self.crystal:
            self.stretch = CRYSTAL_STRETCH
            range_in_v_per_d = CRYSTAL_RANGE_IN_V_PER_D
        self.highest = range_in_v_per_d * self.velocity / float(2 * self.network.radius.mean())
        self._bearing = force_bearing(self.network)
        self._maps: list[StoredMap] = []

    def end(self, record: Signals, passages: float = PASSAGES) -> float:
        """Return the time, s, a number of `passages` after the start, or the record's end."""
        duration = passages * self.network.length / self.velocity
        return min(float(record.time[-1]), sets_out(record) + duration)

    def passages(self, record: Signals) -> float:
        """Return the length of a record, cut for the rule, in passages of the long waves."""
        return (self.end(record) - sets_out(record)) * self.velocity / self.network.length

    def map(self, record: Signals, whose: Whose = "chain", passages: float = PASSAGES) -> Map:
        """Return the map of a record, which is cut to a number of `passages`."""
        for stored in self._maps:
            if stored.record is record and (stored.whose, stored.passages) == (whose, passages):
                return stored.map
        computed = self._compute_map(record, whose, passages)
        self._maps.append(StoredMap(record, whose, passages, computed))
        return computed

    def _compute_map(self, record: Signals, whose: Whose, passages: float) -> Map:
        """Compute the map of the chain's force-bearing particles, or of layers."""
        z = record.chain_position
        u = record.chain_displacement
        if whose == "chain":
            bearing = self._bearing[record.chain_particle]
            z = z[bearing]
            u = u[:, bearing]
        elif not self.crystal:
            z = record.layer_position
            u = record.layer_displacement
        frequency, amplitude = self._spectra(record, u, passages)
        return Map(z - self.network.wall_position[0], frequency, amplitude)

    def _spectra(
        self, record: Signals, displacement: np.ndarray, passages: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the `spectra` of displacements (nt, p), cut to a number of `passages`."""
        end = self.end(record, passages)
        count = int((record.time <= end * (1 + 1e-9)).sum())
        return spectra(record.time[:count], displacement[:count], self.highest)

    def edges(
        self,
        record: Signals | None,
        whose: Whose = "chain",
        reference: Reference = "map",
        passages: float = PASSAGES,
    ) -> list[Value]:
        """Return f_low-pass, Hz, for each of `THRESHOLDS`.

        Values are unknown if there is no record, or no record of layers, and where the source is
        too weak. `reference` is described at `threshold_curves`.
        """
        needs_layers = whose == "layers" and not self.crystal
        if record is None or (needs_layers and record.layer_displacement is None):
            return [unknown("Hz")] * len(THRESHOLDS)
        distance, frequency, amplitude = self.map(record, whose, passages)
        curves = threshold_curves(frequency, amplitude, reference)
        source = record.source_displacement[:, None]
        source_frequency, sent = self._spectra(record, source, passages)
        edges = []
        for threshold, curve in zip(THRESHOLDS, curves, strict=True):
            edge = at_stretch(distance, curve, self.network.length, self.stretch)
            level = SOURCE_THRESHOLDS * threshold * sent.max()
            source_end = last_crossing(source_frequency, sent, level)[0]
            cut = {
                "threshold": threshold,
                "passages": passages,
                "record_end": self.end(record, passages),
                "highest": self.highest,
            }
            of_source = {"frequency": edge.value, "source_end": source_end}
            strong_enough = limit_step(of_source, "frequency", "source_end")
            steps = (Step("window", "read", cut), *edge.steps, strong_enough)
            if edge.value > source_end:
                caveat = Caveat("source_too_weak", {"frequency": hertz(source_end)})
                edges.append(unknown("Hz", caveat, steps=steps))
            else:
                edges.append(replace(edge, steps=steps))
        return edges

    @cached_property
    def low_pass(self) -> list[Value]:
        """Return f_low-pass, Hz, by the paper's choices from the linear wave, cut as YADE's run."""
        return self.with_chain_scatter(self.edges(self.wave, passages=self.common))

    def with_chain_scatter(self, edges: list[Value]) -> list[Value]:
        """Return values whose error is the scatter between chains, if this is known and larger."""
        widened = []
        for edge, scatter in zip(edges, self.chain_scatter, strict=True):
            error = float(np.fmax(edge.error, scatter))
            widened.append(replace(edge, parts={"fit": error}))
        return widened

    @property
    def common(self) -> float:
        """Return the length, in passages, to which YADE's run and the linear wave are both cut.

        It is at most `PASSAGES`.
        """
        if self.run is None:
            return PASSAGES
        return min(PASSAGES, self.passages(self.run))

    @cached_property
    def of_columns(self) -> np.ndarray:
        """Return f_low-pass (columns, thresholds), Hz, along each column of the linear wave.

        A column is a diameter wide. The scatter of columns shows how much the value depends on the
        choice of the chain. Unknown values are NaN; there are no rows if single particles are not
        recorded.
        """
        if self.wave.particle_displacement is None:
            return np.empty((0, len(THRESHOLDS)))
        network = self.network
        particles = np.flatnonzero(self._bearing)
        displacement = self.wave.particle_displacement[:, particles]
        frequency, amplitude = self._spectra(self.wave, displacement, self.common)
        distance = network.position[particles, 2] - network.wall_position[0]
        low, high = np.array(self.stretch) * network.length
        inside = (distance >= low) & (distance < high)
        medians = []
        for column in columns_of(network, particles):
            maximum = amplitude[:, column].max()
            in_stretch = amplitude[:, column[inside[column]]]
            if in_stretch.shape[1] >= MIN_PARTICLES_OF_COLUMN:
                curves = [last_crossing(frequency, in_stretch, t * maximum) for t in THRESHOLDS]
                medians.append(np.median(curves, axis=1))
        return np.array(medians).reshape(-1, len(THRESHOLDS))

    @cached_property
    def chain_scatter(self) -> np.ndarray:
        """Return the standard deviation between columns (thresholds,), Hz; NaN for fewer than 2."""
        scatter = np.full(len(THRESHOLDS), np.nan)
        for n, values in enumerate(self.of_columns.T):
            known = values[np.isfinite(values)]
            if len(known) > 1:
                scatter[n] = np.std(known, ddof=1)
        return scatter

    @cached_property
    def mean_of_columns(self) -> Value:
        """Return f_low-pass, Hz, by the 2 % rule as the mean over columns, with their scatter.

        The value is unknown if half of the columns, or fewer, have one.
        """
        columns = self.of_columns[:, 0]
        known = columns[np.isfinite(columns)]
        needed = len(columns) // 2 + 1
        numbers = {"columns_with_value": len(known), "columns": len(columns), "needed": needed}
        steps = (limit_step(numbers, "columns_with_value", "needed", least=True),)
        if len(known) < needed:
            counts = {"known": len(known), "columns": len(columns)}
            return unknown("Hz", Caveat("few_columns", counts), steps=steps)
        parts = {"chain": float(self.chain_scatter[0])}
        return Value(float(known.mean()), "Hz", parts, steps=steps)

    def choices(self) -> list[tuple[str, Value]]:
        """Return f_low-pass, Hz, for each choice of the rule, with a text that names the choice."""
        rows = []
        records = (("YADE", self.run), ("linear wave", self.wave))
        for (name, record), whose, reference in product(records, WHOSE, REFERENCES):
            maximum = f"each of the {whose}"
            if reference == "map":
                maximum = "the whole map"
            edges = self.edges(record, whose, reference, self.common)
            for threshold, edge in zip(THRESHOLDS, edges, strict=True):
                text = f"{name}, {whose}, {100 * threshold:g} % of the maximum of {maximum}"
                rows.append((text, edge))
        for passages in OTHER_PASSAGES:
            text = f"linear wave, chain, 2 % of the map, record of {passages:g} passages"
            rows.append((text, self.edges(self.wave, passages=passages)[0]))
        return rows


def columns_of(network: Network, particles: np.ndarray) -> list[np.ndarray]:
    """Return, for each column a diameter wide, which of the `particles` (p,) it contains."""
    diameter = 2 * float(network.radius.mean())
    # The width of a crystal's cell is slightly less than whole diameters under pressure.
    cells = np.maximum(1, (network.cell_size[:2] / diameter + 0.05).astype(int))
    place = (network.position[particles, :2] / network.cell_size[:2] % 1 * cells).astype(int)
    column = place[:, 0] * cells[1] + place[:, 1]
    return [np.flatnonzero(column == number) for number in np.unique(column)]
