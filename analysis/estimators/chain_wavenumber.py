"""Wave number of the wave that leaves the source, at one frequency, from one chain's record.

The dispersion relation of the paper's Figs. 14 and 15 is the ridge of the frequency - wave number
map of a chain. At one frequency that is the kappa at which the sum of U(z) exp(-i kappa z) over the
chain is largest, U(z) the spectrum of the displacement at z. Distances need not be equal.
"""

from __future__ import annotations

import numpy as np

from analysis.estimators.fits import summit
from modal.waves.signals import Signals

STRETCH = (0.1, 0.6)
"""Part of the length that is used: behind the source wall's own field, ahead of the front's end."""
POINTS = 400


def chain_wavenumber(
    record: Signals,
    frequency: float,
    length: float,
    *,
    velocity: float,
    end: float = np.inf,
    part: np.ndarray | None = None,
) -> float:
    """kappa, 1/m, at `frequency` (Hz) of the record up to `end` (s); NaN where there is no ridge.

    `velocity` (m/s) of the long waves bounds the search: 0.6 to 2.5 times its wave number. `part`
    (nc,) bool leaves out particles of the chain. A maximum on the bound is none.
    """
    depth = (record.chain_position - record.chain_position.min()) / length
    used = (depth >= STRETCH[0]) & (depth <= STRETCH[1])
    if part is not None:
        used &= part
    kept = record.time <= end * (1 + 1e-9)
    if used.sum() < 8 or not np.isfinite(frequency) or frequency <= 0:
        return np.nan
    time, z = record.time[kept], record.chain_position[used]
    # The wave exp(i kappa z - i omega t) counts as forward.
    field = np.exp(2j * np.pi * frequency * time) @ record.chain_displacement[np.ix_(kept, used)]
    # Particles swing unequally; the phase alone says how far the wave has come.
    field = field / np.maximum(abs(field), np.finfo(float).tiny)
    slowest = 2 * np.pi * frequency / velocity
    kappa = np.linspace(0.6, 2.5, POINTS) * slowest
    height = abs(field @ np.exp(-1j * np.outer(z - z[0], kappa)))
    top = int(np.argmax(height))
    if top in (0, POINTS - 1):
        return np.nan
    return float(kappa[top] + summit(*height[top - 1 : top + 2]) * (kappa[1] - kappa[0]))
