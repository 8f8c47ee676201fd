"""Set length and interval of computed records, and refuse records that cannot be used."""

from pathlib import Path

import numpy as np

from analysis.estimators.coherent import PASSAGES
from analysis.estimators.damped_transform import UNEVEN, layer_distance
from analysis.estimators.layer_lattice import LayerLattice
from modal.packing.network import Network
from modal.tools.errors import InputError
from modal.waves.signals import Signals

RECORD_INTERVAL_IN_D_PER_V = 0.4
"""Time between two records, in D / V: so there are two records in a period of a wave of 1.25 V / D,
a frequency above that of all modes."""
RECORD_LENGTH_IN_PASSAGES = 1.5 * PASSAGES
"""Length of the record, in times that the affine wave takes from wall to wall."""
MIN_V_S_OVER_V_P = 0.5
"""Least ratio V_S / V_P for which the record of an S-wave is long enough."""
MIN_RECORD_TIMES = 50
"""Fewest times of a record in which a wave can be followed."""
MIN_CHAIN_PARTICLES = 10
"""Fewest particles of a chain along which a velocity or an attenuation can be fitted."""


def record_length(affine_passage: float, direction: str) -> float:
    """Return the length of a record, s, for a wall that moves along a direction.

    `affine_passage` is the time, s, that the affine wave takes from wall to wall.
    """
    length = RECORD_LENGTH_IN_PASSAGES * affine_passage
    if direction == "z":
        return length
    return length / MIN_V_S_OVER_V_P


def record_interval(affine_frequency: float, recorded: Signals | None) -> float:
    """Return the time between two records of a computed wave, s.

    `affine_frequency` is V / D, Hz. If there is a recorded wave, the interval is that of its
    records or a multiple of it, so that both waves have common times.
    """
    interval = RECORD_INTERVAL_IN_D_PER_V / affine_frequency
    if recorded is None:
        return interval
    recorded_interval = float(recorded.time[1] - recorded.time[0])
    return recorded_interval * max(1, int(interval / recorded_interval))


def check_record(record: Signals, path: Path | str, network: Network) -> None:
    """Raise InputError if a record is too small, damaged, or made in another packing.

    `path` is the name of the record in the message.
    """
    times, particles = np.shape(record.chain_displacement)
    if times < MIN_RECORD_TIMES or particles < MIN_CHAIN_PARTICLES:
        raise InputError(
            "small_record",
            f"{path}: fewer than {MIN_RECORD_TIMES} times or {MIN_CHAIN_PARTICLES} particles",
            remedy="record more",
        )
    if not np.isfinite(record.chain_displacement).all():
        raise InputError(
            "not_finite", f"{path}: displacements that are no numbers", remedy="record it again"
        )
    if record.chain_particle.max() >= network.n_particles:
        raise InputError(
            "chain_outside_packing",
            f"{path}: its chain leaves the packing",
            remedy="give the packing it is of",
        )


def check_layers(record: Signals, path: Path | str, lattice: LayerLattice) -> None:
    """Raise InputError unless the chain of a crystal's record has one particle in each layer."""
    layers = layer_distance(record) / lattice.distance
    if abs(layers - 1) > UNEVEN:
        raise InputError(
            "layers_skipped",
            f"{path}: its chain has a particle in every {layers:.3g} layers of the crystal, of "
            "which neither band nor wavelength can be read",
            remedy="record one in each",
        )
