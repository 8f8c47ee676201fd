"""Find the low-pass frequency of a packing by the paper's threshold rule and its variants.

`threshold_rule` has the rule. Here the map has the chain's force-bearing particles, the maximum is
that of the whole map, the record ends after `PASSAGES` of the measured wave, before the reflection,
and the value is the median over one stretch of the chain, equal for all thresholds. The free
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
from analysis.estimators.threshold_rule import (
    THRESHOLDS,
    Reference,
    at_stretch,
    last_crossing,
    spectra,
    threshold_curves,
)
from analysis.steps import Step, limit_step
from analysis.value import Value, hertz, unknown
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.waves.signals import Signals

Whose = Literal["chain", "layers"]
"""The displacement that the threshold rule takes: that of the chain or of layers."""
WHOSE: tuple[Whose, ...] = ("chain", "layers")
REFERENCES: tuple[Reference, ...] = ("map", "own")
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
CRYSTAL_RANGE_IN_V_PER_D = 0.7
"""Highest frequency that is computed for crystals, in V_P / D; their band ends at 0.45."""
RANGE_IN_V_PER_D = 0.4
"""Highest frequency that is computed for packings other than crystals, in V_P / D."""
SOURCE_THRESHOLDS = 3.0
"""Least amplitude of the source at f_low-pass, relative to the source's largest amplitude and in
thresholds. With less, the end of the source's own spectrum is seen."""
MIN_PARTICLES_OF_COLUMN = 5
"""Fewest particles in the stretch for which a column is used."""


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
