"""Load a packing from isotropic pressure to unequal stresses along z and across it.

There are two kinds. "Triaxial": the axial stress stays constant while the lateral stresses are
changed to a share of it. "Oedometric" (one-dimensional compression): the walls approach while the
lateral strain is zero. The ratio of lateral to axial stress in oedometric compression is K0, the
coefficient of earth pressure at rest. Both kinds of loading begin at the end of a compression
(`modal.preparation.compression`), with its friction.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.dem.motion import Dynamics
from modal.formats.provenance import STATE, Provenance, Source, is_current
from modal.packing.sample import read_sample, write_sample
from modal.preparation.compression import run_to_checkpoint, start_dynamics
from modal.preparation.protocol import STRESS_MARGIN, Stage
from modal.preparation.strain_control import Servo
from modal.preparation.study import Study
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

RATE_RATIO = 0.1
"""Largest strain rate divided by that of the isotropic compression: an inertial number of 1e-3."""
FAILURE_STRAIN = 0.15
"""Largest strain along any axis, beyond which a packing that has not reached its stresses counts as
flowing: dense packings fail at some per cent, loose ones come near their final strength at 0.1."""


def load_further(
    folder: Path,
    study: Study,
    isotropic: Sequence[tuple[float, Path]],
    stresses: Sequence[float],
    ratio: float,
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """Load packings from isotropic states to each axial stress, and return (stress, file) pairs.

    With a `ratio` of lateral to axial stress, each path begins at the isotropic state of its axial
    stress; with NaN, the width is constant, and one path goes from the first state to each stress,
    Pa, in turn. Files of current states are kept. The attributes of a state are `stress_ratio`, the
    mean lateral stress divided by the axial one, the `strain` (3,), and whether it has `settled`.
    Raises InputError if a packing flows before it reaches its stresses.
    """
    is_oedometric = math.isnan(ratio)
    loading = "oedometric" if is_oedometric else f"K{ratio:g}"
    starts = dict(isotropic)
    files: list[tuple[float, Path]] = []
    _, before = isotropic[0]
    for stress in stresses:
        if not is_oedometric:
            before = starts[stress]
        path = folder / f"{stress:g}Pa_{loading}.sample.h5"
        settings = study.attributes | {"stress": stress, "loading": loading}
        made = Provenance(command, settings, (Source.of(STATE, before),))
        if not (path.exists() and is_current(path, made, say)):
            start = read_sample(before)
            stage = Loading(f"{stress:g}", study, (ratio, ratio, 1.0), start.lengths)
            start.study |= {"stress": stress, "stage_time": 0.0}
            loaded, _ = run_to_checkpoint(start, stage, start_dynamics, say)
            reached_ratio = stage.control.stress[:2].mean() / stage.control.stress[2]
            loaded.study |= {"stress_ratio": reached_ratio, "strain": stage.strain(loaded.lengths)}
            write_sample(path, replace(loaded, provenance=made.attributes()))
            say(f"{path}: written, lateral over axial stress {reached_ratio:.3f}")
        files.append((stress, path))
        before = path
    return files


class Loading(Stage):
    """Stage that loads each axis to its share (3,) of a stress, Pa; NaN means no strain.

    `start` (3,) are the lengths of the cell at the beginning, m.
    """

    checks = None

    def __init__(self, name: str, study: Study, shares: Sequence[float], start: Floats) -> None:
        super().__init__(name, study)
        inertial_number = RATE_RATIO * study.inertial_number
        mixture = study.mixture
        stress = self.control.target
        self.control = Servo(stress, inertial_number, mixture.radius, mixture.mean, shares)
        self.patience += FAILURE_STRAIN / self.control.limit
        self._largest_stress = stress * max(1.0, float(np.nanmax(shares)))
        self._start = start

    def time_step(self) -> float:
        """Return a time step, s, stable at the largest target stress."""
        return self.study.time_step(STRESS_MARGIN * self._largest_stress)

    def strain(self, lengths: Floats) -> Floats:
        """Return the logarithmic strain (3,) of the cell since the start, compression positive."""
        strain: Floats = np.log(self._start / lengths)
        return strain

    def refuse_failure(self, packing: Dynamics) -> None:
        """Raise InputError if the packing flows."""
        largest = abs(self.strain(packing.contacts.lengths)).max()
        if largest > FAILURE_STRAIN and not self.control.error() < self.limits.stress_error:
            stress = self.control.stress
            ratio = stress[:2].mean() / stress[2]
            raise InputError(
                "packing_flows",
                f"the packing fails on its way to {self.name} Pa along z",
                f"at a strain of {largest:.2f} its lateral over axial stress is {ratio:.3f}",
                "take a ratio nearer to 1, or more friction",
            )
