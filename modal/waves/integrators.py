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
step ahead, u_(k+1) = u_k + dt v_(k+1/2).

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

from modal.solvers.spectrum import GrowthError, bound_of_spectrum, dot
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

    Without what the source's displacement adds to the forces. `products` with K; `error`: a bound,
    relative to the largest force and the largest motion.
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
    """Without time step: exact to the `tolerance`, relative. It knows no dashpots."""

    tolerance: float = 1e-9
    time_step = None

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """The record, by one recurrence; GrowthError where K has negative directions."""
        refuse_dashpots(driven, "Chebyshev polynomials of K")

        def series_for(top: float) -> Expansion:
            orders, times = orders_of(top, duration), duration / interval + 1
            numbers = EXPANSION_COPIES * orders * times + (orders + times) * driven.count
            refuse_endless(
                f"a wave of {duration:g} s, recorded every {interval:g} s,",
                driven.springs,
                products=orders / 1.1,
                bytes_needed=8 * numbers,
                remedy="take a shorter duration or a longer interval",
            )
            return Expansion(motion, record_times(duration, interval), top)

        def largest(series: Expansion, record: Floats) -> Floats:
            found = driven.largest(record, motion.displacement(series.time))
            # A wave that has not come to the receiver wall yet: its stress counts beside the
            # source's.
            found[:-1] = found[:-1].max(initial=0.0)
            return found

        series, record, products, error = summed(
            driven.springs, driven.push.copy, driven, series_for, largest, self.tolerance
        )
        return Seen(series.time, record, products, error)


def refuse_dashpots(driven: Driven, what: str) -> None:
    """InputError of an integrator that does not know them."""
    if driven.dashpots is not None:
        raise InputError(f"{what} know no damping of contacts; leave it out, or give no time step")


LOOK = 50
"""Steps between two looks at the energy."""
EXCESS = 1.5
"""Largest velocity over what the source's work allows; above 1 because of round-off, and because
the full tangent is not symmetric and conserves energy only nearly."""


@dataclass(frozen=True)
class Leapfrog:
    """The scheme of DEM programs, with their time step, s; it knows no dashpots.

    Records are whole numbers of steps apart.
    """

    time_step: float

    def carry(self, driven: Driven, motion: Motion, duration: float, interval: float) -> Seen:
        """The record, of an error that is not known.

        InputError where the time step exceeds the stability limit 2 / omega_max. GrowthError where
        the network is unstable: its velocities then exceed what the source's work allows.
        """
        refuse_dashpots(driven, "the leapfrog's steps")
        step, operator = self.time_step, driven.springs
        every = _steps_between_records(interval, step)
        top, _ = bound_of_spectrum(operator)
        limit = 2 / np.sqrt(top) if top > 0 else np.inf
        if not step < limit:
            raise InputError(
                f"time step {step:g} s: the scheme is stable up to 2 / omega_max = {limit:.4g} s; "
                "take a smaller one"
            )
        refuse_endless(
            f"a wave of {duration:g} s in steps of {step:g} s",
            operator,
            products=duration / step,
            bytes_needed=8 * duration / step * (3 + driven.count / every),
            remedy="take a shorter duration",
        )
        times = record_times(duration, interval)
        steps = every * (len(times) - 1)
        moved = motion.displacement(step * np.arange(-1, steps + 2, dtype=float))
        # The force that holds a source which moves; one that pushes needs none.
        holds = driven.rows[0] if driven.held.any() else None
        work, stiffness = 0.0, float(driven.held.max(initial=0.0))
        u, velocity, force = (np.zeros(operator.shape[0]) for _ in range(3))
        record = np.empty((len(times), driven.count))
        for k in progress(steps + 1, "leapfrog"):
            if k % every == 0:
                driven.observe(u, record[k // every])
            before, now, after = moved[k : k + 3]
            np.multiply(driven.push, now, out=force)
            if holds is None:
                work += step / 2 * dot(force, velocity)
            else:
                work += (after - before) / 2 * float((stiffness * now + holds @ u)[0])
            pushed = force.copy() if holds is None else None
            operator.accumulate(u, force, -1.0)
            force *= step
            velocity += force
            if pushed is not None:
                work += step / 2 * dot(pushed, velocity)
            if k % LOOK == LOOK - 1 or k == steps:
                kinetic = 0.5 * dot(velocity, velocity)
                stretch = np.sqrt(stiffness / 8) * abs(after - now)
                if not kinetic <= EXCESS**2 * _most_kinetic(work, step / limit, stretch):
                    raise GrowthError(velocity, k + 1)
            np.multiply(velocity, step, out=force)
            u += force
        return Seen(times, record, steps + 1, np.nan)


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


def _most_kinetic(work: float, share: float, stretch: float) -> float:
    """Largest kinetic energy, J, after `work`, J, of the wall in a stable network.

    With v the velocities and w the mean positions, of the wall too, of two states a step apart,
    leapfrog keeps v M v / 2 + w K w / 2 - (dt^2 / 8) v K v equal to the work. Where K has no
    negative direction the second term is positive and the third below (share root(kinetic) +
    stretch)^2: `share` is the step over its limit, `stretch` the root of the energy, J, that the
    wall's own step alone would store.
    """
    room = 1 - share**2
    reach = share * stretch
    return ((reach + np.sqrt(reach**2 + room * max(work + stretch**2, 0.0))) / room) ** 2


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
        spring, dashpot = driven.springs, driven.dashpots
        top = _fastest(driven)
        refuse_endless(
            f"a damped wave of {duration:g} s",
            spring,
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
        record, walls = np.zeros((len(times), driven.count)), driven.walls
        state, products = np.zeros((2, len(driven.push))), 0
        seen = np.empty(driven.count)
        for k in progress(len(edges) - 1, "wave"):
            start, length = edges[k], edges[k + 1] - edges[k]
            source = _polynomial(motion, start, length)
            inside = np.flatnonzero(at == k)
            share = (times[inside] - start) / length
            power = np.ones(len(inside))
            speed = np.polynomial.polynomial.polyder(source) / length
            moving = np.polynomial.polynomial.polyval(share, speed)
            record[inside, :walls] += moving[:, None] * driven.held_viscous
            following, term = state.copy(), state
            for order in range(MOST_TERMS):
                if len(inside):
                    driven.observe(term[0], seen)
                    seen[:walls] += driven.viscous @ term[1]
                    record[inside] += power[:, None] * seen
                    power = power * share
                ahead = np.empty_like(state)
                ahead[0] = term[1]
                spring.combine(term[0], ahead[1], -1.0)
                if dashpot is not None:
                    dashpot.combine(term[1], ahead[1], -1.0, gamma=1.0)
                if order < len(source):
                    ahead[1] += driven.push * source[order]
                if order < len(speed):
                    ahead[1] += driven.drag * speed[order]
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
    stiff, dashpots = bound_of_spectrum(driven.springs)[0], driven.dashpots
    viscous = 0.0 if dashpots is None else bound_of_spectrum(dashpots)[0]
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


def _polynomial(motion: Motion, start: float, length: float) -> Array:
    """Coefficients (q,), m, of the motion in powers of the share of a step that has passed."""
    at = chebyshev.chebpts1(DEGREE + 1)
    values = motion.displacement(start + length * (at + 1) / 2)
    if not values.any():
        return np.zeros(1)
    series = chebyshev.Chebyshev(chebyshev.chebfit(at, values, DEGREE), domain=[0, 1])
    return series.convert(kind=np.polynomial.Polynomial).coef
