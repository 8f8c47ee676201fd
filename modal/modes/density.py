"""Estimate the density of states of a packing from products with K alone: kernel polynomials.

With omega = omega_max x every mode is counted by half at x and by half at -x. The density is then
even, only even Chebyshev polynomials contribute, and T_2k(x) = T_k(2 omega^2 / omega_max^2 - 1)
follows from products with A = M^-1/2 K M^-1/2. Therefore the resolution at low frequency is as good
as elsewhere; an expansion in omega^2 would lose it (Y. M. Beltukov, C. Fusco, D. A. Parshin, A.
Tanguy, Phys. Rev. E 93, 023006, 2016). The traces of T_2k are estimated with random vectors of
signs; the Jackson kernel keeps the density positive (A. Weisse, G. Wellein, A. Alvermann, H.
Fehske, Rev. Mod. Phys. 78, 275, 2006, Eqs. 71 and 74). The format "granular-density-of-states",
version 1, is defined here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modal.formats.column import Column
from modal.formats.product import Product
from modal.formats.provenance import Provenance
from modal.formats.tables import html_table
from modal.modes.collective import every_floppy
from modal.modes.counts import count_below
from modal.modes.moments import block_width, exact_moments, moments_of, multiplied_vectors
from modal.modes.zero_modes import by_structure
from modal.packing.network import Network
from modal.solvers.chebyshev import jackson
from modal.system.contacts import PreStress, Sliding
from modal.system.linear_system import LinearSystem
from modal.tools.arguments import checked, frequencies
from modal.tools.arrays import Floats
from modal.tools.display import Drawn, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.workload import refuse_endless

FILE_COLUMNS: dict[str, Any] = {"all": 6, "translation": slice(0, 3), "rotation": slice(3, 6)}
"""Groups of columns in a file, and the components of `DensityOfStates.density` that each holds.

