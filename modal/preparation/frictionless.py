"""Energy minimum of frictionless spheres at a given pressure, by FIRE.

Positions and the logarithms of the three lengths move together down the enthalpy E + p V
(fast inertial relaxation engine: Bitzek et al., PRL 97, 170201, 2006; the half step back after an
uphill one: Guenole et al., Comp. Mat. Sci. 175, 109584, 2020). Walls are lengths as well: they
move homothetically with the cell.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.dem.contacts import MovingContacts
from modal.packing.sample import Sample
from modal.tools.arrays import Floats

SKIN = 0.1
"""Reach of the list of pairs at first, diameters: the cloud is on its way."""
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
    """How near to rest: stress (3,), Pa; its error over the target; residual, mean over mean force.

    `steps` and `seconds` were spent; converged tells whether both tolerances were met.
    """

    stress: Floats
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
    low = sample.walls[0]
    sample = replace(sample, position=sample.position - [0, 0, low], walls=sample.walls - low)
    contacts = MovingContacts(sample, skin=SKIN, history=False, stiffness=sample.radii is not None)
    force, stiffness = contacts.load, contacts.stiffness
    # Lengths are variables of the same stiffness as positions: log length times sqrt(n) D.
    scale = np.sqrt(len(force)) * 2 * sample.radius
    # Where hardly anything touches, the step is that of overlaps of 1e-8 R (below 10 Pa).
    softest = float(sample.laws[0].stiffness_normal(1e-8 * sample.radius, sample.radius))
    velocity, drift = np.zeros_like(force), np.zeros(3)
    mixing, downhill, dt = MIXING, 0, 0.0
    best, best_score = (sample, Minimum(np.zeros(3), np.inf, np.inf, 0, 0.0)), np.inf
    for step in range(max_steps + 1):
        contacts.touch()
        pull = np.zeros(3)
        if pressure is not None:
            pull = (contacts.virial - pressure * contacts.lengths.prod()) / scale
        if step % CHECK_EVERY == 0:
            rest = _rest(contacts, pressure, step, start)
            score = max(rest.residual / tolerance, rest.stress_error / stress_tolerance)
            rest.converged = score < 1
            if score < best_score or not np.isfinite(best_score):
                best, best_score = (contacts.sample(), rest), score
            if watch:
                watch(best[0], rest)
            if rest.converged or contacts.elastic_energy == 0 and pressure is None:
                break
        limit = STEP / np.sqrt(max(contacts.mean_stiffness, softest))
        if len(stiffness):
            # A large sphere among small ones has many contacts: omega^2 <= 2 sum kn / m.
            limit = min(limit, 1 / np.sqrt(max(stiffness.max(), softest)))
        dt = min(max(dt, 0.02 * limit), limit)
        power = _dot(force, velocity) + pull @ drift
        keep, push = 0.0, 0.0
        if power > 0:
            downhill += 1
            square = _dot(velocity, velocity) + float(drift @ drift)
            square /= _dot(force, force) + float(pull @ pull)
            keep, push = 1 - mixing, mixing * math.sqrt(square)
            if downhill > 20:
                dt, mixing = min(1.1 * dt, limit), 0.99 * mixing
        elif step:
            _move(contacts, velocity, drift / scale, -0.5 * dt)
            downhill, mixing, dt = 0, MIXING, 0.5 * dt
        velocity *= keep
        velocity += (push + dt) * force
        drift = keep * drift + (push + dt) * pull
        # Far from rest a step may not carry spheres through each other, nor crush the cell.
        fastest = np.sqrt(3) * max(velocity.max(), -velocity.min())
        hold = min(
            1.0,
            0.05 * 2 * contacts.smallest / max(fastest * dt, 1e-300),
            0.01 / max(abs(drift).max() * dt / scale, 1e-300),
        )
        if hold < 1:
            velocity *= hold
            drift *= hold
        _move(contacts, velocity, drift / scale, dt)
    found, reached = best
    reached.steps, reached.seconds = step, time.perf_counter() - start
    return found, reached


def _dot(a: Floats, b: Floats) -> float:
    # Not BLAS: its threads cost more than they save here, and make the sum depend on their number.
    return float(np.einsum("ij,ij", a, b))


def _move(contacts: MovingContacts, velocity: Floats, strain_rate: Floats, dt: float) -> None:
    stretch = np.exp(strain_rate * dt)
    contacts.side *= stretch[:2]
    contacts.walls *= stretch[2]
    contacts.position *= stretch
    contacts.position += dt * velocity


def _rest(contacts: MovingContacts, pressure: float | None, step: int, start: float) -> Minimum:
    stress = contacts.stress()
    error = 0.0 if pressure is None else float(abs(stress - pressure).max() / pressure)
    return Minimum(stress, error, contacts.unbalanced(), step, time.perf_counter() - start)
