"""Dynamic structure factor: how much of a standing or a plane wave lies at each frequency.

S_r(f) = sum_i <e_r|i>^2 delta(f - f_i), over all modes i of the packing, where e_r is the pattern
sin(pi r z / L) of every force-bearing sphere, normalised in the mass. Its ridge over kappa_r is the
dispersion relation of a random packing far beyond the modes that can be told by eye, and its width
is the rate at which disorder scatters the wave. Of a periodic cell e is a plane wave exp(i k x)
that fits into it, of equal displacement along k (longitudinal, S_L) or across (transverse, S_T, the
mean over both directions across). Weights add up to 1, and their mean omega^2 is e's own.

No mode is computed: S is the expansion of the delta function in Chebyshev polynomials of the
operator (kernel polynomials: Weisse et al., Rev. Mod. Phys. 78, 275, 2006), in omega as in
`modal.modes.density`. "granular-structure-factor", version 1.

The full width of the ridge of the dynamic structure factor is the rate, in Hz, at which a standing
wave loses its energy to others, over 2 pi. The mean free path is the velocity over that rate. Where
it falls to half a wavelength, l = lambda / 2 (pi times the width is then the frequency), a plane
wave is no longer one: the limit of Ioffe and Regel, a low-pass that needs no threshold.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from analysis.estimators.fits import PowerLaw, power_law, summit
from modal.formats.product import product_of, stored
from modal.formats.provenance import Provenance
from modal.modes.density import FULL_WIDTH, block_width, moments_of
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.solvers.chebyshev import jackson
from modal.system.linear_system import LinearSystem
from modal.tools.errors import InputError, UnavailableError, refuse_unknown

SCHEMA = "granular-structure-factor"
VERSION = 1
POLARISATIONS = {"L": 2, "T": 4}
"""Patterns of one plane wave: cosine and sine, of transverse ones along both directions across."""
AROUND = 0.7, 1.3
"""Part of a frequency between which the width's power of the frequency is fitted."""


