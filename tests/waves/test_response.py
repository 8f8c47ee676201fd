"""Transfer functions against dense solves, against the transform of a wave, and a known chain."""

import numpy as np
import pytest

from analysis.packing_data import PackingData
from analysis.quantities import gain as gain_quantity
from modal.packing import crystal as gallery
from modal.waves.propagate import propagate
from modal.waves.response import frequency_response, maxima
from modal.waves.signals import Signals

TRAVELS = 11.9
"""Travel times from wall to wall in a record with a resolution of 0.376 f_1, cut at e^-7."""


def gain_of_record(signals, highest):
    """Return frequency, gain and resolution under a window that ends at e^-7 with the record."""
    time = signals.time
    gamma = 7 / time[-1]
    frequency = np.arange(gamma / np.pi / 4, highest, gamma / np.pi / 4)
    kernel = np.exp((2j * np.pi * frequency[:, None] - gamma) * time)
    gain = abs(kernel @ signals.receiver_stress) / abs(kernel @ signals.source_stress)
    return frequency, gain, gamma / np.pi


def test_gain_from_signals_equals_gain_from_the_recurrence():
    network = gallery.fcc(cells=(2, 2, 20))
    signals = propagate(network, 6e-4, interval=1e-7).signals
    frequency, gain, resolution = gain_of_record(signals, 3e4)
    response = frequency_response(network, highest=5e4, resolution=resolution)
    count = len(frequency)
    assert frequency == pytest.approx(response.frequency[:count])
    # The cut leaves e^-7 of the last reflection, and the gain of a short column rises far above 1.
    assert gain == pytest.approx(response.gain[:count], rel=1e-2)
    peaks, heights = maxima(frequency, gain)
    assert abs(response.gain_maxima()[0] - peaks[0]) < 0.2 * resolution
    assert heights[0] == pytest.approx(gain[:20].max(), rel=0.1)


def undamped_column(window: float, travels: float) -> Signals:
    """Return wall stresses of a rod between equal, rigid walls, by its reflections alone.

    L / V is one millisecond: an arrival at the receiver after 1, 3, 5, ... passages, each doubled,
    an arrival at the source after 2, 4, ...; nothing is lost, and no code of the project is used.
    `window` is the length of a smooth push of the wall, a Gaussian of so many seconds.
    """
    time = np.arange(0, travels * 1e-3, 5e-6)

    def push(delay):
        return np.exp(-(((time - delay - 5 * window) / window) ** 2))

    source = push(0.0)
    receiver = np.zeros_like(time)
    for k in range(1, int(travels) + 1):
        if k % 2:
            receiver += 2 * push(1e-3 * k)
        else:
            source += 2 * push(1e-3 * k)
    return Signals(
        time=time, chain_displacement=np.zeros((len(time), 0)), source_displacement=0 * time,
        source_stress=source, receiver_stress=receiver, producer="rod", case="", amplitude=1.0,
        input_frequency=1 / window, time_step=5e-6, run_time=0.0,
    )  # fmt: skip


@pytest.mark.parametrize("travels", [6.0, TRAVELS])
def test_height_of_the_gain_is_the_windows(travels):
    """Compare the height with 1 / sinh(gamma L / V), that of a rod without damping.

    The cut, at e^-7, leaves 1e-3 of the transform; the parabola through the top has an error, too.
    """
    frequency, gain, resolution = gain_of_record(undamped_column(2e-5, travels), 2e3)
    peaks, heights = maxima(frequency, gain)
    assert heights[0] == pytest.approx(1 / np.sinh(np.pi * resolution * 1e-3), rel=1e-2)
    if travels == TRAVELS:  # with 6 passages the maxima run into each other
        assert peaks[0] == pytest.approx(250, rel=2e-2)


def test_height_of_the_gain_is_told_with_its_resolution():
    shown = gain_quantity.height(PackingData(gallery.fcc(cells=(1, 1, 200))))
    assert "Hz (undamped column: 1.6" in shown
    assert float(shown.split()[0]) == pytest.approx(1.588, rel=5e-3)  # dense solve of the chain
