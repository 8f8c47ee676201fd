"""The standing waves sin(pi r z / L) among the modes of a disordered packing (Fig. 10, Table 2).

A crystal's P resonances are pure. In a random packing the r-th standing wave is shared by many
modes; its share in mode i is <e_r|i>^2, with e_r the pattern of all force-bearing spheres,
normalised in the mass. The r-th resonance is the mode with the largest share, which is what a
reader of mode shapes would choose, with the share as the measure of how far it is one.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimators.fits import straight_line, summit
from analysis.estimators.structure_factor import standing_waves
from modal.packing.network import Network

LEAST_SHARE = 0.25
"""Below it the standing wave belongs to no mode."""
HIGHEST_ORDER = 40
LONG = 1, 10
"""Of r - 1: the orders that the velocity of long waves is fitted to."""


@dataclass(frozen=True)
class Standing:
    """Of r = 1 ... R: frequency (R,) Hz, share (R,) of the pattern, row (R,) in the mode set."""

    frequency: np.ndarray
    share: np.ndarray
    row: np.ndarray


def standing_modes(frequency: np.ndarray, z_shape: np.ndarray, network: Network) -> Standing:
    """The resonances r = 1, 2, ... up to the first that no mode bears.

    Of modes: frequency (k,) Hz, and their mass-normalised displacements along z, `z_shape` (k, n).
    """
    orders = np.arange(1, HIGHEST_ORDER + 1)
    along_z = standing_waves(network, orders).reshape(network.n_particles, 6, -1)[:, 2]
    share = (z_shape @ (along_z * np.sqrt(network.mass)[:, None])) ** 2
    row = np.argmax(share, axis=0)
    largest = share[row, np.arange(len(orders))]
    lost = np.flatnonzero(largest < LEAST_SHARE)
    kept = slice(0, lost[0] if len(lost) else len(orders))
    return Standing(frequency[row[kept]], largest[kept], row[kept])


def fitted_wavenumbers(shape: np.ndarray, depth: np.ndarray, length: float) -> np.ndarray:
    """kappa (R,) 1/m of the sine that fits each of the shapes (R, p) best, r = 1 ... R in order.

    `depth` (p,) from the source wall and `length` from wall to wall, m. Phase and wave number are
    free: walls that give way make the standing waves longer than Eq. 4 has them. NaN where the best
    is more than half an order off.
    """
    found = np.full(len(shape), np.nan)
    offsets = np.linspace(-0.5, 0.5, 101)
    angle = np.pi * depth / length
    # exp(i kappa z) of all offsets from an order; its square has the sums of products in it.
    aside = np.exp(1j * np.outer(angle, offsets))
    twice = aside**2
    for k, u in enumerate(shape):
        middle = np.exp(1j * (k + 1) * angle)
        both, products = (u * middle) @ aside, middle**2 @ twice
        # What the best a sin(kappa z) + b cos(kappa z) explains of the sum of u^2.
        explained = 2 * (len(u) * abs(both) ** 2 - (products.conj() * both**2).real)
        explained /= len(u) ** 2 - abs(products) ** 2
        kappa = np.pi * (k + 1 + offsets) / length
        kept = kappa > 0.6 * np.pi / length
        kappa, explained = kappa[kept], explained[kept]
        at = int(np.argmax(explained))
        if 0 < at < len(kappa) - 1:
            shift = summit(*explained[at - 1 : at + 2])
            found[k] = kappa[at] + shift * (kappa[1] - kappa[0])
    return found


def long_wave_velocity(frequency: np.ndarray, wavenumber: np.ndarray) -> tuple[float, float]:
    """V_P, m/s, and its standard error: omega / kappa = V (1 + b kappa^2), r = 2 ... 10.

    frequency (R,) Hz and wavenumber (R,) 1/m of r = 1 ... R; NaN with fewer than ten.
    """
    if len(frequency) < LONG[1]:
        return np.nan, np.nan
    f, kappa = frequency[slice(*LONG)], wavenumber[slice(*LONG)]
    velocity = 2 * np.pi * f / kappa
    if np.isfinite(velocity).sum() < 5:
        return np.nan, np.nan
    return straight_line(kappa**2, velocity).at(0.0)
