"""Clumps come to rest, and carry waves of finite amplitude: against the linear wave, and books."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal
from scipy.spatial.transform import Rotation

import modal
from modal.packing.clumps import parse_template
from modal.packing.contact_law import GLASS, RADIUS
from modal.packing.sample import Sample
from modal.packing.state import net_forces, residual_forces
from modal.packing.tiling import repeat_sample
from modal.preparation.relax import relax
from modal.waves.discs import Disc
from modal.waves.motions import Pulse
from modal.waves.sources import Plane, Point, Wall

TWO = "0 0 -0.5 1 0 0 0.5 1"
"""Template of a clump: x, y, z and radius of two spheres."""


def stack_of_pairs(overlap, periodic_z=False):
    """Return 27 upright clumps of two spheres with equal contacts, in exact balance.

    In even numbers of neighbours spheres can roll on each other like gears, without resistance.
    """
    template = parse_template(TWO.split()).scaled(RADIUS)
    radius = float(template.radius[0])
    bare = Sample(
        np.zeros((0, 3)), np.ones(2), np.zeros(2), 0.3, radius=radius, periodic_z=periodic_z
    )
    pair, wall = bare.laws
    at_wall = wall.overlap_of_force(pair.normal_force(overlap, radius / 2), radius)
    if periodic_z:
        at_wall = overlap / 2
    width = 2 * radius - overlap
    pitch = np.array([width, width, width + np.ptp(template.arm[:, 2])])
    centre = (np.argwhere(np.ones((3, 3, 3))) + 0.5) * pitch
    centre[:, 2] += overlap / 2 - at_wall
    count = len(centre)
    arm = np.tile(template.arm, (count, 1))
    return replace(
        bare,
        position=np.repeat(centre, 2, axis=0) + arm,
        side=3 * pitch[:2],
        walls=np.array([0, 3 * pitch[2] + overlap - 2 * at_wall]),
        body=np.repeat(np.arange(count), 2),
        arm=arm,
        body_mass=np.full(count, GLASS.density * template.volume),
        body_tensor=np.tile(GLASS.density * template.tensor, (count, 1, 1)),
    )


def disturbed(overlap, periodic_z=True):
    """Return the stack after each clump has moved and turned by some tenths of an overlap."""
    stack = stack_of_pairs(overlap, periodic_z)
    random = np.random.default_rng(4)
    count = stack.grains
    turn = Rotation.from_rotvec(0.2 * overlap / RADIUS * random.standard_normal((count, 3)))
    arm = np.repeat(turn.as_matrix(), 2, axis=0) @ stack.arm[:, :, None]
    moved = np.repeat(0.2 * overlap * random.standard_normal((count, 3)), 2, axis=0)
    position = stack.position - stack.arm + arm[:, :, 0] + moved
    position += np.array([0, 0, 0.3 * RADIUS]) * periodic_z
    low = np.array([0, 0, stack.walls[0]])
    position = low + (position - low) % stack.lengths
    axes = turn.as_matrix()
    tensor = axes @ stack.body_tensor @ axes.transpose(0, 2, 1)
    return replace(stack, position=position, arm=arm[:, :, 0], body_tensor=tensor)


@pytest.fixture(scope="module")
def rested():
    """Return a disturbed stack without walls, some of whose clumps cross the period, at rest."""
    sample, balance = relax(disturbed(1e-6))
    assert balance.at_rest
    return sample


def test_clumps_come_to_rest_as_rigid_bodies(rested):
    start = disturbed(1e-6)
    assert residual_forces(start.network()).mean() > 0.05
    network = rested.network()
    assert residual_forces(network).mean() < 1e-10
    assert abs(net_forces(network)).max() < 1e-9 * network.force_normal.mean()
    lengths = np.linalg.norm(rested.arm, axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(start.arm, axis=1), rtol=1e-12)
    apart = rested.position - rested.arm
    apart = apart[::2] - apart[1::2]
    apart -= rested.lengths * np.round(apart / rested.lengths)
    assert abs(apart).max() < 1e-15
    moments = np.linalg.eigvalsh(rested.body_tensor)
    np.testing.assert_allclose(moments, np.linalg.eigvalsh(start.body_tensor), rtol=1e-9)
    # The axis of each body of revolution is along its arms.
    along = np.einsum("kij,kj->ki", rested.body_tensor, rested.arm[::2])
    np.testing.assert_allclose(along, moments[:, :1] * rested.arm[::2], rtol=0, atol=1e-9 * 1e-12)


def waves(sample, source, direction, size):
    """Return particle displacements of the wave of the law, and of that of linear springs."""
    network = sample.network()
    if isinstance(source, Point):
        size *= network.stiffness_normal.mean() * (RADIUS if direction == "torsion" else 1)
    options = {"motion": Pulse(size, 1e5), "direction": direction, "source": source}
    options |= {"interval": 1e-6, "particles": True}
    wave = modal.propagate(sample, 3e-5, nonlinear=True, time_step=1e-7, **options)
    linear = modal.propagate(network, 3e-5, **options)
    assert abs(wave.signals.balance.gap) < 2e-3
    assert wave.signals.balance.slid == 0
    return wave.signals.particle_displacement, linear.signals.particle_displacement


@pytest.mark.parametrize(
    ("source", "direction"),
    [(Wall(), "z"), (Wall(), "x"), (Plane(5e-3), "x"), (Point(10), "torsion"), (Point(10), "y")],
)
def test_small_waves_of_clumps_are_the_linear_wave(source, direction):
    """Linear springs leave out the overlap over the radius, 9e-4 here, and the wave's 1e-4."""
    law, linear = waves(stack_of_pairs(1e-6), source, direction, 1e-10)
    assert abs(law - linear).max() < 3e-3 * abs(linear).max()


