"""The same linear wave by leapfrog, with the time step of a DEM run.

Not needed to obtain a wave (`modal.waves.propagate` has no time-step error) but to take one apart:
with the DEM's own scheme and step the linear wave carries the same time-integration error, and what
then remains between the two is physics. State k is at time k dt: forces from u_k and from the wall
at d(k dt), velocities half a step ahead, u_(k+1) = u_k + dt v_(k+1/2).
"""

from __future__ import annotations

import time as clock

import numpy as np

from modal.packing.network import Network
from modal.solvers.spectrum import GrowthError, bound_of_spectrum, dot
from modal.system.operator import ContactOperator
from modal.system.root_mass import RootMass
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_endless
from modal.waves.receivers import Receivers
from modal.waves.signals import Signals
from modal.waves.source import Motion, Pulse

LOOK = 50
"""Steps between two looks at the energy."""
EXCESS = 1.5
"""Largest velocity over what the wall's work allows; above 1 because of round-off, and because the
full tangent is not symmetric and conserves energy only nearly."""


def leapfrog(
    network: Network,
    duration: float,
    time_step: float,
    *,
    motion: Motion | None = None,
    every: int = 1,
    pre_stress: str = "none",
    particles: bool = False,
    direction: str = "z",
    network_sha256: str = "",
) -> Signals:
    """The wave by leapfrog; its signals are recorded at every `every`-th step.

    `duration` and `time_step` in s; `motion` of the source wall, by default the pulse of the study;
    `pre_stress` as in `modal.system.contacts`; `particles` records every particle;
    `direction`, x, y or z, is that of the wall and of all that is recorded;
    `network_sha256` is noted in the signals. InputError where the time step exceeds the stability
    limit 2 / omega_max. GrowthError where the network is unstable: its velocities then exceed what
    the work of the wall allows.
    """
    if not (0 < time_step <= duration < np.inf and every >= 1):
        raise InputError("the time step must be positive and no longer than the duration")
    started = clock.perf_counter()
    motion = motion or Pulse()
    receivers = Receivers(
        network,
        pre_stress=pre_stress,
        particles=particles,
        direction=direction,
    )
    operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
    top, _ = bound_of_spectrum(operator)
    limit = 2 / np.sqrt(top) if top > 0 else np.inf
    if not time_step < limit:
        raise InputError(
            f"time step {time_step:g} s: the scheme is stable up to 2 / omega_max = {limit:.4g} s; "
            "take a smaller one"
        )
    refuse_endless(
        f"a wave of {duration:g} s in steps of {time_step:g} s",
        operator,
        products=duration / time_step,
        bytes_needed=8 * duration / time_step * (3 + receivers.count / every),
        remedy="take a shorter duration",
    )
    push = RootMass.of(network).over(receivers.source)
    steps = round(duration / time_step)
    wall = motion.displacement(time_step * np.arange(-1, steps + 2, dtype=float))
    work = 0.0
    u, velocity, force = (np.zeros(operator.shape[0]) for _ in range(3))
    rows = np.empty((steps // every + 1, receivers.count))
    for k in progress(steps + 1, "leapfrog"):
        if k % every == 0:
            receivers.observe(u, rows[k // every])
        before, now, after = wall[k : k + 3]
        work += (after - before) / 2 * receivers.source_force(u, now)
        np.multiply(push, now, out=force)
        operator.accumulate(u, force, -1.0)
        force *= time_step
        velocity += force
        if k % LOOK == LOOK - 1 or k == steps:
            kinetic = 0.5 * dot(velocity, velocity)
            stretch = np.sqrt(receivers.source_stiffness / 8) * abs(after - now)
            if not kinetic <= EXCESS**2 * _most_kinetic(work, time_step / limit, stretch):
                raise GrowthError(velocity, k + 1)
        np.multiply(velocity, time_step, out=force)
        u += force
    return receivers.signals(
        time_step * every * np.arange(len(rows), dtype=float),
        rows,
        motion,
        time_step=time_step,
        run_time=clock.perf_counter() - started,
        network_sha256=network_sha256,
    )


def steps_between_records(interval: float, time_step: float) -> int:
    """Steps from record to record; InputError where the interval, s, is no multiple of a step."""
    if not (0 < time_step < np.inf and 0 < interval < np.inf):
        raise InputError("time step and interval must be positive; give them in s")
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
