"""Frequency response from source wall to chain and receiver wall, and the gain factor.

At omega, with a damping gamma that sets the resolution, the motion per unit motion of the source
wall is (A - s)^-1 c, s = (omega + i gamma)^2, in the notation of `modal.waves.propagate`: the
transform of the impulse response under the window exp(-gamma t). With z = 2 s / omega_max^2 - 1 and
w = z + sqrt(z^2 - 1), |w| > 1, the recurrence that carries a wave carries it too:

    1 / (z - x) = 4 / (w - 1/w) * (1/2 + sum_k w^-k T_k(x)).

About omega_max / (2 gamma) ln(1 / tolerance) products serve all frequencies, and half as many more
make sure of it (`modal.waves.chebyshev`). Of viscous contacts the response is that at real
frequencies (`modal.waves.damped_response`). The format
"granular-frequency-response", version 1, is defined here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from modal.formats.hdf5 import complete, get, open_h5, put
from modal.formats.provenance import Provenance, new_product
from modal.packing.network import Network
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.contacts import with_sliding
from modal.system.damping import ContactDamping
from modal.system.operator import ContactOperator
from modal.tools.arguments import checked
from modal.tools.arrays import Complex, Floats, Ints
from modal.tools.display import axes_of, quantity
from modal.tools.errors import InputError
from modal.tools.workload import refuse_above, refuse_endless
from modal.waves.chebyshev import summed
from modal.waves.damped_response import REMEDY, damped_rows
from modal.waves.driven import Driven
from modal.waves.receivers import Receivers
from modal.waves.weights import CHUNK, Resolvent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA = "granular-frequency-response"
VERSION = 1


@dataclass(repr=False)
class Response:
    """Transfer functions per unit motion of the source wall, time dependence exp(-i omega t).

    frequency (nf,) Hz; source_stress, receiver_stress (nf,) complex, Pa/m, compression positive;
    chain_displacement (nf, nc) and layer_displacement (nf, nl) complex, m/m; `resolution` Hz, the
    full width at half height of a single resonance in power; `products` with K; `direction` of the
    wall and of all motions and stresses. With `damping` of the contacts resonances have their own
    widths, `resolution` is 0 and there are no products.
    """

    frequency: Floats
    source_stress: Complex
    receiver_stress: Complex
    chain_particle: Ints
    chain_displacement: Complex
    layer_position: Floats
    layer_displacement: Complex
    resolution: float
    products: int
    direction: str = "z"
    damping: ContactDamping | None = None

    def __repr__(self) -> str:
        ends = " to ".join(quantity(float(f), "Hz") for f in self.frequency[[0, -1]])
        width = f"resolution {quantity(self.resolution, 'Hz')}"
        if self.damping:
            width = f"damping {self.damping.normal:g} {self.damping.tangential:g}"
        return (
            f"<Response: {len(self.frequency)} frequencies from {ends}, {width}, gain up to "
            f"{self.gain.max():.4g}>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the gain factor over frequency; returns the Axes."""
        ax = axes_of(ax)
        ax.semilogy(self.frequency / 1e3, self.gain)
        ax.set(xlabel="frequency, kHz", ylabel="gain: receiver over source stress")
        return ax

    @property
    def gain(self) -> Floats:
        """Shape (nf,): receiver stress over source stress (Otsubo et al. 2017, Fig. 19)."""
        return abs(self.receiver_stress) / abs(self.source_stress)

    def gain_maxima(self) -> Floats:
        """Shape (number of maxima,), Hz: where the gain has a local maximum.

        Found between the frequencies of the response by a parabola through the logarithm of three.
        """
        g = np.log(self.gain)
        k = 1 + np.flatnonzero((g[1:-1] > g[:-2]) & (g[1:-1] >= g[2:]))
        bend = g[k - 1] - 2 * g[k] + g[k + 1]
        shift = 0.5 * (g[k - 1] - g[k + 1]) / bend
        return self.frequency[k] + shift * (self.frequency[1] - self.frequency[0])


