"""Dynamic structure factors S_L and S_T of a cell that is periodic in all directions.

S(k, f) = sum_i |<e|i>|^2 delta(f - f_i) over all modes i, e the plane wave exp(i k x) of every
force-bearing sphere, of equal displacement along k (longitudinal, S_L) or across (transverse, S_T,
the mean over both directions across), normalised in the mass. The wave vectors are those that fit
into the cell. Two ways to see it: with a resolution, as in `analysis.estimators.structure_factor`,
for what disorder makes of a wave; and as the few lines that Lanczos' recursion finds, which are
exact where the wave is a sum of few modes, as in a crystal (R. Haydock, Solid State Physics 35,
215, 1980). Both keep the sum rules: the weights add up to 1, and their mean omega^2 is e's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import eigh_tridiagonal

from analysis.estimators.structure_factor import StructureFactor, power_of_patterns
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.errors import InputError

POLARISATIONS = ("L", "T")


def wave_vectors(network: Network, orders: np.ndarray) -> np.ndarray:
    """Shape (R, 3), rad/m: those with `orders` (R, 3) periods along x, y and z of the cell."""
    orders = np.asarray(orders)
    if orders.ndim != 2 or orders.shape[1] != 3 or orders.dtype.kind != "i" or len(orders) == 0:
        raise InputError("wave vectors: give three whole numbers of periods for each")
    for axis in range(3):
        if orders[:, axis].any() and not network.cell_periodic[axis]:
            raise InputError(
                f"no plane wave goes along {'xyz'[axis]}, where the packing is not periodic; take "
                "standing waves (structure_factor) between walls"
            )
    if not orders.any(axis=1).all():
        raise InputError("wave vectors: 0 0 0 is no wave")
    periods = np.where(network.cell_periodic, network.cell_size, 1.0)
    return 2 * np.pi * orders / periods


def plane_patterns(network: Network, vector: np.ndarray, polarisation: str) -> np.ndarray:
    """Shape (6n, 2) or (6n, 4): cosine and sine of one wave, scaled by M^1/2, squares adding to 1.

    `vector` (3,), rad/m; of transverse waves both directions across it, with half the weight each.
    """
    if polarisation not in POLARISATIONS:
        raise InputError(f"polarisation {polarisation!r}: choose one of {', '.join(POLARISATIONS)}")
    bearing = force_bearing(network)
    if not bearing.any():
        raise InputError("no particle has two contacts; such a packing carries no wave")
    along = vector / np.linalg.norm(vector)
    frame = np.linalg.svd(along[None])[2]
    directions = frame[:1] if polarisation == "L" else frame[1:]
    phase = network.position @ vector
    pattern = np.zeros((network.n_particles, 6, 2 * len(directions)))
    for k, direction in enumerate(directions):
        for part, wave in enumerate((np.cos(phase), np.sin(phase))):
            pattern[:, :3, 2 * k + part] = (wave * bearing)[:, None] * direction
    pattern = RootMass.of(network).times(pattern.reshape(-1, 2 * len(directions)))
    return pattern / np.linalg.norm(pattern)


def plane_structure_factor(
    network: Network,
    orders: np.ndarray,
    polarisation: str = "L",
    resolution: float = 1e3,
    highest: float | None = None,
) -> StructureFactor:
    """S_L or S_T of plane waves with `orders` (R, 3) periods in the cell, to `highest`, Hz.

    About 2.4 f_max / resolution products with K for each longitudinal wave, twice as many for each
    transverse one.
    """
    if not 0 < resolution < np.inf:
        raise InputError("resolution must be a positive number of Hz")
    vectors = wave_vectors(network, orders)
    rows = []
    for vector in vectors:
        pattern = plane_patterns(network, vector, polarisation)
        frequency, power = power_of_patterns(
            network, partial(_columns, pattern), pattern.shape[1], resolution, highest
        )
        rows.append(power.sum(axis=0))
    wavenumber = np.linalg.norm(vectors, axis=1)
    return StructureFactor(frequency, np.asarray(orders), wavenumber, np.array(rows), resolution)


def _columns(pattern: np.ndarray, part: slice) -> np.ndarray:
    return pattern[:, part]


@dataclass(frozen=True)
class Lines:
    """Lines of a structure factor: frequency (k,), Hz, and weight (k,), which add up to 1."""

    frequency: np.ndarray
    weight: np.ndarray


def plane_lines(
    network: Network, order: np.ndarray, polarisation: str = "L", steps: int = 12
) -> Lines:
    """The lines of S_L or S_T of one wave, `order` (3,), by so many steps of Lanczos' recursion.

    Exact where the wave is a sum of no more than `steps` modes; else the first 2 `steps` moments
    in omega^2 are.
    """
    (vector,) = wave_vectors(network, np.asarray(order)[None])
    operator = ContactOperator(network, mass_scaled=True)
    squares, weights = [], []
    for start in plane_patterns(network, vector, polarisation).T:
        size = float(start @ start)
        if size > np.finfo(float).eps:
            square, weight = _gauss_lines(operator, start / np.sqrt(size), steps)
            squares.append(square)
            weights.append(size * weight)
    square = np.concatenate(squares)
    frequency = np.sign(square) * np.sqrt(abs(square)) / (2 * np.pi)
    ascending = np.argsort(frequency)
    return Lines(frequency[ascending], np.concatenate(weights)[ascending])


def _gauss_lines(
    operator: ContactOperator, start: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """omega^2 (k,) and weights (k,) of the Gauss rule that Lanczos makes of a unit vector."""
    basis, diagonal, off = [start], [], []
    for _ in range(steps):
        ahead = operator.apply(basis[-1])
        diagonal.append(float(ahead @ basis[-1]))
        # Against all vectors, twice: round-off would bring back lines that were found already.
        for _ in range(2):
            ahead -= np.array(basis).T @ (np.array(basis) @ ahead)
        off.append(float(np.linalg.norm(ahead)))
        if off[-1] <= 1e-10 * max(diagonal):
            break
        basis.append(ahead / off[-1])
    square, vector = eigh_tridiagonal(np.array(diagonal), np.array(off[: len(diagonal) - 1]))
    return square, vector[0] ** 2


def ioffe_regel(found: StructureFactor) -> float:
    """The Ioffe-Regel frequency, Hz: where a wave decays within its period; NaN where none does.

    The line's full width G and its frequency f meet at f = pi G (H. Shintani and H. Tanaka, Nature
    Materials 7, 870, 2008): the mean free path is then half a wavelength. Between two wave numbers
    log(pi G / f) is taken as a straight line.
    """
    peak, width = found.ridge()
    order = np.argsort(found.wavenumber)
    peak, width = peak[order], width[order]
    seen = np.isfinite(peak) & (width > 0)
    peak, ratio = peak[seen], np.log(np.pi * width[seen] / peak[seen])
    beyond = np.flatnonzero(ratio >= 0)
    if len(beyond) == 0 or beyond[0] == 0:
        return float("nan")
    k = int(beyond[0])
    share = -ratio[k - 1] / (ratio[k] - ratio[k - 1])
    return float(peak[k - 1] + share * (peak[k] - peak[k - 1]))
