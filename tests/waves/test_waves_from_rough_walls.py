"""Waves between walls of held spheres, against the equation of motion without held rows."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from held_packings import between_rough_walls, dense_squares_of_free, free_rows
from packings import polydisperse, sheared
from places import SHEARED
from refusals import refusal
from scipy.integrate import solve_ivp

import modal
from modal.packing.crystal import fcc
from modal.packing.ends import bodies_at_end, rough_wall
from modal.packing.network import Network
from modal.packing.rattlers import force_bearing
from modal.packing.sample import read_sample
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.waves.motions import Pulse
from modal.waves.signals import Signals
from modal.waves.sources import Point, RoughWall

pytestmark = pytest.mark.two_ways


@pytest.fixture(scope="module")
def rough():
    """Return 60 spheres of several sizes between two walls of held spheres."""
    return between_rough_walls(polydisperse())


@pytest.fixture(scope="module")
def highest(rough):
    """Return the highest frequency of that packing, Hz."""
    return LinearSystem.of(rough).highest_frequency


def moved_source(network: Network, axis: int) -> np.ndarray:
    """Return the unit displacement (6n,) of the source's spheres along an axis."""
    unit = np.zeros((network.n_particles, 6))
    unit[rough_wall(network, "source"), axis] = 1
    return unit.ravel()


def equation_of_motion(network: Network, push, motion, times) -> np.ndarray:
    """Return u (times, 6n) of M u'' = -K u + push d(t) without held rows, by Runge and Kutta."""
    rows = free_rows(network)
    K = stiffness_matrix(network).toarray()[np.ix_(rows, rows)]
    mass = mass_diagonal(network)[rows]
    n_rows = len(rows)

    def rate(time, state):
        """Return velocities and accelerations."""
        drive = motion.displacement(np.array([time]))[0]
        force = push[rows] * drive - K @ state[:n_rows]
        return np.concatenate([state[n_rows:], force / mass])

    start = np.zeros(2 * n_rows)
    interval = (0.0, times[-1])
    result = solve_ivp(rate, interval, start, "DOP853", times, rtol=1e-9, atol=1e-18)
    u = np.zeros((len(times), 6 * network.n_particles))
    u[:, rows] = result.y[:n_rows].T
    return u


@dataclass
class SentWave:
    """A wave that a rough wall sends along an axis, and the exact motion of all bodies."""

    axis: int
    signals: Signals
    displacement: np.ndarray
    """Exact displacements and turns, (nt, 6n)."""
    force: np.ndarray
    """Forces and torques on all bodies that their contacts must balance, K u, (nt, 6n)."""


@pytest.fixture(scope="module", params=["z", "x"])
def wave(rough, highest, request):
    """Send a pulse of a tenth of the highest frequency along z or x."""
    axis = "xyz".index(request.param)
    motion = Pulse(1e-9, 0.1 * highest)
    duration = 15 / highest
    signals = modal.propagate(
        rough,
        duration,
        source=RoughWall(),
        motion=motion,
        interval=duration / 30,
        direction=request.param,
        particles=True,
    ).signals
    source = moved_source(rough, axis)
    K = stiffness_matrix(rough).toarray()
    u = equation_of_motion(rough, -K @ source, motion, signals.time)
    u += motion.displacement(signals.time)[:, None] * source
    return SentWave(axis, signals, u, u @ K.T)


def test_the_walls_are_those_of_held_spheres(rough):
    source = rough_wall(rough, "source")
    receiver = rough_wall(rough, "receiver")
    assert rough.held[source].all()
    assert rough.held[receiver].all()
    assert len(source) + len(receiver) == rough.held.sum()


def test_displacements_from_a_rough_wall(rough, wave):
    """Compare within 1e-6, the relative error of the expansion; the receiver rests."""
    displacement = wave.signals.particle_displacement
    exact = wave.displacement[:, wave.axis :: 6]
    assert wave.signals.source == "rough wall"
    assert wave.signals.from_wall_to_wall
    assert abs(displacement - exact).max() < 1e-6 * abs(exact).max()
    assert not displacement[:, rough_wall(rough, "receiver")].any()


