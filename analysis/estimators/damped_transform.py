"""Dispersion relation of the chain by a nearly unbiased estimator: the damped transform.

The record ends before the reflection returns, so a Fourier transform in time truncates the slow,
high frequencies and biases whatever is read from it. A damped transform (Laplace, s = eta + i
omega) does not: exp(-eta T) makes the cut negligible. In a periodic medium whose layers act on
their nearest neighbours, (U[n+1] + U[n-1]) / (2 U[n]) = cosh(q l) is the same for all n, and an
analytic function of s^2 that tends to 1. It is measured at many s, fitted by a polynomial in s^2
without assuming the law, and continued to the real frequency axis: cos(kappa l) = G(-omega^2).
A pure sine (an eigenmode) has the same ratio, so modes are measured in the same way.

Least squares of the ratio is biased by noise, which stands on both sides. So the equation is
weighted by U[n] as its neighbours two to forty layers away predict it from the G found before,
whose noise is another: an instrumental variable, as in errors-in-variables regression.
"""

from dataclasses import dataclass

import numpy as np

from modal.tools.errors import UnavailableError
from modal.waves.signals import Signals

INSTRUMENT = 40
"""Layers away whose displacement predicts a layer's."""
LAST = 120
"""Layers up to which the chain is used: the record has little of those farther."""
PASSES = 6
"""Three passes of the nearest-neighbour law, which finds the band, and three of the full order."""

OF_MODES = 3
"""Order of the polynomial that is fitted to modes, which have no noise."""
REACH = 0.9
"""Of pi / l: wave numbers up to which a dispersion relation is held against Eq. 9."""
SHORTEST = 10
"""Particles of the shortest chain that is evaluated."""
UNEVEN = 0.1
"""Deviation of a spacing from their mean; a missing particle doubles one."""
MOVED = 0.15
"""Mean displacement of the chain where the record begins, in parts of the largest one."""
CLIPPED = 3
"""Samples at exactly the largest value that no wave has by chance."""


@dataclass(frozen=True)
class Dispersion:
    """G = cos(kappa l) = 1 + x (c0 + c1 x + ...), x = -(omega / scale)^2; scale in rad/s."""

    coefficients: np.ndarray
    scale: float
    distance: float

    def cosine(self, omega: np.ndarray | float) -> np.ndarray:
        """cos(kappa l) at angular frequencies, rad/s; with omega = -i s, cosh(q l) at s."""
        x = -((np.asarray(omega) / self.scale) ** 2)
        return 1 + x * np.polynomial.polynomial.polyval(x, self.coefficients)

    @property
    def velocity(self) -> float:
        """Long-wave velocity, m/s: the slope at omega -> 0; NaN where noise has it fall."""
        with np.errstate(invalid="ignore"):
            return float(self.distance * self.scale / np.sqrt(2 * self.coefficients[0]))

    @property
    def low_pass_frequency(self) -> float:
        """Band edge, Hz: the lowest frequency at which cos(kappa l) = -1."""
        powers = np.concatenate([[2.0], self.coefficients])  # 1 + G as a polynomial in x
        roots = np.polynomial.polynomial.polyroots(powers)
        real = -roots.real[(np.abs(roots.imag) < 1e-6 * np.abs(roots)) & (roots.real < 0)]
        return float(self.scale * np.sqrt(real.min()) / (2 * np.pi)) if real.size else np.nan

    def omega(self, kappa: np.ndarray) -> np.ndarray:
        """omega(kappa), rad/s, for wavenumbers (k,) 1/m below pi / l."""
        grid = np.linspace(0, 2 * np.pi * self.low_pass_frequency, 4001)
        phase = np.arccos(np.clip(self.cosine(grid), -1, 1))
        return np.interp(np.asarray(kappa) * self.distance, np.maximum.accumulate(phase), grid)