@checked
def frequency_response(
    network: Network,
    *,
    highest: float | None = None,
    resolution: float = 1e3,
    tolerance: float = 1e-5,
    pre_stress: str = "none",
    sliding: str = "elastic",
    direction: str = "z",
    damping: ContactDamping | None = None,
) -> Response:
    """What a steady motion of the source wall does at each frequency: motions, stresses, gain.

    Frequencies from a quarter of a `resolution` to `highest`, Hz (the top of the spectrum where it
    is None), four to a resolution, which is the width that damping gives a resonance. The result
    has `gain` (nf,), receiver over source stress (Otsubo et al. 2017, Fig. 19), and complex
    motions and stresses per metre of the wall's motion. `tolerance` bounds what the expansion
    leaves out of each record: of the motions, the stress on the source and that on the receiver
    wall, relative to the largest of each at any of the frequencies. Where a stress is small, as at
    an antiresonance, it and the gain are off by more of their own. `pre_stress` as in
    `modal.system.contacts`, `sliding` as of `modal.eigenmodes`; `direction` of the wall's
    motion, x or y for S-waves.

    With `damping` (`modal.system.damping`) the contacts have dashpots and the response is that
    at real frequencies, which are as close as said, by a factorisation for each of them.

    InputError for packings without walls or stiffness, and where it would take more than a day or
    the memory; GrowthError where K has negative directions.

    >>> import modal
    >>> gain = frequency_response(modal.fcc(cells=(1, 1, 30)), highest=2e4)
    >>> gain.gain_maxima().round(-1)
    array([ 3420., 10250., 17080.])
    """
    if not (0 < resolution < np.inf and 0 < tolerance < 1):
        raise InputError("resolution must be a positive number of Hz, tolerance between 0 and 1")
    network = with_sliding(network, sliding)
    if damping is not None and not damping.none:
        if pre_stress != "none":
            raise InputError(f"pre-stress {pre_stress!r} with damping: take none")
        own = Receivers(network, direction=direction)
        top, _ = bound_of_spectrum(ContactOperator(network, mass_scaled=True))
        end = _end(top, highest, resolution)
        refuse_above(
            0.0,
            64.0 * end / resolution * own.count,
            f"a damped response at {4 * end / resolution:.2g} frequencies takes",
            REMEDY,
        )
        frequency = np.arange(resolution / 4, end, resolution / 4)
        found = damped_rows(network, damping, own, frequency)
        return _response(own, frequency, found, resolution=0.0, products=0, damping=damping)
    # A resonance has the power 1 / ((omega - omega_r)^2 + gamma^2): full width 2 gamma.
    gamma = np.pi * resolution
    # The window leaves of a wave what comes within 1 / gamma.
    driven = Driven(network, 1 / gamma, tolerance, pre_stress=pre_stress, direction=direction)
    receivers = driven.receivers

    def series_for(top: float) -> Resolvent:
        end = _end(top, highest, resolution)
        orders = 1.5 * float(np.sqrt(top)) / (2 * gamma) * float(np.log(1 / tolerance))
        frequencies = 4 * end / resolution
        numbers = (orders + 4 * frequencies) * receivers.count + 4 * CHUNK * orders
        refuse_endless(
            f"a response with a resolution of {resolution:g} Hz",
            driven.operator,
            products=orders,
            bytes_needed=8 * numbers,
            remedy="take a coarser resolution or a lower highest frequency",
        )
        return Resolvent(np.arange(resolution / 4, end, resolution / 4), gamma, top)

    def largest(series: Resolvent, record: Complex) -> Floats:
        return receivers.largest(record, np.ones(len(series.frequency)))

    series, record, products, error = summed(
        driven.operator, driven.start, receivers, series_for, largest, tolerance
    )
    if error > tolerance:
        raise InputError(
            f"round-off is up to {error:.1g} of a record: so little comes through within the "
            f"window of {1 / gamma:g} s; take a finer resolution or a larger tolerance"
        )
    return _response(receivers, series.frequency, record, resolution=resolution, products=products)


def _end(top: float, highest: float | None, resolution: float) -> float:
    """Hz: where the frequencies end; `top` is the end of the spectrum in omega^2, 1/s^2."""
    end = float(np.sqrt(top)) / (2 * np.pi) if highest is None else highest
    if not resolution < end < np.inf:
        raise InputError(f"highest frequency {end:g} Hz: must exceed the resolution")
    return end


def _response(
    receivers: Receivers,
    frequency: Floats,
    rows: Complex,
    *,
    resolution: float,
    products: int,
    damping: ContactDamping | None = None,
) -> Response:
    """The response of the rows (nf, receivers.count) that are observed at the frequencies."""
    c, nl = 2 + len(receivers.chain), len(receivers.layers.position)
    return Response(
        frequency=frequency,
        source_stress=(receivers.source_stiffness - rows[:, 0]) / receivers.area,
        receiver_stress=rows[:, 1] / receivers.area,
        chain_particle=receivers.chain,
        chain_displacement=rows[:, 2:c],
        layer_position=receivers.layers.position,
        layer_displacement=rows[:, c : c + nl],
        resolution=resolution,
        products=products,
        direction=receivers.direction,
        damping=damping,
    )


def write_response(
    path: str | Path,
    response: Response,
    network_sha256: str = "",
    made: Provenance | None = None,
) -> None:
    """Write the response atomically; complex numbers as a last axis of real and imaginary part."""
    with new_product(path, SCHEMA, VERSION, made) as file:
        file.attrs["network_sha256"] = network_sha256
        file.attrs.update(resolution=response.resolution, direction=response.direction)
        if response.damping:
            file.attrs["damping"] = [response.damping.normal, response.damping.tangential]
        put(file, "frequency", response.frequency, "Hz")
        put(file, "gain", response.gain, "1")
        put(file, "chain/particle", response.chain_particle.astype(np.int32), "1")
        put(file, "layers/position", response.layer_position, "m")
        for name, values, units in (
            ("source/stress", response.source_stress, "Pa/m"),
            ("receiver/stress", response.receiver_stress, "Pa/m"),
            ("chain/displacement", response.chain_displacement, "m/m"),
            ("layers/displacement", response.layer_displacement, "m/m"),
        ):
            put(file, name, np.stack([values.real, values.imag], axis=-1), units)


def read_response(path: str | Path) -> Response:
    """What `write_response` has written, `products` unknown (0); InputError for anything wrong."""
    with open_h5(path, SCHEMA, VERSION) as file:
        frequency = get(file, "frequency", "f", (None,))
        particle = get(file, "chain/particle", "i", (None,))
        layer = get(file, "layers/position", "f", (None,))
        complexes = {}
        for name, columns in (
            ("source/stress", ()),
            ("receiver/stress", ()),
            ("chain/displacement", particle.shape),
            ("layers/displacement", layer.shape),
        ):
            parts = get(file, name, "f", (*frequency.shape, *columns, 2))
            complexes[name.replace("layers", "layer").replace("/", "_")] = (
                parts[..., 0] + 1j * parts[..., 1]
            )
        with complete(path):
            resolution = float(file.attrs["resolution"])
            direction = str(file.attrs.get("direction", "z"))
            ratios = file.attrs.get("damping")
            damping = None if ratios is None else ContactDamping(*map(float, ratios))
    return Response(
        frequency=frequency,
        chain_particle=particle,
        layer_position=layer,
        resolution=resolution,
        products=0,
        direction=direction,
        damping=damping,
        **complexes,
    )