@pytest.mark.parametrize("direction", ["z", "x"])
def test_plane_between_clumps_that_cross_a_period_is_that_of_the_linear_wave(rested, direction):
    source = Plane(float(rested.walls.mean()) + 1e-4)
    law, linear = waves(rested, source, direction, 1e-10)
    assert abs(law - linear).max() < 5e-3 * abs(linear).max()


def test_energy_of_clumps_adds_up_where_contacts_slide():
    """Push a stack of little friction by a third of an overlap, sideways."""
    sample = replace(stack_of_pairs(1e-6), friction=0.05)
    wave = modal.propagate(
        sample, 4e-5, nonlinear=True, motion=Pulse(3e-7, 1e5), direction="x", time_step=4e-8
    )
    work, kinetic, stored, dissipated = wave.energy.T
    assert abs(kinetic + stored + dissipated - work).max() < 1e-3 * work.max()
    assert dissipated[-1] > 0.05 * work.max()
    signals = wave.signals
    assert signals.slip_energy.sum() == pytest.approx(dissipated[-1], rel=1e-12)
    assert signals.slip_ends.max() < sample.grains


def test_clumps_that_would_be_the_source_or_are_held_are_refused(rested):
    options = {"nonlinear": True, "motion": Pulse(1e-10, 1e5)}
    disc = Disc((RADIUS, RADIUS, 5e-3), 4 * RADIUS)
    with refusal("clumps"):
        modal.propagate(rested, 1e-5, source=disc, **options)
    with refusal("clumps"):
        walled = replace(stack_of_pairs(1e-6), periodic_sides=(False, False))
        modal.propagate(walled, 1e-5, source=Plane(5e-3), direction="torsion", **options)
    with refusal("clumps"):
        repeat_sample(rested, 2, 1)
    held = np.zeros((len(rested.position), 6), bool)
    with refusal("held_bodies"):
        modal.propagate(replace(rested, fixed=held), 1e-5, source=Plane(5e-3), **options)
