"""Print digests of all results that threads share, as JSON.

`solvers/test_same_bits.py` runs this program twice, from the root of the project. The limits below
which a loop has one thread are removed, so that small packings do; they are read or simple, so that
only loops for threads are compiled.
"""

import hashlib
import json
from dataclasses import replace

import numpy as np
from changes import in_flight, renumbered
from packings import sheared_crystal
from places import SHEARED

import modal
from modal.dem.contacts import MovingContacts
from modal.dem.motion import Dynamics
from modal.packing.sample import read_sample
from modal.preparation.cloud import make_cloud
from modal.preparation.durations import time_step
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.relax import elastic_motion
from modal.preparation.strain_control import INERTIAL_NUMBER, Servo
from modal.preparation.study import Study
from modal.solvers.same_bits import same_bits_product
from modal.system.operator import ContactOperator
from modal.tools import loops, slabs
from modal.waves.motions import Pulse

STRESS = 3e5
"""Target of the servo, Pa: three times the stress of the packing, so that the cell changes."""


def digest(*arrays: np.ndarray) -> str:
    """Return a digest of all bits."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def digest_products(pre_stress: str) -> str:
    """Return the digest of products with one vector and with three, of shuffled contacts."""
    network = sheared_crystal()
    network = renumbered(network, np.random.default_rng(5).permutation(network.n_particles))
    operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
    assert len(operator._contacts.slabs) > 8
    x = np.random.default_rng(7).standard_normal((operator.shape[0], 4))
    blocks = (x[:, :1].copy(), x[:, 1:].copy())
    return digest(*(operator.combine(block, 2 * block, 1e-9, -2.0, 0.5) for block in blocks))


def digest_linear() -> str:
    """Return the digest of a wave and a response of a packing without equal parts."""
    network = modal.fcc(cells=(5, 5, 80))
    stiffness = network.stiffness_normal.copy()
    stiffness[0] *= 1.1
    network = replace(network, stiffness_normal=stiffness)
    wave = modal.propagate(network, 2e-4).signals
    gain = modal.frequency_response(network, highest=5e4, resolution=2e3)
    signals = (wave.chain_displacement, wave.layer_displacement, wave.receiver_stress)
    return digest(*signals, gain.source_stress, gain.chain_displacement)


def digest_blas() -> str:
    """Return the digest of products by BLAS; bits would differ for blocks four times as large."""
    rng = np.random.default_rng(1)
    products = []
    for rows, inner, columns in ((700, 100, 700), (41, 1030, 23), (3000, 7, 40)):
        left = rng.standard_normal((rows, inner))
        right = rng.standard_normal((inner, columns))
        products.append(same_bits_product(left, right))
    return digest(*products)


def digest_nonlinear() -> str:
    """Return the digest of a wave at finite amplitude."""
    motion = Pulse(2e-7, 1e5)
    wave = modal.propagate(
        read_sample(SHEARED), 2e-5, nonlinear=True, motion=motion, time_step=1e-7
    )
    return digest(wave.signals.chain_displacement, wave.energy)


def digest_moving() -> str:
    """Return the digest of spheres that collide, slide and spin under a servo."""
    sample = read_sample(SHEARED)
    velocity, surface_velocity = 0.05 * np.random.default_rng(5).standard_normal((2, 150, 3))
    sample = in_flight(sample, velocity, surface_velocity / sample.radius)
    servo = Servo(STRESS, INERTIAL_NUMBER)
    motion = Dynamics(sample, damping=0.2, control=servo.follow)
    motion.advance(50, time_step(STRESS), 5)
    assert motion.contacts.sliding > 0
    return digest(motion.contacts.position)


def digest_descent() -> str:
    """Return the digest of spheres without friction after some steps down their energy."""
    study = Study(0.0, 200, 4.9, seed=3)
    motion = Descent(make_cloud(study), Pressure("1e+07", study))
    motion.advance(100, 1.0, 1)
    return digest(motion.sample(moving=False).position)


def digest_springs() -> str:
    """Return the digest of a step to rest by conjugate gradients, and of the loads after it."""
    sample = read_sample(SHEARED)
    contacts = MovingContacts(sample)
    motion = np.random.default_rng(3).standard_normal((150, 6))
    # A thousandth of the overlaps: most contacts stick, and the springs have a balance.
    motion *= 1e-3 * np.median(sample.network().overlap)
    motion[:, 3:] /= sample.radius
    contacts.move(motion)
    to_rest = elastic_motion(contacts, contacts.sample())
    assert to_rest is not None
    contacts.move(to_rest)
    return digest(to_rest, contacts.load)


if __name__ == "__main__":
    slabs.ENOUGH = 1
    digests = {
        "products": digest_products("none"),
        "products with pre-stress": digest_products("normal"),
        "linear waves": digest_linear(),
        "BLAS": digest_blas(),
        "nonlinear wave": digest_nonlinear(),
        "moving spheres": digest_moving(),
        "descent": digest_descent(),
        "springs": digest_springs(),
    }
    print(json.dumps({"threads": loops.threads_for(1000), "digests": digests}))
