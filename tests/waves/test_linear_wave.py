"""The linear wave: the energy that the source gives it, its limits, what is refused."""

from functools import partial

import numpy as np
import pytest
from changes import scaled, stiffer
from oracles import stepped, wall_pattern
from places import SHEARED
from refusals import refusal

from modal.packing import crystal as gallery
from modal.packing.network import SOURCE_WALL, Network
from modal.packing.sample import read_sample
from modal.solvers.spectrum import GrowthError
from modal.system import linear_system
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.system.operator import ContactOperator
from modal.waves.motions import Pulse, SampledMotion
from modal.waves.propagate import propagate
from modal.waves.response import frequency_response

pytestmark = pytest.mark.two_ways


def with_one_stiff_contact(contact: int, factor: float) -> Network:
    """Return a crystal of 144 spheres whose highest mode is that of a single contact."""
    network = gallery.fcc(cells=(3, 3, 16))
    factors = scaled(np.ones(network.n_contacts), contact, factor)
    return stiffer(network, factors, factors)


def test_products_are_those_of_the_orders_and_an_interval_too_small_is_refused(monkeypatch):
    """Count the products for a network with a stiff contact.

    They are the orders of cos(omega t), those that the tolerance adds, and those that find the
    highest mode. If the highest frequency were too low by a tenth, wave and response are refused.
    """
    network = with_one_stiff_contact(11, 3.0)
    wave = propagate(network, 3e-4, tolerance=1e-12)
    top = np.linalg.eigvalsh(LinearSystem.of(network).dynamical_matrix.toarray())[-1]
    assert wave.products <= 1.15 * np.sqrt(top) * 3e-4 / 2 + 130
    monkeypatch.setattr(linear_system, "bound_of_spectrum", lambda _: (0.9 * top, 1))
    for compute in (
        lambda: propagate(with_one_stiff_contact(11, 3.0), 3e-4),
        lambda: frequency_response(with_one_stiff_contact(11, 3.0), highest=1e5),
    ):
        with pytest.raises(GrowthError):
            compute()


def squeezed(times: float) -> Network:
    """Return a crystal whose contacts press `times` as hard as their stiffness implies."""
    network = gallery.fcc(cells=(1, 1, 12))
    return network.unchecked(force_normal=times * network.force_normal)


def test_step_limit_is_that_of_the_tangent_in_use():
    """Compare the limit of the step with and without forces.

    Contacts under tension stiffen the crystal across them: the highest mode rises.
    """
    network = squeezed(-1e5)
    limits = []
    for pre_stress in ("none", "normal"):
        operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
        limits.append(2 / np.sqrt(np.linalg.eigvalsh(operator @ np.eye(operator.shape[0]))[-1]))
    assert limits[1] < 0.9 * limits[0]
    step = (limits[0] + limits[1]) / 2
    stepped(network, 1e-4, step)
    with refusal("time_step"):
        stepped(network, 1e-4, step, pre_stress="normal")


@pytest.mark.parametrize("pre_stress", ["normal", "full"])
def test_unstable_network_is_refused_by_both(pre_stress):
    """Refuse a network whose strong forces push the spheres aside, so that motion grows."""
    network = squeezed(2e4)
    operator = ContactOperator(network, mass_scaled=True, pre_stress=pre_stress)
    lowest = np.linalg.eigvals(operator @ np.eye(operator.shape[0])).real.min()
    # It grows by more than exp(10) in the time asked for.
    assert np.sqrt(-lowest) * 3e-4 > 10
    for simulate in (propagate, partial(stepped, step=1e-7)):
        with pytest.raises(GrowthError):
            simulate(network, 3e-4, pre_stress=pre_stress)


@pytest.mark.parametrize(
    ("share", "corners", "pre_stress"),
    [(0.1, 0, "none"), (0.1, 12, "full"), (0.98, 0, "full"), (0.98, 12, "none")],
)
def test_leapfrog_is_that_of_a_loop_over_its_steps(share, corners, pre_stress):
    """Compare with a plain loop, near the limit of the step and with a wall that jerks."""
    system = LinearSystem.of(read_sample(SHEARED).network(), pre_stress=pre_stress)
    dt = share * 2 / np.sqrt(system.spectral_bound)
    steps_per_record = 4
    records = 50
    motion = Pulse()
    if corners:
        rng = np.random.default_rng(corners)
        corner_times = np.sort(rng.uniform(0, dt * steps_per_record * records, corners))
        corner_values = rng.random(corners)
        motion = SampledMotion(np.append(0, corner_times), 1e-9 * np.append(0, corner_values))
    times = {
        "time_step": dt,
        "interval": steps_per_record * dt,
        "particles": True,
        "tolerance": 1e-11,
    }
    times["pre_stress"] = pre_stress
    wave = propagate(system.network, steps_per_record * records * dt, motion=motion, **times)
    push, pull, holding_force = wall_pattern(system.network, SOURCE_WALL, pre_stress)
    A = system.dynamical_matrix
    root = system.sqrt_mass
    v, speed = np.zeros((2, system.size))
    wall_displacement = motion.displacement(dt * np.arange(steps_per_record * records + 1))
    for k, d in enumerate(wall_displacement):
        if k % steps_per_record == 0:
            u = root.over(v)
            row = k // steps_per_record
            moves = wave.signals.particle_displacement
            stress = wave.signals.source_stress
            assert abs(moves[row] - u[2::6]).max() <= 1e-10 * abs(moves).max()
            force = (holding_force * d - pull @ u) / system.network.area
            assert abs(stress[row] - force) <= 1e-10 * abs(stress).max()
        speed += dt * (root.over(push) * d - A @ v)
        v += dt * speed
    # As many products as steps at the limit, and what finds it: no more for shorter steps.
    assert wave.products < len(wall_displacement) * share + 200


def test_long_wave_is_refused_before_it_starts():
    """Refuse 1,000 s of 2,000 spheres by either method, for products and for memory.

    The refusal is immediate: no search among 1e11 numbers for one with a fast transform.
    """
    for times in ({"duration": 4e5}, {"duration": 1e308, "interval": 1e308}):
        with refusal("too_large", "days"):
            propagate(gallery.fcc(cells=(1, 1, 2)), **times)
    network = gallery.fcc(cells=(4, 4, 125))
    assert network.n_particles == 2000
    for simulate in (propagate, partial(stepped, step=1e-7, every=10)):
        with refusal("too_large", "B"):
            simulate(network, 1e3)


@pytest.mark.parametrize("damping", [None, ContactDamping(0.1, 0.1)])
@pytest.mark.parametrize(
    ("duration", "interval", "count"), [(1e-5, 1e-6, 11), (1e-5, 6e-6, 2), (1.1e-5, 3e-6, 4)]
)
def test_a_record_ends_within_its_duration(duration, interval, count, damping):
    times = {"duration": duration, "interval": interval, "damping": damping}
    signals = propagate(gallery.fcc(cells=(1, 1, 3)), **times).signals
    assert signals.time == pytest.approx(interval * np.arange(count))
    assert signals.time[-1] <= duration * (1 + 1e-9)
    assert signals.time_step == interval
    assert 0 < signals.run_time < 600
