"""Which frequencies a packing lets through: the paper's threshold rule, and what its choices do.

The rule (section 5.1 of Otsubo et al. 2017): on a map of frequency over distance from the source,
shaded by the amplitude of the displacement of one chain of particles, f_low-pass is the frequency
at which the amplitude falls to 2 % (or 1 %) of the maximum value, where it no longer varies with
distance; the record ends before the reflection. Here the map is that of the chain's force-bearing
particles, the maximum that of the whole map, the record ends after `PASSAGES` of the measured wave,
and the value is the median over one `STRETCH` for all thresholds. Its free choices are whose
displacement is taken, relative to what, and how long the record is: `Passband` varies every one.
The unbiased band edge of a crystal is in `damped_transform`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.source_motion import sets_out
from analysis.value import Value, hertz, unknown
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

THRESHOLDS = (0.02, 0.01, 0.03, 0.05)
"""The paper's two first."""
PASSAGES = 0.95
"""Longest record, in passages of the long waves from wall to wall: the front is then at 0.95 L."""
STRETCH = {True: (0.05, 0.15), False: (0.5, 0.6)}
"""Part of the length whose median counts, of a crystal or not. A crystal's value falls from the
source on, because the waves of its band edge are slow and the record is short (section 5.1)."""
NEAR = 0.02
"""Part of the length next to the source wall that never counts: there its own field is seen."""
FLAT = 0.1
"""Largest relative change to the stretches before and behind that still counts as a plateau."""
REACH = {True: 0.7, False: 0.4}
"""Highest frequency that is looked at, V_P / D, of a crystal, whose band ends at 0.45, or not."""
SENT = 3.0
"""Least part of the source's largest amplitude that is sent at f_low-pass, in thresholds: where the
source has less, it is its own end that is seen."""
SURE = 0.9
"""Part of the spectrum below whose end it is seen that nothing more follows."""
WHOSE, REFERENCES = ("chain", "layers"), ("map", "own")
"""Whose displacement; relative to the maximum of the whole map, or of the own spectrum."""
OVERSAMPLING = 4
"""Frequencies a record length."""


def last_crossing(
    frequency: np.ndarray, amplitude: np.ndarray, level: np.ndarray | float
) -> np.ndarray:
    """Highest frequency (nc,) Hz at which each column falls through its level, interpolated.

    frequency (nf,) Hz, amplitude (nf, nc), level (nc,) or a number. Between two frequencies the
    logarithm of the amplitude is taken as straight. NaN where a column is above its level close to
    the last frequency, or nowhere.

    >>> last_crossing(np.arange(4.0), np.array([[8.0], [8.0], [2.0], [0.1]]), 4.0)
    array([1.5])
    """
    count = len(frequency)
    if count < 2:  # as of a record shorter than a period of the highest frequency
        return np.full(amplitude.shape[1], np.nan)
    above = amplitude > level
    last = np.minimum(count - 1 - np.argmax(above[::-1], axis=0), count - 2)
    column = np.arange(amplitude.shape[1])
    tiny = np.finfo(float).tiny
    here, next_ = (np.log(np.maximum(amplitude[last + k, column], tiny)) for k in (0, 1))
    wanted = np.log(np.maximum(np.broadcast_to(level, here.shape), tiny))
    part = (here - wanted) / np.maximum(here - next_, 1e-12)
    found = frequency[last] + (frequency[1] - frequency[0]) * np.clip(part, 0, 1)
    return np.where(above.any(axis=0) & (last <= SURE * (count - 1)), found, np.nan)


