"""Provide a page with a wave: motion of all spheres, signals of some, slip in contacts.

Keys are those that `packing.js` and `player.js` read.
"""

from typing import Any, NamedTuple

import numpy as np

from analysis.watch.coding import SHADES, code_displacements, code_numbers, round_numbers
from modal.packing.network import Network
from modal.tools.arrays import Floats, Ints
from modal.tools.display import quantity
from modal.waves.signals import TORSION, WALL_SOURCES, Signals

MAX_MOTION_BYTES = 7_500_000
"""Largest size of the displacements in a page, bytes; base64 makes 10 MB of text of it."""
MIN_FRAMES = 100
MAX_FRAMES = 400
"""Least and largest number of times of a wave in a page: as many as fit into `MAX_MOTION_BYTES`."""
BYTES_A_SPHERE = 2
"""Bytes of a sphere at one time: a page shows one component of a wave's displacement."""
SHOWN_SIGNALS = 16
"""Number of spheres of the chain whose signals can be chosen."""
MIN_TYPICAL_DISPLACEMENT = 1e-3
"""Least displacement that has full colours, divided by the largest."""
PRODUCERS = {
    "yade": "a wave simulated by YADE",
    "linear": "the linear wave of its contacts' springs",
    "nonlinear": "a wave whose contacts slide and open",
}
"""Descriptions of waves by the program that computed them."""
DECADES = 4
"""Powers of ten below the largest slip energy that are shown: eyes distinguish no more."""
MAX_SPECTRUM_FREQUENCY = 2.5
"""Highest frequency of the spectra divided by that of the pulse."""


def describe_wave(network: Network, signals: Signals, moved: np.ndarray) -> dict[str, Any]:
    """Return the displacements (n_times, n) of all spheres, m, and the signals of some.

    The times are thinned to as many as a page can contain.
    """
    n_times = len(signals.time)
    frames = _choose_frames(n_times, network.n_particles)
    largest = float(abs(moved).max()) or 1.0
    # A wave that has left the wall is small beside the push: colours are full at its size.
    typical = float(np.median(abs(moved[frames]).max(axis=1)))
    typical = max(typical, MIN_TYPICAL_DISPLACEMENT * largest)
    interval = float(np.mean(np.diff(signals.time)))
    frequency = np.fft.rfftfreq(n_times, interval)
    in_band = frequency <= MAX_SPECTRUM_FREQUENCY * signals.input_frequency
    heights = signals.chain_position
    traces = signals.chain_displacement
    whose = "the sphere"
    if not len(heights):  # without two walls there is no chain
        heights = signals.layer_position
        traces = signals.layer_displacement
        whose = "the layer"
    wall = signals.source_displacement[frames]
    if signals.source not in WALL_SOURCES or signals.direction == TORSION:
        wall = 0 * wall
    recorded = _describe_motion(signals)
    shown_signals = []
    for column in _choose_signals(heights):
        displacement = traces[:, column]
        amplitude = abs(np.fft.rfft(displacement))
        shown_signals.append(
            {
                "name": f"{whose} at z = {1e3 * heights[column]:.1f} mm",
                "displacement": round_numbers(1e9 * displacement),
                "spectrum": round_numbers(1e15 * interval * amplitude[in_band]),
            }
        )
    return {
        "kind": "wave",
        "told": (
            f"{network.n_particles:,} spheres; {PRODUCERS.get(signals.producer, 'a wave')}, "
            f"pulse of {quantity(signals.input_frequency, 'Hz')}, "
            f"{recorded.source}; {len(frames)} of {n_times} recorded times. "
            f"Coloured by {recorded.colour}."
        ),
        "along": signals.direction,
        "symbol": recorded.symbol,
        "unit": recorded.unit,
        "time": round_numbers(1e6 * signals.time[frames]),
        "displacement": code_displacements(moved[frames], largest),
        "real": largest,
        "largest_nm": 1e9 * largest,
        "wall_displacement": round_numbers(1e9 * wall),
        "contrast": float(np.log10(largest / typical)),
        "signal_time": round_numbers(1e6 * signals.time),
        "spectrum_frequency": round_numbers(frequency[in_band] / 1e3),
        "signals": shown_signals,
    }


def _choose_frames(n_times: int, n_spheres: int) -> Ints:
    """Return the indices of the times that are shown, evenly spaced over the record."""
    fitting = MAX_MOTION_BYTES // (BYTES_A_SPHERE * n_spheres)
    count = int(np.clip(fitting, MIN_FRAMES, MAX_FRAMES))
    return np.unique(np.linspace(0, n_times - 1, min(count, n_times)).round().astype(int))


class _RecordedMotion(NamedTuple):
    """Words for the motion in a wave's record, and for its source.

    symbol, unit: symbol and unit of the motion. colour: meaning of the colours. source: name of the
    source.
    """

    symbol: str
    unit: str
    colour: str
    source: str


def _describe_motion(signals: Signals) -> _RecordedMotion:
    """Return the words for a record: displacements along an axis, or turns about z."""
    unit = "rad" if signals.direction == TORSION else "m"
    source = f"{quantity(2 * signals.amplitude, unit)} high"
    if signals.source not in WALL_SOURCES:
        source = f"from the {signals.source}"
    if signals.direction == TORSION:
        return _RecordedMotion("θ_z", "nrad", "turn about z, which moves no centre", source)
    colour = f"displacement along {signals.direction}"
    return _RecordedMotion(f"u_{signals.direction}", "nm", colour, source)


def _choose_signals(heights: Floats) -> Ints:
    """Return the columns (k,) whose signals are shown, evenly spaced in height, lowest first."""
    ascending = np.argsort(heights)
    places = np.linspace(0, len(ascending) - 1, SHOWN_SIGNALS).round().astype(int)
    return ascending[np.unique(places)]


def describe_slip(network: Network, signals: Signals) -> dict[str, Any]:
    """Return the energy that slip dissipated at each sphere, on a logarithmic scale.

    The result is empty if nothing slid.
    """
    if signals.slip_ends is None or signals.slip_energy is None:
        return {}
    dissipated = slip_of_spheres(network.n_particles, signals.slip_ends, signals.slip_energy)
    largest = float(dissipated.max())
    if not largest > 0:
        return {}
    smallest = 10.0**-DECADES * largest
    height = np.log10(np.maximum(dissipated, smallest) / largest) / DECADES + 1
    total = quantity(float(signals.slip_energy.sum()), "J", 3)
    count = len(signals.slip_energy)
    return {
        "slip": code_numbers(np.round(SHADES * height), "u1"),
        "slip_ends": [f"{10.0**-DECADES:g} of it or less", quantity(largest, "J", 3)],
        "slip_decades": DECADES,
        "slip_told": f"Slip dissipated {total} in {count} contacts.",
    }


def slip_of_spheres(count: int, ends: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Return the energy (count,), J, that slip dissipated at each sphere.

    Each of the two spheres `ends` (k, 2) of a contact gets half of its energy (k,). A contact with
    a wall (a negative second end) gives all to its sphere, so that the sum is that over contacts.
    """
    first, second = ends.T
    is_pair = second >= 0
    share_of_first = np.where(is_pair, 0.5, 1.0)
    at_first: np.ndarray = np.bincount(first, share_of_first * energy, count)
    return at_first + np.bincount(second[is_pair], 0.5 * energy[is_pair], count)