def laplace_ratio(
    field: np.ndarray, cosine: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Neighbour ratio G (k,) and its weight (k,) from transforms U (k, nc) of a chain.

    By least squares, or with `cosine` (k,), an estimate of G, by the instrument that it predicts.
    """
    reach = min(INSTRUMENT, field.shape[1] // 5)
    middle = np.arange(reach, min(LAST, field.shape[1] - reach))
    u, sides = field[:, middle], field[:, middle - 1] + field[:, middle + 1]
    instrument = u
    if cosine is not None:
        instrument, total = np.zeros_like(u), np.zeros(len(cosine))
        before, now = np.ones_like(cosine), cosine  # T_j(G): U[n+j] + U[n-j] = 2 T_j(G) U[n]
        for j in range(2, reach + 1):
            before, now = now, 2 * cosine * now - before
            instrument += now.conj()[:, None] * (field[:, middle + j] + field[:, middle - j]) / 2
            total = total + abs(now) ** 2
        instrument /= total[:, None]
    power = (instrument.conj() * u).sum(axis=1)
    return (instrument.conj() * sides).sum(axis=1) / (2 * power), np.sqrt(abs(power))


def _fit(
    square: np.ndarray, ratio: np.ndarray, weight: np.ndarray, order: int
) -> tuple[np.ndarray, float]:
    """Weighted least squares of G = 1 + x p(x), x = square / scale^2, real coefficients."""
    scale = np.sqrt(np.abs(square).max())
    x = square / scale**2
    matrix = weight[:, None] * x[:, None] ** np.arange(1, order + 1)
    target = weight * (ratio - 1)
    rows = np.concatenate([matrix.real, matrix.imag])
    coefficients = np.linalg.lstsq(rows, np.concatenate([target.real, target.imag]), rcond=None)[0]
    return coefficients, float(scale)


def chain_dispersion(signals: Signals, order: int = 2, decay: float = 3.0) -> Dispersion:
    """Dispersion from recorded chain signals; band and instrument are found by repeated passes.

    decay = eta T, what the cut at the record's end T is damped by. On exact signals the bias is
    below 1e-5; 5 % of white noise scatters V_P by 0.3 % and the band edge by 0.6 %, and biases
    neither. Higher orders and stronger damping pass on more noise.
    """
    _refuse_damaged(signals)
    time = signals.time - signals.time[0]
    eta, step = decay / time[-1], np.gradient(time)
    top = 2 * np.pi * 2 * signals.input_frequency * 0.9
    result = None
    for done in range(PASSES):
        s = eta + 1j * np.linspace(0.02, 1.0, 160) * top
        field = np.exp(-np.outer(s, time)) * step @ signals.chain_displacement
        guess = None if result is None else result.cosine(-1j * s)
        ratio, weight = laplace_ratio(field, guess)
        scale = np.abs(s) ** 2  # relative accuracy at small s, where G - 1 itself is small
        weight = weight / weight.max() / (scale / scale.max() + 0.1)
        coefficients, unit = _fit(s**2, ratio, weight, order if done > 2 else 1)
        result = Dispersion(coefficients, unit, layer_distance(signals))
        edge = result.low_pass_frequency
        if np.isfinite(edge):
            top = 2 * np.pi * edge * 1.02
    return result


def _refuse_damaged(signals: Signals) -> None:
    """InputError for records that the neighbour ratio would take for another dispersion."""
    z, u = signals.chain_position, signals.chain_displacement
    if len(z) < SHORTEST:
        raise UnavailableError(
            f"the chain has {len(z)} particles; a dispersion needs {SHORTEST}", code="short_chain"
        )
    spacing = np.diff(z)
    if not abs(spacing - spacing.mean()).max() < UNEVEN * spacing.mean():
        raise UnavailableError(
            "the chain's spacing is uneven or falls: a particle is missing or out of order, or it "
            "is no crystal's chain; record it again",
            code="uneven_chain",
        )
    size = abs(u)
    if not size.any():
        raise UnavailableError(
            "the chain does not move: there is no wave in the record", code="no_wave"
        )
    if abs(u[0].mean()) > MOVED * size.max():
        raise UnavailableError(
            "the chain is not at rest where the record begins; record the wave from its source's "
            "first motion on, displacements from where the particles were then",
            code="not_from_rest",
        )
    if (size == size.max()).sum() >= CLIPPED:
        raise UnavailableError(
            "the record is clipped: its largest value repeats; record a smaller wave",
            code="clipped_record",
        )


def mode_dispersion(frequency: np.ndarray, shape: np.ndarray, distance: float) -> Dispersion:
    """Dispersion from P resonances: frequency (k,) Hz and z shapes along the chain (k, nc)."""
    ratio = mode_cosine(shape)
    square = -((2 * np.pi * np.asarray(frequency)) ** 2) + 0j
    coefficients, unit = _fit(square, ratio + 0j, 1 / np.abs(square), OF_MODES)
    return Dispersion(coefficients, unit, distance)


def mode_cosine(shape: np.ndarray) -> np.ndarray:
    """cos(kappa l) of each resonance (k,), from its shape along the chain (k, nc)."""
    middle = shape[:, 1:-1]
    return (middle * (shape[:, 2:] + shape[:, :-2])).sum(axis=1) / (2 * (middle**2).sum(axis=1))


def layer_distance(signals: Signals) -> float:
    """Mean distance of neighbours along the chain, m."""
    return float(np.ptp(signals.chain_position) / (len(signals.chain_position) - 1))


def rms_deviation(measured: Dispersion, velocity: float, f_low_pass: float) -> float:
    """RMS relative deviation of omega(kappa) from Eq. 9, up to kappa l = `REACH` pi.

    Eq. 9 is taken as omega = 2 pi f_low_pass sin(kappa l / 2), l = velocity / (pi f_low_pass).
    """
    distance = velocity / (np.pi * f_low_pass)
    kappa = np.linspace(0.02, REACH, 200) * np.pi / distance
    exact = 2 * np.pi * f_low_pass * np.sin(kappa * distance / 2)
    return float(np.sqrt(np.mean((measured.omega(kappa) / exact - 1) ** 2)))