@dataclass(frozen=True)
class Scattering:
    """frequency (n,) Hz of the ridge, rising; width (n,) Hz, full at half height; velocity m/s.

    diameter in m. Of the waves whose widths are told from zero.
    """

    frequency: np.ndarray
    width: np.ndarray
    velocity: float
    diameter: float

    def free_path(self, frequency: float) -> float:
        """Mean free path at a frequency (Hz), in diameters: V / (2 pi width).

        The width is straight between the ridge's logarithms; NaN outside.
        """
        if len(self.width) < 2 or not np.isfinite(frequency) or frequency <= 0:
            return np.nan
        f, width = np.log(self.frequency), np.log(self.width)
        there = np.exp(np.interp(np.log(frequency), f, width, np.nan, np.nan))
        return float(self.velocity / (2 * np.pi * there) / self.diameter)

    @property
    def limit(self) -> float:
        """Ioffe-Regel frequency, Hz: the first at which pi times the width reaches it; else NaN."""
        f, excess = self.frequency, np.pi * self.width / self.frequency
        beyond = np.flatnonzero(excess >= 1)
        if not len(beyond) or beyond[0] == 0:
            return np.nan
        pair = [beyond[0] - 1, beyond[0]]
        return float(np.exp(np.interp(0, np.log(excess[pair]), np.log(f[pair]))))

    def of_waves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Frequency, Hz, width, Hz, and mean free path, D, up to the Ioffe-Regel frequency.

        Or up to where the width falls back to half of its largest: what stands out is then no ridge
        but a single line of its noise.
        """
        f, width = self.frequency, self.width
        lost = np.append(width < 0.5 * np.maximum.accumulate(width), True)
        beyond = np.append(np.pi * width >= f, True)
        kept = slice(0, min(int(np.argmax(lost)), int(np.argmax(beyond)) + 1))
        f, width = f[kept], width[kept]
        return f, width, self.velocity / (2 * np.pi * width) / self.diameter

    def power(self, frequency: float) -> PowerLaw:
        """The width as a power of the frequency, about a frequency in Hz."""
        low, high = (part * frequency for part in AROUND)
        steep = (self.frequency > low) & (self.frequency < high)
        return power_law(self.frequency[steep], self.width[steep])


@dataclass(frozen=True)
class StructureFactor:
    """power (R, nf), 1/Hz, at frequency (nf,) Hz of standing waves; each row integrates to 1.

    order (R,) r, wavenumber (R,) pi r / L, rad/m (Eq. 4); of plane waves order (R, 3), the periods
    along x, y and z, and wavenumber the length of the wave vector; `resolution` Hz, the full width
    at half height that a single mode has.
    """

    frequency: Annotated[np.ndarray, stored("", "f", "nf", unit="Hz")]
    order: Annotated[np.ndarray, stored("", "i", "R")]
    wavenumber: Annotated[np.ndarray, stored("", "f", "R", unit="1/m")]
    power: Annotated[np.ndarray, stored("", "f", "R", "nf", unit="1/Hz")]
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
            peak[n] = f[k] + step * summit(*near)
            low, high = np.flatnonzero(row[:k] < row[k] / 2), np.flatnonzero(row[k:] < row[k] / 2)
            if len(low) and len(high):
                a, b = low[-1], k + high[0]
                left = np.interp(row[k] / 2, row[[a, a + 1]], f[[a, a + 1]])
                right = np.interp(row[k] / 2, row[[b, b - 1]], f[[b, b - 1]])
                width[n] = np.sqrt(max((right - left) ** 2 - self.resolution**2, 0))
        return peak, width

    def scattering(self, velocity: float, diameter: float) -> Scattering:
        """What the ridge tells, as far as its frequency rises; `velocity` m/s, `diameter` m."""
        peak, width = self.ridge()
        rising = np.isfinite(peak) & (np.maximum.accumulate(np.nan_to_num(peak)) == peak)
        told = rising & (width > self.resolution / 2)
        return Scattering(peak[told], width[told], velocity, diameter)


FORMAT = product_of(SCHEMA, StructureFactor)


def _patterns(network: Network, waves: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Shape (6n, d w): `waves` (n, w) of force-bearing spheres along each of `directions` (d, 3).

    Scaled by M^1/2.
    """
    bearing = force_bearing(network)
    if not bearing.any():
        raise UnavailableError(
            "no particle has two contacts; such a packing carries no wave", code="carries_no_wave"
        )
    pattern = np.zeros((network.n_particles, 6, len(directions) * waves.shape[1]))
    moving = (waves * bearing[:, None])[:, None, None] * directions.T[:, :, None]
    pattern[:, :3] = moving.reshape(network.n_particles, 3, -1)
    return LinearSystem.of(network).sqrt_mass.times(pattern.reshape(6 * network.n_particles, -1))


def standing_waves(network: Network, orders: np.ndarray) -> np.ndarray:
    """Shape (6n, R): sin(pi r z / L) along z of force-bearing spheres, scaled by M^1/2, unit."""
    if not network.length > 0:
        raise UnavailableError("the walls are in one place: no wave stands", code="no_volume")
    depth = (network.position[:, 2] - network.wall_position[0]) / network.length
    pattern = _patterns(network, np.sin(np.pi * depth[:, None] * orders), np.eye(3)[2:])
    return pattern / np.linalg.norm(pattern, axis=0)


def wave_vectors(network: Network, orders: np.ndarray) -> np.ndarray:
    """Shape (R, 3), rad/m: those with `orders` (R, 3) periods along x, y and z of the cell."""
    orders = np.asarray(orders)
    if orders.ndim != 2 or orders.shape[1] != 3 or orders.dtype.kind != "i" or len(orders) == 0:
        raise InputError("wave vectors: give three whole numbers of periods for each")
    walls = np.flatnonzero(orders.any(axis=0) & ~np.asarray(network.cell_periodic))
    if len(walls):
        raise UnavailableError(
            f"no plane wave goes along {'xyz'[walls[0]]}, where the packing is not periodic; take "
            "standing waves (whole numbers r) between walls",
            code="not_periodic",
        )
    if not orders.any(axis=1).all():
        raise InputError("wave vectors: 0 0 0 is no wave")
    return 2 * np.pi * orders / np.where(network.cell_periodic, network.cell_size, 1.0)


