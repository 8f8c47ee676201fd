"""Measure the dispersion relation of a chain almost without bias, by a damped transform.

The record ends before the reflection returns. A Fourier transform in time therefore truncates the
slow waves of high frequency and biases what is read from it. A damped transform (Laplace, s = eta +
i omega) does not, as exp(-eta T) makes the cut negligible. In a periodic medium whose layers act on
their nearest neighbours, (U[n+1] + U[n-1]) / (2 U[n]) = cosh(q l) is equal for all n, and is an
analytic function of s^2 that tends to 1. It is measured at many s, fitted by a polynomial in s^2,
without assuming the law, and continued to the real frequency axis: cos(kappa l) = G(-omega^2). A
pure sine (an eigenmode) also has this ratio, so that modes are measured in the same way.

Least squares of the ratio is biased by noise, which is in the numerator and the denominator. The
equation is therefore weighted by a prediction of U[n] from layers two to forty away, with the G of
the pass before. Their noise is independent: this is an instrumental variable, as in
errors-in-variables regression.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyroots, polyval

from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals

INSTRUMENT_REACH = 40
"""Distance, in layers, up to which other layers predict the displacement of a layer."""
LAST_LAYER = 120
"""Number of layers from the source that are used; layers farther away have little motion."""
FIRST_PASSES = 3
"""Number of passes that fit the law of nearest neighbours, in order to find the band."""
PASSES = 6
"""Number of all passes; those after `FIRST_PASSES` fit a polynomial of the full order."""
FREQUENCIES = 160
COARSE = 16
"""Every so many frequencies have phases of their own, from which those between follow."""
LOWEST_FREQUENCY_RATIO = 0.02
"""Lowest frequency, relative to the highest one."""
FIRST_BAND_RATIO = 0.9
"""Highest frequency before the band is known, relative to the end of the pulse's spectrum, which is
twice the pulse's frequency."""
BAND_RATIO = 1.02
"""Highest frequency once the band edge is known, divided by the band edge."""
MODE_ORDER = 3
"""Order of the polynomial that is fitted to modes, which have no noise."""
MAX_PHASE_RATIO = 0.9
"""Largest wave number, relative to pi / l, at which a relation is compared with Eq. 9."""
MIN_PARTICLES = 10
"""Fewest particles of a chain that is evaluated."""
UNEVEN = 0.1
"""Largest deviation of a spacing of the chain from the mean spacing, divided by the mean; where a
particle is missing the spacing is twice as large."""
MAX_INITIAL_DISPLACEMENT = 0.15
"""Largest mean displacement at the first time of a record, divided by the largest displacement; a
record with a larger one does not begin at rest."""
MIN_CLIPPED_SAMPLES = 3
"""Number of samples at exactly the largest value from which on a record counts as clipped: no wave
has so many by chance."""


@dataclass(frozen=True)
class Dispersion:
    """A dispersion relation G = cos(kappa l) = 1 + x (c0 + c1 x + ...), x = -(omega / scale)^2.

    Attributes
    ----------
    coefficients : ndarray (order,)
        Coefficients c0, c1, ...
    scale : float
        Scale of the frequency, rad/s.
    distance : float
        Distance l of the layers, m.
    """

    coefficients: np.ndarray
    scale: float
    distance: float

    def cosine(self, omega: np.ndarray | float) -> np.ndarray:
        """Return cos(kappa l) at angular frequencies, rad/s; for omega = -i s this is cosh(q l)."""
        x = -((np.asarray(omega) / self.scale) ** 2)
        return 1 + x * polyval(x, self.coefficients)

    @property
    def velocity(self) -> float:
        """Return the long-wave velocity, m/s, from the slope of G at 0.

        The velocity is NaN if noise reverses the slope.
        """
        with np.errstate(invalid="ignore"):
            return float(self.distance * self.scale / np.sqrt(2 * self.coefficients[0]))

    @property
    def low_pass_frequency(self) -> float:
        """Return the band edge, Hz: the lowest frequency at which cos(kappa l) = -1, or NaN."""
        one_plus_cosine = np.concatenate([[2.0], self.coefficients])  # a polynomial in x
        roots = polyroots(one_plus_cosine)
        is_real = np.abs(roots.imag) < 1e-6 * np.abs(roots)
        square = -roots.real[is_real & (roots.real < 0)]
        if not square.size:
            return np.nan
        return float(self.scale * np.sqrt(square.min()) / (2 * np.pi))

    def omega(self, kappa: np.ndarray) -> np.ndarray:
        """Return omega (k,), rad/s, for wave numbers (k,), 1/m, below pi / l."""
        grid = np.linspace(0, 2 * np.pi * self.low_pass_frequency, 4001)
        phase = np.arccos(np.clip(self.cosine(grid), -1, 1))
        return np.interp(np.asarray(kappa) * self.distance, np.maximum.accumulate(phase), grid)


