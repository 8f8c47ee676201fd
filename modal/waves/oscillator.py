"""Solve for an oscillator that the source drives: y'' + omega^2 y = d(t), from rest.

A linear wave depends on the motion of its source only through y(omega^2, t). From one time to the
next

    y(t + h) = y cos(wh) + y' sin(wh) / w + the integral of d(s) sin(w (t + h - s)) / w,  w = omega,

and similarly for y', with the integral by Gauss's rule. Steps last some radians of the oscillator
and of the motion, and none contains a corner of the motion, so that the error is only round-off.
"""

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modal.tools.arrays import Floats
from modal.waves.motions import Motion

RADIANS_PER_STEP = 6.0
"""Longest step, in radians of the fastest oscillator or of the motion."""
NODES_PER_STEP = 14
"""Number of nodes of Gauss's rule in a step. The rule has an error of 1e-22 for a cosine of three
radians to each side, and of 1e-17 for a product of two."""
CACHED_PROPAGATORS = 8
"""Number of step lengths whose sines and cosines are kept: steps between evenly spaced times differ
by round-off."""


def steps(motion: Motion, marks: Floats, fastest: float, radians: float, slow: float) -> Floats:
    """Return the ends of steps, s: all marks, the corners of the motion, and even steps between.

    No step is longer than `radians` of the `fastest` oscillation, 1/s, nor, while the motion lasts,
    than `slow` radians of the motion.
    """
    end = marks[-1]
    corners = motion.corners
    marks = np.union1d(marks, corners[corners < end])
    motion_rate = 2 * np.pi * motion.frequency / slow * (marks[:-1] < corners[-1])
    parts = np.ceil(np.diff(marks) * np.maximum(fastest / radians, motion_rate)).astype(int)
    parts = np.maximum(parts, 1)
    pieces = []
    for (start, stop), count in zip(pairwise(marks), parts, strict=True):
        pieces.append(np.linspace(start, stop, count + 1)[:-1])
    return np.concatenate([*pieces, [end]])


class _Propagator(NamedTuple):
    """The step of length h of oscillators with omega (nw,).

    The fields are cos(omega h), sin(omega h) / omega, and the weights (nw, q) of the source's
    motion at the q nodes, for y and for y'.
    """

    cosine: Floats
    sine: Floats
    displacement_weight: Floats
    velocity_weight: Floats


def oscillation(motion: Motion, square: Floats, time: Floats) -> Floats:
    """Return y (nw, nt), m s^2, for omega^2 (nw,), 1/s^2, at ascending times (nt,), s."""
    omega = np.sqrt(np.maximum(square, 0))
    fastest = float(omega.max(initial=0.0))
    ends = steps(motion, time, fastest, RADIANS_PER_STEP, RADIANS_PER_STEP)
    x, weight = np.polynomial.legendre.leggauss(NODES_PER_STEP)
    lengths = np.diff(ends)
    is_recorded = np.isin(ends, time)
    moved = motion.displacement(ends[:-1, None] + lengths[:, None] * (1 + x) / 2)

    @lru_cache(CACHED_PROPAGATORS)
    def propagator(h: float) -> _Propagator:
        time_left = h * (1 - x) / 2
        sine_left = time_left * np.sinc(omega[:, None] * time_left / np.pi)
        cosine_left = np.cos(omega[:, None] * time_left)
        return _Propagator(
            cosine=np.cos(omega * h),
            sine=h * np.sinc(omega * h / np.pi),
            displacement_weight=sine_left * weight * h / 2,
            velocity_weight=cosine_left * weight * h / 2,
        )

    y, rate = np.zeros((2, len(omega)))
    recorded = []
    if is_recorded[0]:
        recorded.append(y)
    for h, d, is_recorded_here in zip(lengths.tolist(), moved, is_recorded[1:], strict=True):
        step = propagator(h)
        y, rate = (
            y * step.cosine + rate * step.sine,
            rate * step.cosine - omega**2 * step.sine * y,
        )
        if d.any():
            y = y + step.displacement_weight @ d
            rate = rate + step.velocity_weight @ d
        if is_recorded_here:
            recorded.append(y)
    return np.array(recorded).reshape(-1, len(omega)).T


def leapfrog(motion: Motion, square: Floats, count: int, every: int, step: float) -> Floats:
    """Return y (nw, count) of omega^2 (nw,), 1/s^2, by the leapfrog scheme of a DEM.

    y is recorded at each `every`-th step; a step is `step` seconds long.
    """
    moved = motion.displacement(step * np.arange(every * (count - 1), dtype=float))
    y, speed = np.zeros((2, len(square)))
    response = np.zeros((len(square), count))
    for k, d in enumerate(moved, 1):
        speed += step * (d - square * y)
        y += step * speed
        if k % every == 0:
            response[:, k // every] = y
    return response