def plane_waves(network: Network, vector: np.ndarray, polarisation: str) -> np.ndarray:
    """Shape (6n, 2) or (6n, 4): cosine and sine of one wave, scaled by M^1/2, squares adding to 1.

    `vector` (3,), rad/m; of transverse waves both directions across it, with half the weight each.
    """
    refuse_unknown("polarisation", polarisation, POLARISATIONS)
    frame = np.linalg.svd((vector / np.linalg.norm(vector))[None])[2]
    phase = network.position @ vector
    waves = np.column_stack([np.cos(phase), np.sin(phase)])
    pattern = _patterns(network, waves, frame[:1] if polarisation == "L" else frame[1:])
    return pattern / np.linalg.norm(pattern)


def structure_factor(
    network: Network,
    orders: np.ndarray,
    resolution: float = 1e3,
    highest: float | None = None,
    polarisation: str = "L",
) -> StructureFactor:
    """S of standing waves r in `orders` (R,), or of plane waves, `orders` (R, 3) periods in a cell.

    To `highest`, Hz (default: the whole band). Plane waves are longitudinal or transverse
    (`POLARISATIONS`). About 1.2 f_max / resolution products with K for each r, twice as many for a
    longitudinal plane wave, four times for a transverse one.
    """
    orders = np.asarray(orders)
    if not 0 < resolution < np.inf or len(orders) == 0 or (orders.ndim == 1 and orders.min() < 1):
        raise InputError("resolution must be a positive number of Hz, the orders 1 or more")
    if orders.ndim == 1:
        of, columns = orders, 1
        wavenumber = np.pi * orders / network.length
    else:
        of, columns = wave_vectors(network, orders), POLARISATIONS[polarisation]
        wavenumber = np.linalg.norm(of, axis=1)

    def waves(some: np.ndarray) -> np.ndarray:
        if orders.ndim == 1:
            return standing_waves(network, some)
        return np.column_stack([plane_waves(network, each, polarisation) for each in some])

    system = LinearSystem.of(network)
    operator, top = system.renumbered, system.spectral_bound
    if top <= 0:
        raise UnavailableError(
            "the network has no stiffness; all its modes are at zero", code="no_stiffness"
        )
    f_top = float(np.sqrt(top) / (2 * np.pi))
    # A line's standard deviation in omega / omega_max is pi over the orders, odd ones included.
    count = max(2, int(np.ceil(np.pi * FULL_WIDTH * f_top / resolution / 2)))
    some = max(1, block_width(system.size) // columns)
    moments = [
        moments_of(
            *(operator, waves(of[first : first + some]), top, count),
            f"structure {first + 1}/{len(of)}",
        ).sum(axis=1)
        for first in range(0, len(of), some)
    ]
    frequency = np.arange(resolution / 5, min(highest or f_top, 0.999 * f_top), resolution / 5)
    angle = np.arccos(frequency / f_top)
    wave = np.cos(2 * angle[:, None] * np.arange(count)) * jackson(count)
    wave[:, 1:] *= 2
    power = np.concatenate(moments) @ (wave * (2 / (np.pi * f_top * np.sin(angle)))[:, None]).T
    power = power.reshape(len(orders), -1, len(frequency)).sum(axis=1)
    return StructureFactor(frequency, orders, wavenumber, power, resolution)


def write_structure(
    path: str | Path, found: StructureFactor, made: Provenance | None = None
) -> None:
    """Write atomically, of standing waves."""
    FORMAT.write(path, vars(found), made)


def read_structure(path: str | Path) -> StructureFactor:
    """Read and validate; InputError with one line for anything wrong."""
    return StructureFactor(**FORMAT.read(path))
