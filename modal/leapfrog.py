"""The same linear wave by leapfrog, with the time step of a DEM run.

Not needed to obtain a wave (`modal.wave` has no time-step error) but to take one apart: with the
DEM's own scheme and step the linear wave carries the same time-integration error, and what then
remains between the two is physics. State k is at time k dt: forces from u_k and from the wall at
d(k dt), velocities half a step ahead, u_(k+1) = u_k + dt v_(k+1/2).
"""

from __future__ import annotations

import time as clock

import numpy as np

from modal.assembly import mass_diagonal
from modal.network import Network
from modal.operator import ContactOperator
from modal.progress import progress
from modal.receivers import Receivers
from modal.signals import Signals
from modal.source import Motion, Pulse
from modal.storage import InputError
from modal.wave import TOP_MARGIN, top_of_spectrum


def leapfrog(
    network: Network,
    duration: float,
    time_step: float,
    *,
    motion: Motion | None = None,
    every: int = 1,
    pre_stress: str = "none",
    particles: bool = False,
    network_sha256: str = "",
) -> Signals:
    """Signals at every `every`-th step; duration and time step in s. InputError if unstable."""
    if not (0 < time_step <= duration < np.inf and every >= 1):
        raise InputError("the time step must be positive and no longer than the duration")
    started = clock.perf_counter()
    motion = motion or Pulse()
    receivers = Receivers(network, pre_stress=pre_stress, particles=particles)
    top, _ = top_of_spectrum(ContactOperator(network, mass_scaled=True, pre_stress="none"))
    limit = 2 / np.sqrt(top / TOP_MARGIN)
    if time_step > limit:
        raise InputError(
            f"time step {time_step:g} s: the scheme is stable up to 2 / omega_max = {limit:.4g} s; "
            "take a smaller one"
        )
    operator = ContactOperator(network, pre_stress=pre_stress)
    per_mass = time_step / mass_diagonal(network)
    steps = round(duration / time_step)
    wall = motion.displacement(time_step * np.arange(steps + 1))
    u, velocity, force = (np.zeros(operator.shape[0]) for _ in range(3))
    rows = np.empty((steps // every + 1, receivers.count))
    for k in progress(steps + 1, "leapfrog"):
        if k % every == 0:
            receivers.observe(u, rows[k // every])
        np.multiply(receivers.source, wall[k], out=force)
        operator.accumulate(u, force, -1.0)
        force *= per_mass
        velocity += force
        np.multiply(velocity, time_step, out=force)
        u += force
    return receivers.signals(
        time_step * every * np.arange(len(rows)),
        rows,
        motion,
        time_step=time_step,
        run_time=clock.perf_counter() - started,
        network_sha256=network_sha256,
    )
