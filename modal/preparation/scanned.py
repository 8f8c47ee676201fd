"""Bring spheres to rest under a stress: those of a scan, or a sample that would creep.

The spheres move from where they are until their contacts balance and bear the stress: without
friction down the enthalpy (`modal.preparation.frictionless`), with friction by damped motion under
a servo on the three principal stresses, as each state of a compression.

The overlaps of a scan are not known: the noise of its positions decides which of many states it
becomes; without friction a packing becomes denser than it was, as its contacts may slide. A sample
whose contacts still slide loses stress at a fixed cell; under the servo it creeps until it bears
its stress at rest.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from modal.packing.network import Network
from modal.packing.noted_laws import ELASTIC
from modal.packing.precision import taken_as_exact
from modal.packing.sample import Sample
from modal.packing.sample_of_network import bare_sample
from modal.packing.scan import Scan
from modal.preparation.compression import run_to_checkpoint, start_dynamics
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.protocol import SETTLED, Stage
from modal.preparation.study import Study
from modal.tools.errors import InputError

MAX_CHECKPOINTS = 100
"""Number of checkpoints after which the motion is given up: each is many steps."""


def sample_of_scan(network: Network, friction: float) -> Sample:
    """Return the spheres of a scan as a sample, whose contacts follow from positions.

    Raises InputError if the network is not from a scan, if its law does not follow from a material,
    or if its sides are free.
    """
    if Scan.of(network.study) is None:
        raise InputError(
            "not_scanned",
            "the network is not from a scan",
            "its contacts are known already",
            "give a network that `import --stress --tolerance` has written, or a sample",
        )
    missing = [name for name in ELASTIC if network.noted(name) is None]
    if missing:
        raise InputError(
            "no_material",
            "the scan was imported with a law that is not that of a material",
            remedy='import it with "granular hertz/material E 0 NU tangential mindlin NULL 0 MU"',
        )
    if not network.cell_periodic[:2].all():
        raise InputError(
            "free_sides",
            "the sides along x or y are free",
            "a sample is periodic there",
            "measure its moduli in a box with `moduli --inside`; a box that is cut out fits no "
            "periodic cell, as its spheres overlap across the sides",
        )
    sample = bare_sample(taken_as_exact(network), friction)
    position = sample.position.copy()
    position[:, :2] = (position[:, :2] - position[:, :2].min(axis=0)) % sample.side
    if sample.periodic_z:
        low = sample.walls[0]
        position[:, 2] = low + (position[:, 2] - low) % sample.length
    return replace(sample, position=position, study={}, provenance={})


def bring_to_stress(
    sample: Sample,
    stress: float,
    say: Callable[[str], None],
    residual: float = SETTLED.residual,
) -> Sample:
    """Return the spheres of a sample at rest under an isotropic stress, Pa.

    Contacts slide at the friction of the sample. The spheres are at rest when their mean net force
    is below `residual` times the mean contact force; `settled` among the attributes of the result
    says whether they came so far. `say` is called with lines of progress.

    Raises InputError if the stress is not positive.
    """
    if not 0 < stress < np.inf:
        raise InputError("stress", f"stress {stress:g}", "must be positive", "give it in Pa")
    material = sample.material
    smallest = float(np.min(sample.sizes))
    study = Study(
        mu_comp=sample.friction,
        spheres=len(sample.position),
        width=float(min(sample.side)) / (2 * sample.radius),
        solid=f"{material.young!r} {material.poisson!r} {material.density!r} {smallest!r}",
        residual=residual,
    )
    # The time that a path spent at its last stress is none of this stage's.
    sample = replace(sample, study=sample.study | {"stage_time": 0.0})
    name = f"{stress:g}"
    is_over = False
    for _ in range(MAX_CHECKPOINTS):
        if sample.friction == 0:
            sample, is_over = run_to_checkpoint(sample, Pressure(name, study), Descent, say)
        else:
            sample, is_over = run_to_checkpoint(sample, Stage(name, study), start_dynamics, say)
        if is_over:
            break
    return replace(sample, study=sample.study | {"stress": stress})
