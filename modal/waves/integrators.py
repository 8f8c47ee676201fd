"""Integrate a forced system in time: exactly, in the steps of a DEM, or with dashpots.

The motion d(t) of the source drives v'' + A v = c d(t). Hence v(t) = y(A, t) c, where y(omega^2, t)
solves y'' + omega^2 y = d(t) from rest (`modal.waves.oscillator`). As a function of x = 2 omega^2 /
omega_max^2 - 1 it is expanded in Chebyshev polynomials, whose coefficients fall faster than any
power beyond order omega_max t / 2. One pass over T_k(X) c is enough for all times, and only the
recorded rows of each T_k(X) c are stored. The expansion also holds in the complex plane, so that a
slightly unsymmetric tangent needs no other method.

Leapfrog is only used to analyse a DEM run: with the scheme and the step of the DEM the linear wave
has the same time-integration error, and the remaining difference is physics. State k is at time k
dt: forces from u_k and from the wall at d(k dt), velocities half a step ahead, u_(k+1) = u_k + dt
v_(k+1/2). The response of an oscillator below the stability limit is then a polynomial in omega^2,
so that the same expansion applies, with a number of products that does not depend on the step.

With dashpots the modes are complex, and Taylor series in time replace the Chebyshev polynomials of
K. The state y = (u, v) follows y' = L y + g(t), and its Taylor series about the start of a step
follows from a recurrence: (k + 1) a_(k+1) = L a_k + g_k, where g_k are the coefficients of the
source's motion in the step. A step lasts some radians of the highest mode, and takes as many
products with K and C as the tolerance requires; records inside a step are values of polynomials.
The work is proportional to the number of exact digits, while schemes of fixed order need a power of
ten (`docs/attenuation.md`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.polynomial import polyder, polyval

from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import InputError, UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import Expansion, orders_of, summed
from modal.waves.forced_system import ForcedSystem
from modal.waves.motions import Motion
from modal.waves.oscillator import leapfrog, oscillation, steps
from modal.waves.signals import record_times

EXPANSION_COPIES = 4
"""Number of arrays of orders times times that `Expansion` holds at once."""
RADIANS_PER_STEP = 8.0
"""Length of a step of the Taylor series, in radians of the fastest mode. The terms of the series
rise to exp(8) before they fall, which makes a round-off of 7e-13; longer steps would take fewer
products and lose more digits."""
MOTION_RADIANS_PER_STEP = 2.0
"""Length of a step, in radians of the source's motion, which is represented by a polynomial of
`MOTION_DEGREE`."""
MOTION_DEGREE = 14
MAX_TERMS = 200


@dataclass(frozen=True)
class WaveRecord:
    """A record of a forced system.

    Attributes
    ----------
    time : ndarray (nt,)
        Times, s.
    record : ndarray (nt, count)
        Readings of the rows of the system.
    products : int
        Number of products with K.
    error : float
        Bound of the error, relative to the largest force and the largest motion.
    """

    time: Floats
    record: Floats
    products: int
    error: float


def by_polynomials(
    forced: ForcedSystem,
    motions: Sequence[Motion],
    duration: float,
    interval: float,
    tolerance: float,
    time_step: float | None = None,
) -> list[WaveRecord]:
    """Compute the waves of some motions by Chebyshev polynomials, exactly in time.

    `tolerance` is the relative error of each wave; all of them share the products with K. With a
    `time_step`, s, the waves are those of the leapfrog scheme. Records are an `interval`, s, apart,
    for leapfrog a whole number of steps. Raises GrowthError if K has negative directions;
    InputError with dashpots, for a run that would take too long, and if the time step exceeds the
    stability limit 2 / omega_max.
    """
    if forced.dashpots is not None:
        raise InputError(
            "damping",
            "Chebyshev polynomials of K, which give a leapfrog's steps too, know no damping of "
            "contacts",
            remedy="leave it out, or give no time step",
        )
    steps_between_records = 0
    if time_step is not None:
        steps_between_records = _steps_between_records(interval, time_step)

    def series_for(top: float) -> list[Expansion]:
        if time_step is not None:
            _refuse_unstable(time_step, top)
        times = len(motions) * (duration / interval + 1)
        _refuse_endless_expansion(forced, top, duration, times, steps_between_records)
        time = record_times(duration, interval)

        def response(motion: Motion, square: Floats) -> Floats:
            if time_step is None:
                return oscillation(motion, square, time)
            return leapfrog(motion, square, len(time), steps_between_records, time_step)

        expansions = []
        for motion in motions:
            moved = motion.displacement(time)
            expansions.append(Expansion(partial(response, motion), time, moved, top))
        return expansions

    records = []
    for series, record, products, error in summed(forced, series_for, tolerance):
        records.append(WaveRecord(series.time, record, products, error))
    return records


def _refuse_unstable(time_step: float, top: float) -> None:
    """Raise InputError if a time step, s, exceeds the stability limit; `top` is omega_max^2."""
    limit = 2 / np.sqrt(top)
    if not time_step < limit:
        raise InputError(
            "time_step",
            f"time step {time_step:g} s",
            f"the scheme is stable up to 2 / omega_max = {limit:.4g} s",
            "take a smaller one",
        )


def _refuse_endless_expansion(
    forced: ForcedSystem,
    top: float,
    duration: float,
    times: float,
    steps_between_records: int,
) -> None:
    """Raise InputError if the expansions take more than a day, or more than the free memory."""
    orders = orders_of(top, duration)
    coefficients = (EXPANSION_COPIES * orders + steps_between_records) * times
    readings = (orders + times) * forced.count
    remedy = "take a shorter duration or a longer interval"
    if steps_between_records:
        remedy += ", or step"
    refuse_endless(
        f"a wave of {duration:g} s, recorded at {times:.3g} times,",
        forced.springs.operator,
        products=orders / 1.1,
        bytes_needed=8 * (coefficients + readings),
        remedy=remedy,
    )


def _steps_between_records(interval: float, time_step: float) -> int:
    """Return the steps from record to record; InputError if they are not whole."""
    if not 0 < time_step < np.inf:
        raise InputError("time_step", "the time step must be positive", remedy="give it in s")
    count = max(1, round(interval / time_step))
    if abs(count * time_step / interval - 1) > 1e-9:
        fitting_step = interval / np.ceil(interval / time_step)
        raise InputError(
            "time_step",
            f"interval {interval:g} s",
            f"no multiple of the time step {time_step:g} s",
            f"take {count * time_step:g} s, or a step of {fitting_step:g} s",
        )
    return count


def by_series(
    forced: ForcedSystem, motion: Motion, duration: float, interval: float, tolerance: float
) -> WaveRecord:
    """Compute a wave with dashpots in long steps, each a Taylor series in time.

    `tolerance` bounds the truncated terms of a step, relative to the largest state. Raises
    InputError if a series does not converge.
    """
    springs = forced.springs
    assert forced.dashpots is not None
    top = _fastest_rate(forced)
    refuse_endless(
        f"a damped wave of {duration:g} s",
        springs.operator,
        products=8 * top * duration,
        bytes_needed=8.0 * (duration / interval + 1) * forced.count,
        remedy="take a shorter duration",
    )
    times = record_times(duration, interval)
    ends = steps(motion, times[[0, -1]], top, RADIANS_PER_STEP, MOTION_RADIANS_PER_STEP)
    step_of_time = np.searchsorted(ends, times, side="right") - 1
    step_of_time = np.clip(step_of_time, 0, len(ends) - 2)
    record = forced.blank(motion.displacement(times))
    series = _TaylorStep(forced, tolerance, top)
    state = np.zeros((2, springs.operator.shape[0]))
    for k in progress(len(ends) - 1, "wave"):
        start = ends[k]
        length = ends[k + 1] - start
        rows = np.flatnonzero(step_of_time == k)
        share = (times[rows] - start) / length
        state = series.advance(state, motion, start, length, share, record, rows)
    return WaveRecord(times, record, series.products, tolerance)


class _TaylorStep:
    """Advance the state of a system with dashpots, displacement and velocity (2, size), by a step.

    `products` counts the products with K so far.
    """

    def __init__(self, forced: ForcedSystem, tolerance: float, top: float) -> None:
        assert forced.dashpots is not None
        self.springs = forced.springs
        self.dashpots = forced.dashpots
        self.walls = forced.walls
        self.tolerance = tolerance
        self.top = top
        self.push = forced.springs.push.toarray()[0]
        self.drag = forced.dashpots.push.toarray()[0]
        self.products = 0

    def advance(
        self,
        state: Floats,
        motion: Motion,
        start: float,
        length: float,
        share: Floats,
        record: Floats,
        rows: Ints,
    ) -> Floats:
        """Return the state at the end of a step that starts at `start` and is `length` long, s.

        The records with indices `rows` (k,) lie inside the step, at the fraction `share` (k,) of
        its length.
        """
        displacement, velocity = _motion_polynomials(motion, start, length)
        record[rows, : self.walls] += polyval(share, velocity)[:, None] * self.dashpots.held
        power = np.ones(len(rows))
        following = state.copy()
        term = state
        for order in range(MAX_TERMS):
            if len(rows):
                reading = self.springs.rows @ term[0]
                reading[: self.walls] += self.dashpots.rows @ term[1]
                record[rows] += power[:, None] * reading
                power = power * share
            ahead = np.empty_like(state)
            ahead[0] = term[1]
            self.springs.operator.combine(term[0], ahead[1], -1.0)
            self.dashpots.operator.combine(term[1], ahead[1], -1.0, gamma=1.0)
            if order < len(displacement):
                ahead[1] += self.push * displacement[order]
            if order < len(velocity):
                ahead[1] += self.drag * velocity[order]
            ahead *= length / (order + 1)
            self.products += 1
            following += ahead
            term = ahead
            limit = self.tolerance * 1e-2 * self._size(following)
            if self._size(term) <= limit and order >= len(displacement):
                return following
        raise UnavailableError(
            "not_converged", "the series of the wave did not end", remedy="take a larger tolerance"
        )

    def _size(self, state: Floats) -> float:
        """Return the norm of a state, with displacements scaled to the unit of velocities."""
        return float(self.top * np.linalg.norm(state[0]) + np.linalg.norm(state[1]))


def _fastest_rate(forced: ForcedSystem) -> float:
    """Return a bound of the rates |lambda|, 1/s, from |lambda|^2 <= omega^2 + |lambda| gamma."""
    stiff = forced.system.spectral_bound
    if stiff <= 0:
        raise UnavailableError(
            "no_stiffness", "the network has no stiffness", remedy="no wave goes through it"
        )
    viscous = 0.0
    if forced.system.dashpots:
        viscous = forced.system.dashpots.spectral_bound
    return float(viscous / 2 + np.sqrt(viscous**2 / 4 + stiff))


def _motion_polynomials(motion: Motion, start: float, length: float) -> tuple[Floats, Array]:
    """Return the coefficients (q,) of polynomials for the source's motion, m, and velocity, m/s.

    The variable of the polynomials runs from 0 at `start` to 1 at the end of a step of the
    `length`, s.
    """
    nodes = chebyshev.chebpts1(MOTION_DEGREE + 1)
    values = motion.displacement(start + length * (nodes + 1) / 2)
    if not values.any():
        return np.zeros(1), np.zeros(1)
    fit = chebyshev.chebfit(nodes, values, MOTION_DEGREE)
    series = chebyshev.Chebyshev(fit, domain=[0, 1])
    displacement = np.array(series.convert(kind=np.polynomial.Polynomial).coef, float)
    return displacement, polyder(displacement) / length
