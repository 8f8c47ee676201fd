"""Integrate a forced system with dashpots in time, in long steps of Taylor series.

With dashpots the modes are complex, and Taylor series in time replace the Chebyshev polynomials of
K. The state y = (u, v) follows y' = L y + g(t), and its Taylor series about the start of a step
follows from a recurrence: (k + 1) a_(k+1) = L a_k + g_k, where g_k are the coefficients of the
source's motion in the step. A step lasts some radians of the highest mode, and takes as many
products with K and C as the tolerance requires; records inside a step are values of polynomials.
The work is proportional to the number of exact digits, while schemes of fixed order need a power of
ten (`docs/attenuation.md`).
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.polynomial.polynomial import polyder, polyval

from modal.tools.arrays import Array, Floats, Ints
from modal.tools.errors import UnavailableError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.forced_system import ForcedSystem
from modal.waves.integrators import Integration, WaveRecord
from modal.waves.motions import Motion
from modal.waves.oscillator import steps

RADIANS_PER_STEP = 8.0
"""Length of a step of the Taylor series, in radians of the fastest mode. The terms of the series
rise to exp(8) before they fall, which makes a round-off of 7e-13; longer steps would take fewer
products and lose more digits."""
MOTION_RADIANS_PER_STEP = 2.0
"""Length of a step, in radians of the source's motion, which is represented by a polynomial of
`MOTION_DEGREE`."""
MOTION_DEGREE = 14
MAX_TERMS = 200


def by_series(forced: ForcedSystem, motion: Motion, integration: Integration) -> WaveRecord:
    """Compute a wave with dashpots in long steps, each a Taylor series in time.

    The tolerance bounds the truncated terms of a step, relative to the largest state. Raises
    InputError if a series does not converge.
    """
    springs = forced.springs
    duration = integration.duration
    assert forced.dashpots is not None
    top = _fastest_rate(forced)
    refuse_endless(
        f"a damped wave of {duration:g} s",
        springs.operator,
        products=8 * top * duration,
        bytes_needed=8.0 * (duration / integration.interval + 1) * forced.count,
        remedy="take a shorter duration",
    )
    times = integration.times
    ends = steps(motion, times[[0, -1]], top, RADIANS_PER_STEP, MOTION_RADIANS_PER_STEP)
    step_of_time = np.searchsorted(ends, times, side="right") - 1
    step_of_time = np.clip(step_of_time, 0, len(ends) - 2)
    record = forced.blank(motion.displacement(times))
    series = _TaylorSeries(forced, integration.tolerance, top)
    state = np.zeros((2, springs.operator.shape[0]))
    for k in progress(len(ends) - 1, "wave"):
        start = ends[k]
        length = ends[k + 1] - start
        rows = np.flatnonzero(step_of_time == k)
        step = _Step(start, length, rows, (times[rows] - start) / length)
        state = series.advance(state, motion, step, record)
    return WaveRecord(times, record, series.products, integration.tolerance)


class _Step(NamedTuple):
    """A step in time, and the records inside it.

    Attributes
    ----------
    start, length : float
        s.
    rows : ndarray (k,) of int
        Indices of the records inside the step.
    share : ndarray (k,)
        Times of these records since the start, divided by the length.
    """

    start: float
    length: float
    rows: Ints
    share: Floats


class _TaylorSeries:
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

    def advance(self, state: Floats, motion: Motion, step: _Step, record: Floats) -> Floats:
        """Return the state at the end of a step, and fill the records inside it."""
        rows = step.rows
        displacement, velocity = _motion_polynomials(motion, step.start, step.length)
        wall_motion = polyval(step.share, velocity)[:, None] * self.dashpots.held
        record[rows, : self.walls] += wall_motion
        power = np.ones(len(rows))
        following = state.copy()
        term = state
        for order in range(MAX_TERMS):
            if len(rows):
                reading = self.springs.rows @ term[0]
                reading[: self.walls] += self.dashpots.rows @ term[1]
                record[rows] += power[:, None] * reading
                power = power * step.share
            ahead = np.empty_like(state)
            ahead[0] = term[1]
            self.springs.operator.combine(term[0], ahead[1], -1.0)
            self.dashpots.operator.combine(term[1], ahead[1], -1.0, gamma=1.0)
            if order < len(displacement):
                ahead[1] += self.push * displacement[order]
            if order < len(velocity):
                ahead[1] += self.drag * velocity[order]
            ahead *= step.length / (order + 1)
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
