"""Compute the frequency response of a packing to a source, and the gain from wall to wall.

At omega, with a damping gamma that sets the resolution, the motion per unit motion of the source is
(A - s)^-1 c, s = (omega + i gamma)^2, in the notation of `modal.waves.forced_system`: the transform
of the impulse response under the window exp(-gamma t). With z = 2 s / omega_max^2 - 1 and w = z +
sqrt(z^2 - 1), |w| > 1, the Chebyshev recurrence that gives a wave also gives the response:

    1 / (z - x) = 4 / (w - 1/w) * (1/2 + sum_k w^-k T_k(x)).

About omega_max / (2 gamma) ln(1 / tolerance) products with A are enough for all frequencies, and
half as many more confirm the error (`modal.waves.chebyshev`). With dashpots resonances have their
own widths, and no window is needed: at each real frequency (A - i omega D - omega^2) v = push - i
omega drag is solved by one complex factorisation. A recurrence or a computed wave would need too
many steps, because slow modes decay slowest. The format "granular-frequency-response" is defined
here, its columns in `modal.waves.signals`.
"""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy.sparse as sp

from modal.formats.column import Column
from modal.formats.hdf5 import complete
from modal.formats.product import product_of
from modal.formats.provenance import Provenance
from modal.packing.network import Network
from modal.solvers.factor import factorise
from modal.system.contacts import PreStress, Sliding
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Complex, Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_above, refuse_endless
from modal.waves.chebyshev import CHUNK, Resolvent, summed
from modal.waves.discs import Disc
from modal.waves.forced_system import ForcedSystem
from modal.waves.receivers import Receivers
from modal.waves.signals import (
    FILE_VERSIONS,
    Direction,
    Recording,
    is_directed,
    read_recording,
    write_recording,
)
from modal.waves.sources import Source, default_source, direction_of, hold_own_bodies

RESOLUTION = 0.005
"""Default resolution divided by the highest mode's frequency: 1 kHz in the study's packings under
100 kPa."""
RESOLUTION_OF_RANGE = 0.05
"""Largest default resolution divided by the highest frequency of the response, so that at least
eighty frequencies show it."""
MAX_FREQUENCY_OVER_HIGHEST_MODE = 10
"""Largest frequency of a response divided by that of the highest mode, above which all motion
decays with the distance from the source."""
REMEDY = "take fewer frequencies, or a smaller packing"
"""Text of the remedy for a damped response that takes too long or too much memory."""


