"""Energy minimum of frictionless spheres at a given pressure, by FIRE.

Positions and the logarithms of the three lengths move together down the enthalpy E + p V
(fast inertial relaxation engine: Bitzek et al., PRL 97, 170201, 2006; the half step back after an
uphill one: Guenole et al., Comp. Mat. Sci. 175, 109584, 2020). Walls are lengths as well: they
move homothetically with the cell.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.dem.central_forces import CentralForces
from modal.dem.downhill import drive, go
from modal.packing.sample import Sample

CHECK_EVERY = 25
"""Steps between two looks at the convergence, whose sums cost a fifth of a step."""
STEP = 0.3
"""Largest time step over sqrt(m / mean kn); the highest mode of a dense packing, about
sqrt(12 kn / m), would allow 0.58 if all contacts were equally stiff."""

MIXING = 0.1
"""First share of the velocity that is turned towards the force."""
STRESS_TOLERANCE = 1e-3
"""Of each of the three stresses, relative to the pressure."""
MAX_STEPS = 200_000


@dataclass
class Minimum:
    """How near to rest: stress (3,), Pa; its error over the target; residual, see `CentralForces`.

    `steps` and `seconds` were spent; converged tells whether both tolerances were met.
    """

    stress: np.ndarray
    stress_error: float
    residual: float
    steps: int
    seconds: float
    converged: bool = False


def minimise(
    sample: Sample,
    pressure: float | None,
    *,
    tolerance: float,
    stress_tolerance: float = STRESS_TOLERANCE,
    max_steps: int = MAX_STEPS,
    watch: Callable[[Sample, Minimum], None] | None = None,
) -> tuple[Sample, Minimum]:
    """The sample at the energy minimum under `pressure`, Pa; at fixed lengths if it is None.

    Ends when the residual is below `tolerance` and all three stresses are within
    `stress_tolerance` of the pressure; after `max_steps`, with the best state that was met: neither
    falls monotonically. `watch` sees the best state so far at every check.
    """
    start = time.perf_counter()
    position = sample.position.copy()
    position[:, 2] -= sample.walls[0]
    lengths = np.array([*sample.side, sample.walls[1] - sample.walls[0]])
    forces = CentralForces(sample)
    # Lengths are variables of the same stiffness as positions: log length times sqrt(n) D.
    scale = np.sqrt(len(position)) * 2 * sample.radius
    # Where hardly anything touches, the step is that of overlaps of 1e-8 R (below 10 Pa).
    softest = float(sample.laws[0].stiffness_normal(1e-8 * sample.radius, sample.radius))
    smallest = float(np.min(sample.sizes))
    velocity, drift = np.zeros_like(position), np.zeros(3)
    mixing, downhill, dt = MIXING, 0, 0.0
    best_score = np.inf
    best = position.copy(), lengths.copy(), Minimum(np.zeros(3), np.inf, np.inf, 0, 0.0)
    for step in range(max_steps + 1):
        forces.of(position, lengths)
        volume = lengths.prod()
        pull = np.zeros(3) if pressure is None else (forces.virial - pressure * volume) / scale
        if step % CHECK_EVERY == 0:
            rest = _rest(forces, volume, pressure, step, start)
            score = max(rest.residual / tolerance, rest.stress_error / stress_tolerance)
            rest.converged = score < 1
            if score < best_score or not np.isfinite(best_score):
                best, best_score = (position.copy(), lengths.copy(), rest), score
            if watch:
                watch(_at(sample, *best[:2]), rest)
            if rest.converged or forces.energy == 0 and pressure is None:
                break
        limit = STEP / np.sqrt(max(forces.mean_stiffness, softest))
        if len(forces.stiffness):
            # A large sphere among small ones has many contacts: omega^2 <= 2 sum kn / m.
            limit = min(limit, 1 / np.sqrt(max(forces.stiffness.max(), softest)))
        dt = min(max(dt, 0.02 * limit), limit)
        power, speed, size, fastest, strongest = drive(velocity, forces.force)
        power += pull @ drift
        keep, push = 0.0, 0.0
        if power > 0:
            downhill += 1
            keep = 1 - mixing
            push = mixing * np.sqrt((speed + drift @ drift) / (size + pull @ pull))
            if downhill > 20:
                dt, mixing = min(1.1 * dt, limit), 0.99 * mixing
        elif step:
            back = np.exp(-0.5 * dt * drift / scale)
            lengths *= back
            go(position, velocity, forces.force, 1.0, 0.0, back, -0.5 * dt)
            downhill, mixing, dt = 0, MIXING, 0.5 * dt
        push += dt
        drift = keep * drift + push * pull
        # Far from rest a step may not carry spheres through each other, nor crush the cell.
        fastest = keep * fastest + push * strongest
        hold = min(
            1.0,
            0.05 * 2 * smallest / max(fastest * dt, 1e-300),
            0.01 / max(abs(drift).max() * dt / scale, 1e-300),
        )
        drift *= hold
        stretch = np.exp(drift * dt / scale)
        lengths *= stretch
        go(position, velocity, forces.force, hold * keep, hold * push, stretch, dt)
    position, lengths, reached = best
    reached.steps, reached.seconds = step, time.perf_counter() - start
    return _at(sample, position, lengths), reached


def _rest(
    forces: CentralForces, volume: float, pressure: float | None, step: int, start: float
) -> Minimum:
    stress = forces.virial / volume
    error = 0.0 if pressure is None else float(abs(stress - pressure).max() / pressure)
    return Minimum(stress, error, forces.residual, step, time.perf_counter() - start)


def _at(sample: Sample, position: np.ndarray, lengths: np.ndarray) -> Sample:
    inside = position.copy()
    axes = 3 if sample.periodic_z else 2
    inside[:, :axes] %= lengths[:axes]
    walls = np.array([0.0, lengths[2]])
    return replace(sample, position=inside, side=lengths[:2].copy(), walls=walls)
