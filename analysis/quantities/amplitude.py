"""When is linear right? What changes with the amplitude of a pulse (`measure(amplitudes=...)`).

Of the displacements u+ and u- of two waves whose source moves by +d(t) and by -d(t), the odd part
(u+ - u-) / 2 is that of a linear wave but for terms of the third order of the amplitude, and the
even part (u+ + u-) / 2, of the second order, has the harmonics, the drift, and what a packing not
quite at rest does by itself. Slip and opening are of no order: they come where contacts are near.
"""

from functools import partial
from typing import Any

import numpy as np

import modal
from analysis.caveats import Caveat
from analysis.estimators.coherent import PASSAGES
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities.registry import on_request
from analysis.record_rules import RECORD_INTERVAL_IN_D_PER_V
from analysis.value import Value
from modal.tools.arrays import Floats
from modal.tools.errors import UnavailableError
from modal.waves.motions import Pulse

AMPLITUDE = {
    "odd_part": "change of the odd part of waves pushed both ways from the linear one",
    "even_part": "largest even part of waves pushed both ways over the odd one",
    "second_harmonic": "twice the pulse's frequency over that, root mean squares",
    "slipping_share": "share of contacts that slide while a wave passes",
    "opening_share": "share of contacts that open while a wave passes",
    "slip_loss": "share of the source's work that slip dissipates",
    "slip_sharing": "number of contacts that share what slip dissipates",
}
"""Names, and what they are.

Where nothing slides the odd part grows as the square of the amplitude, the even one and the second
harmonic, root mean squares over the chain, as the amplitude. Shares are of both waves together, the
loss their mean; contacts share it as many would that all dissipate alike, (sum e)^2 over sum e^2.
"""
COUNTED = "slipping_share", "opening_share", "slip_sharing"
"""What has no error but the choice of the packing."""


@cached_on_packing
def finite(m: PackingData) -> dict[str, Floats]:
    """Over amplitudes (na,) what waves of the sample do that are pushed both ways by each.

    Pulses u = A (1 - cos 2 pi f t) with +A and with -A; and `error` (na,): of the time steps, and
    of what the packing does without a wave.
    """
    if len(m.amplitudes) == 0:
        raise UnavailableError(
            "no_amplitudes", "it is measured of a sample over amplitudes, which were not given"
        )
    frequency, rows = (m.source or m.pulse).frequency, []
    duration = PASSAGES / (m.affine_frequency * m.diameter / m.network.length)
    # In times of the packing's own: the second harmonic has eight records a period.
    interval = RECORD_INTERVAL_IN_D_PER_V / 2 / m.affine_frequency
    wave = partial(modal.propagate, m.sample, duration, interval=interval)
    for size in m.amplitudes:
        ahead = wave(nonlinear=True, motion=Pulse(size, frequency))
        # All three in the same steps: their common error is none of the amplitude's.
        step = ahead.signals.time_step
        same: dict[str, Any] = {"motion": Pulse(-size, frequency), "time_step": step}
        back = wave(nonlinear=True, **same)
        linear = -wave(pre_stress="full", **same).signals.chain_displacement
        u, v = ahead.signals.chain_displacement, back.signals.chain_displacement
        odd, even = (u - v) / 2, (u + v) / 2
        phase = np.exp(-2j * np.pi * frequency * ahead.signals.time)
        rows.append(
            (
                abs(odd - linear).max() / abs(linear).max(),
                abs(even).max() / abs(odd).max(),
                np.linalg.norm(phase**2 @ even) / np.linalg.norm(phase @ odd),
                np.mean((ahead.dissipated > 0) | (back.dissipated > 0)),
                np.mean(ahead.opened | back.opened),
                np.mean([one.energy[-1, 3] / abs(one.energy[-1, 0]) for one in (ahead, back)]),
                np.mean([_sharing(one.signals.slip_energy) for one in (ahead, back)]),
                np.hypot(ahead.error, ahead.noise),
            )
        )
    return dict(zip((*AMPLITUDE, "error"), np.array(rows, float).T, strict=True))


def _sharing(energy: Floats | None) -> float:
    """How many contacts share what slip dissipated; none where nothing slid."""
    if energy is None or not energy.any():
        return 0.0
    return float(energy.sum() ** 2 / (energy**2).sum())


def _over_amplitudes(name: str, m: PackingData) -> Value:
    values = finite(m)[name]
    sizes = ", ".join(f"{size:.3g}" for size in m.amplitudes)
    error = 0 * values if name in COUNTED else finite(m)["error"]
    return Value(values, "1", {"fit": error}, (Caveat("amplitudes", {"sizes": sizes}),))


for _name, _definition in AMPLITUDE.items():
    on_request("1", name=_name, definition=_definition)(partial(_over_amplitudes, _name))
