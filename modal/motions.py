"""Provide motions of a source in time: pulses, bursts, chirps, steps, recorded signals.

>>> import modal
>>> from modal.motions import SineBurst
>>> crystal = modal.fcc(cells=(1, 1, 20))
>>> wave = modal.propagate(crystal, 5e-5, motion=SineBurst(1e-9, 5e4))
>>> wave.signals.input_frequency
50000.0
"""

from modal.waves.bursts import SineBurst, SquareWave, Window
from modal.waves.motions import Motion, Pulse, SampledMotion, chirp, read_motion, step

__all__ = [
    "Motion",
    "Pulse",
    "SampledMotion",
    "SineBurst",
    "SquareWave",
    "Window",
    "chirp",
    "read_motion",
    "step",
]