The seven components are u_x, u_y, u_z, theta_x, theta_y, theta_z, and their sum."""
KINDS = {"density": "1/Hz", "density_error": "1/Hz", "count_below": "1", "count_below_error": "1"}
"""The columns of a group, with their units."""
SCHEMA = "granular-density-of-states"
VERSION = 1


def _columns() -> dict[str, Column]:
    """Return the columns of the file format."""
    columns = {"frequency": Column("frequency", "f", ("nf",), "Hz")}
    shapes: dict[str, tuple[int, ...]] = {"all": (), "translation": (3,), "rotation": (3,)}
    for group, shape in shapes.items():
        for kind, unit in KINDS.items():
            name = f"{group}/{kind}"
            columns[name] = Column(name, "f", ("nf", *shape), unit)
    return columns


FORMAT = Product(SCHEMA, _columns(), {"resolution": float, "vectors": int})
MIN_VECTORS = 6
"""Least number of random vectors: enough to estimate their scatter."""
RESOLUTION = 0.01
"""Default resolution, divided by the highest frequency: 2 kHz in the study's packings under 100
kPa."""
FULL_WIDTH = 2 * np.sqrt(2 * np.log(2))
"""Full width at half height of a Gaussian, divided by the standard deviation."""
FREQUENCIES_TOGETHER = 256
"""Number of frequencies evaluated at a time, which bounds the memory."""
DENSE_PAYS = 4
"""Degrees of freedom, divided by the number of random vectors, up to which the whole spectrum takes
less time than the products with the vectors."""
MAX_DENSE_SIZE = 3000
"""Degrees of freedom up to which the whole spectrum takes some seconds; its traces have no
error."""


@dataclass(frozen=True, repr=False)
class DensityOfStates(Drawn):
    """The density of states as a series, evaluated by `density` and `count_below`.

    Attributes
    ----------
    moments : ndarray (vectors, 6, N)
        Estimated traces of P_c T_2k(omega / omega_max), k < N, where P_c keeps one component, u_x,
        u_y, u_z, theta_x, theta_y, theta_z; a single row if the traces are exact.
    highest : float
        The frequency of x = omega / omega_max = 1, Hz.
    zero_modes : ndarray (6,)
        Shares of the components in the zero modes, which were separated exactly.
    resolution : float
        The full width at half height of a single mode at low frequency, Hz; it falls as
        sqrt(1 - x^2) towards the top.
    products : int
        Number of products with A = M^-1/2 K M^-1/2.
    counted : bool, default True
        Whether an exact count confirms that these are all zero modes; in large packings without
        doubt only the zero modes that the structure of the contacts shows are found.

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
        """Number of random vectors behind the estimates; 0 if the traces are exact."""
        return 0 if len(self.moments) == 1 else len(self.moments)

    def __repr__(self) -> str:
        vectors = f"{self.random_vectors} random vectors" if self.random_vectors else "exact traces"
        return (
            f"<DensityOfStates: up to {quantity(self.highest, 'Hz')}, resolution "
            f"{quantity(self.resolution, 'Hz')}, {vectors}>"
        )

    def _repr_html_(self) -> str:
        """Return range, resolution and numbers of modes and vectors as a table, for a notebook."""
        every = self.count_below(self.highest)[0][6]
        rows = [
            ["highest frequency", quantity(self.highest, "Hz")],
            ["resolution", quantity(self.resolution, "Hz")],
            ["modes", f"{every:.0f}, {self.zero_modes.sum():.0f} of them zero modes"],
            ["random vectors", str(self.random_vectors or "none: traces are exact")],
        ]
        return html_table(["density of states", ".plot() draws it"], rows)

    def draw(self, ax: Any) -> None:
        """Draw the modes per kHz against frequency: all, translations and rotations."""
        frequency = self.grid()
        per_hz, error_per_hz = self.density(frequency)
        value = 1e3 * per_hz
        total = value[:, 6]
        error = 1e3 * error_per_hz[:, 6]
        ax.fill_between(frequency / 1e3, total - error, total + error, alpha=0.3)
        ax.plot(frequency / 1e3, total, label="all")
        ax.plot(frequency / 1e3, value[:, :3].sum(axis=1), label="translations")
        ax.plot(frequency / 1e3, value[:, 3:6].sum(axis=1), label="rotations")
        ax.set(xlabel="frequency, kHz", ylabel="modes per kHz", ylim=(0, None))
        ax.legend()

    def density(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Compute the modes per Hz at frequencies (nf,), Hz, without the zero modes.

        Returns values and standard errors, 1/Hz, (nf, 7): the six components, then their sum; (7,)
        for a single frequency. They are zero from `highest` on. Raises InputError if a frequency is
        negative or NaN.
        """
        weight = jackson(self.moments.shape[2])
        weight[1:] *= 2

        def terms(theta: Floats) -> Floats:
            waves = np.cos(2 * theta[:, None] * np.arange(len(weight))) * weight
            return waves * (2 / (np.pi * self.highest * np.sin(theta)))[:, None]

        value, error = self._evaluate(frequency, terms)
        above = np.asarray(frequency) >= self.highest
        value[above] = 0.0
        error[above] = 0.0
        return value, error

    def reduced(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Compute modes per Hz divided by f^2, 1/Hz^3, and the standard error, (nf,); f > 0.

        The waves of a solid make this ratio constant at low frequency, equal to the `debye_level`
        of the solid (`modal.elasticity.moduli`) times the volume; an excess above this level is the
        boson peak.
        """
        value, error = self.density(frequency)
        square = np.asarray(frequency, float) ** 2
        return value[..., 6] / square, error[..., 6] / square

    def count_below(self, frequency: ArrayLike) -> tuple[Floats, Floats]:
        """Return the number of modes below frequencies (nf,), Hz, with zero modes.

        This is the integral of the density.

        Returns values and standard errors (nf, 7) as `density` does.
        """
        n_orders = self.moments.shape[2]
        order = np.arange(n_orders)
        weight = 2 / np.pi * jackson(n_orders)

        def terms(theta: Floats) -> Floats:
            waves = np.empty((len(theta), n_orders))
            waves[:, 0] = np.pi / 2 - theta
            waves[:, 1:] = -np.sin(2 * theta[:, None] * order[1:]) / order[1:]
            return weight * waves

        value, error = self._evaluate(frequency, terms)
        return value + np.append(self.zero_modes, self.zero_modes.sum()), error

    def grid(self) -> Floats:
        """Return frequencies, Hz, from zero to just below `highest`, four to a resolution.

        The spacing is at most a quarter of a hundredth of `highest`.
        """
        width = min(self.resolution, RESOLUTION * self.highest)
        return np.arange(0, self.highest, width / 4)

    def _evaluate(
        self, frequency: ArrayLike, terms: Callable[[Floats], Floats]
    ) -> tuple[Floats, Floats]:
        """Return means and errors (nf, 7) of the series with `terms` (nf, N) at angles (nf,)."""
        f = frequencies(frequency)
        theta = np.arccos(np.minimum(f.ravel() / self.highest, 1 - 1e-12))
        with_sum = np.concatenate([self.moments, self.moments.sum(axis=1, keepdims=True)], axis=1)
        value, error = np.zeros((2, len(theta), 7))
        for first in range(0, len(theta), FREQUENCIES_TOGETHER):
            part = slice(first, first + FREQUENCIES_TOGETHER)
            estimates = np.einsum("fk,vck->vfc", terms(theta[part]), with_sum, optimize=True)
            value[part] = estimates.mean(axis=0)
            if self.random_vectors:
                error[part] = estimates.std(axis=0, ddof=1) / np.sqrt(len(estimates))
        shape = (*f.shape, 7)
        return value.reshape(shape), error.reshape(shape)


@checked
def density_of_states(
    network: Network,
    *,
    resolution: float | None = None,
    tolerance: float = 1e-3,
    sliding: Sliding = "elastic",
    pre_stress: PreStress = "none",
    seed: int = 1,
) -> DensityOfStates:
    """Estimate how the 6n natural frequencies of a packing are distributed, without finding each.

    For small networks the whole spectrum is cheaper than the random vectors; it is then computed,
    and the only error is the width of the kernel. Motions without energy are counted separately, at
    zero.

    Parameters
    ----------
    network : Network
        The packing, n spheres.
    resolution : float, optional
        Full width of a single mode, Hz; by default a hundredth of the highest frequency.
    tolerance : float, default 1e-3
        Bound on the standard error of every count, divided by the number of all modes: for vectors
        of signs the variance of one count N of n is below 2 N (1 - N / n) <= n / 2.
    sliding : str, default "elastic"
        As in `modal.eigenmodes`.
    pre_stress : str, default "none"
        "none" or "normal".
    seed : int, default 1
        Seed of the random vectors.

    Returns
    -------
    DensityOfStates
        Its `density` and `count_below` return modes per Hz and numbers of modes, (nf, 7), at any
        frequencies (nf,), with standard errors of the same shape.

    Raises
    ------
    InputError
        If K has a negative direction, or the work exceeds a day or the memory.

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
        raise InputError("seed", f"seed {seed}", remedy="give a whole number from 0 on")
    if not 0 < tolerance < 1:
        raise InputError(
            "tolerance",
            f"tolerance {tolerance:g}",
            remedy="give a share of all modes between 0 and 1",
        )
    system = LinearSystem.of(network, pre_stress=pre_stress, sliding=sliding)
    return density_of(system, resolution, tolerance, seed)


def density_of(
    system: LinearSystem,
    resolution: float | None = None,
    tolerance: float = 1e-3,
    seed: int = 1,
    *,
    counting: bool = True,
) -> DensityOfStates:
    """Estimate the density of a system as `density_of_states` does; kept with the network.

    Without `counting` the zero modes are those that the structure of the contacts shows, and no
    matrix is factorised.
    """
    width = RESOLUTION * system.highest_frequency if resolution is None else resolution
    return system.cached_recent(
        "densities of states",
        (width, tolerance, seed, counting),
        lambda: _estimate(system, width, tolerance, seed, counting),
        lambda states: states.moments.nbytes,
    )


def _estimate(
    system: LinearSystem, resolution: float, tolerance: float, seed: int, counting: bool
) -> DensityOfStates:
    """Estimate the density of states as `density_of` does, without the cache."""
    size = system.size
    top, products = system.spectral_bound_and_cost
    if top <= 0:
        raise UnavailableError(
            "no_stiffness", "the network has no stiffness", remedy="all its modes are at zero"
        )
    highest = system.highest_frequency
    # The kernel's standard deviation in x is pi divided by the number of orders, odd ones included.
    count = max(2, int(np.ceil(np.pi * FULL_WIDTH * highest / resolution / 2)))
    motions = max(system.degrees_of_freedom, 1)
    vectors = max(MIN_VECTORS, int(np.ceil(min(1 / (2 * tolerance**2 * motions), 1e18))))
    exact = size <= MAX_DENSE_SIZE and size <= DENSE_PAYS * vectors
    _refuse_endless(system, resolution, tolerance, count, vectors, exact)
    if unstable := count_below(system, 0.0):
        raise UnavailableError(
            "unstable",
            f"K has a negative direction ({unstable} unstable modes)",
            "the packing does not vibrate with these springs",
            "`count` says how many modes lie below a frequency, with these",
        )
    floppy = every_floppy(system) if counting else by_structure(system)
    if exact:
        moments, at_zero = exact_moments(system, top, count)
        return DensityOfStates(moments, highest, at_zero, resolution, products)
    zero_modes = floppy.basis
    network = system.network
    squares = np.asarray(zero_modes.multiply(zero_modes).sum(axis=1))
    at_zero = squares.reshape(-1, 6).sum(axis=0)
    random = np.random.default_rng(seed)
    width = block_width(size)
    moments = np.empty((vectors, 6, count))
    for first in range(0, vectors, width):
        some = slice(first, min(first + width, vectors))
        n_vectors = some.stop - first
        # The last block is filled with zeros: a product of another width would cost more.
        start = np.zeros((size, width))
        for column in start.T[:n_vectors]:
            column[:] = 2.0 * random.integers(0, 2, size, np.int8) - 1
        if network.fixed is not None:
            start[network.fixed.ravel()] = 0.0
        start -= zero_modes @ (zero_modes.T @ start)
        label = f"density {some.stop}/{vectors}"
        moments[some] = moments_of(system.renumbered, start, top, count, label)[:n_vectors]
    products += multiplied_vectors(size, vectors) * (1 + count // 2)
    return DensityOfStates(moments, highest, at_zero, resolution, products, floppy.counted)


def _refuse_endless(
    system: LinearSystem,
    resolution: float,
    tolerance: float,
    count: int,
    vectors: int,
    exact: bool,
) -> None:
    """Raise InputError if moments, by random `vectors` or exact, take too much time or memory.

    `count` is the number of moments.
    """
    size = system.size
    if exact:
        products: float = system.spectral_bound_and_cost[1]
        numbers = size * (count + 4 * size)
    else:
        width = block_width(size)
        products = multiplied_vectors(size, vectors) * count / 2
        numbers = 6 * (vectors + width) * count + (2 + 3 * width) * size
    refuse_endless(
        f"a density with resolution {resolution:g} Hz and tolerance {tolerance:g}",
        system.renumbered,
        products=products,
        bytes_needed=8 * numbers,
        remedy="take a coarser one",
    )


def write_density(
    path: str | Path, states: DensityOfStates, made: Provenance | None = None
) -> None:
    """Write density and counts on `states.grid()` to a file atomically, with their provenance."""
    frequency = states.grid()
    curves = (*states.density(frequency), *states.count_below(frequency))
    values: dict[str, Any] = {
        "frequency": frequency,
        "resolution": states.resolution,
        "vectors": states.random_vectors,
    }
    for group, columns in FILE_COLUMNS.items():
        for kind, curve in zip(KINDS, curves, strict=True):
            values[f"{group}/{kind}"] = curve[:, columns]
    FORMAT.write(path, values, made)


def read_density(path: str | Path) -> tuple[Floats, Floats, Floats]:
    """Read frequencies (nf,), Hz, modes per Hz (nf,), and numbers of modes below (nf,).

    The modes per Hz are without the zero modes, the numbers of modes with them. Translations and
    rotations are added up, as `write_density` has written them.

    Raises InputError if the file is not valid.
    """
    columns = FORMAT.read(path)
    return columns["frequency"], columns["all/density"], columns["all/count_below"]
