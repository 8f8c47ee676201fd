"""Density of states of a whole packing, from products with K alone: kernel polynomials in omega.

With omega = omega_max x every mode counts half at x and half at -x. The density is then even, only
even Chebyshev polynomials take part, and T_2k(x) = T_k(2 omega^2 / omega_max^2 - 1) follows from
products with A = M^-1/2 K M^-1/2. So the resolution is the same at low frequency, where an
expansion in omega^2 loses it (Y. M. Beltukov, C. Fusco, D. A. Parshin, A. Tanguy, Phys. Rev. E 93,
023006, 2016). The traces of T_2k are estimated with random vectors of signs; the Jackson kernel
keeps the density positive (A. Weisse, G. Wellein, A. Alvermann, H. Fehske, Rev. Mod. Phys. 78, 275,
2006, Eqs. 71 and 74). The format "granular-density-of-states", version 1, is defined here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from modal.formats.product import Column, Product
from modal.formats.provenance import Provenance
from modal.modes.collective import every_floppy
from modal.modes.counts import count_below
from modal.packing.network import Network
from modal.solvers.chebyshev import WIDTHS, chebyshev, jackson
from modal.solvers.spectrum import largest_growth
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator, component_sums
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless

SUMS: dict[str, Any] = {"all": 6, "translation": slice(0, 3), "rotation": slice(3, 6)}
"""Of the seven numbers that `DensityOfStates.density` gives those that a file holds."""
KINDS = {"density": "1/Hz", "density_error": "1/Hz", "count_below": "1", "count_below_error": "1"}
SCHEMA = "granular-density-of-states"
VERSION = 1
FORMAT = Product(
    SCHEMA,
    {"frequency": Column("frequency", "f", ("nf",), "Hz")}
    | {
        f"{which}/{kind}": Column(f"{which}/{kind}", "f", ("nf", *more), unit)
        for which, more in {"all": (), "translation": (3,), "rotation": (3,)}.items()
        for kind, unit in KINDS.items()
    },
    {"resolution": float, "vectors": int},
)
FEWEST = 6
"""Random vectors: enough to see their scatter."""
RESOLUTION = 0.01
"""Where none is given, of the highest frequency: 2 kHz in the study's packings under 100 kPa."""
FULL_WIDTH = 2 * np.sqrt(2 * np.log(2))
"""Full width at half height of a Gaussian over its standard deviation."""
CHUNK = 256
"""Frequencies evaluated at a time, to bound the memory."""
NUMBERS = 2**24
"""Numbers of vectors that are multiplied together, at most."""
DENSE_PAYS = 4
"""Degrees of freedom to a random vector below which the whole spectrum costs less than they do."""
LARGEST_DENSE = 3000
"""Degrees of freedom up to which a spectrum is found in some seconds: its traces have no error."""


