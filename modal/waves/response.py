"""Frequency response of a packing to a source, and the gain factor from wall to wall.

At omega, with a damping gamma that sets the resolution, the motion per unit motion of the source
is (A - s)^-1 c, s = (omega + i gamma)^2, in the notation of `modal.waves.forced_system`: the
transform of the impulse response under the window exp(-gamma t). With z = 2 s / omega_max^2 - 1 and
w = z + sqrt(z^2 - 1), |w| > 1, the recurrence that carries a wave carries it too:

    1 / (z - x) = 4 / (w - 1/w) * (1/2 + sum_k w^-k T_k(x)).

About omega_max / (2 gamma) ln(1 / tolerance) products serve all frequencies, and half as many more
make sure of it (`modal.waves.chebyshev`). With dashpots a resonance has a width of its own, and no
window is needed: at real frequencies (A - i omega D - omega^2) v = push - i omega drag is solved
for each by one complex factorisation; neither moments of K nor a wave serve, since a mode that is
slow decays slowest. The format "granular-frequency-response" is defined here, its columns in
`modal.waves.signals`.
"""

import time as clock
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy.sparse as sp

from modal.formats.hdf5 import complete
from modal.formats.product import Column, product_of
from modal.formats.provenance import Provenance
from modal.packing.network import Network
from modal.solvers.factor import factorise
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Complex, Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_above, refuse_endless
from modal.waves.chebyshev import CHUNK, Resolvent, summed
from modal.waves.forced_system import ForcedSystem
from modal.waves.receivers import Receivers
from modal.waves.signals import VERSION, Recording, along, read_recording, write_recording
from modal.waves.sources import Source, Wall

RESOLUTION = 0.005
"""Where none is given, of the highest mode's frequency: 1 kHz in the study's packings under 100
kPa; and at most `RESOLUTION_OF_RANGE` of the highest frequency that is asked for."""
RESOLUTION_OF_RANGE = 0.05
REMEDY = "take fewer frequencies, or a smaller packing"


