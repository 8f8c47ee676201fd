"""What a wave of finite amplitude does that a linear one does not, from waves pushed both ways.

Of the displacements u+ and u- of two waves whose source moves by +d(t) and by -d(t), the odd part
(u+ - u-) / 2 is that of a linear wave but for terms of the third order of the amplitude, and the
even part (u+ + u-) / 2, of the second order, has the harmonics, the drift, and what a packing not
quite at rest does by itself. Slip and opening are of no order: they come where contacts are near.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import modal
from modal.packing.sample import Sample
from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.waves.source import Pulse


@dataclass(frozen=True)
class FiniteAmplitude:
    """Over amplitudes (na,), m, each (na,).

    `odd`: largest difference of the odd part and the linear wave with pre-stress, over the largest
    of that; `even`: largest even part over the largest odd one; `harmonic`: root mean square over
    the chain of the even part at twice the frequency of the pulse, over that of the odd part at it;
    `slipping`, `opening`: shares of contacts that slid, or were seen to open, in one of both waves;
    `loss`: what slip dissipated over what the source has given in all, mean of both waves;
    `sharing`: number of contacts that would dissipate as much if all did alike, (sum e)^2 over
    sum e^2; `error`: of the time steps, and of what the packing does without a wave.
    """

    odd: Floats
    even: Floats
    harmonic: Floats
    slipping: Floats
    opening: Floats
    loss: Floats
    sharing: Floats
    error: Floats


def finite_amplitude(
    sample: Sample, amplitudes: Sequence[float], frequency: float, duration: float
) -> FiniteAmplitude:
    """Waves from the source wall, of pulses u = A (1 - cos 2 pi f t) with +A and with -A.

    InputError for amplitudes that are none.
    """
    if not all(0 < size < np.inf for size in amplitudes):
        raise InputError(f"amplitudes {list(amplitudes)}: give positive ones, in m")
    rows = []
    for size in amplitudes:
        ahead = modal.propagate(sample, duration, nonlinear=True, motion=Pulse(size, frequency))
        # All three in the same steps: their common error is none of the amplitude's.
        step = ahead.signals.time_step
        same: dict[str, Any] = {"motion": Pulse(-size, frequency), "time_step": step}
        back = modal.propagate(sample, duration, nonlinear=True, **same)
        mirror = modal.propagate(sample, duration, pre_stress="full", **same).signals
        u, v = ahead.signals.chain_displacement, back.signals.chain_displacement
        odd, even, linear = (u - v) / 2, (u + v) / 2, -mirror.chain_displacement
        phase = np.exp(-2j * np.pi * frequency * ahead.signals.time)
        first, second = np.linalg.norm(phase @ odd), np.linalg.norm(phase**2 @ even)
        rows.append(
            (
                abs(odd - linear).max() / abs(linear).max(),
                abs(even).max() / abs(odd).max(),
                second / first,
                np.mean((ahead.dissipated > 0) | (back.dissipated > 0)),
                np.mean(ahead.opened | back.opened),
                np.mean([one.energy[-1, 3] / abs(one.energy[-1, 0]) for one in (ahead, back)]),
                np.mean([_sharing(one.signals.slip_energy) for one in (ahead, back)]),
                np.hypot(ahead.error, ahead.noise),
            )
        )
    return FiniteAmplitude(*np.array(rows, float).T)


def _sharing(energy: Floats | None) -> float:
    """How many contacts share what slip dissipated; none where nothing slid."""
    if energy is None or not energy.any():
        return 0.0
    return float(energy.sum() ** 2 / (energy**2).sum())
