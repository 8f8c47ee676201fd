"""Test a packing with two transducers, as laboratories do: travel times and velocities.

A disc of spheres sends sine bursts, and a second disc above it receives them. The velocity is the
tip-to-tip distance, between the mean centres of the spheres of both discs, divided by the travel
time of each rule (`analysis.estimators.arrival_rules`). For comparison, the velocities of the
longest waves follow from the elastic moduli: the bench test should give these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.estimators.arrival_rules import RULES, RecordPair, Rule
from analysis.transducer_pair import TransducerPair, has_free_sides, widths
from analysis.value import Value
from modal.elasticity.slab import strained_velocities
from modal.elasticity.static_response import elastic_moduli
from modal.formats.tables import html_table
from modal.packing.ends import has_two_ends
from modal.packing.network import Network
from modal.packing.rattlers import firmly_held
from modal.tools.arguments import checked, frequencies
from modal.tools.display import plain, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.waves.bursts import SineBurst
from modal.waves.defaults import PULSE_AMPLITUDE_IN_D, mean_diameter, p_velocity
from modal.waves.discs import Disc
from modal.waves.propagate import propagate_motions
from modal.waves.signals import Direction

RADIUS_IN_WIDTHS = 0.25
"""Default radius of a disc, divided by the packing's smaller width."""
SAMPLES_PER_PERIOD = 40
"""Samples of a record in a period of the highest frequency."""
MIN_SAMPLES_IN_PASSAGE = 200
"""Least number of samples in the passage of the longest waves."""
PASSAGES = 2.0
"""Length of a record, in passages of the longest waves, besides the duration of the burst: grains
delay short waves by half."""
S_OVER_P_VELOCITY = 0.5
"""V_S / V_P where the moduli are not known."""
DEFAULT_WAVELENGTHS_IN_D = (25.0, 12.0, 8.0, 6.0)
"""Wavelengths of the bursts by default, in mean diameters: from those that grains hardly disperse
to the shortest that dense packings pass."""


@dataclass(frozen=True)
class TransducerRow:
    """The velocity by one rule at one frequency.

    Attributes
    ----------
    rule : str
    frequency : float
        Frequency of the burst, Hz.
    velocity : Value
        Velocity, m/s, with its error and caveats.
    near_field : float
        Distance divided by the wavelength at this frequency, computed with the velocity of the
        longest waves.
    """

    rule: Rule
    frequency: float
    velocity: Value
    near_field: float

    def as_json(self) -> dict[str, Any]:
        """Return the row for JSON; unknown numbers are None."""
        return {
            "rule": self.rule,
            "frequency_hz": self.frequency,
            "velocity": plain(self.velocity.value),
            "error": plain(self.velocity.error),
            "near_field": plain(self.near_field),
            "caveats": [str(caveat) for caveat in self.velocity.caveats],
            "codes": self.velocity.codes,
        }


@dataclass(frozen=True, repr=False)
class TransducerTest:
    """The result of `transducers`.

    Attributes
    ----------
    rows : tuple of TransducerRow
        One for each frequency and rule.
    v_p, v_s : float
        Velocities of the longest waves along z by the moduli, m/s; NaN if the packing has none. For
        free sides `v_p` is that of a bar.
    distance : float
        Tip-to-tip distance of the discs, m.
    pairs : tuple of RecordPair
        The two traces at each frequency.
    """

    rows: tuple[TransducerRow, ...]
    v_p: float
    v_s: float
    distance: float
    pairs: tuple[RecordPair, ...]

    def __repr__(self) -> str:
        return (
            f"<TransducerTest: {len(self.pairs)} frequencies over {self.distance:.4g} m, "
            f"V_P {self.v_p:.4g}, V_S {self.v_s:.4g} m/s by the moduli>"
        )

    def _repr_html_(self) -> str:
        """Return a velocity for each frequency and rule as a table, for a notebook."""
        header = ["rule", "frequency", "velocity", "distance / wavelength", "caveats"]
        rows = []
        for row in self.rows:
            caveats = "; ".join(map(str, row.velocity.caveats))
            numbers = [quantity(row.frequency, "Hz"), row.velocity.text(), f"{row.near_field:.2g}"]
            rows.append([row.rule, *numbers, caveats])
        for name, velocity in (("V_P", self.v_p), ("V_S", self.v_s)):
            rows.append([f"{name} by the moduli", "", quantity(velocity, "m/s"), "", ""])
        return html_table(header, rows)

    def as_json(self) -> dict[str, Any]:
        """Return the test for JSON."""
        return {
            "rows": [row.as_json() for row in self.rows],
            "v_p": plain(self.v_p),
            "v_s": plain(self.v_s),
            "distance": self.distance,
        }