@dataclass(repr=False, kw_only=True)
class Response(Recording, Drawn):
    """Transfer functions per unit motion of the source, time dependence exp(-i omega t).

    With `damping` of the contacts resonances have their own widths. The chain, heights
    of layers, `source`, `direction` and what is empty without walls are as of
    `modal.waves.signals.Signals`.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Hz.
    source_stress, receiver_stress : ndarray of complex (nf,)
        Pa/m, compression positive.
    chain_displacement, layer_displacement : ndarray of complex (nf, nc) and (nf, nl)
        m/m.
    resolution : float
        Hz, the full width at half height of a single resonance in power; 0 with `damping`.
    products : int
        Products with K; 0 with `damping`.
    damping : ContactDamping or None
        Of the contacts.

    Examples
    --------
    >>> import modal
    >>> found = modal.frequency_response(modal.fcc(cells=(1, 1, 20)), highest=2e4)
    >>> found.gain.shape == found.frequency.shape
    True
    """

    frequency: Annotated[Floats, Column("frequency", "f", ("n",), "Hz")]
    resolution: float
    products: int
    damping: ContactDamping | None = None

    def __repr__(self) -> str:
        ends = " to ".join(quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
        width = f"resolution {quantity(self.resolution, 'Hz')}"
        if self.damping:
            width = f"damping {self.damping.normal:g} {self.damping.tangential:g}"
        most = f"layers move up to {abs(self.layer_displacement).max():.4g} times the source"
        if self.from_wall_to_wall:
            most = f"gain up to {self.gain.max():.4g}"
        return f"<Response: {len(self.frequency)} frequencies from {ends}, {width}, {most}>"

    @property
    def from_wall_to_wall(self) -> bool:
        """Whether there is a stress on the source and on a receiver wall."""
        return bool(len(self.receiver_stress) and len(self.source_stress))

    def draw(self, ax: Any) -> None:
        """Draw the gain factor over frequency."""
        ax.semilogy(self.frequency / 1e3, self.gain)
        ax.set(xlabel="frequency, kHz", ylabel="gain: receiver over source stress")

    @property
    def gain(self) -> Floats:
        """Shape (nf,): receiver stress over source stress (Otsubo et al. 2017, Fig. 19).

        InputError where there are no two walls.
        """
        if not self.from_wall_to_wall:
            raise InputError(
                "input", "a gain is from wall to wall", remedy="this response has no stress on both"
            )
        return abs(self.receiver_stress) / abs(self.source_stress)

    def gain_maxima(self) -> Floats:
        """Shape (number of maxima,), Hz: where the gain has a local maximum.

        Found between the frequencies of the response as `maxima` has it.
        """
        return maxima(self.frequency, self.gain)[0]


def maxima(frequency: Floats, gain: Floats) -> tuple[Floats, Floats]:
    """Frequencies (k,) Hz and heights (k,) of the local maxima of a gain (nf,).

    By the parabola through three values of 1 / gain^2, which of a single resonance is one.
    """
    g = gain**-2.0
    k = 1 + np.flatnonzero((g[1:-1] < g[:-2]) & (g[1:-1] <= g[2:]))
    left, right = g[k - 1] - g[k], g[k + 1] - g[k]
    shift = 0.5 * (left - right) / (left + right)
    least = g[k] - 0.25 * (left - right) * shift
    heights = np.where(least > 0, least, g[k]) ** -0.5
    return frequency[k] + shift * (frequency[1] - frequency[0]), heights


BEYOND = 10
"""Times the highest mode's frequency up to which a response may go."""
SCHEMA = "granular-frequency-response"
_TABLE = product_of(SCHEMA, Response, versions=VERSION)
FORMAT = replace(
    _TABLE,
    columns={
        **{name: along(c, kind="c", unit=f"{c.unit}/m") for name, c in _TABLE.columns.items()},
        "gain": Column("gain", "f", ("n",), "1", optional=True),
    },
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
    pre_stress: str = "none",
    sliding: str = "elastic",
    direction: str = "z",
    damping: ContactDamping | None = None,
) -> Response:
    """What a steady motion of a source does at each frequency: motions, stresses, gain.

    Frequencies go from a quarter of a `resolution` up, four to a resolution. With `damping` the
    contacts have dashpots; then each frequency takes a factorisation, and resonances have their own
    widths.

    Parameters
    ----------
    network : Network
        The packing.
    source : Source, optional
        As of `modal.propagate`: the source wall by default.
    highest : float, optional
        Last frequency, Hz; the top of the spectrum by default.
    resolution : float, optional
        Width that a resonance has, Hz; by default 0.005 of the highest mode's frequency, at most a
        twentieth of `highest`.
    tolerance : float, default 1e-5
        What the expansion leaves out at most: of the motions, of the stress on the source and of
        that on the receiver wall, in parts of the largest of each at any frequency. Where a stress
        is small, as at an antiresonance, it and the gain are off by more of their own.
    pre_stress : str, default "none"
        As of `modal.eigenmodes`.
    sliding : str, default "elastic"
        As of `modal.eigenmodes`.
    direction : str, default "z"
        As of `modal.propagate`.
    damping : ContactDamping, optional
        Dashpots of the contacts (`modal.system.damping`).

    Returns
    -------
    Response
        `frequency` (nf,) Hz; `gain` (nf,), receiver over source stress (Otsubo et al. 2017, Fig.
        19); complex motions and stresses per metre of the source's motion.

    Raises
    ------
    InputError
        For packings without stiffness, for a source that they do not have, and where it would take
        more than a day or the memory.
    GrowthError
        Where K has negative directions.

    Examples
    --------
    >>> import modal
    >>> gain = frequency_response(modal.fcc(cells=(1, 1, 30)), highest=2e4)
    >>> gain.gain_maxima().round(-1)
    array([ 3420., 10250., 17080.])
    """
    system = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding, damping=damping)
    if resolution is None:
        resolution = default_resolution(system.highest_frequency, highest)
    if not (frequencies(resolution) > 0 and 0 < tolerance < 1):
        raise InputError(
            "input", "resolution must be a positive number of Hz, tolerance between 0 and 1"
        )
    source, receivers = source or Wall(), Receivers(system.network, direction)
    # The window leaves of a wave what comes within 1 / gamma.
    forced = ForcedSystem.of(system, source, receivers, 1 / (np.pi * resolution), tolerance)
    record_of = _damped if forced.dashpots else _windowed
    frequency, record, products = record_of(forced, highest, resolution, tolerance)
    return Response(
        frequency=frequency,
        **receivers.columns(record, forced.stresses),
        resolution=0.0 if forced.dashpots else resolution,
        products=products,
        source=source.name,
        source_height=source.height_in(network),
        damping=damping if forced.dashpots else None,
    )


def default_resolution(highest_mode: float, highest: float | None) -> float:
    """Return the resolution, Hz, of a response up to `highest`, Hz, of modes to `highest_mode`."""
    resolution = RESOLUTION * highest_mode
    if highest is not None:
        resolution = min(resolution, RESOLUTION_OF_RANGE * float(frequencies(highest)))
    return resolution or 1.0  # a packing without stiffness is refused with the source