@dataclass(repr=False, kw_only=True)
class Response(Recording, Drawn):
    """Transfer functions per unit motion of the source, time dependence exp(-i omega t).

    With `damping` of the contacts resonances have their own widths. The chain, the heights of
    layers, `source`, `direction`, and the fields that are empty without walls are as in
    `modal.waves.signals.Signals`.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Frequencies, Hz.
    source_stress, receiver_stress : ndarray of complex (nf,)
        Stresses on both walls, Pa/m, compression positive.
    chain_displacement, layer_displacement : ndarray of complex (nf, nc) and (nf, nl)
        Displacements, m/m.
    resolution : float
        Full width at half height of a single resonance in power, Hz; 0 with `damping`.
    products : int
        Number of products with K; 0 with `damping`.
    damping : ContactDamping or None
        Dashpots of the contacts.

    Examples
    --------
    >>> import modal
    >>> response = modal.frequency_response(modal.fcc(cells=(1, 1, 20)), highest=2e4)
    >>> response.gain.shape == response.frequency.shape
    True
    """

    ROWS = "n"
    INDEX = "frequency"

    frequency: Annotated[Floats, Column("frequency", "f", ("n",), "Hz")]
    resolution: float
    products: int
    damping: ContactDamping | None = None

    def __repr__(self) -> str:
        ends = " to ".join(quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
        width = f"resolution {quantity(self.resolution, 'Hz')}"
        if self.damping:
            width = f"damping {self.damping.normal:g} {self.damping.tangential:g}"
        largest = f"layers move up to {abs(self.layer_displacement).max():.4g} times the source"
        if self.from_wall_to_wall:
            largest = f"gain up to {self.gain.max():.4g}"
        return f"<Response: {len(self.frequency)} frequencies from {ends}, {width}, {largest}>"

    @property
    def from_wall_to_wall(self) -> bool:
        """Whether there is a stress both on the source and on a receiver wall."""
        return bool(len(self.receiver_stress) and len(self.source_stress))

    def draw(self, ax: Any) -> None:
        """Draw the gain factor against frequency."""
        ax.semilogy(self.frequency / 1e3, self.gain)
        ax.set(xlabel="frequency, kHz", ylabel="gain: receiver over source stress")

    @property
    def gain(self) -> Floats:
        """Receiver stress divided by source stress (nf,) (Otsubo et al. 2017, Fig. 19).

        Raises InputError if there are no two walls.
        """
        if not self.from_wall_to_wall:
            raise InputError(
                "no_gain", "a gain is from wall to wall", "this response has no stress on both"
            )
        return abs(self.receiver_stress) / abs(self.source_stress)

    def gain_maxima(self) -> Floats:
        """Return the frequencies (k,), Hz, of the local maxima of the gain, by `maxima`."""
        return maxima(self.frequency, self.gain)[0]


def maxima(frequency: Floats, gain: Floats) -> tuple[Floats, Floats]:
    """Return frequencies (k,), Hz, and heights (k,) of the local maxima of a gain (nf,).

    Each maximum is found from a parabola through three values of 1 / gain^2. For a single resonance
    this is exact.
    """
    inverse = gain**-2.0
    is_minimum = (inverse[1:-1] < inverse[:-2]) & (inverse[1:-1] <= inverse[2:])
    k = 1 + np.flatnonzero(is_minimum)
    left = inverse[k - 1] - inverse[k]
    right = inverse[k + 1] - inverse[k]
    shift = 0.5 * (left - right) / (left + right)
    vertex = inverse[k] - 0.25 * (left - right) * shift
    heights = np.where(vertex > 0, vertex, inverse[k]) ** -0.5
    return frequency[k] + shift * (frequency[1] - frequency[0]), heights


SCHEMA = "granular-frequency-response"
_TABLE = product_of(SCHEMA, Response, versions=FILE_VERSIONS)


def _response_columns() -> dict[str, Column]:
    """Return the columns of the file of a response.

    Columns with components along the source's direction are complex, per metre of its motion.
    """
    columns = dict(_TABLE.columns)
    for name, column in columns.items():
        if is_directed(column):
            columns[name] = column._replace(kind="c", unit=f"{column.unit}/m")
    columns["gain"] = Column("gain", "f", ("n",), "1", optional=True)
    return columns


FORMAT = replace(
    _TABLE,
    columns=_response_columns(),
    attributes={**_TABLE.attributes, "damping": np.ravel},
    defaults={**_TABLE.defaults, "damping": np.empty(0)},
)


@checked
def frequency_response(
    network: Network,
    *,
    source: Source | None = None,
    highest: float | None = None,
    resolution: float | None = None,
    tolerance: float = 1e-5,
    pre_stress: PreStress = "none",
    sliding: Sliding = "elastic",
    direction: Direction | None = None,
    damping: ContactDamping | None = None,
    receivers: Sequence[Disc] = (),
) -> Response:
    """Compute motions, stresses and gain under a steady motion of a source at each frequency.

    Frequencies start at a quarter of the `resolution`, and their spacing is a quarter of it. With
    `damping` the contacts have dashpots; each frequency then takes a factorisation, and resonances
    have their own widths.

    Parameters
    ----------
    network : Network
        The packing.
    source : Source, optional
        As in `modal.propagate`; the source wall by default.
    highest : float, optional
        Highest frequency, Hz; by default that of the highest mode.
    resolution : float, optional
        Width of a resonance, Hz; by default 0.005 of the highest mode's frequency, at most a
        twentieth of `highest`.
    tolerance : float, default 1e-5
        Largest truncation error of the motions, of the stress on the source and of the stress on
        the receiver wall, each relative to its largest value at any frequency. If a stress is
        small, as at an antiresonance, its relative error and that of the gain are larger.
    pre_stress : str, default "none"
        As in `modal.eigenmodes`.
    sliding : str, default "elastic"
        As in `modal.eigenmodes`.
    direction : str, optional
        As in `modal.propagate`.
    damping : ContactDamping, optional
        Dashpots of the contacts (`modal.system.damping`).
    receivers : sequence of Disc, optional
        Discs whose mean motion is recorded.

    Returns
    -------
    Response
        `frequency` (nf,) Hz; `gain` (nf,), receiver stress divided by source stress (Otsubo et al.
        2017, Fig. 19); complex motions and stresses per metre of the source's motion.

    Raises
    ------
    InputError
        If the packing has no stiffness, if the source does not exist in it, or if the response
        would take more than a day or more than the free memory.
    GrowthError
        If K has negative directions.

    Examples
    --------
    >>> import modal
    >>> gain = frequency_response(modal.fcc(cells=(1, 1, 30)), highest=2e4)
    >>> gain.gain_maxima().round(-1)
    array([ 3420., 10250., 17080.])
    """
    source = source or default_source(network)
    direction = direction_of(source, direction)
    system = LinearSystem.of(
        hold_own_bodies(network, source), pre_stress=pre_stress, sliding=sliding, damping=damping
    )
    if resolution is None:
        resolution = default_resolution(system.highest_frequency, highest)
    if not (frequencies(resolution) > 0 and 0 < tolerance < 1):
        raise InputError(
            "resolution_or_tolerance",
            "resolution must be a positive number of Hz, tolerance between 0 and 1",
        )
    readings = Receivers(network, direction, discs=receivers)
    # The window cuts a wave off after about 1 / gamma.
    forced = ForcedSystem.of(system, source, readings, 1 / (np.pi * resolution), tolerance)
    if forced.dashpots:
        frequency, record = _damped_record(forced, highest, resolution)
        products = 0
        resolution = 0.0
    else:
        frequency, record, products = _windowed_record(forced, highest, resolution, tolerance)
        damping = None
    return Response(
        frequency=frequency,
        **readings.columns(record, forced.stresses),
        resolution=resolution,
        products=products,
        source=source.name,
        source_height=source.height_in(network),
        source_position=source.position_in(network),
        damping=damping,
    )


def default_resolution(highest_mode: float, highest: float | None) -> float:
    """Return the default resolution, Hz, of a response up to `highest`, Hz.

    `highest_mode`, Hz, is the frequency of the highest mode.
    """
    resolution = RESOLUTION * highest_mode
    if highest is not None:
        resolution = min(resolution, RESOLUTION_OF_RANGE * float(frequencies(highest)))
    return resolution or 1.0  # a packing without stiffness is refused with the source


def frequencies_up_to(end: float, resolution: float) -> Floats:
    """Return the frequencies (nf,), Hz, below `end`, a quarter of the resolution apart.

    `end` itself is left out, also if it differs by round-off.
    """
    count = int(np.ceil(4 * end / resolution * (1 - 1e-9))) - 1
    return np.arange(1.0, count + 1) * (resolution / 4)


def _end_frequency(spectral_bound: float, highest: float | None, resolution: float) -> float:
    """Return the frequency, Hz, at which a response ends.

    `spectral_bound`, 1/s^2, is the largest omega^2. Raises InputError for an impossible `highest`.
    """
    highest_mode = float(np.sqrt(spectral_bound) / (2 * np.pi))
    end = highest_mode
    if highest is not None:
        end = float(frequencies(highest))
    if not resolution < end <= MAX_FREQUENCY_OVER_HIGHEST_MODE * highest_mode:
        raise InputError(
            "highest_frequency",
            f"highest frequency {end:g} Hz",
            f"must exceed the resolution, and may be {MAX_FREQUENCY_OVER_HIGHEST_MODE} times "
            f"that of the highest mode, {highest_mode:.3g} Hz, above which all motion dies away",
            "give Hz",
        )
    return end


def _windowed_record(
    forced: ForcedSystem, highest: float | None, resolution: float, tolerance: float
) -> tuple[Floats, Complex, int]:
    """Compute a response by an expansion in Chebyshev polynomials.

    Return frequencies (nf,), Hz, the record (nf, count), and the number of products with K.
    """
    # A resonance has the power 1 / ((omega - omega_r)^2 + gamma^2): full width 2 gamma.
    gamma = np.pi * resolution

    def series_for(spectral_bound: float) -> list[Resolvent]:
        end = _end_frequency(spectral_bound, highest, resolution)
        orders = 1.5 * float(np.sqrt(spectral_bound)) / (2 * gamma) * float(np.log(1 / tolerance))
        numbers = (orders + 16 * end / resolution) * forced.count + 4 * CHUNK * orders
        refuse_endless(
            f"a response with a resolution of {resolution:g} Hz",
            forced.springs.operator,
            products=orders,
            bytes_needed=8 * numbers,
            remedy="take a coarser resolution or a lower highest frequency",
        )
        return [Resolvent(frequencies_up_to(end, resolution), gamma, spectral_bound)]

    ((series, record, products, error),) = summed(forced, series_for, tolerance)
    if error > tolerance:
        raise UnavailableError(
            "not_converged",
            f"round-off is up to {error:.1g} of a record",
            f"so little comes through within the window of {1 / gamma:g} s",
            "take a finer resolution or a larger tolerance",
        )
    return series.frequency, record, products


def _damped_record(
    forced: ForcedSystem, highest: float | None, resolution: float
) -> tuple[Floats, Complex]:
    """Compute the response of a system with dashpots by a factorisation for each frequency.

    Return frequencies (nf,), Hz, and the record (nf, count). Raises UnavailableError if the
    factorisations would take more than a day or more than the free memory.
    """
    system = forced.system
    springs = forced.springs
    dashpots = forced.dashpots
    assert dashpots and system.dashpots
    end = _end_frequency(system.spectral_bound, highest, resolution)
    count = 4 * end / resolution

    def refuse_too_large(seconds_each: float) -> None:
        task = f"a damped response at {count:.2g} frequencies takes"
        refuse_above(seconds_each * count, 16.0 * count * forced.count, task, REMEDY)

    refuse_too_large(0.0)
    frequency = frequencies_up_to(end, resolution)
    A = system.assemble_dynamical_matrix()
    D = system.dashpots.assemble_dynamical_matrix()
    identity = sp.identity(system.size, format="csr")
    record: Complex = forced.blank(np.ones(len(frequency), complex))
    started = clock.perf_counter()
    for k in progress(len(frequency), "response"):
        s = -2j * np.pi * frequency[k]
        matrix = (A + s * D + s**2 * identity).tocsr()
        factor = factorise(matrix, symmetric=system.symmetric, remedy=REMEDY)
        load = springs.operator.outward((springs.push + s * dashpots.push).toarray()[0])
        v = springs.operator.inward(factor.solve(load))
        factor.release()
        record[k] += springs.rows @ v
        record[k, : forced.walls] += s * (dashpots.rows @ v + dashpots.held)
        if k == 0:
            refuse_too_large(clock.perf_counter() - started)
    if not np.isfinite(record).all():
        raise UnavailableError(
            "not_converged",
            "the damped response is not finite at one of its frequencies",
            remedy=REMEDY,
        )
    return frequency, record


def write_response(path: str | Path, response: Response, made: Provenance | None = None) -> None:
    """Write a response atomically, with its provenance."""
    gain = None
    if response.from_wall_to_wall:
        gain = response.gain
    damping = []
    if response.damping:
        damping = [response.damping.normal, response.damping.tangential]
    write_recording(FORMAT, path, vars(response) | {"gain": gain, "damping": damping}, made)


def read_response(path: str | Path) -> Response:
    """Read a response that `write_response` has written; `products`, which is not stored, is 0.

    Raises InputError if anything in the file is wrong.
    """
    values = read_recording(FORMAT, path)
    with complete(path):
        ratios = tuple(map(float, values["damping"]))
        values["damping"] = ContactDamping(*ratios) if ratios else None
    values.pop("gain", None)
    return Response(products=0, **values)
