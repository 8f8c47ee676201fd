"""Dynamic structure factor: how much of a standing wave lies at each frequency.

S_r(f) = sum_i <e_r|i>^2 delta(f - f_i), over all modes i of the packing, where e_r is the pattern
sin(pi r z / L) of every force-bearing sphere, normalised in the mass. Its ridge over kappa_r is the
dispersion relation of a random packing far beyond the modes that can be told by eye, and its width
is the rate at which disorder scatters the wave. No mode is computed: S_r is the expansion of the
delta function in Chebyshev polynomials of the operator (kernel polynomials: Weisse et al., Rev.
Mod. Phys. 78, 275, 2006), in omega as in `modal.modes.density`. "granular-structure-factor",
version 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modal.formats.product import Column, Product
from modal.formats.provenance import Provenance
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.solvers.spectrum import bound_of_spectrum
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.waves.signals import DIRECTIONS

SCHEMA = "granular-structure-factor"
VERSION = 1
FORMAT = Product(
    SCHEMA,
    {
        "frequency": Column("frequency", "f", ("nf",), "Hz"),
        "order": Column("order", "i", ("R",), "1"),
        "wavenumber": Column("wavenumber", "f", ("R",), "1/m"),
        "power": Column("power", "f", ("R", "nf"), "1/Hz"),
    },
    {"network_sha256": str, "resolution": float},
)
BLOCK = 8
"""Patterns that share one pass over the contacts: bounds the memory."""
FULL_WIDTH = 2 * np.sqrt(2 * np.log(2))


@dataclass(frozen=True)
class StructureFactor:
    """power (R, nf), 1/Hz, at frequency (nf,) Hz of standing waves; each row integrates to 1.

    order (R,) r, wavenumber (R,) pi r / L, rad/m (Eq. 4); of plane waves order (R, 3), the periods
    along x, y and z, and wavenumber the length of the wave vector; `resolution` Hz, the full width
    at half height that a single mode has.
    """

    frequency: np.ndarray
    order: np.ndarray
    wavenumber: np.ndarray
    power: np.ndarray
    resolution: float

    def ridge(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequency (R,) Hz of each row's maximum, and its width (R,), the resolution taken off.

        Widths are full at half height; both lines are near-Gaussian, so squares subtract. What is
        below a fifth of the resolution is not told from zero. NaN where half height is outside.
        """
        peak, width = np.full((2, len(self.order)), np.nan)
        f, step = self.frequency, self.frequency[1] - self.frequency[0]
        for n, row in enumerate(self.power):
            k = int(np.argmax(row))
            if not 0 < k < len(row) - 1:
                continue
            near = np.log(np.maximum(row[k - 1 : k + 2], np.finfo(float).tiny))
            bend = near[0] - 2 * near[1] + near[2]
            peak[n] = f[k] + 0.5 * step * (near[0] - near[2]) / bend
            low, high = np.flatnonzero(row[:k] < row[k] / 2), np.flatnonzero(row[k:] < row[k] / 2)
            if len(low) and len(high):
                a, b = low[-1], k + high[0]
                left = np.interp(row[k] / 2, row[[a, a + 1]], f[[a, a + 1]])
                right = np.interp(row[k] / 2, row[[b, b - 1]], f[[b, b - 1]])
                width[n] = np.sqrt(max((right - left) ** 2 - self.resolution**2, 0))
        return peak, width


def standing_waves(network: Network, orders: np.ndarray, direction: str = "z") -> np.ndarray:
    """Shape (6n, R): sin(pi r z / L) of force-bearing spheres, scaled by M^1/2, unit.

    They move along `direction`: z for P-waves, x or y for S-waves.
    """
    if direction not in DIRECTIONS:
        raise InputError(f"direction {direction!r}: choose x, y or z")
    bearing = force_bearing(network)
    if not bearing.any():
        raise InputError("no particle has two contacts; such a packing carries no wave")
    depth = (network.position[:, 2] - network.wall_position[0]) / network.length
    pattern = np.zeros((network.n_particles, 6, len(orders)))
    pattern[:, DIRECTIONS.index(direction)] = (
        np.sin(np.pi * depth[:, None] * orders) * bearing[:, None]
    )
    pattern = RootMass.of(network).times(pattern.reshape(-1, len(orders)))
    return pattern / np.linalg.norm(pattern, axis=0)


