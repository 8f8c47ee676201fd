"""What carries a wave through a `Driven` system: exactly in time, in a DEM's steps, in long ones.

The source's motion d(t) drives v'' + A v = c d(t). Hence v(t) = y(A, t) c, where y(omega^2, t)
answers y'' + omega^2 y = d(t) from rest (`modal.waves.source`). As a function of x = 2 omega^2 /
omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster than any
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
power of ten (`docs/damping.md`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.polynomial import chebyshev

from modal.solvers.spectrum import bound_of_spectrum
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import Expansion, orders_of, summed
from modal.waves.driven import Driven
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


@runtime_checkable
class Integrator(Protocol):
    """Carries a wave through a driven system."""

    @property
    def time_step(self) -> float | None:
        """Of its own, s; None of one that has none."""

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """What is recorded from 0 on at every `interval`, s, of the `duration`, s.

        InputError where it cannot: for dashpots, for an unstable packing, for an endless run.
        """


@dataclass(frozen=True)
class Chebyshev:
    """Exact in time to the `tolerance`, relative; or, with a `time_step`, s, what leapfrog gives.

    It knows no dashpots. Records of a leapfrog are whole numbers of its steps apart.
    """

    tolerance: float = 1e-9
    time_step: float | None = None

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """The record, by one recurrence.

        GrowthError where K has negative directions, InputError where the time step exceeds the
        stability limit 2 / omega_max.
        """
        if driven.dashpots is not None:
            raise InputError(
                "Chebyshev polynomials of K, which give a leapfrog's steps too, know no damping of "
                "contacts; leave it out, or give no time step"
            )
        step, found, top = self.time_step, 0, None
        if step is not None:
            every = _steps_between_records(interval, step)
            top, found = driven.system.end(bound_of_spectrum)

        def series_for(top: float) -> Expansion:
            if step is not None and not step < 2 / np.sqrt(top):
                raise InputError(
                    f"time step {step:g} s: the scheme is stable up to 2 / omega_max = "
                    f"{2 / np.sqrt(top):.4g} s; take a smaller one"
                )
            orders, times = orders_of(top, duration), duration / interval + 1
            numbers = EXPANSION_COPIES * orders * times + (orders + times) * driven.count
            refuse_endless(
                f"a wave of {duration:g} s, recorded every {interval:g} s,",
                driven.springs.operator,
                products=orders / 1.1,
                bytes_needed=8 * numbers,
                remedy="take a shorter duration or a longer interval",
            )
            time = record_times(duration, interval)

            def response(square: Floats) -> Floats:
                if step is None:
                    return motion.response(square, time)
                return leapfrog(motion, square, len(time), every, step)

            return Expansion(response, time, motion.displacement(time), top)

        series, record, products, error = summed(driven, series_for, self.tolerance, top)
        return Seen(series.time, record, products + found, error)


def leapfrog(motion: Motion, square: Floats, count: int, every: int, step: float) -> Floats:
    """Shape (nw, count): y of omega^2 (nw,), 1/s^2, at each `every`-th of a DEM's steps, s."""
    moved = motion.displacement(step * np.arange(every * (count - 1), dtype=float))
    y, speed = np.zeros((2, len(square)))
    response = np.zeros((len(square), count))
    for k, d in enumerate(moved, 1):
        speed += step * (d - square * y)
        y += step * speed
        if k % every == 0:
            response[:, k // every] = y
    return response


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
DEGREE = 14
"""Of the polynomial that stands for the source's motion in a step."""
MOST_TERMS = 200


@dataclass(frozen=True)
class Taylor:
    """Long steps, each a series in time, with dashpots or without.

    `tolerance` bounds the terms that a step leaves out, relative to the largest state.
    """

    tolerance: float = 1e-9
    time_step = None

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """The record; InputError where a series does not end."""
        springs, dashpots, walls = driven.springs, driven.dashpots, driven.walls
        top = _fastest(driven)
        refuse_endless(
            f"a damped wave of {duration:g} s",
            springs.operator,
            products=8 * top * duration,
            bytes_needed=8.0 * (duration / interval + 1) * driven.count,
            remedy="take a shorter duration",
        )
        times = record_times(duration, interval)
        end = float(times[-1])
        # The polynomial of the source holds for a few radians of its own.
        step = min(RADIANS / top, 2 / (2 * np.pi * max(motion.frequency, 1 / end)))
        edges = _steps(motion.corners, end, step)
        at = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)
        record = driven.blank(motion.displacement(times))
        push, drag = (link.push.toarray()[0] if link else 0.0 for link in (springs, dashpots))
        state, products = np.zeros((2, springs.operator.shape[0])), 0
        for k in progress(len(edges) - 1, "wave"):
            start, length = edges[k], edges[k + 1] - edges[k]
            source, speed = _polynomial(motion, start, length)
            inside = np.flatnonzero(at == k)
            share = (times[inside] - start) / length
            power = np.ones(len(inside))
            if dashpots:
                moving = np.polynomial.polynomial.polyval(share, speed)
                record[inside, :walls] += moving[:, None] * dashpots.held
            following, term = state.copy(), state
            for order in range(MOST_TERMS):
                if len(inside):
                    seen = springs.rows @ term[0]
                    if dashpots:
                        seen[:walls] += dashpots.rows @ term[1]
                    record[inside] += power[:, None] * seen
                    power = power * share
                ahead = np.empty_like(state)
                ahead[0] = term[1]
                springs.operator.combine(term[0], ahead[1], -1.0)
                if dashpots:
                    dashpots.operator.combine(term[1], ahead[1], -1.0, gamma=1.0)
                if order < len(source):
                    ahead[1] += push * source[order]
                if order < len(speed):
                    ahead[1] += drag * speed[order]
                ahead *= length / (order + 1)
                products += 1
                following += ahead
                term = ahead
                small = _size(term, top) <= self.tolerance * 1e-2 * _size(following, top)
                if small and order >= len(source):
                    break
            else:
                raise InputError("the series of the wave did not end; take a larger tolerance")
            state = following
        return Seen(times, record, products, self.tolerance)