@dataclass(frozen=True, repr=False)
class DensityOfStates(Drawn):
    """The density of states as a series; evaluate it with `density` and `count_below`.

    Attributes
    ----------
    moments : ndarray (vectors, 6, N)
        Estimated traces of P_c T_2k(omega / omega_max), k < N, where P_c keeps one component, u_x,
        u_y, u_z, theta_x, theta_y, theta_z; a single row where the traces are exact.
    highest : float
        The frequency of x = omega / omega_max = 1, Hz.
    zero_modes : ndarray (6,)
        How much of the zero modes, which were split off exactly, is in each component.
    resolution : float
        Hz, the full width at half height that a single mode has at low frequency; it falls as
        sqrt(1 - x^2) towards the top.
    products : int
        Products with A = M^-1/2 K M^-1/2 that were spent.
    counted : bool, default True
        Whether an exact count says that these are all zero modes; in large sound packings they are
        those that the contacts show.

    Examples
    --------
    >>> import modal
    >>> states = modal.density_of_states(modal.fcc(cells=(1, 1, 20)), resolution=2e4)
    >>> states.zero_modes.shape, states.counted
    ((6,), True)
    """

    moments: Floats
    highest: float
    zero_modes: Floats
    resolution: float
    products: int
    counted: bool = True

    @property
    def random_vectors(self) -> int:
        """How many random vectors the estimates come from; none where the traces are exact."""
        return 0 if len(self.moments) == 1 else len(self.moments)

    def __repr__(self) -> str:
        vectors = f"{self.random_vectors} random vectors" if self.random_vectors else "exact traces"
        return (
            f"<DensityOfStates: up to {quantity(self.highest, 'Hz')}, resolution "
            f"{quantity(self.resolution, 'Hz')}, {vectors}>"
        )

    def draw(self, ax: Any) -> None:
        """Draw modes per kHz over frequency, all and by kind of motion."""
        frequency = self.grid()
        value, error = (1e3 * column for column in self.density(frequency))
        total = value[:, 6]
        ax.fill_between(frequency / 1e3, total - error[:, 6], total + error[:, 6], alpha=0.3)
        ax.plot(frequency / 1e3, total, label="all")
        ax.plot(frequency / 1e3, value[:, :3].sum(axis=1), label="translations")
        ax.plot(frequency / 1e3, value[:, 3:6].sum(axis=1), label="rotations")
        ax.set(xlabel="frequency, kHz", ylabel="modes per kHz", ylim=(0, None))
        ax.legend()

    def density(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Modes per Hz at frequencies (nf,) in Hz; zero modes that were split off excluded.

        Returns values and standard errors (nf, 7): the six components, then their sum; of a single
        frequency (7,). Zero from `highest` on. InputError for what is no frequency.
        """
        weight = jackson(self.moments.shape[2])
        weight[1:] *= 2

        def terms(theta: Floats) -> Floats:
            wave = np.cos(2 * theta[:, None] * np.arange(len(weight))) * weight
            return wave * (2 / (np.pi * self.highest * np.sin(theta)))[:, None]

        value, error = self._mean_and_error(frequency, terms)
        above = np.asarray(frequency) >= self.highest
        value[above] = error[above] = 0.0
        return value, error

    def reduced(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Modes per Hz over f^2, 1/Hz^3, and its standard error, each (nf,); f above zero.

        Waves of a solid make it level at low frequency, at its `debye_level` times the volume
        (`modal.elasticity.moduli`); what stands above that is the boson peak.
        """
        value, error = self.density(frequency)
        square = np.asarray(frequency, float) ** 2
        return value[..., 6] / square, error[..., 6] / square

    def count_below(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Number of modes below frequencies (nf,) in Hz, zero modes included: the integral.

        Returns values and standard errors (nf, 7), as `density`.
        """
        order, weight = np.arange(self.moments.shape[2]), 2 / np.pi * jackson(self.moments.shape[2])

        def terms(theta: Floats) -> Floats:
            wave = np.empty((len(theta), len(order)))
            wave[:, 0] = np.pi / 2 - theta
            wave[:, 1:] = -np.sin(2 * theta[:, None] * order[1:]) / order[1:]
            return weight * wave

        value, error = self._mean_and_error(frequency, terms)
        return value + np.append(self.zero_modes, self.zero_modes.sum()), error

    def grid(self) -> Floats:
        """Frequencies, Hz, from zero to just below `highest`: four to a resolution.

        Four to a hundredth of `highest` where the resolution is coarser.
        """
        width = min(self.resolution, RESOLUTION * self.highest)
        return np.arange(0, self.highest, width / 4)

    def _mean_and_error(
        self, frequency: ArrayLike, terms: Callable[[Floats], Floats]
    ) -> tuple[Floats, Floats]:
        """Values and errors (nf, 7) of the series with `terms` (nf, N) at angles theta (nf,)."""
        asked = frequencies(frequency)
        theta = np.arccos(np.minimum(asked.ravel() / self.highest, 1 - 1e-12))
        with_sum = np.concatenate([self.moments, self.moments.sum(axis=1, keepdims=True)], axis=1)
        value, error = np.zeros((2, len(theta), 7))
        for first in range(0, len(theta), CHUNK):
            part = slice(first, first + CHUNK)
            each = np.einsum("fk,vck->vfc", terms(theta[part]), with_sum, optimize=True)
            value[part] = each.mean(axis=0)
            if self.random_vectors:
                error[part] = each.std(axis=0, ddof=1) / np.sqrt(len(each))
        shape = (*asked.shape, 7)
        return value.reshape(shape), error.reshape(shape)


@checked
def density_of_states(
    network: Network,
    *,
    resolution: float | None = None,
    tolerance: float = 1e-3,
    sliding: str = "elastic",
    pre_stress: str = "none",
    seed: int = 1,
) -> DensityOfStates:
    """How the 6n natural frequencies of a packing are distributed, without finding each of them.

    Small networks need so many random vectors that the whole spectrum costs less; then there is no
    error but the kernel's width. Motions without energy are split off, at zero.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    resolution : float, optional
        Full width with which a mode appears, Hz; by default a hundredth of the highest frequency.
    tolerance : float, default 1e-3
        Bound on the standard error of every count, in parts of all modes: for vectors of signs the
        variance of one count N of n is below 2 N (1 - N / n) <= n / 2.
    sliding : str, default "elastic"
        As of `modal.eigenmodes`.
    pre_stress : str, default "none"
        Or "normal".
    seed : int, default 1
        Of the random vectors.

    Returns
    -------
    DensityOfStates
        Its `density` and `count_below` give modes a Hz and numbers of modes at any frequencies,
        (nf,) and (nf, 7), with standard errors of the same shape.

    Raises
    ------
    InputError
        Where K has a negative direction, or the work exceeds a day or the memory.

    Examples
    --------
    >>> import modal
    >>> dos = density_of_states(modal.fcc(cells=(2, 2, 20)), resolution=1e4)
    >>> value, error = dos.count_below([2.2e5])
    >>> value.shape, round(value[0, 6])
    ((1, 7), 480)
    """
    if resolution is not None and not frequencies(resolution) > 0:
        raise InputError(
            "resolution", f"resolution {resolution:g} Hz", remedy="give a positive number of Hz"
        )
    if seed < 0 or seed % 1 != 0:
        raise InputError("input", f"seed {seed}", remedy="give a whole number from 0 on")
    if not 0 < tolerance < 1:
        raise InputError(
            "input", f"tolerance {tolerance:g}", remedy="give a share of all modes between 0 and 1"
        )
    system = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding)
    return density_of(system, resolution, tolerance, seed)


def density_of(
    system: LinearSystem, resolution: float | None = None, tolerance: float = 1e-3, seed: int = 1
) -> DensityOfStates:
    """As `density_of_states`, of a system that is at hand."""
    width = RESOLUTION * system.highest_frequency if resolution is None else resolution
    return system.kept(
        "densities of states",
        (width, tolerance, seed),
        lambda: _density(system, width, tolerance, seed),
        lambda states: states.moments.nbytes,
    )


def _density(
    system: LinearSystem, resolution: float, tolerance: float, seed: int
) -> DensityOfStates:
    """As `density_of_states`, of a system."""
    operator, size, (top, products) = system.renumbered, system.size, system.spectral_bound_and_cost
    if top <= 0:
        raise UnavailableError(
            "no_stiffness", "the network has no stiffness", remedy="all its modes are at zero"
        )
    highest = system.highest_frequency
    # The kernel's standard deviation in x is pi over the number of orders, odd ones included.
    count = max(2, int(np.ceil(np.pi * FULL_WIDTH * highest / resolution / 2)))
    vectors = max(FEWEST, int(np.ceil(min(1 / (2 * tolerance**2 * size), 1e18))))
    exact = size <= LARGEST_DENSE and size <= DENSE_PAYS * vectors
    width = block_width(size)
    multiplied = width * int(np.ceil(vectors / width))
    random = 6 * (vectors + width) * count + (2 + 3 * width) * size
    numbers = size * (count + 4 * size) if exact else random
    refuse_endless(
        f"a density with resolution {resolution:g} Hz and tolerance {tolerance:g}",
        operator,
        products=products if exact else multiplied * count / 2,
        bytes_needed=8 * numbers,
        remedy="take a coarser one",
    )
    if unstable := count_below(system, 0.0):
        raise UnavailableError(
            "unstable",
            f"K has a negative direction ({unstable} unstable modes)",
            "the packing does not vibrate with these springs",
            "`count` says how many modes lie below a frequency, with these",
        )
    floppy = every_floppy(system)
    if exact:
        moments, at_zero = _exact_moments(system, top, count)
        return DensityOfStates(moments, highest, at_zero, resolution, products)
    zero = floppy.basis
    at_zero = np.asarray(zero.multiply(zero).sum(axis=1)).reshape(-1, 6).sum(axis=0)
    signs = np.random.default_rng(seed)
    moments = np.empty((vectors, 6, count))
    for first in range(0, vectors, width):
        some = slice(first, min(first + width, vectors))
        # Columns of zeros where there are fewer: less than a product of another width.
        start = np.zeros((size, width))
        for column in start.T[: some.stop - first]:
            column[:] = 2.0 * signs.integers(0, 2, size, np.int8) - 1
        start -= zero @ (zero.T @ start)
        label = f"density {some.stop}/{vectors}"
        moments[some] = moments_of(operator, start, top, count, label)[: some.stop - first]
    products += multiplied * (1 + count // 2)
    return DensityOfStates(moments, highest, at_zero, resolution, products, floppy.counted)


def _exact_moments(system: LinearSystem, top: float, count: int) -> tuple[Floats, Floats]:
    """Shape (1, 6, count): the traces themselves, of elastic modes; (6,): those of zero modes."""
    square, vector = eigh(system.dynamical_matrix.toarray(), overwrite_a=True)
    zero = square <= system.zero_threshold
    angle = np.arccos(np.clip(2 * square[~zero] / top - 1, -1, 1))
    share = np.einsum("ncv,ncv->cv", *2 * [vector.reshape(-1, 6, len(square))])
    moments = share[:, ~zero] @ np.cos(angle[:, None] * np.arange(count))
    return moments[None], share[:, zero].sum(axis=1)


def block_width(size: int) -> int:
    """How many vectors (size,) are multiplied together."""
    return max(1, min(WIDTHS[0], NUMBERS // size))


def moments_of(
    operator: ContactOperator, start: Floats, top: float, count: int, label: str
) -> Floats:
    """Shape (k, 6, count): <r| P_c T_j(X) |r> for start vectors r (6n, k), components c.

    The block is worked on.
    One product gives two moments: tr P_c T_j T_k = tr T_j P_c T_k, and
    2 T_j T_k = T_(j+k) + T_|j-k|. InputError where the spectrum is not within 0 to `top`.
    """
    moments, sums = np.empty((start.shape[1], 6, count + 2)), np.empty((2, 6, start.shape[1]))
    orders = chebyshev(operator, operator.inward(start), 2 / top, -1.0, sums)
    before, now = next(orders), next(orders)
    for k in progress(count // 2, label):
        # Here now = T_(k+1) r; the sums are those of T_k r, with itself and with it.
        before, now = now, next(orders)
        if k == 0:
            moments[:, :, :2] = sums.T
        else:
            moments[:, :, 2 * k : 2 * k + 2] = 2 * sums.T - moments[:, :, :2]
    last = 2 * (count // 2)
    moments[:, :, last] = 2 * component_sums(before, now)[0].T - moments[:, :, 0]
    first, largest = moments[:, :, 0].sum(axis=1), moments[:, :, last].sum(axis=1)
    if not (abs(largest) <= largest_growth(operator, last) * first).all():
        raise UnavailableError(
            "not_converged", "the top of the spectrum was not found", remedy="ask with another seed"
        )
    return moments[:, :, :count]


def write_density(
    path: str | Path, states: DensityOfStates, made: Provenance | None = None
) -> None:
    """Write density and counts on `states.grid()` atomically."""
    frequency = states.grid()
    found = (*states.density(frequency), *states.count_below(frequency))
    values: dict[str, Any] = {
        f"{which}/{kind}": data[:, columns]
        for which, columns in SUMS.items()
        for kind, data in zip(KINDS, found, strict=True)
    }
    values |= {"frequency": frequency}
    values |= {"resolution": states.resolution, "vectors": states.random_vectors}
    FORMAT.write(path, values, made)


def read_density(path: str | Path) -> tuple[Floats, Floats, Floats]:
    """Frequency (nf,), Hz, modes per Hz without the zero modes, and modes below with them.

    Motions of all kinds together, as `write_density` has written them. InputError with one line
    for anything wrong.
    """
    said = FORMAT.read(path)
    return said["frequency"], said["all/density"], said["all/count_below"]
