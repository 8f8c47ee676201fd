"""Compute the dynamic structure factor: the frequencies that a standing or plane wave contains.

For a standing wave, S_r(f) = sum_i <e_r|i>^2 delta(f - f_i) over all modes i of the packing, where
e_r is the pattern sin(pi r z / L) of every force-bearing sphere, normalised with the mass. The
ridge of S over kappa_r is the dispersion relation of a random packing, far beyond the modes that
can be identified by eye; its width is the rate at which disorder scatters the wave. In a periodic
cell e is a plane wave exp(i k x) that fits into the cell, with equal displacement along k
(longitudinal, S_L) or across k (transverse, S_T, the mean over both directions). S integrates to 1,
and its mean omega^2 equals e . A e.

No mode is computed: S is the expansion of the delta function in Chebyshev polynomials of the
operator (kernel polynomials: Weisse et al., Rev. Mod. Phys. 78, 275, 2006), in omega as in
`modal.modes.density`. The files are "granular-structure-factor", version 1.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from analysis.estimators.fits import summit
from analysis.estimators.scattering import Scattering
from modal.formats.column import stored
from modal.formats.product import product_of
from modal.formats.provenance import Provenance
from modal.modes.density import FULL_WIDTH
from modal.modes.moments import block_width, moments_of
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.solvers.chebyshev import jackson
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError, UnavailableError, refuse_unknown

SCHEMA = "granular-structure-factor"
VERSION = 1
POLARISATIONS = {"L": 2, "T": 4}
"""Number of patterns of one plane wave: a cosine and a sine, for transverse waves along both
directions across the wave vector."""
SMALLEST_WIDTH_RATIO = 0.5
"""Least width, relative to the resolution, that counts as a width of the wave."""
LINES_PER_RESOLUTION = 5
"""Number of computed frequencies within the full width of a single mode's line."""
HIGHEST_FREQUENCY_RATIO = 0.999
"""Highest frequency, divided by that of the spectral bound: at the bound the Chebyshev expansion
diverges."""


class PowerPeak(NamedTuple):
    """The largest power of a wave on the grid of frequencies, with the powers beside it.

    grid_frequency: where it is, Hz. step: of the grid, Hz. before, largest, behind: powers, 1/Hz.
    """

    grid_frequency: float
    step: float
    before: float
    largest: float
    behind: float

    @property
    def frequency(self) -> float:
        """Return where the parabola through the logarithms of the three powers is highest, Hz."""
        powers = np.array([self.before, self.largest, self.behind])
        before, largest, behind = np.log(np.maximum(powers, np.finfo(float).tiny))
        return float(self.grid_frequency + self.step * summit(before, largest, behind))


