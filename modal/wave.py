"""The linear wave without time stepping: one Chebyshev recurrence on the source pattern.

With v = M^1/2 u and A = M^-1/2 K M^-1/2 the source wall's motion d(t) drives v'' + A v = c d(t),
c the scaled force on the particles for a unit displacement of the wall. Hence v(t) = y(A, t) c,
where y(omega^2, t) answers y'' + omega^2 y = d(t) from rest. For the pulse of the study y is known
in closed form; as a function of x = 2 omega^2 / omega_max^2 - 1 it is expanded in Chebyshev
polynomials, whose coefficients fall faster than any power beyond order omega_max t / 2. One pass of
T_k(X) c serves all times, and of every T_k(X) c only the recorded rows are kept.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct
from scipy.sparse.linalg import eigsh

from modal.chain import wall_to_wall_chain
from modal.contact import contact_springs, cross_matrix
from modal.modes import Eigenproblem, start_vector
from modal.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.signals import Signals, source_pulse
from modal.storage import InputError

AMPLITUDE = 2.5e-9
"""A of u = A (1 - cos 2 pi f t), m: the paper's double amplitude 2A is 5 nm."""
INPUT_FREQUENCY = 1e5
"""Nominal input frequency, Hz (Otsubo et al. 2017, section 2)."""


def wall_pattern(network: Network, wall: int) -> tuple[np.ndarray, float]:
    """Force on the particles (6n,) and on the wall (N/m) for a unit z-displacement of a wall."""
    at = network.particle_j == wall
    push = contact_springs(network)[at][:, :, 2]
    turn = np.einsum("cij,cj->ci", cross_matrix(network.lever_i[at]), push)
    pattern = np.zeros((network.n_particles, 6))
    np.add.at(pattern, network.particle_i[at], np.concatenate([push, turn], axis=1))
    return pattern.ravel(), float(push[:, 2].sum())


def _driven_from_rest(square: np.ndarray, time: np.ndarray, frequency: float) -> np.ndarray:
    """Shape (nw, nt): response to 1 - cos(Omega t) switched on at t = 0, unit A.

    (1 - cos wt)/w^2 - (cos Omega t - cos wt)/(w^2 - Omega^2), written with sin(x)/x, which is
    smooth where w = 0 or w = Omega.
    """
    omega = np.sqrt(np.maximum(square, 0))[:, None]
    drive = 2 * np.pi * frequency
    t = np.maximum(time, 0)[None, :]

    def half_product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        # 2 sin(a t) sin(b t) / (4 a b) with a or b allowed to vanish.
        return 0.5 * t**2 * np.sinc(a * t / np.pi) * np.sinc(b * t / np.pi)

    constant = half_product(omega / 2, omega / 2)
    # cos(Omega t) - cos(w t) = 2 sin((w + Omega) t / 2) sin((w - Omega) t / 2).
    return constant - half_product((omega + drive) / 2, (omega - drive) / 2)


def pulse_response(square: np.ndarray, time: np.ndarray, frequency: float) -> np.ndarray:
    """Shape (nw, nt), s^2: y of y'' + omega^2 y = d(t) for the one-period pulse with A = 1.

    The pulse is 1 - cos switched on at 0 and off one period later: two such responses.
    """
    return _driven_from_rest(square, time, frequency) - _driven_from_rest(
        square, time - 1 / frequency, frequency
    )


@dataclass(frozen=True)
class LinearWave:
    """Result of `propagate`: signals, number of products with K, and the bound of the error."""

    signals: Signals
    products: int
    truncation: float


def top_of_spectrum(problem: Eigenproblem) -> float:
    """Slightly above the largest omega^2 (1e-4 relative): the interval of the expansion."""
    if problem.size <= 60:
        return float(np.linalg.eigvalsh(problem.scaled.toarray())[-1]) * (1 + 1e-4)
    v0 = start_vector(problem.size)
    top = eigsh(problem.scaled, k=1, which="LA", v0=v0, tol=1e-6, return_eigenvectors=False)
    return float(top[0]) * (1 + 1e-4)


def propagate(
    network: Network,
    duration: float,
    *,
    amplitude: float = AMPLITUDE,
    input_frequency: float = INPUT_FREQUENCY,
    interval: float = 1e-6,
    tolerance: float = 1e-9,
    network_sha256: str = "",
) -> LinearWave:
    """Signals of the chain and of both walls, exact in time to `tolerance`.

    duration and recording interval in s. The tolerance bounds the dropped coefficients relative
    to the largest one.
    """
    if not (duration > 0 and input_frequency > 0 and 0 < interval <= duration):
        raise InputError("duration, interval and input frequency must be positive numbers of s, Hz")
    started = clock.perf_counter()
    problem = Eigenproblem.of(network)
    chain = wall_to_wall_chain(network)
    scale = 1 / np.sqrt(problem.mass)
    source, source_stiffness = wall_pattern(network, SOURCE_WALL)
    receiver, _ = wall_pattern(network, RECEIVER_WALL)
    top = top_of_spectrum(problem)

    time = np.arange(0, duration + 0.5 * interval, interval)
    order = int(1.1 * np.sqrt(top) * duration / 2) + 60
    angle = np.pi * (np.arange(order) + 0.5) / order
    response = pulse_response(top * (1 + np.cos(angle)) / 2, time, input_frequency)
    coefficient = dct(response, type=2, axis=0) / order
    coefficient[0] /= 2
    size = abs(coefficient).max(axis=1)
    needed = int(np.flatnonzero(size > tolerance * size.max())[-1]) + 1
    if needed == order:
        raise InputError("the expansion did not converge; ask for a larger tolerance")

    rows = 6 * chain + 2
    weights = np.stack([source * scale, receiver * scale])
    kept = np.empty((needed, len(rows) + 2))

    def keep(k: int, vector: np.ndarray) -> None:
        kept[k, :-2] = vector[rows] * scale[rows]
        kept[k, -2:] = weights @ vector

    before = source * scale
    keep(0, before)
    now = 2 / top * (problem.scaled @ before) - before
    if needed > 1:
        keep(1, now)
    for k in range(2, needed):
        before, now = now, 4 / top * (problem.scaled @ now) - 2 * now - before
        keep(k, now)

    recorded = amplitude * (coefficient[:needed].T @ kept)
    pulse = source_pulse(time, amplitude, input_frequency)
    area = float(network.cell_size[0] * network.cell_size[1])
    signals = Signals(
        time=time,
        chain_particle=chain,
        chain_position=network.position[chain, 2],
        chain_displacement=recorded[:, :-2],
        source_displacement=pulse,
        source_stress=(source_stiffness * pulse - recorded[:, -2]) / area,
        receiver_stress=recorded[:, -1] / area,
        producer="linear",
        case=str(network.study.get("case", "")),
        amplitude=amplitude,
        input_frequency=input_frequency,
        time_step=interval,
        run_time=clock.perf_counter() - started,
        network_sha256=network_sha256,
    )
    return LinearWave(signals, needed - 1, float(size[needed:].sum() / size.max()))
