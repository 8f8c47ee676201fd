"""Integrate a forced system in time: exactly, or in the steps of a DEM.

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
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.workload import refuse_endless
from modal.waves.chebyshev import Expansion, orders_of, summed
from modal.waves.forced_system import ForcedSystem
from modal.waves.motions import Motion
from modal.waves.oscillator import leapfrog, oscillation
from modal.waves.signals import record_times

EXPANSION_COPIES = 4
"""Number of arrays of orders times times that `Expansion` holds at once."""


@dataclass(frozen=True)
class Integration:
    """Times of a record, and the accuracy of its integration.

    Attributes
    ----------
    duration, interval : float
        Length of the record, and time between two states of it, s.
    tolerance : float
        Error relative to the largest record.
    time_step : float, optional
        Step of the leapfrog scheme, s; without it the integration is exact in time.
    """

    duration: float
    interval: float
    tolerance: float
    time_step: float | None = None

    @property
    def times(self) -> Floats:
        """Times (nt,) of the record, s."""
        return record_times(self.duration, self.interval)


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
    forced: ForcedSystem, motions: Sequence[Motion], integration: Integration
) -> list[WaveRecord]:
    """Compute the waves of some motions by Chebyshev polynomials, exactly in time.

    All waves share the products with K. With a time step, the waves are those of the leapfrog
    scheme, and the records are a whole number of steps apart. Raises GrowthError if K has negative
    directions; InputError with dashpots, for a run that would take too long, and if the time step
    exceeds the stability limit 2 / omega_max.
    """
    if forced.dashpots is not None:
        raise InputError(
            "damping",
            "Chebyshev polynomials of K, which give a leapfrog's steps too, know no damping of "
            "contacts",
            remedy="leave it out, or give no time step",
        )
    duration = integration.duration
    time_step = integration.time_step
    steps_between_records = 0
    if time_step is not None:
        steps_between_records = _steps_between_records(integration.interval, time_step)

    def series_for(top: float) -> list[Expansion]:
        if time_step is not None:
            _refuse_unstable(time_step, top)
        times = len(motions) * (duration / integration.interval + 1)
        _refuse_endless_expansion(forced, top, duration, times, steps_between_records)
        time = integration.times

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
    for series, record, products, error in summed(forced, series_for, integration.tolerance):
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