def frequencies_up_to(end: float, resolution: float) -> Floats:
    """Return the frequencies (nf,), Hz, below `end`: four to a resolution, from a quarter of one.

    Round-off does not decide whether `end` itself is among them.
    """
    count = int(np.ceil(4 * end / resolution * (1 - 1e-9))) - 1
    return np.arange(1.0, count + 1) * (resolution / 4)


def _end(top: float, highest: float | None, resolution: float) -> float:
    """Hz: where the frequencies end; `top` is the end of the spectrum in omega^2, 1/s^2."""
    last = float(np.sqrt(top) / (2 * np.pi))
    end = last if highest is None else float(frequencies(highest))
    if not resolution < end <= BEYOND * last:
        raise InputError(
            "input",
            f"highest frequency {end:g} Hz",
            f"must exceed the resolution, and may be {BEYOND} times "
            f"that of the highest mode, {last:.3g} Hz, above which all motion dies away",
            "give Hz",
        )
    return end


def _windowed(
    forced: ForcedSystem, highest: float | None, resolution: float, tolerance: float
) -> tuple[Floats, Complex, int]:
    """Frequencies (nf,), Hz, what is recorded at them (nf, count), and products with K."""
    # A resonance has the power 1 / ((omega - omega_r)^2 + gamma^2): full width 2 gamma.
    gamma = np.pi * resolution

    def series_for(top: float) -> Resolvent:
        end = _end(top, highest, resolution)
        orders = 1.5 * float(np.sqrt(top)) / (2 * gamma) * float(np.log(1 / tolerance))
        numbers = (orders + 16 * end / resolution) * forced.count + 4 * CHUNK * orders
        refuse_endless(
            f"a response with a resolution of {resolution:g} Hz",
            forced.springs.operator,
            products=orders,
            bytes_needed=8 * numbers,
            remedy="take a coarser resolution or a lower highest frequency",
        )
        return Resolvent(frequencies_up_to(end, resolution), gamma, top)

    series, record, products, error = summed(forced, series_for, tolerance)
    if error > tolerance:
        raise UnavailableError(
            "not_converged",
            f"round-off is up to {error:.1g} of a record",
            f"so little comes through within the window of {1 / gamma:g} s",
            "take a finer resolution or a larger tolerance",
        )
    return series.frequency, record, products


def _damped(
    forced: ForcedSystem, highest: float | None, resolution: float, _: float
) -> tuple[Floats, Complex, int]:
    """The same of dashpots, by a factorisation for each frequency, which takes no products.

    InputError where these would take more than the memory or more than a day.
    """
    system, springs, dashpots = forced.system, forced.springs, forced.dashpots
    assert dashpots and system.dashpots
    end = _end(system.spectral_bound, highest, resolution)
    count = 4 * end / resolution

    def refuse(seconds: float) -> None:
        task = f"a damped response at {count:.2g} frequencies takes"
        refuse_above(seconds * count, 16.0 * count * forced.count, task, REMEDY)

    refuse(0.0)
    frequency = frequencies_up_to(end, resolution)
    A, C = system.assemble_dynamical_matrix(), system.dashpots.assemble_dynamical_matrix()
    identity = sp.identity(system.size, format="csr")
    record: Complex = forced.blank(np.ones(len(frequency), complex))
    started = clock.perf_counter()
    for k in progress(len(frequency), "response"):
        s = -2j * np.pi * frequency[k]
        matrix = (A + s * C + s**2 * identity).tocsr()
        factor = factorise(matrix, symmetric=system.symmetric, remedy=REMEDY)
        load = springs.operator.outward((springs.push + s * dashpots.push).toarray()[0])
        v = springs.operator.inward(factor.solve(load))
        factor.release()
        record[k] += springs.rows @ v
        record[k, : forced.walls] += s * (dashpots.rows @ v + dashpots.held)
        if k == 0:
            refuse(clock.perf_counter() - started)
    if not np.isfinite(record).all():
        raise UnavailableError(
            "not_converged",
            "the damped response is not finite at a frequency of its own",
            remedy=f"{REMEDY}",
        )
    return frequency, record, 0


def write_response(path: str | Path, response: Response, made: Provenance | None = None) -> None:
    """Write the response atomically."""
    ratios = response.damping
    more = {
        "gain": response.gain if response.from_wall_to_wall else None,
        "damping": [ratios.normal, ratios.tangential] if ratios else [],
    }
    write_recording(FORMAT, path, vars(response) | more, made)


def read_response(path: str | Path) -> Response:
    """What `write_response` has written, `products` unknown (0); InputError for anything wrong."""
    said = read_recording(FORMAT, path)
    with complete(path):
        ratios = tuple(map(float, said["damping"]))
        said["damping"] = ContactDamping(*ratios) if ratios else None
    said.pop("gain", None)
    return Response(products=0, **said)
