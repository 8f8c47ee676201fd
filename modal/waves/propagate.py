"""The linear wave without time stepping: one Chebyshev recurrence on the source pattern.

With v = M^1/2 u and A = M^-1/2 K M^-1/2 the source wall's motion d(t) drives v'' + A v = c d(t), c
the scaled force on the particles for a unit displacement of the wall. Hence v(t) = y(A, t) c, where
y(omega^2, t) answers y'' + omega^2 y = d(t) from rest (`modal.waves.source`). As a function of x =
2 omega^2 / omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster
than any power beyond order omega_max t / 2. One pass of T_k(X) c serves all times, and of every
T_k(X) c only the recorded rows are kept. The expansion holds in the complex plane too, so a tangent
that is not quite symmetric needs nothing else.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from math import gcd
from typing import TYPE_CHECKING, Protocol

import numpy as np

from modal.arguments import checked
from modal.display import quantity
from modal.formats.arrays import Floats
from modal.formats.hdf5 import InputError
from modal.packing.network import Network
from modal.progress import progress
from modal.solvers.same_bits import same_bits_product
from modal.solvers.spectrum import GrowthError, largest_growth, norm, top_of_spectrum, wider_top
from modal.stiffness.damping import ContactDamping
from modal.stiffness.operator import ContactOperator
from modal.waves.damped import propagate_damped
from modal.waves.driven import Driven
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse
from modal.workload import refuse_endless

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOK = 50
"""Products between two looks at the growth of a recurrence."""
EXPANSION_COPIES = 4
"""Arrays of orders times times that `expansion` holds at once."""


@dataclass(frozen=True, repr=False)
class LinearWave:
    """Result of `propagate`: signals, number of products with K, and the bound of the error.

    It was computed in one of so many `repeats` of which the packing consists sideways.
    """

    signals: Signals
    products: int
    truncation: float
    repeats: int = 1

    def __repr__(self) -> str:
        peak = quantity(float(abs(self.signals.receiver_stress).max()), "Pa")
        return (
            f"<LinearWave: {self.signals!r}, {peak} at most on the receiver wall, {self.products} "
            f"products with K>"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the displacement over time and distance, as `Signals.plot`; returns the Axes."""
        return self.signals.plot(ax)


class Observer(Protocol):
    """What records of a motion are made: `count` numbers, each linear in M^1/2 u."""

    count: int

    def observe(self, u: Floats, out: Floats) -> None:
        """Write the numbers (count,) of the motion u (6n,) into `out`."""


def chebyshev_moments(
    operator: ContactOperator,
    start: Floats,
    top: float,
    count: int,
    receivers: Observer,
) -> Floats:
    """Shape (count, receivers.count): what the receivers read of T_k(2 A / top - 1) start.

    Row k belongs to the Chebyshev polynomial T_k. `operator` is A, `start` (6n,), which is worked
    on in place, `top` the upper end of the interval in omega^2, 1/s^2; the receivers are
    mass-scaled. GrowthError where the vectors grow, as they do when modes lie outside the interval.
    """
    rows = np.empty((count, receivers.count))
    before, now = start, np.empty_like(start)
    first = norm(start)
    for k in progress(count, "wave"):
        if k == 0:
            now[:] = before
        elif k == 1:
            operator.combine(before, now, 2 / top, own=-1.0)
        else:
            # T_k = 2 X T_(k-1) - T_(k-2), built in the array of T_(k-2).
            operator.combine(now, before, 4 / top, own=-2.0, kept=-1.0)
            before, now = now, before
        receivers.observe(now, rows[k])
        if k % LOOK == LOOK - 1 or k == count - 1:
            growth = norm(now) / first if first > 0 else 0.0
            if not growth <= largest_growth(operator, k):
                raise GrowthError(now, k)
    return rows


def moments_within_spectrum(
    operator: ContactOperator,
    start: Callable[[], Floats],
    receivers: Observer,
    count_for: Callable[[float], int],
) -> tuple[Floats, float, int]:
    """`chebyshev_moments` on an interval that holds the spectrum.

    Returns the moments, the top of their interval, 1/s^2, and the number of products with K.
    `start` makes the start anew for each try; `count_for` gives the number of moments for a top.
    The first top is an estimate. Where the recurrence grows, the estimate was too small and a
    larger one is tried. Where it does not grow, modes a little above the top do no harm: the
    expansion holds there too, and the error of leaving out high orders is no larger than inside.
    InputError where there is no stiffness.
    """
    top, products = top_of_spectrum(operator)
    if top == 0:
        raise InputError("the network has no stiffness; no wave goes through it")
    while True:
        count = count_for(top)
        try:
            rows = chebyshev_moments(operator, start(), top, count, receivers)
        except GrowthError as found:
            top, more = wider_top(operator, found, top)
            products += more + found.products
        else:
            return rows, top, products + count - 1


def _orders(top: float, duration: float) -> int:
    """Number of Chebyshev orders beyond which the coefficients of a wave are negligible.

    `top`: upper end of the interval in omega^2, 1/s^2; `duration` of the wave in s.
    """
    order = int(1.1 * np.sqrt(top) * duration / 2) + 60
    # Up to the next number whose Fourier transform is fast.
    while gcd(order, 30**20) != order:
        order += 1
    return order