def neighbour_ratio(
    field: np.ndarray, cosine: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio G (k,) of neighbours and its weight (k,) from transforms U (k, nc).

    Without `cosine`, G is fitted by least squares. With an estimate `cosine` (k,) of G, it is
    fitted with the instrumental variable that the estimate predicts.
    """
    reach = min(INSTRUMENT_REACH, field.shape[1] // 5)
    middle = np.arange(reach, min(LAST_LAYER, field.shape[1] - reach))
    u = field[:, middle]
    neighbours = field[:, middle - 1] + field[:, middle + 1]
    instrument = u
    if cosine is not None:
        instrument = _predict_from_neighbours(field, middle, reach, cosine)
    power = (instrument.conj() * u).sum(axis=1)
    ratio = (instrument.conj() * neighbours).sum(axis=1) / (2 * power)
    return ratio, np.sqrt(abs(power))


def _predict_from_neighbours(
    field: np.ndarray, middle: np.ndarray, reach: int, cosine: np.ndarray
) -> np.ndarray:
    """Return the displacement (k, m) of the `middle` layers (m,), predicted from other layers.

    The other layers are 2 to `reach` layers away: U[n+j] + U[n-j] = 2 T_j(G) U[n], with the
    Chebyshev polynomials T_j.
    """
    prediction = np.zeros_like(field[:, middle])
    total = np.zeros(len(cosine))
    previous = np.ones_like(cosine)
    polynomial = cosine
    for j in range(2, reach + 1):
        following = 2 * cosine * polynomial - previous
        previous = polynomial
        polynomial = following
        pair = field[:, middle + j] + field[:, middle - j]
        prediction += polynomial.conj()[:, None] * pair / 2
        total = total + abs(polynomial) ** 2
    prediction /= total[:, None]
    return prediction


def _fit_polynomial(
    square: np.ndarray, ratio: np.ndarray, weight: np.ndarray, order: int
) -> tuple[np.ndarray, float]:
    """Fit G = 1 + x p(x), x = square / scale^2, by weighted least squares.

    Returns the real coefficients (order,) of p, and the scale, rad/s.
    """
    scale = np.sqrt(np.abs(square).max())
    x = square / scale**2
    matrix = weight[:, None] * x[:, None] ** np.arange(1, order + 1)
    target = weight * (ratio - 1)
    real_matrix = np.concatenate([matrix.real, matrix.imag])
    real_target = np.concatenate([target.real, target.imag])
    coefficients = np.linalg.lstsq(real_matrix, real_target, rcond=None)[0]
    return coefficients, float(scale)


def chain_dispersion(signals: Signals, order: int = 2, decay: float = 3.0) -> Dispersion:
    """Measure the dispersion relation of a recorded chain.

    The passband, and the prediction that replaces noisy data, are improved in repeated passes. On
    exact signals the bias is below 1e-5. With white noise of 5 %, V_P scatters by 0.3 % and the
    band edge by 0.6 %, both without bias.

    Parameters
    ----------
    signals : Signals
        UnavailableError if the record is damaged: its chain is short, uneven, still, clipped or not
        at rest at the beginning.
    order : int
        Order of the polynomial. Higher orders amplify noise.
    decay : float
        Damping eta T of the window over the record of the length T. Stronger damping amplifies
        noise.
    """
    _refuse_damaged(signals)
    time = signals.time - signals.time[0]
    eta = decay / time[-1]
    weights = np.exp(-eta * time) * np.gradient(time)
    damped = weights[:, None] * signals.chain_displacement
    top = 2 * np.pi * 2 * signals.input_frequency * FIRST_BAND_RATIO
    dispersion = None
    for number in range(PASSES):
        omega = np.linspace(LOWEST_FREQUENCY_RATIO, 1.0, FREQUENCIES) * top
        s = eta + 1j * omega
        phases = _phases(omega, time)
        # Two real products take half of the time of one of complex with real numbers.
        field = phases.real @ damped + 1j * (phases.imag @ damped)
        estimate = None
        if dispersion is not None:
            estimate = dispersion.cosine(-1j * s)
        ratio, weight = neighbour_ratio(field, estimate)
        size = np.abs(s) ** 2  # relative accuracy at small s, where G - 1 itself is small
        weight = weight / weight.max() / (size / size.max() + 0.1)
        pass_order = 1
        if number >= FIRST_PASSES:
            pass_order = order
        coefficients, scale = _fit_polynomial(s**2, ratio, weight, pass_order)
        dispersion = Dispersion(coefficients, scale, layer_distance(signals))
        edge = dispersion.low_pass_frequency
        if np.isfinite(edge):
            top = 2 * np.pi * edge * BAND_RATIO
    assert dispersion is not None
    return dispersion


def _phases(omega: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return exp(-i omega t) (k, nt) for equally spaced omega (k,), rad/s, and times (nt,), s.

    Each phase is computed as a product of two: that of every `COARSE`-th frequency, and that of a
    step between these. A product takes a tenth of the time of an exponential, and is as exact.
    """
    steps = np.arange(COARSE)[:, None] * (omega[1] - omega[0])
    fine = np.exp(-1j * steps * time)
    coarse = np.exp(-1j * omega[::COARSE, None] * time)
    return (coarse[:, None] * fine).reshape(-1, len(time))[: len(omega)]


def _refuse_damaged(signals: Signals) -> None:
    """Raise UnavailableError for records that would give a wrong dispersion relation."""
    z = signals.chain_position
    u = signals.chain_displacement
    if len(z) < MIN_PARTICLES:
        raise UnavailableError(
            "short_chain",
            f"the chain has {len(z)} particles",
            remedy=f"a dispersion needs {MIN_PARTICLES}",
        )
    spacing = np.diff(z)
    if not abs(spacing - spacing.mean()).max() < UNEVEN * spacing.mean():
        raise UnavailableError(
            "uneven_chain",
            "the chain's spacing is uneven or falls",
            "a particle is missing or out of order, or it is no crystal's chain",
            "record it again",
        )
    size = abs(u)
    if not size.any():
        raise UnavailableError(
            "no_wave", "the chain does not move", "there is no wave in the record"
        )
    if abs(u[0].mean()) > MAX_INITIAL_DISPLACEMENT * size.max():
        raise UnavailableError(
            "not_from_rest",
            "the chain is not at rest where the record begins",
            remedy=(
                "record the wave from its source's "
                "first motion on, displacements from where the particles were then"
            ),
        )
    if (size == size.max()).sum() >= MIN_CLIPPED_SAMPLES:
        raise UnavailableError(
            "clipped_record",
            "the record is clipped",
            "its largest value repeats",
            "record a smaller wave",
        )


def mode_dispersion(frequency: np.ndarray, shape: np.ndarray, distance: float) -> Dispersion:
    """Fit the dispersion relation of P resonances.

    `frequency` (k,) is in Hz; `shape` (k, nc) are displacements along z of a chain whose layers are
    a `distance`, m, apart.
    """
    ratio = mode_cosine(shape)
    square = -((2 * np.pi * np.asarray(frequency)) ** 2) + 0j
    weight = 1 / np.abs(square)
    coefficients, scale = _fit_polynomial(square, ratio + 0j, weight, MODE_ORDER)
    return Dispersion(coefficients, scale, distance)


def mode_cosine(shape: np.ndarray) -> np.ndarray:
    """Return cos(kappa l) (k,) of resonances, from their shapes along the chain (k, nc)."""
    middle = shape[:, 1:-1]
    neighbours = shape[:, 2:] + shape[:, :-2]
    return (middle * neighbours).sum(axis=1) / (2 * (middle**2).sum(axis=1))


def layer_distance(signals: Signals) -> float:
    """Return the mean distance of neighbours along the chain, m."""
    return float(np.ptp(signals.chain_position) / (len(signals.chain_position) - 1))


def rms_deviation(measured: Dispersion, velocity: float, f_low_pass: float) -> float:
    """Return the RMS relative deviation of omega(kappa) from Eq. 9.

    Eq. 9 of the paper is omega = 2 pi f_low_pass sin(kappa l / 2), with l = velocity / (pi
    f_low_pass), m/s and Hz. The relations are compared up to kappa l = `MAX_PHASE_RATIO` pi.
    """
    distance = velocity / (np.pi * f_low_pass)
    kappa = np.linspace(0.02, MAX_PHASE_RATIO, 200) * np.pi / distance
    exact = 2 * np.pi * f_low_pass * np.sin(kappa * distance / 2)
    return float(np.sqrt(np.mean((measured.omega(kappa) / exact - 1) ** 2)))