def spectra(
    time: np.ndarray, displacement: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (nf,), Hz, to `highest`, and the amplitudes (nf, p) of a motion (nt, p).

    Amplitudes are in single precision, hence in units of the largest displacement.
    """
    largest = float(abs(displacement).max(initial=0.0)) or 1.0
    step = float(time[1] - time[0])
    frequency = np.arange(0, min(highest, 0.5 / step), 1 / (OVERSAMPLING * len(time) * step))
    kernel = np.exp(-2j * np.pi * frequency[:, None] * time)
    amplitude = np.empty((len(frequency), displacement.shape[1]), np.float32)
    for start in range(0, displacement.shape[1], 4096):  # some spectra at a time: memory
        part = slice(start, start + 4096)
        u = displacement[:, part] / largest
        # Two real products are half of the work of a complex one.
        amplitude[:, part] = np.hypot(kernel.real @ u, kernel.imag @ u)
    return frequency, amplitude


def threshold_curves(
    frequency: np.ndarray, amplitude: np.ndarray, reference: str = "map"
) -> np.ndarray:
    """The rule for every column and each of `THRESHOLDS`; shape (thresholds, p), Hz.

    Relative to the maximum of the whole map (`map`), or of each column (`own`).
    """
    top = amplitude.max() if reference == "map" else amplitude.max(axis=0)
    return np.array([last_crossing(frequency, amplitude, t * top) for t in THRESHOLDS])


def at_stretch(
    distance: np.ndarray, values: np.ndarray, length: float, stretch: tuple[float, float]
) -> Value:
    """The value, Hz, of a curve (nc,) over distance (nc,) on a stretch, in parts of `length`, m.

    The median over the stretch, half the quartile distance as its error; unknown where fewer than
    three particles, or less than half of them, have a value. It stands on a plateau if it
    is that of the stretches of equal width before and behind. Else the rule has no
    answer of its own.
    """
    low, high = stretch
    medians = []
    for shift in (-1, 0, 1):
        first, last = low + shift * (high - low), high + shift * (high - low)
        inside = (distance >= max(NEAR, first) * length) & (distance < last * length)
        seen = values[inside & np.isfinite(values)]
        told = len(seen) > 2 and 2 * len(seen) > inside.sum()
        medians.append(float(np.median(seen)) if told else np.nan)
        if shift == 0 and not told:
            counts = {"seen": len(seen), "particles": int(inside.sum())}
            return unknown("Hz", Caveat("few_particles", counts))
        if shift == 0:
            error = float(np.subtract(*np.percentile(seen, [75, 25]))) / 2
    before, value, behind = medians
    found = Value(value, "Hz", {"fit": error})
    change = float(np.max(abs(np.array([before, behind]) / value - 1)))
    if change <= FLAT:
        return replace(found, plateau=True)
    caveat = Caveat("no_plateau_beside")
    if np.isfinite(change):
        caveat = Caveat("no_plateau", {"change": change})
    return replace(found, plateau=False, caveats=(caveat,))


@dataclass
class Passband:
    """The threshold rule on a packing's records: `run` of YADE, or None, and the linear `wave`.

    `velocity` (m/s) is that of the long waves. The linear wave is recorded on every particle, so
    that the rule can be had along every column of the sample. A crystal has its own layers; in
    other packings layers are slabs a diameter thick.
    """

    network: Network
    wave: Signals
    run: Signals | None
    velocity: float
    crystal: bool

    def __post_init__(self) -> None:
        self.highest = REACH[self.crystal] * self.velocity / float(2 * self.network.radius.mean())
        self.stretch = STRETCH[self.crystal]
        self._bearing = force_bearing(self.network)
        self._maps: dict[tuple, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def end(self, record: Signals, passages: float = PASSAGES) -> float:
        """Where a record ends for the rule, s: so many passages after the wave has set out.

        Or as long as it is.
        """
        passed = passages * self.network.length / self.velocity
        return min(float(record.time[-1]), sets_out(record) + passed)

    def passages(self, record: Signals) -> float:
        """That end in passages of the long waves."""
        return (self.end(record) - sets_out(record)) * self.velocity / self.network.length

    def map(
        self, record: Signals, whose: str = "chain", passages: float = PASSAGES
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance (nc,) m, frequency (nf,) Hz and amplitude (nf, nc) of a record cut short."""
        key = id(record), whose, passages
        if key not in self._maps:
            z, u = record.chain_position, record.chain_displacement
            if whose == "chain":
                bearing = self._bearing[record.chain_particle]
                z, u = z[bearing], u[:, bearing]
            elif not self.crystal:
                z, u = record.layer_position, record.layer_displacement
            found = self._spectra(record, u, passages)
            self._maps[key] = z - self.network.wall_position[0], *found
        return self._maps[key]

    def _spectra(
        self, record: Signals, u: np.ndarray, passages: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of motions u (nt, p) of a record cut short: `spectra`."""
        kept = slice(int((record.time <= self.end(record, passages) * (1 + 1e-9)).sum()))
        return spectra(record.time[kept], u[kept], self.highest)

    def edges(
        self,
        record: Signals | None,
        whose: str = "chain",
        reference: str = "map",
        passages: float = PASSAGES,
    ) -> list[Value]:
        """f_low-pass for each of `THRESHOLDS`; unknown without a record, or one of layers."""
        if record is None or (
            whose == "layers" and not self.crystal and record.layer_displacement is None
        ):
            return [unknown("Hz")] * len(THRESHOLDS)
        distance, frequency, amplitude = self.map(record, whose, passages)
        curves = threshold_curves(frequency, amplitude, reference)
        found = [at_stretch(distance, row, self.network.length, self.stretch) for row in curves]
        at, sent = self._spectra(record, record.source_displacement[:, None], passages)
        ends = [last_crossing(at, sent, SENT * t * sent.max())[0] for t in THRESHOLDS]
        return [
            unknown("Hz", Caveat("source_too_weak", {"frequency": hertz(end)}))
            if edge.value > end
            else edge
            for edge, end in zip(found, ends, strict=True)
        ]

    @cached_property
    def low_pass(self) -> list[Value]:
        """By the paper's words, of the linear wave cut as the run is."""
        return self.of_any_chain(self.edges(self.wave, passages=self.common))

    def of_any_chain(self, edges: list[Value]) -> list[Value]:
        """With the error of the choice of the chain, where that is known and larger."""
        return [
            replace(edge, parts={"fit": float(np.fmax(edge.error, scatter))})
            for edge, scatter in zip(edges, self.chain_scatter, strict=True)
        ]

    @property
    def common(self) -> float:
        """Passages of the record: those of the run, where it is shorter than `PASSAGES`."""
        return PASSAGES if self.run is None else min(PASSAGES, self.passages(self.run))

    @cached_property
    def of_columns(self) -> np.ndarray:
        """f_low-pass (columns, thresholds), Hz, along each column of the linear wave.

        A column is a diameter wide. Their scatter says how much the value depends on which chain is
        taken. NaN where unknown; none where single particles are not recorded.
        """
        if self.wave.particle_displacement is None:
            return np.empty((0, len(THRESHOLDS)))
        network, found = self.network, list[np.ndarray]()
        bearing = np.flatnonzero(self._bearing)
        u = self.wave.particle_displacement[:, bearing]
        frequency, amplitude = self._spectra(self.wave, u, self.common)
        distance = network.position[bearing, 2] - network.wall_position[0]
        low, high = np.array(self.stretch) * network.length
        inside = (distance >= low) & (distance < high)
        for own in columns_of(network, bearing):
            top, part = amplitude[:, own].max(), amplitude[:, own[inside[own]]]
            if part.shape[1] > 4:
                curves = [last_crossing(frequency, part, t * top) for t in THRESHOLDS]
                found.append(np.median(curves, axis=1))
        return np.array(found).reshape(-1, len(THRESHOLDS))

    @cached_property
    def chain_scatter(self) -> np.ndarray:
        """Standard deviation over the columns (thresholds,), Hz; NaN from fewer than two."""
        known = [values[np.isfinite(values)] for values in self.of_columns.T]
        return np.array([np.std(v, ddof=1) if len(v) > 1 else np.nan for v in known])

    @cached_property
    def mean_of_columns(self) -> Value:
        """The 2 % rule, Hz: mean over all columns, and their scatter."""
        columns = self.of_columns[:, 0]
        known = columns[np.isfinite(columns)]
        if 2 * len(known) <= len(columns):
            counts = {"known": len(known), "columns": len(columns)}
            return unknown("Hz", Caveat("few_columns", counts))
        return Value(float(known.mean()), "Hz", {"chain": float(self.chain_scatter[0])})

    def choices(self) -> list[tuple[str, Value]]:
        """What each choice makes of f_low-pass, the others kept."""
        rows = []
        records = ("YADE", self.run), ("linear wave", self.wave)
        for (name, record), whose, reference in product(records, WHOSE, REFERENCES):
            of = "the whole map" if reference == "map" else f"each of the {whose}"
            edges = self.edges(record, whose, reference, self.common)
            for threshold, edge in zip(THRESHOLDS, edges, strict=True):
                text = f"{name}, {whose}, {100 * threshold:g} % of the maximum of {of}"
                rows.append((text, edge))
        for passages in (0.7, 1.15, 1.73):
            text = f"linear wave, chain, 2 % of the map, record of {passages:g} passages"
            rows.append((text, self.edges(self.wave, passages=passages)[0]))
        return rows


def columns_of(network: Network, particles: np.ndarray) -> list[np.ndarray]:
    """Of each column, a diameter wide: which of the particles (p,) stand in it."""
    diameter = 2 * float(network.radius.mean())
    # A crystal's cell, pressed together, is little less than whole diameters wide.
    cells = np.maximum(1, (network.cell_size[:2] / diameter + 0.05).astype(int))
    place = (network.position[particles, :2] / network.cell_size[:2] % 1 * cells).astype(int)
    column = place[:, 0] * cells[1] + place[:, 1]
    return [np.flatnonzero(column == number) for number in np.unique(column)]