@checked
def transducers(
    network: Network,
    at: tuple[float, float] | None = None,
    frequencies_hz: Sequence[float] | None = None,
    *,
    radius: float | None = None,
    direction: Direction = "x",
    cycles: int = 1,
) -> TransducerTest:
    """Send bursts between two discs of spheres in a packing, and read travel times by all rules.

    The source is a plate that moves by a burst of a sine; the receiver is a disc of spheres that
    move freely. Both are in the middle of the cross-section. Contacts are linear springs.

    Parameters
    ----------
    network : Network
        The packing.
    at : pair of float, optional
        Heights z of source and receiver, m; by default those of the two ends of the packing.
    frequencies_hz : sequence of float, optional
        Frequencies of the bursts, Hz; by default those of waves that are 25, 12, 8 and 6 diameters
        long.
    radius : float, optional
        Radius of the discs, m; by default a quarter of the packing's smaller width.
    direction : str, default "x"
        Motion of the discs: x or y for S-waves, z for P-waves.
    cycles : int, default 1
        Periods of a burst.

    Returns
    -------
    TransducerTest
        `rows` with a velocity for each rule and frequency; `v_p` and `v_s` by the moduli, m/s.

    Raises
    ------
    InputError
        If a disc has no spheres, if both are at the same height, if a frequency is not positive, or
        if `at` is left out for a cell that is periodic along z.

    Examples
    --------
    >>> import analysis, modal
    >>> crystal = modal.fcc(cells=(2, 2, 100))
    >>> heights = crystal.length * 0.2, crystal.length * 0.8
    >>> test = analysis.transducers(crystal, heights, [1e4], radius=1.0)
    >>> [row.rule for row in test.rows][:2]
    ['first_arrival', 'zero_crossing']
    """
    if frequencies_hz is not None:
        frequencies_hz = _positive(frequencies_hz)
    if at is None:
        at = _ends(network)
    if radius is None:
        radius = RADIUS_IN_WIDTHS * float(widths(network).min())
    discs = [Disc((*_middle(network), z), radius, direction) for z in at]
    source, receiver = discs
    if set(receiver.spheres(network)) & set(source.spheres(network)):
        raise InputError(
            "discs_overlap",
            f"discs at {at[0]:g} and {at[1]:g} m share spheres",
            remedy="give heights that are some diameters apart",
        )
    v_p, v_s = modulus_velocities(network, direction)
    velocity = v_p if direction == "z" else v_s
    transducer_pair = TransducerPair(network, source, receiver, velocity)
    distance = transducer_pair.distance
    diameter = mean_diameter(network)
    known_velocity = velocity if velocity > 0 else S_OVER_P_VELOCITY * p_velocity(network)
    if frequencies_hz is None:
        frequencies_hz = [known_velocity / (each * diameter) for each in DEFAULT_WAVELENGTHS_IN_D]
    amplitude = PULSE_AMPLITUDE_IN_D * diameter
    bursts = [SineBurst(amplitude, each, cycles) for each in frequencies_hz]
    duration, interval = _record(distance / known_velocity, bursts)
    waves = propagate_motions(
        network, duration, bursts, interval=interval, source=source, receivers=[receiver]
    )
    pairs = tuple(RecordPair.of(wave.signals) for wave in waves)
    rows = [_row(transducer_pair, pair, rule) for pair in pairs for rule in RULES]
    return TransducerTest(tuple(rows), v_p, v_s, distance, pairs)