def expansion(motion: Motion, time: Floats, top: float, tolerance: float) -> tuple[Floats, float]:
    """Chebyshev coefficients (count, nt) of y(top (1 + x) / 2, t) at times (nt,), and their error.

    Orders are dropped from where all are below `tolerance` times the largest; the second result is
    the sum of the largest dropped ones over the largest of all.
    """
    order = _orders(top, time[-1])
    angle = np.pi * (np.arange(order) + 0.5) / order
    response = motion.response(top * (1 + np.cos(angle)) / 2, time)
    coefficient = _cosines(response) / order
    coefficient[0] /= 2
    size = abs(coefficient).max(axis=1)
    if not size.any():
        return coefficient[:1], 0.0
    needed = int(np.flatnonzero(size > tolerance * size.max())[-1]) + 1
    if needed == order:
        raise InputError("the expansion did not converge; ask for a larger tolerance")
    return coefficient[:needed], float(size[needed:].sum() / size.max())


def _cosines(values: Floats) -> Floats:
    """Twice the sum of values (N, nt) times cos(pi k (n + 1/2) / N) over n, for each k < N.

    A Fourier transform of the even rows, then the odd ones backwards (J. Makhoul, IEEE Trans.
    Acoust. Speech Signal Process. 28, 27, 1980). scipy.fft would take a tenth of a second to load.
    """
    count = len(values)
    half = np.fft.rfft(np.concatenate([values[::2], values[1::2][::-1]]), axis=0)
    half *= 2 * np.exp(-0.5j * np.pi * np.arange(len(half)) / count)[:, None]
    whole = np.empty_like(values)
    whole[: len(half)] = half.real
    # The transform of real rows: what stands at N - k is conjugate to k.
    whole[len(half) :] = -half.imag[count - len(half) : 0 : -1]
    return whole


@checked
def propagate(
    network: Network,
    duration: float,
    *,
    motion: Motion | None = None,
    interval: float = 1e-6,
    tolerance: float = 1e-9,
    pre_stress: str = "none",
    particles: bool = False,
    direction: str = "z",
    damping: ContactDamping | None = None,
    whole: bool = False,
    network_sha256: str = "",
) -> LinearWave:
    """The wave that a small motion of the source wall sends through a packing.

    The contacts' springs stay what they are (linear). There is no time-step error: the result holds
    to `tolerance` at every recorded time. Its `signals` have displacements, m, of a chain of
    particles from wall to wall and of layers, and stresses on both walls, Pa: `time` (nt,),
    `chain_displacement` (nt, nc), `receiver_stress` (nt,). The wall moves along `direction`, and
    all is recorded along it: "z" sends P-waves, "x" and "y" send S-waves.

    `duration` and recording `interval` in s; `motion` of the source wall, by default the pulse of
    the study. `tolerance` bounds the coefficients that the expansion drops, relative to the largest
    one. `pre_stress` as in `modal.stiffness.pre_stress`; `particles` records every particle;
    `network_sha256` is noted in the signals. `damping` gives the contacts dashpots
    (`modal.stiffness.damping`), which takes some ten times as many products. A packing of equal
    parts side by side, as a crystal, is computed in one of them where that is exact to the
    `tolerance` too (`modal.waves.driven`), unless `whole` asks for all of it. InputError for
    impossible arguments, for a network without stiffness, and where the run would take more than a
    day or the memory; GrowthError where K has negative directions.

    >>> import modal
    >>> wave = propagate(modal.fcc(cells=(1, 1, 30)), duration=5e-5)
    >>> wave.signals.chain_displacement.shape
    (51, 30)
    """
    if not (0 < interval <= duration < np.inf and 0 < tolerance < 1):
        raise InputError(
            "duration and interval must be positive, the interval no longer than the duration, "
            "the tolerance between 0 and 1"
        )
    started = clock.perf_counter()
    motion = motion or Pulse()
    if damping is not None and not damping.none:
        if pre_stress != "none":
            raise InputError(f"pre-stress {pre_stress!r} with damping: take none")
        damped, products = propagate_damped(
            network,
            duration,
            damping,
            motion,
            interval=interval,
            tolerance=tolerance,
            particles=particles,
            direction=direction,
            network_sha256=network_sha256,
        )
        return LinearWave(damped, products, tolerance)
    driven = Driven(
        network,
        duration,
        tolerance,
        pre_stress=pre_stress,
        particles=particles,
        direction=direction,
        whole=whole,
    )
    receivers = driven.receivers
    time, recorded, products, truncation = carried(
        driven.operator, driven.start, receivers, motion, duration, interval, tolerance
    )
    signals = receivers.signals(
        time,
        recorded,
        motion,
        time_step=interval,
        run_time=clock.perf_counter() - started,
        network_sha256=network_sha256,
    )
    return LinearWave(signals, products, truncation + driven.difference, driven.repeats)


def carried(
    operator: ContactOperator,
    start: Callable[[], Floats],
    receivers: Observer,
    motion: Motion,
    duration: float,
    interval: float,
    tolerance: float,
) -> tuple[Floats, Floats, int, float]:
    """Times (nt,), what is recorded at them (nt, count), products with K, and the truncation.

    `start` makes the mass-scaled force (6n,) on the particles for a unit displacement of the
    source, which goes by `motion`; the other arguments are those of `propagate`.
    """
    planned: dict[float, tuple[Floats, Floats, float]] = {}

    def count_for(top: float) -> int:
        orders, times = _orders(top, duration), duration / interval + 1
        numbers = EXPANSION_COPIES * orders * times + (orders + times) * receivers.count
        refuse_endless(
            f"a wave of {duration:g} s, recorded every {interval:g} s,",
            operator,
            products=orders / 1.1,
            bytes_needed=8 * numbers,
            remedy="take a shorter duration or a longer interval",
        )
        time = np.arange(0, duration + 0.5 * interval, interval)
        planned[top] = time, *expansion(motion, time, top, tolerance)
        return len(planned[top][1])

    rows, top, products = moments_within_spectrum(operator, start, receivers, count_for)
    time, coefficient, truncation = planned[top]
    return time, same_bits_product(coefficient.T, rows), products, truncation