def _size(state: Floats, top: float) -> float:
    """The state in units of velocity."""
    return float(top * np.linalg.norm(state[0]) + np.linalg.norm(state[1]))


def _fastest(driven: Driven) -> float:
    """A bound of the rates of all modes, 1/s: |lambda|^2 <= omega^2 + |lambda| gamma."""
    stiff, dashpots = driven.system.top, driven.dashpots
    viscous = bound_of_spectrum(dashpots.operator)[0] if dashpots else 0.0
    if stiff <= 0:
        raise InputError("the network has no stiffness; no wave goes through it")
    return float(viscous / 2 + np.sqrt(viscous**2 / 4 + stiff))


def _steps(corners: Floats, end: float, longest: float) -> Floats:
    """Times, s, of the steps' ends: at each corner of the source's motion, evenly in between."""
    inside = corners[(corners > 0) & (corners < end)]
    marks = np.concatenate([[0.0], inside, [end]])
    parts = [
        np.linspace(a, b, int(np.ceil((b - a) / longest)) + 1)[:-1]
        for a, b in zip(marks[:-1], marks[1:], strict=True)
    ]
    return np.concatenate([*parts, [end]])


def _polynomial(motion: Motion, start: float, length: float) -> tuple[Floats, Array]:
    """Coefficients (q,) of the motion, m, and of its velocity, m/s, in powers of a step's share."""
    at = chebyshev.chebpts1(DEGREE + 1)
    values = motion.displacement(start + length * (at + 1) / 2)
    if not values.any():
        return np.zeros(1), np.zeros(1)
    series = chebyshev.Chebyshev(chebyshev.chebfit(at, values, DEGREE), domain=[0, 1])
    moved = np.array(series.convert(kind=np.polynomial.Polynomial).coef, float)
    return moved, np.polynomial.polynomial.polyder(moved) / length