@pytest.mark.parametrize(("wall", "sign"), [("source", 1), ("receiver", -1)])
def test_stresses_on_rough_walls(rough, wave, wall, sign):
    """Sum the forces on the held spheres, from the rows of K that are left out, within 1e-6.

    The relative error of the expansion is that of the motion; stresses are linear in it.
    """
    rows = 6 * rough_wall(rough, wall) + wave.axis
    exact = sign * wave.force[:, rows].sum(axis=1) / rough.area
    stress = getattr(wave.signals, f"{wall}_stress")
    assert abs(stress - exact).max() < 1e-6 * abs(exact).max()


def test_held_spheres_are_not_in_the_chain(rough, wave):
    """Begin the chain at the source, and average over spheres that are not held."""
    chain = wave.signals.chain_particle
    assert not rough.held[chain].any()
    assert chain[0] in bodies_at_end(rough, "source")
    assert not force_bearing(rough)[rough.held].any()


def test_the_default_source_is_the_wall_that_is_there(rough):
    assert modal.propagate(rough, 1e-5).signals.source == "rough wall"


def test_a_source_of_held_spheres_needs_held_spheres():
    with refusal("no_rough_wall"):
        modal.propagate(sheared(), 1e-5, source=RoughWall())


def test_a_held_sphere_is_no_source(rough):
    sphere = int(rough_wall(rough, "source")[0])
    with refusal("source_moves_nothing"):
        modal.propagate(rough, 1e-5, source=Point(sphere))


@pytest.fixture(scope="module")
def exact_in_time(rough, highest):
    """Return a wave without error of time steps, over ten periods of the highest mode."""
    motion = Pulse(1e-9, 0.1 * highest)
    return modal.propagate(rough, 10 / highest, motion=motion, particles=True).signals


def test_wave_in_time_steps(rough, highest, exact_in_time):
    """Step with leapfrog, whose phase error is (omega dt)^2 / 24 for each radian."""
    interval = float(np.diff(exact_in_time.time)[0])
    signals = modal.propagate(
        rough,
        10 / highest,
        motion=Pulse(1e-9, 0.1 * highest),
        particles=True,
        interval=interval,
        time_step=interval / 40,
    ).signals
    exact = exact_in_time.particle_displacement
    assert abs(signals.particle_displacement - exact).max() < 3e-3 * abs(exact).max()


def test_wave_with_weak_dashpots(rough, highest, exact_in_time):
    """Change the wave by less than a hundredth, with dashpots of 1e-4 of the critical ones."""
    signals = modal.propagate(
        rough,
        10 / highest,
        motion=Pulse(1e-9, 0.1 * highest),
        particles=True,
        damping=ContactDamping(1e-4, 1e-4),
    ).signals
    undamped = exact_in_time.particle_displacement
    difference = abs(signals.particle_displacement - undamped).max()
    assert 1e-7 * abs(undamped).max() < difference < 1e-2 * abs(undamped).max()
    assert not signals.particle_displacement[:, rough_wall(rough, "receiver")].any()


def test_response_of_a_rough_wall(rough, highest):
    """Compare steady vibration with dashpots with a dense solution at one frequency."""
    damping = ContactDamping(0.05, 0.05)
    response = modal.frequency_response(
        rough, damping=damping, highest=0.2 * highest, resolution=0.15 * highest
    )
    rows = free_rows(rough)
    source = moved_source(rough, axis=2)
    K = stiffness_matrix(rough).toarray()
    C = stiffness_matrix(damping.dashpots(rough)).toarray()
    omega = 2 * np.pi * response.frequency[1]
    springs_and_dashpots = K - 1j * omega * C
    inertia = np.diag(omega**2 * mass_diagonal(rough)[rows])
    push = -springs_and_dashpots[rows] @ source
    u = source.astype(complex)
    u[rows] = np.linalg.solve(springs_and_dashpots[np.ix_(rows, rows)] - inertia, push)
    # Two direct solutions: eps times the condition of the matrix, some 1e5.
    chain = response.chain_particle
    np.testing.assert_allclose(response.chain_displacement[1], u[6 * chain + 2], rtol=1e-9)
    on_receiver = 6 * rough_wall(rough, "receiver") + 2
    stress = -(springs_and_dashpots @ u)[on_receiver].sum() / rough.area
    np.testing.assert_allclose(response.receiver_stress[1], stress, rtol=1e-9)


