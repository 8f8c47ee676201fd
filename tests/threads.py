"""Print digests of all results that threads share, as JSON.

`solvers/test_same_bits.py` runs this program twice, from the root of the project. The limits below
which a loop has one thread are removed.
"""

import hashlib
import json
from dataclasses import replace

import numpy as np
from changes import renumbered

import modal
from modal.dem.contacts import MovingContacts
from modal.packing.sample import read_sample
from modal.preparation.cloud import make_cloud
from modal.preparation.frictionless import Descent, Pressure
from modal.preparation.protocol import Study
from modal.preparation.relax import elastic_motion, relax
from modal.solvers.same_bits import same_bits_product
from modal.system.operator import ContactOperator
from modal.tools import loops, slabs
from modal.waves.motions import Pulse


def digest(*arrays: np.ndarray) -> str:
    """Return a digest of all bits."""
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


def products(pre_stress: str) -> str:
    """Return the digest of products with one vector and with three, of shuffled contacts."""
    from test_cores import crystal

    network = crystal()
    network = renumbered(network, np.random.default_rng(5).permutation(network.n_particles))
    operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
    assert len(operator._contacts.slabs) > 8
    x = np.random.default_rng(7).standard_normal((operator.shape[0], 4))
    return digest(
        *(operator.combine(u, 2 * u, 1e-9, -2.0, 0.5) for u in (x[:, :1].copy(), x[:, 1:].copy()))
    )


def linear() -> str:
    """Return the digest of a wave and a response of a packing without equal parts."""
    network = modal.fcc(cells=(5, 5, 210))
    stiffness = network.stiffness_normal.copy()
    stiffness[0] *= 1.1
    network = replace(network, stiffness_normal=stiffness)
    wave = modal.propagate(network, 2e-4).signals
    gain = modal.frequency_response(network, highest=5e4, resolution=2e3)
    found = (wave.chain_displacement, wave.layer_displacement, wave.receiver_stress)
    return digest(*found, gain.source_stress, gain.chain_displacement)


def blas() -> str:
    """Return the digest of products by BLAS; bits would differ for blocks four times as large."""
    rng, shapes = np.random.default_rng(1), ((700, 100, 700), (41, 1030, 23), (3000, 7, 40))
    pairs = ((rng.standard_normal((t, k)), rng.standard_normal((k, n))) for t, k, n in shapes)
    return digest(*(same_bits_product(a, b) for a, b in pairs))


def nonlinear() -> str:
    """Return the digest of a wave at finite amplitude."""
    sample = read_sample("tests/data/friction150.sample.h5")
    motion = Pulse(2e-7, 1e5)
    wave = modal.propagate(sample, 2e-5, nonlinear=True, motion=motion, time_step=1e-7)
    return digest(wave.signals.chain_displacement, wave.energy)


def moving() -> str:
    """Return the digest of spheres that collide, slide and spin."""
    from test_dynamics import agitated, run

    packing = agitated()
    slabs.ENOUGH = 1
    return digest(run(packing, 50).contacts.position)


def descent() -> str:
    """Return the digest of spheres without friction after some steps down their energy."""
    study = Study(0.0, 200, 4.9, seed=3)
    motion = Descent(make_cloud(study), Pressure("1e+07", study))
    motion.advance(100, 1.0, 1)
    return digest(motion.sample(moving=False).position)


def springs() -> str:
    """Return the digest of a step to rest by conjugate gradients, and of the loads after it."""
    from test_equilibrium import made, shaken

    rested, _ = relax(shaken(made(), 0.02, np.inf))
    packing = shaken(rested, 1e-3)
    slabs.ENOUGH = 1
    contacts = MovingContacts(packing)
    motion = elastic_motion(contacts, contacts.sample())
    contacts.move(motion)
    return digest(motion, contacts.load)


if __name__ == "__main__":
    usual, found = slabs.ENOUGH, {}
    # Both make their packing with one thread: in each of its many short steps two would wait for
    # each other, and long where another program has one of the cores.
    for task in (moving, springs):
        slabs.ENOUGH = usual
        found[task.__name__] = task()
    found |= {f"products, {name}": products(name) for name in ("none", "normal")}
    found |= {task.__name__: task() for task in (linear, blas, nonlinear, descent)}
    print(json.dumps({"threads": loops.threads_for(1000), "found": found}))
