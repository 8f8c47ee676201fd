"""Transfer functions against dense solves, against the transform of a wave, and a known chain."""

import numpy as np
import pytest

from analysis.crystal import compare
from analysis.estimators.transfer import TRAVELS, gain_factor
from analysis.measuring import Measuring
from analysis.quantities import gain
from modal.packing import crystal as gallery
from modal.waves.propagate import propagate
from modal.waves.response import frequency_response
from modal.waves.signals import Signals


def test_gain_from_signals_equals_gain_from_the_recurrence():
    network = gallery.fcc(cells=(2, 2, 20))
    duration = 6e-4
    signals = propagate(network, duration, interval=1e-7).signals
    found = gain_factor(signals, duration, highest=3e4)
    wanted = frequency_response(network, highest=5e4, resolution=found.resolution)
    count = len(found.frequency)
    assert found.frequency == pytest.approx(wanted.frequency[:count])
    # The cut leaves e^-7 of the last reflection, and the gain of a short column rises far above 1.
    assert found.gain == pytest.approx(wanted.gain[:count], rel=1e-2)
    assert gain_factor(signals, 2 * duration) is None
    frequency, height = found.first_maximum()
    assert abs(wanted.gain_maxima()[0] - frequency) < 0.2 * found.resolution
    assert height == pytest.approx(found.gain[:20].max(), rel=0.1)


def undamped_column(window: float, travels: float) -> Signals:
    """Wall stresses of a rod with equal walls, rigid but for the pulse, by its reflections alone.

    L / V is one millisecond: an arrival at the receiver after 1, 3, 5, ... passages, each doubled,
    an arrival at the source after 2, 4, ...; nothing is lost, and no code of the project is used.
    `window` is the length of a smooth push of the wall, a Gaussian of so many seconds.
    """
    time = np.arange(0, travels * 1e-3, 5e-6)

    def push(delay):
        return np.exp(-(((time - delay - 5 * window) / window) ** 2))

    source, receiver = push(0.0), np.zeros_like(time)
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
    """Of a rod without damping it is 1 / sinh(gamma L / V): no height without its resolution.

    What the cut leaves, e^-7, is 1e-3 of the transform; the parabola through the top adds its own.
    """
    found = gain_factor(undamped_column(2e-5, travels), travels * 1e-3 * (1 - 1e-2), highest=2e3)
    frequency, height = found.first_maximum()
    assert height == pytest.approx(1 / np.sinh(np.pi * found.resolution * 1e-3), rel=1e-2)
    assert height == pytest.approx(found.undamped(1e-3), rel=1e-2)
    if travels == TRAVELS:  # with 6 passages the maxima run into each other
        assert frequency == pytest.approx(250, rel=2e-2)


def test_report_and_comparison_state_one_gain():
    """The height of case 2 is the same in both, with the resolution and the undamped column's."""
    m = Measuring(gallery.fcc(cells=(1, 1, 200)))
    *_, linear, _, note = next(row for row in compare(m) if row[0] == "gain")
    shown = gain.height(m)
    assert float(shown.split()[0]) == pytest.approx(float(linear), rel=1e-2)
    assert "Hz (undamped column: 1.6" in shown and "undamped column has 1.6" in note
    assert float(shown.split()[0]) == pytest.approx(1.588, rel=5e-3)  # dense solve of the chain
