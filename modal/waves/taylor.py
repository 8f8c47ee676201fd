"""The linear wave through viscous contacts, by Taylor series in time.

With dashpots the modes are complex and Chebyshev polynomials of K serve no longer. The state y =
(u, v) follows y' = L y + g(t), and its Taylor series about the start of a step is known without any
table: (k + 1) a_(k+1) = L a_k + g_k, where g_k are the coefficients of the source's motion in the
step. A step is some radians of the highest mode long, and takes as many products with K and C as
the tolerance asks; what is recorded inside a step are values of polynomials. Against schemes of
fixed order the work rises with the number of digits, not with a power of ten
(`docs/damping.md`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from modal.solvers.spectrum import bound_of_spectrum
from modal.tools.arrays import Array, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.driven import Driven
from modal.waves.integrators import Seen
from modal.waves.signals import record_times
from modal.waves.source import Motion

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
        whole = driven.recorded(record, motion.displacement(times))
        return Seen(times, whole, products, self.tolerance)


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
