"""The same linear wave by leapfrog, with the time step of a DEM run.

Not needed to obtain a wave (`modal.waves.propagate` has no time-step error) but to take one apart:
with the DEM's own scheme and step the linear wave carries the same time-integration error, and what
then remains between the two is physics. State k is at time k dt: forces from u_k and from the wall
at d(k dt), velocities half a step ahead, u_(k+1) = u_k + dt v_(k+1/2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.solvers.spectrum import GrowthError, bound_of_spectrum, dot
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.driven import Driven
from modal.waves.integrators import Seen, refuse_dashpots
from modal.waves.signals import record_times
from modal.waves.source import Motion

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
        whole = driven.recorded(record, motion.displacement(times))
        return Seen(times, whole, steps + 1, np.nan)


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
