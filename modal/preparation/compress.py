"""The compression of spheres with friction from a cloud to each stress, in modal's own loop.

The same protocol, stages, files and checkpoints as in YADE (`yade_scripts/compress.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from modal.dem.motion import Dynamics
from modal.packing.sample import Sample
from modal.preparation.compression import compress_to_stresses
from modal.preparation.protocol import JAMMING_STRESS, Study, by_tens
from modal.preparation.strain_control import ConstantRate, Servo


def in_motion(sample: Sample, control: ConstantRate | Servo, damping: float) -> Dynamics:
    """A sample whose strain rates a control sets."""
    return Dynamics(sample, damping, control=control.follow)


def compress(
    folder: Path,
    study: Study,
    stresses: Sequence[float],
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """Compress to each stress, Pa, in modal's own motion, as `compress_to_stresses` says.

    Stresses on the way, so that no two are more than ten times apart, have their states as well.
    """
    way = [JAMMING_STRESS * study.mixture.hardness]
    for stress in stresses:
        way += by_tens(way[-1], stress)
    made = study.provenance(command)
    files = compress_to_stresses(folder, study, way[1:], made, in_motion, say)
    return [(stress, path) for stress, path in files if stress in stresses]
