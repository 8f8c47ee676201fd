"""Frequency response of a packing with viscous contacts, at real frequencies.

With dashpots a resonance has a width of its own, and no window is needed: per unit motion of the
source wall, exp(-i omega t), the motion is u = (K - i omega C - omega^2 M)^-1 (b - i omega c), b
and c what springs and dashpots of the wall do. It is solved for each frequency by one complex
factorisation; neither moments of K nor a wave serve, since a mode that is slow decays slowest.
"""

from __future__ import annotations

import time as clock

import numpy as np
import scipy.sparse as sp

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.solvers.factor import factorise
from modal.system.assembly import stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.imposed import WallMoves, put_on
from modal.system.root_mass import RootMass
from modal.tools.arrays import Complex, Floats
from modal.tools.errors import InputError
from modal.tools.progress import progress
from modal.tools.workload import refuse_above
from modal.waves.receivers import Receivers

REMEDY = "take fewer frequencies, or a smaller packing"


def damped_rows(
    network: Network, damping: ContactDamping, receivers: Receivers, frequency: Floats
) -> Complex:
    """Shape (nf, receivers.count): what is observed at the frequencies (nf,), Hz, above 0.

    The first two are the forces on the walls, springs and dashpots together, as of a wave:
    InputError where the factorisations would take more than the memory or more than a day.
    """
    dashpots = damping.dashpots(network)
    root = RootMass.of(network)
    A, C = (root.around(stiffness_matrix(of)) for of in (network, dashpots))
    identity = sp.identity(A.shape[0], format="csr")
    viscous = put_on(dashpots, (), WallMoves(SOURCE_WALL, receivers.axis))
    beyond = put_on(dashpots, (), WallMoves(RECEIVER_WALL, receivers.axis))
    drag = viscous.push[:, 0]
    to_source, to_receiver = root.over(np.hstack([viscous.pull, beyond.pull])).T
    held = float(viscous.held[0, 0])
    rows: Complex = np.empty((len(frequency), receivers.count), complex)
    parts = np.empty((2, receivers.count))
    started = clock.perf_counter()
    for k in progress(len(frequency), "response"):
        omega = 2 * np.pi * frequency[k]
        factor = factorise(A - omega**2 * identity - 1j * omega * C, remedy=REMEDY)
        v = factor.solve(root.over(receivers.source - 1j * omega * drag))
        factor.release()
        for part, out in zip((v.real, v.imag), parts, strict=True):
            receivers.observe(np.ascontiguousarray(part), out)
        rows[k] = parts[0] + 1j * parts[1]
        rows[k, :2] -= 1j * omega * np.array([to_source @ v - held, to_receiver @ v])
        if k == 0:
            seconds = len(frequency) * (clock.perf_counter() - started)
            task = f"a damped response at {len(frequency)} frequencies takes"
            refuse_above(seconds, 0.0, task, REMEDY)
    if not np.isfinite(rows).all():
        raise InputError(f"the damped response is not finite at a frequency of its own; {REMEDY}")
    return rows
