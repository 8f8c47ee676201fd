"""What a motion of the source does to an oscillator: y'' + omega^2 y = d(t), from rest.

A linear wave needs of its source only this y(omega^2, t). From one time to the next

    y(t + h) = y cos(wh) + y' sin(wh) / w + the integral of d(s) sin(w (t + h - s)) / w,  w = omega,

and so y', with the integral by Gauss's rule. In steps of some radians of omega and of the motion,
none across a corner of that, nothing but round-off is left out.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from modal.tools.arrays import Floats
from modal.waves.source import Motion

RADIANS, NODES = 6.0, 14
"""Longest step, in radians of the fastest oscillator or of the motion, and the nodes of the rule in
it: it leaves out 1e-22 of a cosine of three radians to each side, and 1e-17 of a product of two."""
RULES = 8
"""Steps whose sines and cosines are kept: those between evenly spaced times differ by rounding."""


def steps(motion: Motion, marks: Floats, fastest: float, radians: float, slow: float) -> Floats:
    """Times, s, of the steps' ends: all marks, the motion's corners, evenly spaced in between.

    No step is longer than `radians` of the `fastest` oscillation, 1/s, nor, while the motion lasts,
    than `slow` radians of that.
    """
    end, corners = marks[-1], motion.corners
    marks = np.union1d(marks, corners[corners < end])
    moving = 2 * np.pi * motion.frequency / slow * (marks[:-1] < corners[-1])
    parts = np.ceil(np.diff(marks) * np.maximum(fastest / radians, moving)).astype(int)
    pieces = zip(pairwise(marks), np.maximum(parts, 1), strict=True)
    return np.concatenate([*(np.linspace(a, b, n + 1)[:-1] for (a, b), n in pieces), [end]])


def oscillation(motion: Motion, square: Floats, time: Floats) -> Floats:
    """Shape (nw, nt), m s^2: y for omega^2 (nw,), 1/s^2, at ascending times (nt,), s."""
    omega = np.sqrt(np.maximum(square, 0))
    nodes = steps(motion, time, float(omega.max(initial=0.0)), RADIANS, RADIANS)
    x, weight = np.polynomial.legendre.leggauss(NODES)
    length, wanted = np.diff(nodes), np.isin(nodes, time)
    moved = motion.displacement(nodes[:-1, None] + length[:, None] * (1 + x) / 2)

    @lru_cache(RULES)
    def rule(h: float) -> tuple[Floats, Floats, Floats, Floats]:
        left = h * (1 - x) / 2
        late = left * np.sinc(omega[:, None] * left / np.pi)
        early = np.cos(omega[:, None] * left)
        own = np.cos(omega * h), h * np.sinc(omega * h / np.pi)
        return *own, late * weight * h / 2, early * weight * h / 2

    y, rate = np.zeros((2, len(omega)))
    found = [y] if wanted[0] else []
    for h, d, told in zip(length.tolist(), moved, wanted[1:], strict=True):
        cosine, sine, late, early = rule(h)
        y, rate = y * cosine + rate * sine, rate * cosine - omega**2 * sine * y
        if d.any():
            y, rate = y + late @ d, rate + early @ d
        if told:
            found.append(y)
    return np.array(found).reshape(-1, len(omega)).T


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