@dataclass(frozen=True)
class StructureFactor:
    """The dynamic structure factor of standing or plane waves.

    Attributes
    ----------
    frequency : ndarray (nf,)
        Hz.
    order : ndarray (R,) or (R, 3)
        Order r of standing waves; for plane waves, the numbers of periods in the cell along x, y
        and z.
    wavenumber : ndarray (R,)
        Wave number pi r / L (Eq. 4), or the length of the wave vector, rad/m.
    power : ndarray (R, nf)
        Structure factor of each wave, 1/Hz; each row integrates to 1.
    resolution : float
        Full width at half height of a single mode, Hz.
    """

    frequency: Annotated[np.ndarray, stored("", "f", "nf", unit="Hz")]
    order: Annotated[np.ndarray, stored("", "i", "R")]
    wavenumber: Annotated[np.ndarray, stored("", "f", "R", unit="1/m")]
    power: Annotated[np.ndarray, stored("", "f", "R", "nf", unit="1/Hz")]
    resolution: float

    def ridge(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the frequency (R,), Hz, of each row's maximum and its width (R,), Hz.

        Widths are full widths at half height, after subtracting the resolution in squares, because
        both lines are nearly Gaussian. A width below a fifth of the resolution cannot be
        distinguished from zero. NaN if the maximum or half of its height lies outside the
        frequencies.
        """
        frequency = np.full(len(self.order), np.nan)
        width = np.full(len(self.order), np.nan)
        for n, row in enumerate(self.power):
            peak = self.peak_of_row(n)
            if peak is not None:
                frequency[n] = peak.frequency
                width[n] = self._width(row, int(np.argmax(row)))
        return frequency, width

    def peak_of_row(self, row: int) -> PowerPeak | None:
        """Return the largest power of a row; None if it is at either end of the frequencies."""
        power = self.power[row]
        top = int(np.argmax(power))
        if not 0 < top < len(power) - 1:
            return None
        step = float(self.frequency[1] - self.frequency[0])
        return PowerPeak(float(self.frequency[top]), step, *power[top - 1 : top + 2].tolist())

    def _width(self, row: np.ndarray, top: int) -> float:
        """Return the full width at half height, Hz, of a row (nf,) whose maximum is at `top`."""
        half = row[top] / 2
        below_before = np.flatnonzero(row[:top] < half)
        below_behind = np.flatnonzero(row[top:] < half)
        if not len(below_before) or not len(below_behind):
            return np.nan
        first = below_before[-1]
        rise = [first, first + 1]
        last = top + below_behind[0]
        fall = [last, last - 1]
        left = np.interp(half, row[rise], self.frequency[rise])
        right = np.interp(half, row[fall], self.frequency[fall])
        return np.sqrt(max((right - left) ** 2 - self.resolution**2, 0))

    def scattering(self, velocity: float, diameter: float) -> Scattering:
        """Return the part of the ridge where its frequency rises and its width is known.

        `velocity` is that of the long waves, m/s, `diameter` that of the spheres, m.
        """
        peak, width = self.ridge()
        highest_peak = np.maximum.accumulate(np.nan_to_num(peak))
        rising = np.isfinite(peak) & (highest_peak == peak)
        used = rising & (width > self.resolution * SMALLEST_WIDTH_RATIO)
        return Scattering(peak[used], width[used], velocity, diameter)


FORMAT = product_of(SCHEMA, StructureFactor)


def _patterns(network: Network, waves: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return patterns (6n, d w) of force-bearing spheres, scaled by M^1/2.

    Each of the `waves` (n, w) moves spheres along each of the `directions` (d, 3).
    """
    bearing = force_bearing(network)
    if not bearing.any():
        raise UnavailableError(
            "carries_no_wave",
            "no particle has two contacts",
            remedy="such a packing carries no wave",
        )
    pattern = np.zeros((network.n_particles, 6, len(directions) * waves.shape[1]))
    displacement = (waves * bearing[:, None])[:, None, None] * directions.T[:, :, None]
    pattern[:, :3] = displacement.reshape(network.n_particles, 3, -1)
    return LinearSystem.of(network).sqrt_mass.times(pattern.reshape(6 * network.n_particles, -1))


def standing_waves(network: Network, orders: np.ndarray) -> np.ndarray:
    """Return the patterns (6n, R) of standing waves: sin(pi r z / L) along z, scaled by M^1/2.

    Only force-bearing spheres move; each pattern has the norm 1. Raises UnavailableError if the
    walls are at the same height.
    """
    if not network.length > 0:
        raise UnavailableError("no_volume", "the walls are in one place", "no wave stands")
    depth = (network.position[:, 2] - network.wall_position[0]) / network.length
    pattern = _patterns(network, np.sin(np.pi * depth[:, None] * orders), np.eye(3)[2:])
    return pattern / np.linalg.norm(pattern, axis=0)


def wave_vectors(network: Network, orders: np.ndarray) -> np.ndarray:
    """Return the wave vectors (R, 3), rad/m, with `orders` (R, 3) periods along x, y and z.

    InputError if orders are not three whole numbers each or all zero, UnavailableError along an
    axis on which the packing is not periodic.
    """
    orders = np.asarray(orders)
    if orders.ndim != 2 or orders.shape[1] != 3 or orders.dtype.kind != "i" or len(orders) == 0:
        raise InputError(
            "wave_vector", "wave vectors", remedy="give three whole numbers of periods for each"
        )
    not_periodic = np.flatnonzero(orders.any(axis=0) & ~np.asarray(network.cell_periodic))
    if len(not_periodic):
        raise UnavailableError(
            "not_periodic",
            f"no plane wave goes along {'xyz'[not_periodic[0]]}, where the packing is not periodic",
            remedy="take standing waves (whole numbers r) between walls",
        )
    if not orders.any(axis=1).all():
        raise InputError("zero_wave_vector", "wave vectors", "0 0 0 is no wave")
    if network.cell_vectors is not None:
        # k . a = 2 pi n along each of the three periods a.
        return 2 * np.pi * orders @ np.linalg.inv(network.cell_vectors).T
    return 2 * np.pi * orders / np.where(network.cell_periodic, network.cell_size, 1.0)


def plane_waves(network: Network, vector: np.ndarray, polarisation: str) -> np.ndarray:
    """Return the patterns of a plane wave, scaled by M^1/2, whose squares add to 1.

    Longitudinal waves ("L") have a cosine and a sine, (6n, 2). Transverse ones ("T") have them
    along both directions across the `vector` (3,), rad/m, with half the weight each, (6n, 4).
    """
    refuse_unknown("polarisation", polarisation, POLARISATIONS)
    frame = np.linalg.svd((vector / np.linalg.norm(vector))[None])[2]
    directions = frame[:1]
    if polarisation == "T":
        directions = frame[1:]
    phase = network.position @ vector
    waves = np.column_stack([np.cos(phase), np.sin(phase)])
    pattern = _patterns(network, waves, directions)
    return pattern / np.linalg.norm(pattern)


def structure_factor(
    network: Network,
    orders: np.ndarray,
    resolution: float = 1e3,
    highest: float | None = None,
    polarisation: str = "L",
) -> StructureFactor:
    """Compute the dynamic structure factor of standing waves or of plane waves.

    This takes about 1.2 f_max / resolution products with K for each standing wave, twice as many
    for a longitudinal plane wave, four times as many for a transverse one.

    Parameters
    ----------
    network : Network
    orders : ndarray (R,) or (R, 3) of int
        Orders r of standing waves, or numbers of periods of plane waves in the cell along x, y and
        z.
    resolution : float
        Full width at half height of a single mode, Hz.
    highest : float, optional
        Highest frequency, Hz; by default that of the whole band.
    polarisation : {"L", "T"}
        Whether plane waves are longitudinal or transverse.
    """
    orders = np.asarray(orders)
    if not 0 < resolution < np.inf or len(orders) == 0 or (orders.ndim == 1 and orders.min() < 1):
        raise InputError(
            "resolution_or_orders",
            "resolution must be a positive number of Hz, the orders 1 or more",
        )
    if orders.ndim == 1:
        waves = orders
        patterns_per_wave = 1
        wavenumber = np.pi * orders / network.length
    else:
        refuse_unknown("polarisation", polarisation, POLARISATIONS)
        waves = wave_vectors(network, orders)
        patterns_per_wave = POLARISATIONS[polarisation]
        wavenumber = np.linalg.norm(waves, axis=1)

    def patterns(part: np.ndarray) -> np.ndarray:
        if orders.ndim == 1:
            return standing_waves(network, part)
        return np.column_stack([plane_waves(network, vector, polarisation) for vector in part])

    system = LinearSystem.of(network)
    if system.spectral_bound <= 0:
        raise UnavailableError(
            "no_stiffness", "the network has no stiffness", remedy="all its modes are at zero"
        )
    f_top = float(np.sqrt(system.spectral_bound) / (2 * np.pi))
    # A line's standard deviation in omega / omega_max is pi over the orders, odd ones included.
    count = max(2, int(np.ceil(np.pi * FULL_WIDTH * f_top / resolution / 2)))
    waves_together = max(1, block_width(system.size) // patterns_per_wave)
    moments = _moments(system, patterns, waves, waves_together, count)
    step = resolution / LINES_PER_RESOLUTION
    if not highest:
        highest = f_top
    frequency = np.arange(step, min(highest, HIGHEST_FREQUENCY_RATIO * f_top), step)
    angle = np.arccos(frequency / f_top)
    kernel = np.cos(2 * angle[:, None] * np.arange(count)) * jackson(count)
    kernel[:, 1:] *= 2
    power = moments @ (kernel * (2 / (np.pi * f_top * np.sin(angle)))[:, None]).T
    power = power.reshape(len(orders), -1, len(frequency)).sum(axis=1)
    return StructureFactor(frequency, orders, wavenumber, power, resolution)


def _moments(
    system: LinearSystem,
    patterns: Callable[[np.ndarray], np.ndarray],
    waves: np.ndarray,
    waves_together: int,
    count: int,
) -> np.ndarray:
    """Return the first `count` Chebyshev moments of the displacement pattern of each wave.

    `waves` (R, ...) are the orders or wave vectors; `patterns` returns the displacement patterns
    (6n, ...) of some of them; `waves_together` waves are computed at once.

    `patterns` returns the patterns of some of the waves; `waves_together` are computed at once.
    """
    moments = []
    for first in range(0, len(waves), waves_together):
        part = waves[first : first + waves_together]
        label = f"structure {first + 1}/{len(waves)}"
        by_component = moments_of(
            system.renumbered, patterns(part), system.spectral_bound, count, label
        )
        moments.append(by_component.sum(axis=1))
    return np.concatenate(moments)


def write_structure(
    path: str | Path, found: StructureFactor, made: Provenance | None = None
) -> None:
    """Write the structure factor of standing waves, with its provenance, atomically."""
    FORMAT.write(path, vars(found), made)


def read_structure(path: str | Path) -> StructureFactor:
    """Read and validate a structure factor; InputError for any fault."""
    return StructureFactor(**FORMAT.read(path))
