"""Sources, systems and integrators in many combinations, against dense matrices."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from changes import bonded
from dense_waves import COMPONENT, DenseSystem, dense_response, dense_wave, moving_spheres
from packings import polydisperse, sheared
from program_files import of_law

import modal
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.system.damping import ContactDamping
from modal.waves.discs import Disc
from modal.waves.motions import SampledMotion
from modal.waves.sources import Plane, Point, Wall

pytestmark = pytest.mark.two_ways

INTERVAL = 1e-6
RECORDS = 30
MOTION = SampledMotion(INTERVAL * np.array([0, 2, 5, 9, 14]), 1e-9 * np.array([0, 2, -1, 1.5, 0]))
DAMPING = ContactDamping(0.05, 0.03)


def free_sides() -> Network:
    """Return spheres of radii 1:3 between two walls, without periods."""
    network = polydisperse(n=40)
    inside = network.with_contacts(~network.cell_shift.any(axis=1))
    return replace(inside, cell_periodic=np.zeros(3, bool), cell_shift=None)


PACKINGS = {
    "free sides": free_sides,
    "cell": lambda: polydisperse(periodic_z=True, n=30),
    "bodies": lambda: bonded(polydisperse(n=30)),
    "sheared": sheared,
    "law": of_law,
}


@cache
def packing(name: str) -> Network:
    """Return the packing of a name."""
    return PACKINGS[name]()


CASES = [
    ("free sides", Wall(), "torsion", "none", None),
    ("free sides", Wall(), "torsion", "full", DAMPING),
    ("free sides", Wall(), "y", "normal", DAMPING),
    ("free sides", Wall(), "z", "none", DAMPING),
    ("free sides", Plane(0.004), "torsion", "none", None),
    ("free sides", Plane(0.004), "torsion", "none", DAMPING),
    ("free sides", Plane(0.004), "x", "normal", None),
    ("free sides", Point(7), "torsion", "full", None),
    ("cell", Point(3), "x", "none", DAMPING),
    ("cell", Point(3), "torsion", "normal", None),
    ("bodies", Wall(), "x", "none", DAMPING),
    ("bodies", Wall(), "z", "none", None),
    ("bodies", Point(4), "torsion", "none", DAMPING),
    ("law", Wall(), "z", "law", None),
    ("free sides", Disc((0.004, 0.004, 0.004), 0.002, "x"), "x", "none", None),
    ("free sides", Disc((0.004, 0.004, 0.0), 0.003, "z"), "z", "normal", DAMPING),
    ("cell", Disc((0.0, 0.0, 0.003), 0.002, "y"), "y", "none", DAMPING),
    ("bodies", Disc((0.004, 0.004, 0.004), 0.002, "z", "force"), "z", "none", None),
]


def assert_close(values, expected, scale=None):
    """Compare within 1e-8 of the largest value, or of a scale.

    The round-off of the exponential is 1e-11 of the motion, the error of the expansion 1e-9.
    """
    if scale is None:
        scale = abs(expected).max()
    assert values == pytest.approx(expected, abs=1e-8 * scale)


@pytest.mark.parametrize(("name", "source", "direction", "pre_stress", "damping"), CASES)
def test_wave_against_a_matrix_exponential(name, source, direction, pre_stress, damping):
    """Compare every sphere and both walls."""
    network = packing(name)
    signals = modal.propagate(
        network,
        INTERVAL * RECORDS,
        source=source,
        direction=direction,
        pre_stress=pre_stress,
        damping=damping,
        motion=MOTION,
        interval=INTERVAL,
        particles=True,
    ).signals
    time = INTERVAL * np.arange(RECORDS + 1)
    displacement, source_force, receiver_force = dense_wave(
        network, source, direction, pre_stress, damping, MOTION, time
    )
    moving = moving_spheres(network, source)
    displacement = displacement + np.outer(MOTION.displacement(time), moving)
    assert_close(signals.particle_displacement, displacement)
    assert signals.source == source.name
    if source.pushes:
        assert len(signals.source_stress) == 0
    else:
        # At corners of the motion its rate jumps, and with it the force of dashpots.
        smooth = np.ones(len(source_force), bool)
        smooth[np.rint(MOTION.time / INTERVAL).astype(int)] = damping is None
        stress = source_force / network.area
        assert_close(signals.source_stress[smooth], stress[smooth], abs(stress).max())
    if name != "cell":
        stress = receiver_force / network.area
        scale = max(abs(stress).max(), abs(signals.source_stress).max(initial=0.0))
        assert_close(signals.receiver_stress, stress, scale)


def means_of_layers(network, values):
    """Return the means over layers of complex values (n,)."""
    layers = Layers(network)
    return layers.means(values.real) + 1j * layers.means(values.imag)


@pytest.mark.parametrize(
    ("name", "source", "direction", "pre_stress", "damping"),
    [case for case in CASES if case[3] == "none" or case[4]]
    + [("sheared", Plane(0.01), "x", "full", None), ("sheared", Point(9), "z", "normal", None)],
)
def test_response_against_dense_solves(name, source, direction, pre_stress, damping):
    """Compare with dense solves, at real frequencies with dashpots.

    Without dashpots the solves are under the window whose width is the resolution. Forces that
    contacts carry need a packing at rest, or dashpots: other packings are unstable.
    """
    network = packing(name)
    resolution = 8e3
    response = modal.frequency_response(
        network,
        source=source,
        direction=direction,
        pre_stress=pre_stress,
        damping=damping,
        highest=4e4,
        resolution=resolution,
        tolerance=1e-9,
    )
    system = DenseSystem.of(network, source, direction, pre_stress, damping)
    decay = np.pi * resolution if damping is None else 0.0
    moving = moving_spheres(network, source)
    layers = []
    forces = []
    for frequency in response.frequency:
        u, *forces_on_walls = dense_response(system, decay - 2j * np.pi * frequency)
        layers.append(means_of_layers(network, u[COMPONENT[direction] :: 6] + moving))
        forces.append(forces_on_walls)
    assert_close(response.layer_displacement, np.array(layers))
    source_stress, receiver_stress = np.array(forces).T / network.area
    if len(response.source_stress):
        assert_close(response.source_stress, source_stress)
    if len(response.receiver_stress):
        assert_close(response.receiver_stress, receiver_stress)