@pytest.fixture(scope="module")
def small_wave():
    """Return a non-linear wave of small amplitude between rough walls, and the linear wave.

    150 spheres with friction are at rest; those at both flat walls are held. The amplitude is a
    thousandth of the median overlap.
    """
    sample = read_sample(SHEARED)
    contacts = sample.contacts()
    fixed = np.zeros((len(sample.position), 6), bool)
    fixed[contacts.particle_i[contacts.particle_j < 0]] = True
    sample = replace(sample, fixed=fixed, friction=10.0)
    network = sample.network()
    highest = LinearSystem.of(network).highest_frequency
    settings = {
        "motion": Pulse(1e-3 * float(np.median(network.overlap)), 0.1 * highest),
        "interval": 0.4 / highest,
        "particles": True,
        "source": RoughWall(),
    }
    duration = 8 / highest
    linear = modal.propagate(network, duration, pre_stress="full", **settings).signals
    # At a tenth of the highest frequency the step's error is (omega dt)^2 / 24 = 1e-5 a period.
    settings |= {"nonlinear": True, "time_step": 0.025 / highest}
    return network, modal.propagate(sample, duration, **settings), linear


@pytest.mark.parametrize("name", ["particle_displacement", "source_stress", "receiver_stress"])
def test_a_wave_of_small_amplitude_follows_the_springs(small_wave, name):
    """Allow 5e-3: a thousandth of an overlap changes a stiffness by half as much; the step adds."""
    _, wave, linear = small_wave
    expected = getattr(linear, name)
    assert abs(getattr(wave.signals, name) - expected).max() < 5e-3 * abs(expected).max()


def test_a_receiver_of_held_spheres_stays_at_rest(small_wave):
    network, wave, _ = small_wave
    receiver = rough_wall(network, "receiver")
    assert not wave.signals.particle_displacement[:, receiver].any()


def test_the_work_of_held_spheres_is_in_the_energy_balance(small_wave):
    """Compare the work of the source with the energies, within a thousandth for the time step."""
    work, *energies = small_wave[1].energy[-1]
    assert abs(work - sum(energies)) < 1e-3 * abs(work)


@pytest.fixture(scope="module")
def crystal():
    """Return a crystal three columns wide, without held spheres."""
    return fcc(cells=(3, 1, 6))


@pytest.fixture(scope="module")
def held_crystal(crystal):
    """Return that crystal with its upper fifth held."""
    upper = crystal.position[:, 2] > 0.8 * crystal.length
    return replace(crystal, fixed=np.repeat(upper[:, None], 6, axis=1))


def test_one_column_stands_for_equal_columns(held_crystal):
    wave = modal.propagate(held_crystal, 1e-5)
    assert wave.repeats == 3
    whole = modal.propagate(held_crystal, 1e-5, whole=True)
    # Displacements are up to 5e-9 m; the expansion has an error of 1e-9 of them.
    np.testing.assert_allclose(
        wave.signals.layer_displacement, whole.signals.layer_displacement, atol=1e-18
    )


def test_columns_held_in_other_motions_are_not_equal(crystal, held_crystal):
    fixed = held_crystal.fixed.copy()
    fixed[0, 3:] = True
    assert modal.propagate(replace(crystal, fixed=fixed), 1e-5).repeats == 1


def test_modes_of_equal_columns(held_crystal):
    square = (2 * np.pi * modal.eigenmodes(held_crystal, all=True).frequency) ** 2
    assert abs(square - dense_squares_of_free(held_crystal)).max() < 1e-12 * square[-1]
