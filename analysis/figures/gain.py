"""Gain factor against frequency, from the linear response of the contact network (Fig. 19)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from analysis.products import Products
from modal.response import frequency_response

RESOLUTION = 500.0
"""Hz: half the distance of the resonances of 200 layers at 100 kPa."""
CLOSE_UP = 1e4
"""Hz: the part in which the paper compares maxima with resonances (Fig. 19c, d)."""


def gain(axes: list[Axes], case: Products) -> dict[str, np.ndarray]:
    """Whole spectrum above, below it the lowest frequencies with the P resonances, if known."""
    response = frequency_response(case.network, resolution=RESOLUTION, pre_stress="normal")
    frequency, factor = response.frequency, response.gain
    axes[0].semilogy(frequency / 1e3, np.maximum(factor, 1e-12))
    axes[0].set_xlim(0, frequency[-1] / 1e3)
    low = frequency <= CLOSE_UP
    axes[1].plot(frequency[low] / 1e3, factor[low])
    columns = {"frequency_hz": frequency, "gain": factor}
    modes = case.modes
    if modes is not None and modes.resonance_frequency is not None:
        resonances = modes.resonance_frequency[modes.resonance_frequency <= CLOSE_UP]
        for f in resonances:
            axes[1].axvline(f / 1e3, color="0.6", linewidth=0.7, linestyle=":")
        columns["resonance_hz"] = resonances
    axes[1].set_xlim(0, CLOSE_UP / 1e3)
    axes[1].set_xlabel("frequency, kHz")
    for ax in axes:
        ax.set_ylabel("gain factor")
    axes[0].set_title(f"receiver over source wall, resolution {RESOLUTION:g} Hz")
    return columns
