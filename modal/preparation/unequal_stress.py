"""Unequal stresses: a packing at rest under one pressure, loaded further along z.

Either the lateral stresses go to a share of the axial one, which stays ("triaxial"), or the walls
approach while nothing moves sideways ("oedometric", one-dimensional compression): the ratio of
lateral to axial stress that then comes about is K0, the earth pressure at rest. Both begin where
a compression ends (`modal.preparation.compression`), with its friction.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from modal.dem.motion import Dynamics
from modal.formats.provenance import STATE, Provenance, Source, is_current
from modal.packing.sample import read_sample, write_sample
from modal.preparation.compression import in_motion, run_to_checkpoint
from modal.preparation.protocol import ABOVE, Stage, Study
from modal.preparation.strain_control import Servo
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

SLOWNESS = 0.1
"""Largest strain rate, over that of the isotropic compression: an inertial number of 1e-3."""
FAILED = 0.15
"""Strain along any axis from which on a packing that has not reached its stresses flows: dense ones
fail at some per cent, loose ones come near their final strength at 0.1."""
RATIOS = 0.05, 20.0
"""Ratios of lateral to axial stress that are tried at all."""


def load_further(
    folder: Path,
    study: Study,
    isotropic: Sequence[tuple[float, Path]],
    stresses: Sequence[float],
    ratio: float,
    command: str,
    say: Callable[[str], None],
) -> list[tuple[float, Path]]:
    """From isotropic states to each axial stress, Pa: files, kept where they are there already.

    To lateral stresses of `ratio` times the axial one, from the state of that stress; with NaN at
    constant width, from the first state to each stress in turn. Their notes tell `stress_ratio`,
    the mean lateral over the axial stress, the `strain` (3,) that it took, and whether they have
    `settled`. InputError where the packing flows before.
    """
    kind, files = "oedometric" if math.isnan(ratio) else f"K{ratio:g}", list[tuple[float, Path]]()
    starts = dict(isotropic)
    _, before = isotropic[0]
    for stress in stresses:
        before = before if math.isnan(ratio) else starts[stress]
        path = folder / f"{stress:g}Pa_{kind}.sample.h5"
        settings = study.attributes | {"stress": stress, "loading": kind}
        made = Provenance(command, settings, (Source.of(STATE, before),))
        if not (path.exists() and is_current(path, made, say)):
            start = read_sample(before)
            stage = Loading(f"{stress:g}", study, (ratio, ratio, 1.0), start.lengths)
            start.study |= {"stress": stress, "stage_time": 0.0}
            found, _ = run_to_checkpoint(start, stage, in_motion, say)
            lateral, axial = stage.control.stress[:2].mean(), stage.control.stress[2]
            found.study |= {"stress_ratio": lateral / axial, "strain": stage.strain(found.lengths)}
            write_sample(path, replace(found, provenance=made.attributes()))
            say(f"{path}: written, lateral over axial stress {found.study['stress_ratio']:.3f}")
        files.append((stress, path))
        before = path
    return files


class Loading(Stage):
    """The way to the shares (3,) of a stress, Pa; NaN is an axis that is not strained."""

    checks = None

    def __init__(self, name: str, study: Study, shares: Sequence[float], start: Floats) -> None:
        super().__init__(name, study)
        slow, mixture = SLOWNESS * study.inertial_number, study.mixture
        stress = self.control.target
        self.control = Servo(stress, slow, mixture.radius, mixture.mean, shares)
        self.patience += FAILED / self.control.limit
        self._largest, self._start = stress * max(1.0, float(np.nanmax(shares))), start

    def time_step(self) -> float:
        """Stable at the largest stress asked for, s."""
        return self.study.time_step(ABOVE * self._largest)

    def strain(self, lengths: Floats) -> Floats:
        """Shape (3,): of the cell since the start, compression positive."""
        strain: Floats = np.log(self._start / lengths)
        return strain

    def look(self, packing: Dynamics) -> None:
        """InputError where the packing flows."""
        largest = abs(self.strain(packing.contacts.lengths)).max()
        if largest > FAILED and not self.control.error() < self.limits[0]:
            stress = self.control.stress
            raise InputError(
                "input",
                f"the packing fails on its way to {self.name} Pa along z",
                "at a strain of "
                f"{largest:.2f} its lateral over axial stress is "
                f"{stress[:2].mean() / stress[2]:.3f}",
                "take a ratio nearer to 1, or more friction",
            )
