"""Two transducers in a packing: their distance, the ways of waves beside the direct one, caveats.

A wave by way of a side, of an end or of a periodic image makes a detour. Where it arrives less than
a period after the direct wave, a rule of travel time reads both together.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.caveats import Caveat
from analysis.estimators.arrival_rules import MIN_WAVELENGTHS, RecordPair, Rule, travel_time
from analysis.value import Value
from modal.packing.network import Network
from modal.tools.arrays import Floats
from modal.waves.defaults import mean_diameter
from modal.waves.discs import Disc

MIN_WAVELENGTH_IN_D = 8.0
"""Wavelength, in mean diameters, below which grains disperse and scatter a wave."""
MAX_REFLECTION_DELAY_IN_PERIODS = 1.0
"""Delay of a wave by way of a side or an end, in periods, below which it overlaps the first one."""
MAX_DEPTH_AT_END_IN_D = 1.5
"""Depth of a disc, in mean diameters, up to which it counts as at the end of the packing: a wave
that comes back from there is a part of what the disc sends or reads."""


def has_free_sides(network: Network) -> bool:
    """Tell whether the sides of a packing are free: it is not periodic along x and y."""
    return not network.cell_periodic[:2].all()


def widths(network: Network) -> Floats:
    """Return the widths (2,), m, along x and y: of the cell, or of a packing with free sides."""
    extent = np.ptp(network.position[:, :2], axis=0) + mean_diameter(network)
    return np.where(network.cell_periodic[:2], network.cell_size[:2], extent)


@dataclass(frozen=True)
class TransducerPair:
    """Source and receiver in a packing, and the velocity of the longest waves between them.

    `velocity`, m/s, is NaN where the moduli have none; each reading then is its own measure.
    """

    network: Network
    source: Disc
    receiver: Disc
    velocity: float

    @cached_property
    def distance(self) -> float:
        """Distance from tip to tip, m."""
        towards = self.receiver.position_in(self.network) - self.source.position_in(self.network)
        return float(np.linalg.norm(towards))

    def measured_velocity(self, records: RecordPair, rule: Rule) -> Value:
        """Return the velocity by a rule, m/s, with its error and caveats."""
        time = travel_time(records, rule)
        velocity = self.distance / time.value
        parts = {name: velocity * part / time.value for name, part in time.parts.items()}
        parts["distance"] = velocity * self._distance_error / self.distance
        # Here the wavelength is that of the moduli's velocity, the same for all rules.
        caveats = tuple(caveat for caveat in time.caveats if caveat.code != "near_field")
        caveats += self._caveats(records.frequency, self.known_velocity(velocity))
        return Value(velocity, "m/s", parts, caveats)

    def known_velocity(self, measured: float) -> float:
        """Return the velocity of the moduli, m/s, or the measured one if they have none."""
        if self.velocity > 0:
            return self.velocity
        return measured

    @cached_property
    def _distance_error(self) -> float:
        """Error of the distance, m: the spheres of a plate are not at the same height.

        The highest spheres send first, so that the error is that of a single height, not of a mean.
        """
        variance = 0.0
        for disc in (self.source, self.receiver):
            variance += float(np.var(self.network.position[disc.spheres(self.network), 2]))
        return float(np.sqrt(variance))

    def _caveats(self, frequency: float, velocity: float) -> tuple[Caveat, ...]:
        """Return the caveats on waves of a frequency, Hz, and a velocity, m/s."""
        caveats = []
        wavelengths = self.distance * frequency / velocity
        if wavelengths < MIN_WAVELENGTHS:
            values = {"wavelengths": wavelengths, "needed": MIN_WAVELENGTHS}
            caveats.append(Caveat("near_field", values))
        wavelength = velocity / frequency / mean_diameter(self.network)
        if wavelength < MIN_WAVELENGTH_IN_D:
            caveats.append(Caveat("wavelength_near_grains", {"wavelength": wavelength}))
        if has_free_sides(self.network):
            caveats.append(Caveat("free_sides"))
        detours = {
            "side_reflections": self._detour_by_sides,
            "end_reflections": self._detour_by_ends,
        }
        for code, detour in detours.items():
            periods = detour * frequency / velocity
            if periods < MAX_REFLECTION_DELAY_IN_PERIODS:
                caveats.append(Caveat(code, {"periods": periods}))
        return tuple(caveats)

    @cached_property
    def _source_is_plane(self) -> bool:
        """Whether the source is as wide as the packing."""
        across = self.network.position[:, :2] - np.asarray(self.source.centre[:2])
        return bool(np.hypot(*across.T).max() <= self.source.radius)

    @cached_property
    def _detour_by_sides(self) -> float:
        """Extra length of the path reflected at a side, m; inf for a plane source.

        A reflection at a free side at the distance w / 2 has the same path as the wave from an
        image at the distance w.
        """
        if self._source_is_plane:
            return np.inf
        width = float(widths(self.network).min())
        return float(np.hypot(self.distance, width)) - self.distance

    @cached_property
    def _detour_by_ends(self) -> float:
        """Extra length of the shortest path by an end, or round a period, over the direct one, m.

        The ways by the ends are those behind the receiver, and behind the source unless it is a
        plane, which no wave passes. Between discs at both ends a wave comes back after two more
        passages.
        """
        if self.network.cell_periodic[2]:
            return float(self.network.cell_size[2]) - 2 * self.distance
        diameter = mean_diameter(self.network)
        low = float(self.network.position[:, 2].min()) - diameter / 2
        high = float(self.network.position[:, 2].max()) + diameter / 2
        source = float(self.source.position_in(self.network)[2])
        receiver = float(self.receiver.position_in(self.network)[2])
        depths = [high - receiver, source - low]
        if source > receiver:
            depths = [receiver - low, high - source]
        if self._source_is_plane:
            depths = depths[:1]
        ways = [2 * depth for depth in depths if depth > MAX_DEPTH_AT_END_IN_D * diameter]
        return min([*ways, 2 * self.distance])
