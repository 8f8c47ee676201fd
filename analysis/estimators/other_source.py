"""A record as it would be, had its source wall moved otherwise: the wave is linear in the motion.

Under a window exp(-eta t), whose share at the record's end does not matter, the transforms of two
records stand to each other as those of their motions. Where the recorded motion has next to nothing
of a frequency, nothing of it is made up: the quotient is that of least squares, P S* / (|S|^2 +
e^2), with e a small part of the largest |S|.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from modal.waves.signals import Signals
from modal.waves.source import Pulse

DECAY = 6.0
"""eta T of the window: what wraps round is damped to e^-12, as the record is padded to 2 T."""
FAINT = 1e-3
"""e over the largest |S| below which a frequency is not sent."""
MOVED = (
    *(f"{name}_displacement" for name in ("chain", "layer", "particle", "source")),
    *("source_stress", "receiver_stress"),
)
"""What of a record goes with the motion."""


def as_of_pulse(record: Signals, pulse: Pulse) -> Signals:
    """The record of another motion as the same wall would have given it for a pulse.

    Amplitude and frequency become those of the pulse; the source's own displacement shows what of
    it the motion has sent. Columns that the record has not stay absent.
    """
    time = record.time
    count = 2 * len(time)
    fade = np.exp(-DECAY * time / time[-1])

    def transform(values: np.ndarray) -> np.ndarray:
        return np.fft.rfft(values * (fade if values.ndim == 1 else fade[:, None]), count, axis=0)

    wanted = pulse.displacement(time)
    sent = transform(record.source_displacement)
    ratio = transform(wanted) * sent.conj()
    ratio /= abs(sent) ** 2 + (FAINT * abs(sent).max()) ** 2

    def turned(values: np.ndarray | None) -> np.ndarray | None:
        if values is None:
            return None
        back = ratio if values.ndim == 1 else ratio[:, None]
        found = np.fft.irfft(back * transform(values), count, axis=0)[: len(time)]
        return found / (fade if values.ndim == 1 else fade[:, None])

    moved: dict[str, Any] = {name: turned(getattr(record, name)) for name in MOVED}
    return replace(
        record,
        **moved,
        amplitude=pulse.amplitude,
        input_frequency=pulse.frequency,
    )
