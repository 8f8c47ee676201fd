"""Find the standing waves sin(pi r z / L) among the modes of a packing (Fig. 10, Table 2).

The P resonances of a crystal are pure. In a random packing many modes share the r-th standing wave;
the share of mode i is <e_r|i>^2, where e_r is the pattern of all force-bearing spheres, normalised
with the mass. The r-th resonance is the mode with the largest share, which is what a reader of mode
shapes would choose; the share measures how pure the resonance is.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimators.fits import straight_line, summit
from analysis.estimators.structure_factor import standing_waves
from modal.packing.network import Network

MIN_SHARE = 0.25
"""Smallest largest share with which a standing wave belongs to a mode; with a smaller one it
belongs to none."""
HIGHEST_ORDER = 40
FITTED_ROWS = slice(1, 10)
"""Rows of the orders r = 2 ... 10, to which the velocity of long waves is fitted."""
MIN_FITTED_ORDERS = 5
MIN_ORDER = 0.6
"""Lowest order r = kappa L / pi of a fitted sine; a longer sine could be an offset as well."""
ORDER_OFFSETS = np.linspace(-0.5, 0.5, 101)
"""Differences between the orders of the fitted sines and the whole number r."""


@dataclass(frozen=True)
class Standing:
    """The resonances of the orders r = 1 ... R.

    Attributes
    ----------
    frequency : ndarray (R,)
        Hz.
    share : ndarray (R,)
        Share of the standing wave that the mode contains, at most 1.
    row : ndarray (R,) of int
        Row of the mode in the mode set.
    next_share : float
        Largest share of the next standing wave in any mode, below `MIN_SHARE`; NaN if all waves up
        to `HIGHEST_ORDER` belong to modes.
    """

    frequency: np.ndarray
    share: np.ndarray
    row: np.ndarray
    next_share: float = np.nan


def standing_modes(frequency: np.ndarray, z_shape: np.ndarray, network: Network) -> Standing:
    """Find the resonances r = 1, 2, ... up to the first standing wave without a mode.

    `frequency` (k,), Hz, and `z_shape` (k, n), the mass-normalised displacements along z, are those
    of the modes.
    """
    orders = np.arange(1, HIGHEST_ORDER + 1)
    along_z = standing_waves(network, orders).reshape(network.n_particles, 6, -1)[:, 2]
    share = (z_shape @ (along_z * np.sqrt(network.mass)[:, None])) ** 2
    row = np.argmax(share, axis=0)
    largest = share[row, np.arange(len(orders))]
    without_mode = np.flatnonzero(largest < MIN_SHARE)
    count = len(orders)
    next_share = np.nan
    if len(without_mode):
        count = without_mode[0]
        next_share = float(largest[count])
    return Standing(frequency[row[:count]], largest[:count], row[:count], next_share)


def fitted_wavenumbers(shape: np.ndarray, depth: np.ndarray, length: float) -> np.ndarray:
    """Return the wave number kappa (R,), 1/m, of the sine that fits each shape best.

    `shape` (R, p) are those of the orders r = 1 ... R, `depth` (p,) is the distance from the source
    wall and `length` that from wall to wall, m. Phase and wave number are free, because walls that
    yield make standing waves longer than by Eq. 4. NaN if the wave number of the best sine differs
    by more than half an order.
    """
    wavenumbers = np.full(len(shape), np.nan)
    angle = np.pi * depth / length
    # exp(i kappa z) for all offsets from an order; the sums of its square give those of products.
    offset_wave = np.exp(1j * np.outer(angle, ORDER_OFFSETS))
    offset_wave_squared = offset_wave**2
    for row, u in enumerate(shape):
        order_wave = np.exp(1j * (row + 1) * angle)
        overlap = (u * order_wave) @ offset_wave
        products = order_wave**2 @ offset_wave_squared
        # What the best a sin(kappa z) + b cos(kappa z) explains of the sum of u^2.
        explained = 2 * (len(u) * abs(overlap) ** 2 - (products.conj() * overlap**2).real)
        explained /= len(u) ** 2 - abs(products) ** 2
        kappa = np.pi * (row + 1 + ORDER_OFFSETS) / length
        allowed = kappa > MIN_ORDER * np.pi / length
        kappa = kappa[allowed]
        explained = explained[allowed]
        top = int(np.argmax(explained))
        if 0 < top < len(kappa) - 1:
            shift = summit(explained[top - 1], explained[top], explained[top + 1])
            wavenumbers[row] = kappa[top] + shift * (kappa[1] - kappa[0])
    return wavenumbers


def long_wave_velocity(frequency: np.ndarray, wavenumber: np.ndarray) -> tuple[float, float]:
    """Return V_P of the longest waves and its standard error, m/s.

    V is fitted in omega / kappa = V (1 + b kappa^2) to the orders r = 2 ... 10. `frequency` (R,),
    Hz, and `wavenumber` (R,), 1/m, are those of r = 1 ... R. NaN if R is below ten, or if fewer
    than `MIN_FITTED_ORDERS` of the nine are known.
    """
    if len(frequency) < FITTED_ROWS.stop:
        return np.nan, np.nan
    kappa = wavenumber[FITTED_ROWS]
    velocity = 2 * np.pi * frequency[FITTED_ROWS] / kappa
    if np.isfinite(velocity).sum() < MIN_FITTED_ORDERS:
        return np.nan, np.nan
    return straight_line(kappa**2, velocity).at(0.0)