def _row(transducer_pair: TransducerPair, records: RecordPair, rule: Rule) -> TransducerRow:
    """Return the velocity by a rule from the two records at a frequency."""
    velocity = transducer_pair.measured_velocity(records, rule)
    known_velocity = transducer_pair.known_velocity(velocity.value)
    near_field = transducer_pair.distance * records.frequency / known_velocity
    return TransducerRow(rule, records.frequency, velocity, near_field)


def modulus_velocities(network: Network, direction: Direction) -> tuple[float, float]:
    """Return V_P and V_S, m/s, of the longest waves along z; NaN where there is none.

    V_S is that of motions along `direction`, x for a `direction` of z. Between walls they are those
    of the bulk to 0.4 %, in seconds where all moduli take minutes. A packing with free sides has
    the V_P of a bar, and no V_S: its longest waves across z bend it.
    """
    if has_free_sides(network):
        return _bar_velocity(network), np.nan
    shear_axis = 1 if direction == "y" else 0
    try:
        p_wave, s_wave = strained_velocities(network, (2, shear_axis))
        return p_wave.velocity, s_wave.velocity
    except UnavailableError:
        pass
    try:
        velocities, motions = elastic_moduli(network).waves((0, 0, 1))
    except UnavailableError:
        return np.nan, np.nan
    p_number = int(np.argmax(abs(motions[:, 2])))
    shear_waves = np.delete(np.arange(3), p_number)
    along_axis = abs(motions[shear_waves, shear_axis])
    return float(velocities[p_number]), float(velocities[shear_waves[np.argmax(along_axis)]])


def _bar_velocity(network: Network) -> float:
    """Return the velocity, m/s, of the longest waves along a bar; NaN unless two ends hold it."""
    if not has_two_ends(network):
        return np.nan
    try:
        return strained_velocities(network, (2,))[0].velocity
    except UnavailableError:
        return np.nan


def _ends(network: Network) -> tuple[float, float]:
    """Return the heights, m, of the lowest and the highest spheres of a packing with two ends."""
    if network.cell_periodic[2]:
        raise InputError(
            "no_ends",
            "the packing is periodic along z and has no ends",
            "transducers have no places there",
            "give their heights (--at Z1 Z2)",
        )
    firm = network.position[firmly_held(network), 2]
    return float(firm.min()), float(firm.max())


def _middle(network: Network) -> tuple[float, float]:
    """Return x and y, m, of the middle of the packing."""
    low = network.position[:, :2].min(axis=0)
    high = network.position[:, :2].max(axis=0)
    middle = np.where(network.cell_periodic[:2], network.cell_size[:2] / 2, (low + high) / 2)
    return float(middle[0]), float(middle[1])


def _positive(frequencies_hz: Sequence[float]) -> list[float]:
    """Return the frequencies of bursts, Hz; raise InputError if one is not positive."""
    hertz_values = np.atleast_1d(frequencies(frequencies_hz))
    if not len(hertz_values) or not (hertz_values > 0).all():
        raise InputError("frequency", "a burst of 0 Hz", remedy="give positive frequencies, in Hz")
    return list(map(float, hertz_values))


def _record(passage: float, bursts: Sequence[SineBurst]) -> tuple[float, float]:
    """Return the duration of the records, s, and the time between two samples, s.

    `passage` is the time, s, that the longest waves take from disc to disc.
    """
    longest_burst = max(float(burst.corners[-1]) for burst in bursts)
    highest = max(burst.frequency for burst in bursts)
    interval = min(1 / (SAMPLES_PER_PERIOD * highest), passage / MIN_SAMPLES_IN_PASSAGE)
    return PASSAGES * passage + longest_burst, interval
