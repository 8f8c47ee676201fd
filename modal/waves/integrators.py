"""What carries a wave through a `Driven` system: exactly in time, in a DEM's steps, in long ones.

The source's motion d(t) drives v'' + A v = c d(t). Hence v(t) = y(A, t) c, where y(omega^2, t)
answers y'' + omega^2 y = d(t) from rest (`modal.waves.oscillator`). As a function of x = 2 omega^2
/ omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster than any
power beyond order omega_max t / 2. One pass of T_k(X) c serves all times, and of every T_k(X) c
only the recorded rows are kept. The expansion holds in the complex plane too, so a tangent that is
not quite symmetric needs nothing else.

Leapfrog is not needed to obtain a wave but to take one apart: with the DEM's own scheme and step
the linear wave carries the same time-integration error, and what then remains between the two is
physics. State k is at time k dt: forces from u_k and from the wall at d(k dt), velocities half a
step ahead, u_(k+1) = u_k + dt v_(k+1/2). An oscillator of any omega^2 below the limit of the step
answers so too, by a polynomial in omega^2: the expansion is the same, of another y, and takes as
many products however short the step.

With dashpots, Taylor series in time: the modes are complex and Chebyshev polynomials of K serve no
longer. The state y = (u, v) follows y' = L y + g(t), and its Taylor series about the start of a
step is known without any table: (k + 1) a_(k+1) = L a_k + g_k, where g_k are the coefficients of
the source's motion in the step. A step is some radians of the highest mode long, and takes as many
products with K and C as the tolerance asks; what is recorded inside a step are values of
polynomials. Against schemes of fixed order the work rises with the number of digits, not with a
power of ten (`docs/attenuation.md`).
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.polynomial import polyder, polyval

from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import Expansion, orders_of, summed
from modal.waves.driven import Driven
from modal.waves.oscillator import leapfrog, oscillation, steps
from modal.waves.signals import record_times
from modal.waves.source import Motion

EXPANSION_COPIES = 4
"""Arrays of orders times times that `Expansion` holds at once."""


@dataclass(frozen=True)
class Seen:
    """Record (nt, count) at times (nt,), s, of what a `Driven` system's rows read.

    `products` with K; `error`: a bound, relative to the largest force and the largest motion.
    """

    time: Floats
    record: Floats
    products: int
    error: float


def by_polynomials(
    driven: Driven,
    motion: Motion,
    duration: float,
    interval: float,
    tolerance: float,
    time_step: float | None = None,
) -> Seen:
    """Exact in time to the `tolerance`, relative; or, with a `time_step`, s, what leapfrog gives.

    Records are an `interval`, s, apart, of a leapfrog a whole number of its steps. GrowthError
    where K has negative directions, InputError for dashpots, for an endless run, and where the time
    step exceeds the stability limit 2 / omega_max.
    """
    if driven.dashpots is not None:
        raise InputError(
            "Chebyshev polynomials of K, which give a leapfrog's steps too, know no damping of "
            "contacts; leave it out, or give no time step"
        )
    every = 0 if time_step is None else _steps_between_records(interval, time_step)

    def series_for(top: float) -> Expansion:
        if time_step is not None and not time_step < 2 / np.sqrt(top):
            raise InputError(
                f"time step {time_step:g} s: the scheme is stable up to 2 / omega_max = "
                f"{2 / np.sqrt(top):.4g} s; take a smaller one"
            )
        orders, times = orders_of(top, duration), duration / interval + 1
        numbers = (EXPANSION_COPIES * orders + every) * times + (orders + times) * driven.count
        refuse_endless(
            f"a wave of {duration:g} s, recorded every {interval:g} s,",
            driven.springs.operator,
            products=orders / 1.1,
            bytes_needed=8 * numbers,
            remedy="take a shorter duration or a longer interval" + ", or step" * bool(every),
        )
        time = record_times(duration, interval)

        def response(square: Floats) -> Floats:
            if time_step is None:
                return oscillation(motion, square, time)
            return leapfrog(motion, square, len(time), every, time_step)

        return Expansion(response, time, motion.displacement(time), top)

    series, record, products, error = summed(driven, series_for, tolerance)
    return Seen(series.time, record, products, error)


def _steps_between_records(interval: float, time_step: float) -> int:
    """Steps from record to record; InputError where the interval, s, is no multiple of a step."""
    if not 0 < time_step < np.inf:
        raise InputError("the time step must be positive; give it in s")
    every = max(1, round(interval / time_step))
    if abs(every * time_step / interval - 1) > 1e-9:
        raise InputError(
            f"interval {interval:g} s: no multiple of the time step {time_step:g} s; take "
            f"{every * time_step:g} s, or a step of {interval / np.ceil(interval / time_step):g} s"
        )
    return every


RADIANS = 8.0
"""Of the fastest mode in a step. The terms of the series rise to exp(8) before they fall: round-off
is then 7e-13; longer steps would take fewer products, and lose more digits."""
SLOW = 2.0
"""Of the motion in a step, for which the polynomial stands that is its series."""
DEGREE = 14
"""Of that polynomial."""
MOST_TERMS = 200


def by_series(
    driven: Driven, motion: Motion, duration: float, interval: float, tolerance: float
) -> Seen:
    """Of a system with dashpots: long steps, each a series in time.

    `tolerance` bounds the terms that a step leaves out, relative to the largest state. InputError
    where a series does not end.
    """
    springs, dashpots, walls = driven.springs, driven.dashpots, driven.walls
    assert dashpots is not None
    top = _fastest(driven)
    refuse_endless(
        f"a damped wave of {duration:g} s",
        springs.operator,
        products=8 * top * duration,
        bytes_needed=8.0 * (duration / interval + 1) * driven.count,
        remedy="take a shorter duration",
    )
    times = record_times(duration, interval)
    edges = steps(motion, times[[0, -1]], top, RADIANS, SLOW)
    at = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)
    record = driven.blank(motion.displacement(times))
    push, drag = (link.push.toarray()[0] for link in (springs, dashpots))
    state, products = np.zeros((2, springs.operator.shape[0])), 0
    for k in progress(len(edges) - 1, "wave"):
        start, length = edges[k], edges[k + 1] - edges[k]
        source, speed = _polynomial(motion, start, length)
        inside = np.flatnonzero(at == k)
        share = (times[inside] - start) / length
        power = np.ones(len(inside))
        record[inside, :walls] += polyval(share, speed)[:, None] * dashpots.held
        following, term = state.copy(), state
        for order in range(MOST_TERMS):
            if len(inside):
                seen = springs.rows @ term[0]
                seen[:walls] += dashpots.rows @ term[1]
                record[inside] += power[:, None] * seen
                power = power * share
            ahead = np.empty_like(state)
            ahead[0] = term[1]
            springs.operator.combine(term[0], ahead[1], -1.0)
            dashpots.operator.combine(term[1], ahead[1], -1.0, gamma=1.0)
            if order < len(source):
                ahead[1] += push * source[order]
            if order < len(speed):
                ahead[1] += drag * speed[order]
            ahead *= length / (order + 1)
            products += 1
            following += ahead
            term = ahead
            small = _size(term, top) <= tolerance * 1e-2 * _size(following, top)
            if small and order >= len(source):
                break
        else:
            raise InputError("the series of the wave did not end; take a larger tolerance")
        state = following
    return Seen(times, record, products, tolerance)


def _size(state: Floats, top: float) -> float:
    """The state in units of velocity."""
    return float(top * np.linalg.norm(state[0]) + np.linalg.norm(state[1]))


def _fastest(driven: Driven) -> float:
    """A bound of the rates of all modes, 1/s: |lambda|^2 <= omega^2 + |lambda| gamma."""
    stiff, dashpots = driven.system.top, driven.system.dashpots
    viscous = dashpots.top if dashpots else 0.0
    if stiff <= 0:
        raise InputError("the network has no stiffness; no wave goes through it")
    return float(viscous / 2 + np.sqrt(viscous**2 / 4 + stiff))


def _polynomial(motion: Motion, start: float, length: float) -> tuple[Floats, Array]:
    """Coefficients (q,) of the motion, m, and of its velocity, m/s, in powers of a step's share."""
    at = chebyshev.chebpts1(DEGREE + 1)
    values = motion.displacement(start + length * (at + 1) / 2)
    if not values.any():
        return np.zeros(1), np.zeros(1)
    series = chebyshev.Chebyshev(chebyshev.chebfit(at, values, DEGREE), domain=[0, 1])
    moved = np.array(series.convert(kind=np.polynomial.Polynomial).coef, float)
    return moved, polyder(moved) / length