def structure_factor(
    network: Network,
    orders: np.ndarray,
    resolution: float = 1e3,
    highest: float | None = None,
    direction: str = "z",
) -> StructureFactor:
    """S_r(f) of the standing waves r in `orders` (R,), to `highest` (Hz; default: the whole band).

    The spheres move along `direction`: z for P-waves, x or y for S-waves.

    About 1.2 f_max / resolution products with K for each r.
    """
    orders = np.asarray(orders, int)
    if not 0 < resolution < np.inf or len(orders) == 0 or orders.min() < 1:
        raise InputError("resolution must be a positive number of Hz, the orders 1 or more")
    frequency, power = power_of_patterns(
        network,
        lambda part: standing_waves(network, orders[part], direction),
        len(orders),
        resolution,
        highest,
    )
    return StructureFactor(frequency, orders, np.pi * orders / network.length, power, resolution)


def power_of_patterns(
    network: Network,
    patterns: Callable[[slice], np.ndarray],
    number: int,
    resolution: float,
    highest: float | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Frequency (nf,), Hz, and power (R, nf), 1/Hz, of a `number` R of patterns of motion.

    `patterns` gives some of them as unit vectors (6n, r), scaled by M^1/2; each row integrates to
    1, or to 0 for a pattern of zeros.
    """
    operator = ContactOperator(network, mass_scaled=True)
    top, _ = bound_of_spectrum(operator)
    if top <= 0:
        raise InputError("the network has no stiffness; all its modes are at zero")
    f_top = float(np.sqrt(top) / (2 * np.pi))
    # A line's standard deviation in omega / omega_max is pi over the orders, odd ones included.
    count = max(2, int(np.ceil(np.pi * FULL_WIDTH * f_top / resolution / 2)))
    moments = np.empty((number, count))
    for first in range(0, number, BLOCK):
        part = slice(first, first + BLOCK)
        label = f"structure {first // BLOCK + 1}/{-(-number // BLOCK)}"
        moments[part] = _moments(operator, patterns(part), top, count, label)
    frequency = np.arange(resolution / 5, min(highest or f_top, 0.999 * f_top), resolution / 5)
    angle = np.arccos(frequency / f_top)
    wave = np.cos(2 * angle[:, None] * np.arange(count)) * _jackson(count)
    wave[:, 1:] *= 2
    power = moments @ (wave * (2 / (np.pi * f_top * np.sin(angle)))[:, None]).T
    return frequency, power


def _moments(
    operator: ContactOperator, start: np.ndarray, top: float, count: int, label: str
) -> np.ndarray:
    """Shape (R, count): <e|T_k(X)|e>; T_2k = 2 T_k T_k - 1 halves the products."""
    found = np.empty((start.shape[1], count))
    found[:, 0] = size = (start * start).sum(axis=0)
    before = start.copy()
    now = operator.accumulate(start, -start, 2 / top)
    found[:, 1] = first = (start * now).sum(axis=0)
    for done in progress(count // 2, label):
        k = done + 1
        if 2 * k < count:
            found[:, 2 * k] = 2 * (now * now).sum(axis=0) - size
        ahead = operator.accumulate(now, -2 * now - before, 4 / top)
        if 2 * k + 1 < count:
            found[:, 2 * k + 1] = 2 * (now * ahead).sum(axis=0) - first
        before, now = now, ahead
    return found


def _jackson(count: int) -> np.ndarray:
    """Shape (count,): damping of the even orders, which makes a delta a positive near-Gaussian."""
    orders = 2 * count
    k, step = np.arange(0, orders, 2), np.pi / (orders + 1)
    turn = np.cos(k * step) * (orders + 1 - k) + np.sin(k * step) / np.tan(step)
    return turn / (orders + 1)


def write_structure(
    path: str | Path,
    found: StructureFactor,
    network_sha256: str = "",
    made: Provenance | None = None,
) -> None:
    """Write atomically, of standing waves."""
    FORMAT.write(path, vars(found) | {"network_sha256": network_sha256}, made)


def read_structure(path: str | Path) -> StructureFactor:
    """Read and validate; InputError with one line for anything wrong."""
    found = FORMAT.read(path)
    del found["network_sha256"]
    return StructureFactor(**found)
