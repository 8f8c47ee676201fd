"""Bodies that cannot make some motions: dense matrices without those rows, and walls."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import slow_stiffness
from packings import polydisperse, sheared
from places import SHEARED
from refusals import refusal
from scipy.integrate import solve_ivp
from scipy.linalg import eig, eigh

import modal
from modal.elasticity.strain import UNIT_STRAINS
from modal.modes.collective import every_floppy
from modal.modes.damped import damped_modes
from modal.packing.crystal import column, fcc
from modal.packing.ends import bodies_at_end, end_heights, rough_wall
from modal.packing.network import read_network, write_network
from modal.packing.rattlers import force_bearing
from modal.packing.rigid_bodies import joined
from modal.packing.sample import read_sample, sample_of_network, write_sample
from modal.preparation.relax import relax
from modal.system.assembly import mass_diagonal, stiffness_matrix
from modal.system.contacts import contact_tangent
from modal.system.damping import ContactDamping
from modal.system.linear_system import LinearSystem
from modal.system.root_mass import RootMass
from modal.waves.motions import Pulse
from modal.waves.sources import Point, RoughWall

pytestmark = pytest.mark.two_ways


def held_at_random(network, seed: int = 5):
    """Hold one sphere in six wholly, and half of the motions of another third of them."""
    rng = np.random.default_rng(seed)
    n = network.n_particles
    kind = rng.random(n)
    fixed = rng.random((n, 6)) < 0.5
    fixed[kind > 1 / 2] = False
    fixed[kind < 1 / 6] = True
    return replace(network, fixed=fixed)


def between_rough_walls(network):
    """Hold the spheres that touch flat walls, and take the flat walls away."""
    held = np.zeros(network.n_particles, bool)
    held[network.particle_i[network.with_wall]] = True
    fixed = np.repeat(held[:, None], 6, axis=1)
    return replace(network.with_contacts(~network.with_wall), fixed=fixed)


@pytest.fixture(scope="module")
def partly():
    """Return 150 spheres with friction, so many that lists of modes are sought by Lanczos."""
    return held_at_random(sheared())


@pytest.fixture(scope="module")
def small():
    """Return 60 spheres of several sizes, some of them held: few rows for dense matrices."""
    return held_at_random(polydisperse())


@pytest.fixture(scope="module")
def rough():
    """Return 60 spheres of several sizes between two walls of held spheres."""
    return between_rough_walls(polydisperse())


def free(network) -> np.ndarray:
    """Return the rows of the motions that are not held."""
    return np.flatnonzero(network.free_motions)


def squares(network, pre_stress="none") -> np.ndarray:
    """Return all omega^2, ascending, from dense K and M without the rows of held motions."""
    K = stiffness_matrix(network, 6, pre_stress).toarray()
    if pre_stress == "none":
        K = slow_stiffness(network)
    rows = free(network)
    return eigh(K[np.ix_(rows, rows)], np.diag(mass_diagonal(network)[rows]), eigvals_only=True)


@pytest.fixture(scope="module")
def partly_squares(partly):
    """Return all omega^2 of `partly`."""
    return squares(partly)


@pytest.fixture(scope="module")
def wanted(partly_squares):
    """Return all frequencies, Hz, of elastic modes of `partly`, ascending."""
    elastic = partly_squares > 1e-9 * partly_squares[-1]
    return np.sqrt(partly_squares[elastic]) / (2 * np.pi)


@pytest.mark.parametrize("pre_stress", ["none", "normal"])
def test_all_modes_are_those_of_the_matrices_without_held_rows(small, pre_stress):
    modes = modal.eigenmodes(small, all=True, pre_stress=pre_stress)
    square = squares(small, pre_stress)
    assert len(modes.frequency) == small.degrees_of_freedom < 6 * small.n_particles
    found = np.sign(modes.frequency) * (2 * np.pi * modes.frequency) ** 2
    # Round-off of a dense solver is some eps of the largest.
    assert abs(found - square).max() < 1e-12 * square[-1]
    assert not modes.mode_shape[:, small.fixed].any()
    assert modes.floppy_modes == (abs(square) < 1e-9 * square[-1]).sum()


def test_lists_and_counts_are_exact(partly, wanted):
    floppy = every_floppy(LinearSystem.of(partly)).total
    assert floppy == partly.degrees_of_freedom - len(wanted)
    low = modal.eigenmodes(partly, lowest=9)
    high = modal.eigenmodes(partly, highest=4)
    middle = modal.eigenmodes(partly, between=(wanted[100] * 0.9999, wanted[119] * 1.0001))
    for modes, part in ((low, wanted[:9]), (high, wanted[-4:]), (middle, wanted[100:120])):
        assert modes.certified, modes.attributes
        np.testing.assert_allclose(modes.frequency, part, rtol=1e-9)
        assert not modes.mode_shape[:, partly.fixed].any()
    cuts = (wanted[[0, 57, 200]] + wanted[[1, 58, 201]]) / 2
    assert modal.count_modes(partly, cuts).tolist() == [floppy + 1, floppy + 58, floppy + 201]
    assert modal.count_modes(partly, 10 * wanted[-1]) == partly.degrees_of_freedom


def test_translations_only(small):
    modes = modal.eigenmodes(small, all=True, translations_only=True)
    rows = np.flatnonzero(small.free_motions[:, :3])
    K = stiffness_matrix(small, 3).toarray()[np.ix_(rows, rows)]
    square = eigh(K, np.diag(mass_diagonal(small, 3)[rows]), eigvals_only=True)
    found = np.sign(modes.frequency) * (2 * np.pi * modes.frequency) ** 2
    assert abs(found - square).max() < 1e-12 * square[-1]


def test_product_and_matrix(small):
    """The loops, the assembled matrix and its blocks; held motions have no entry."""
    system = LinearSystem.of(small)
    A = system.dynamical_matrix.toarray()
    held = small.fixed.ravel()
    assert not A[held].any() and not A[:, held].any()
    u = np.random.default_rng(1).standard_normal((system.size, 3))
    for operator in (system.operator, system.renumbered):
        product = operator.outward(operator.apply(operator.inward(u)))
        np.testing.assert_allclose(product, A @ u, rtol=0, atol=1e-13 * abs(A).max() * 10)
    np.testing.assert_allclose(system.diagonal, A.diagonal(), rtol=1e-12, atol=1e-14 * A.max())


def test_a_tensor_of_inertia_keeps_the_turns_that_are_free():
    """M without held rows has an inverse root of its own, which is no part of the whole one."""
    rng = np.random.default_rng(2)
    plain = polydisperse(n=12)
    axes = np.linalg.qr(rng.standard_normal((12, 3, 3)))[0]
    tensor = axes * [0.7, 1.0, 1.3] @ axes.transpose(0, 2, 1) * plain.inertia[:, None, None]
    shape = {"inertia_tensor": tensor, "inertia": np.trace(tensor, axis1=1, axis2=2) / 3}
    network = held_at_random(replace(plain, **shape), seed=1)
    M = np.diag(mass_diagonal(network))
    for k in range(12):
        M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = tensor[k]
    rows = free(network)
    K = slow_stiffness(network)[np.ix_(rows, rows)]
    square = eigh(K, M[np.ix_(rows, rows)], eigvals_only=True)
    modes = modal.eigenmodes(network, all=True)
    found = np.sign(modes.frequency) * (2 * np.pi * modes.frequency) ** 2
    assert abs(found - square).max() < 1e-11 * square[-1]
    u = rng.standard_normal(72)
    system = LinearSystem.of(network)
    product = system.operator.apply(u)
    np.testing.assert_allclose(product, system.dynamical_matrix @ u, atol=1e-12 * square[-1])
    root_mass = RootMass.of(network)
    projected = root_mass.times(root_mass.over(u))
    wanted = np.where(network.free_motions.ravel(), u, 0)
    np.testing.assert_allclose(projected, wanted, atol=1e-12)


@pytest.mark.parametrize("tolerance", [1e-3, 0.03])
def test_density_counts_the_motions_that_are_free(partly, wanted, tolerance):
    """From exact traces, and with random vectors, whose error is told."""
    states = modal.density_of_states(partly, tolerance=tolerance)
    assert states.zero_modes.sum() == pytest.approx(partly.degrees_of_freedom - len(wanted))
    middle = float(np.median(wanted))
    value, error = states.count_below([middle, states.highest])
    assert abs(value[1, 6] - partly.degrees_of_freedom) <= 5 * error[1, 6] + 1e-6
    components = partly.free_motions.sum(axis=0)
    assert (abs(value[1, :6] - components) <= 5 * error[1, :6] + 1e-6).all()
    # The kernel is a hundredth of the spectrum wide; modes within it may be on either side.
    near = abs(wanted / middle - 1) < 0.03
    below = partly.degrees_of_freedom - len(wanted) / 2
    assert abs(value[0, 6] - below) < near.sum() + 5 * error[0, 6]


def test_a_body_without_moves_is_a_wall():
    """The last sphere of a column, held, is a wall of the stiffness of their contact."""
    chain = column(6)
    last = chain.n_particles - 1
    fixed = np.zeros((last + 1, 6), bool)
    fixed[last] = True
    held = replace(chain, fixed=fixed)
    kept = ~((chain.particle_i == last) & (chain.particle_j < 0))
    shorter = chain.with_contacts(kept)
    at_last = (shorter.particle_j == last) | (shorter.particle_i == last)
    wall = shorter.unchecked(
        position=chain.position[:-1],
        radius=chain.radius[:-1],
        mass=chain.mass[:-1],
        inertia=chain.inertia[:-1],
        particle_j=np.where(at_last, -2, shorter.particle_j),
        lever_j=np.where(at_last[:, None], 0.0, shorter.lever_j),
    )
    expected = modal.eigenmodes(wall, all=True).frequency
    np.testing.assert_allclose(
        modal.eigenmodes(held, all=True).frequency, expected, rtol=1e-12, atol=1e-9 * expected[-1]
    )
    # A dashpot between a sphere and a wall is critical for the mass of the sphere.
    damping = ContactDamping(0.1, 0.2)
    of_wall = damping.dashpots(wall).stiffness_normal
    of_held = damping.dashpots(held).stiffness_normal[kept]
    np.testing.assert_allclose(of_held, of_wall, rtol=1e-12)


def test_zero_modes_by_kind():
    """A ball with no contact that may slide along x and y, a rotor without tangential springs."""
    pair = fcc(cells=(1, 1, 2)).with_contacts(slice(0))
    fixed = np.zeros((2, 6), bool)
    fixed[0] = True
    fixed[1, 2:5] = True
    floppy = every_floppy(LinearSystem.of(replace(pair, fixed=fixed)))
    assert floppy.kinds["free_particles"] == floppy.total == 3
    smooth = column(3)
    smooth = replace(smooth, stiffness_tangential=0 * smooth.stiffness_tangential)
    plane = np.zeros((3, 6), bool)
    plane[:, [1, 3, 5]] = True
    flat = replace(smooth, fixed=plane)
    square = squares(flat)
    floppy = every_floppy(LinearSystem.of(flat))
    assert floppy.total == (square < 1e-9 * square[-1]).sum() == 6


def equation_of_motion(network, push, motion, times):
    """Return u (times, 6n) of M u'' = -K u + push d(t) without held rows, by Runge and Kutta."""
    rows = free(network)
    K = stiffness_matrix(network).toarray()[np.ix_(rows, rows)]
    mass = mass_diagonal(network)[rows]
    half = len(rows)

    def rate(time, state):
        drive = motion.displacement(np.array([time]))[0]
        force = push[rows] * drive - K @ state[:half]
        return np.concatenate([state[half:], force / mass])

    start = np.zeros(2 * half)
    ends = (0.0, times[-1])
    result = solve_ivp(rate, ends, start, "DOP853", times, rtol=1e-9, atol=1e-18)
    u = np.zeros((len(times), 6 * network.n_particles))
    u[:, rows] = result.y[:half].T
    return u


@pytest.fixture(scope="module")
def small_rough():
    """Return a crystal of eight layers, one sphere wide, whose first and last are held."""
    crystal = fcc(cells=(1, 1, 8))
    return between_rough_walls(replace(crystal, cell_shift=crystal.periods))


@pytest.mark.parametrize("direction", ["z", "x"])
def test_a_rough_wall_sends_a_wave(rough, direction):
    """Displacements and the forces on both walls, from the rows of K that are left out."""
    source = rough_wall(rough, "source")
    receiver = rough_wall(rough, "receiver")
    assert rough.held[source].all() and len(source) + len(receiver) == rough.held.sum()
    axis = "xyz".index(direction)
    unit = np.zeros((rough.n_particles, 6))
    unit[source, axis] = 1
    K = stiffness_matrix(rough).toarray()
    top = LinearSystem.of(rough).highest_frequency
    motion = Pulse(1e-9, 0.1 * top)
    duration = 15 / top
    settings = {"interval": duration / 30, "direction": direction, "particles": True}
    wave = modal.propagate(rough, duration, source=RoughWall(), motion=motion, **settings)
    signals = wave.signals
    assert signals.source == "rough wall" and signals.from_wall_to_wall
    u = equation_of_motion(rough, -K @ unit.ravel(), motion, signals.time)
    drive = motion.displacement(signals.time)
    u += drive[:, None] * unit.ravel()
    wanted = u[:, axis::6]
    assert abs(signals.particle_displacement - wanted).max() < 1e-6 * abs(wanted).max()
    assert not signals.particle_displacement[:, receiver].any()
    force = u @ K.T
    for stress, bodies, sign in (
        (signals.source_stress, source, 1),
        (signals.receiver_stress, receiver, -1),
    ):
        expected = sign * force[:, 6 * bodies + axis].sum(axis=1) / rough.area
        assert abs(stress - expected).max() < 1e-6 * abs(expected).max()
    # Held spheres are not averaged with the others, nor part of the chain.
    chain = signals.chain_particle
    assert not rough.held[chain].any() and not force_bearing(rough)[rough.held].any()
    assert {chain[0]} <= {*bodies_at_end(rough, "source")}


def test_the_default_source_is_the_wall_that_is_there(rough):
    assert modal.propagate(rough, 1e-5).signals.source == "rough wall"
    with refusal("no_rough_wall"):
        modal.propagate(sheared(), 1e-5, source=RoughWall())
    spheres = rough_wall(rough, "source")
    with refusal("source_moves_nothing"):
        modal.propagate(rough, 1e-5, source=Point(int(spheres[0])))


def test_time_steps_and_dashpots_keep_held_spheres_at_rest(rough):
    """A wave in steps, with dashpots, and at finite amplitude: as the equation of motion has it."""
    top = LinearSystem.of(rough).highest_frequency
    motion = Pulse(1e-9, 0.1 * top)
    exact = modal.propagate(rough, 10 / top, motion=motion, particles=True).signals
    # An error of (omega dt)^2 / 24 for each period.
    stepped = modal.propagate(
        rough,
        10 / top,
        motion=motion,
        particles=True,
        interval=float(np.diff(exact.time)[0]),
        time_step=float(np.diff(exact.time)[0]) / 40,
    ).signals
    largest = abs(exact.particle_displacement).max()
    assert abs(stepped.particle_displacement - exact.particle_displacement).max() < 3e-3 * largest
    damping = ContactDamping(1e-4, 1e-4)
    damped = modal.propagate(rough, 10 / top, motion=motion, particles=True, damping=damping)
    difference = damped.signals.particle_displacement - exact.particle_displacement
    assert 1e-7 * largest < abs(difference).max() < 1e-2 * largest
    assert not damped.signals.particle_displacement[:, rough_wall(rough, "receiver")].any()


def test_response_of_a_rough_wall(rough):
    """The motion under a steady vibration with dashpots, by one dense solution a frequency."""
    damping = ContactDamping(0.05, 0.05)
    top = LinearSystem.of(rough).highest_frequency
    response = modal.frequency_response(
        rough, damping=damping, highest=0.2 * top, resolution=0.15 * top
    )
    rows = free(rough)
    unit = np.zeros((rough.n_particles, 6))
    unit[rough_wall(rough, "source"), 2] = 1
    K = stiffness_matrix(rough).toarray()
    C = stiffness_matrix(damping.dashpots(rough)).toarray()
    omega = 2 * np.pi * response.frequency[1]
    dynamic = K - 1j * omega * C
    u = unit.ravel().astype(complex)
    inertia = np.diag(omega**2 * mass_diagonal(rough)[rows])
    push = -dynamic[rows] @ unit.ravel()
    u[rows] = np.linalg.solve(dynamic[np.ix_(rows, rows)] - inertia, push)
    chain = response.chain_particle
    np.testing.assert_allclose(response.chain_displacement[1], u[6 * chain + 2], rtol=1e-9)
    on_receiver = 6 * rough_wall(rough, "receiver") + 2
    expected = -(dynamic @ u)[on_receiver].sum() / rough.area
    np.testing.assert_allclose(response.receiver_stress[1], expected, rtol=1e-9)


def test_damped_modes():
    rough = between_rough_walls(polydisperse(n=40))
    damping = ContactDamping(0.02, 0.03)
    top = LinearSystem.of(rough).highest_frequency
    modes = damped_modes(rough, damping, near=0.3 * top, count=4)
    rows = free(rough)
    mass = mass_diagonal(rough)[rows, None]
    K = stiffness_matrix(rough).toarray()[np.ix_(rows, rows)] / mass
    C = stiffness_matrix(damping.dashpots(rough)).toarray()[np.ix_(rows, rows)] / mass
    unit = 2 * np.pi * top
    identity = np.eye(len(rows))
    state = np.block([[0 * identity, identity], [-K / unit**2, -C / unit]])
    rate = eig(state, right=False) * unit
    forwards = rate[rate.imag > 0.05 * unit]
    nearest = forwards[np.argsort(abs(forwards - 2j * np.pi * 0.3 * top))[:4]]
    wanted = np.sort(nearest.imag) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequency, wanted, rtol=1e-8)
    assert not modes.shape[:, rough.fixed].any()


def test_moduli_of_a_cell_with_held_turns():
    """V C_ab = d_a . k d_b - f_a . K^-1 f_b without held rows; held turns stay zero."""
    cell = polydisperse(periodic_z=True)
    fixed = held_at_random(cell).fixed.copy()
    fixed[:, :3] = False
    network = replace(cell, fixed=fixed)
    moduli = modal.elastic_moduli(network, solver="gradients", tolerance=1e-9)
    tangent = contact_tangent(network)
    strain = UNIT_STRAINS.on(network)
    turns = network.free_motions[:, 3:]
    for a, (moving, along) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        gradient = np.zeros((3, 3))
        gradient[moving, along] = 1
        antisymmetric = gradient - gradient.T
        turn = np.array([antisymmetric[2, 1], antisymmetric[0, 2], antisymmetric[1, 0]]) / 2
        np.testing.assert_allclose(strain[a, :, 3:6], turn * turns[network.particle_i])
    rows = free(network)
    K = slow_stiffness(network)[np.ix_(rows, rows)]
    push = LinearSystem.of(network).put_on(UNIT_STRAINS).push.toarray()[rows]
    affine = np.einsum("sca,cab,tcb->st", strain, tangent, strain)
    relaxed = affine - push.T @ np.linalg.pinv(K, rcond=1e-10, hermitian=True) @ push
    volume = network.area * network.length
    np.testing.assert_allclose(
        moduli.stiffness, relaxed / volume, atol=1e-6 * affine.max() / volume
    )


def test_moduli_between_rough_walls():
    """A crystal between held layers has the moduli of the same crystal without end."""
    crystal = fcc(cells=(2, 2, 40))
    ends = between_rough_walls(replace(crystal, cell_shift=crystal.periods))
    endless = modal.elastic_moduli(fcc(cells=(2, 2, 40), periodic_z=True))
    moduli = modal.elastic_moduli(ends)
    assert moduli.region == "bulk"
    np.testing.assert_allclose(
        moduli.stiffness, endless.stiffness, atol=1e-4 * endless.stiffness.max()
    )
    assert moduli.density == pytest.approx(endless.density, rel=1e-4)
    low, high = end_heights(ends)
    assert low == ends.position[rough_wall(ends, "source"), 2].max()
    assert high == ends.position[rough_wall(ends, "receiver"), 2].min()


def test_the_file_says_what_is_held(partly, tmp_path):
    path = tmp_path / "partly.network.h5"
    write_network(path, partly)
    again = read_network(path)
    np.testing.assert_array_equal(again.fixed, partly.fixed)
    assert again.fingerprint == partly.fingerprint != sheared().fingerprint
    none = replace(partly, fixed=np.zeros_like(partly.fixed))
    assert none.fixed is None and none.fingerprint == sheared().fingerprint
    with refusal("wrong_shape", "fixed"):
        replace(partly, fixed=partly.fixed[:, :3])


@pytest.fixture(scope="module")
def rough_sample():
    """Return 150 spheres with friction at rest, of which those at both flat walls are held."""
    sample = read_sample(SHEARED)
    contacts = sample.contacts()
    fixed = np.zeros((len(sample.position), 6), bool)
    fixed[contacts.particle_i[contacts.particle_j < 0]] = True
    return replace(sample, fixed=fixed, friction=10.0)


def test_a_wave_of_small_amplitude_follows_the_springs(rough_sample):
    """Held spheres move with the source, or not at all; their holder takes up the forces."""
    network = rough_sample.network()
    top = LinearSystem.of(network).highest_frequency
    motion = Pulse(1e-3 * float(np.median(network.overlap)), 0.1 * top)
    settings = {"motion": motion, "interval": 0.4 / top, "particles": True, "source": RoughWall()}
    linear = modal.propagate(network, 8 / top, pre_stress="full", **settings).signals
    # At a tenth of the highest frequency the step's error is (omega dt)^2 / 24 = 1e-5 a period.
    settings |= {"nonlinear": True, "time_step": 0.025 / top}
    wave = modal.propagate(rough_sample, 8 / top, **settings)
    signals = wave.signals
    for name in ("particle_displacement", "source_stress", "receiver_stress"):
        expected = getattr(linear, name)
        difference = abs(getattr(signals, name) - expected).max()
        # A thousandth of an overlap changes stiffnesses by half as much; and the time step.
        assert difference < 5e-3 * abs(expected).max(), name
    receiver = rough_wall(network, "receiver")
    assert not signals.particle_displacement[:, receiver].any()
    work = wave.energy[-1]
    assert abs(work[0] - work[1:].sum()) < 1e-3 * abs(work[0])


def test_relax_leaves_held_spheres_where_they_are(rough_sample, tmp_path):
    """A sample whose inner spheres are displaced by a tenth of an overlap comes to rest again."""
    rng = np.random.default_rng(1)
    overlap = float(np.median(rough_sample.network().overlap))
    shaken = rough_sample.position + 0.1 * overlap * rng.standard_normal(
        rough_sample.position.shape
    )
    held = rough_sample.fixed.all(axis=1)
    shaken[held] = rough_sample.position[held]
    shaken[:, :2] %= rough_sample.side
    rested, state = relax(replace(rough_sample, position=shaken, shear=None, friction=0.5))
    assert state.residual < 1e-6
    np.testing.assert_array_equal(rested.position[held], rough_sample.position[held])
    assert (rested.position[~held] != shaken[~held]).any()
    path = tmp_path / "rough.sample.h5"
    write_sample(path, rested)
    np.testing.assert_array_equal(read_sample(path).fixed, rough_sample.fixed)
    np.testing.assert_array_equal(sample_of_network(rested.network(), 0.5).fixed, rested.fixed)


def test_what_is_told_counts_held_bodies_as_walls(rough):
    held = rough.held
    moving = (~held[rough.particle_i]).sum() + (~held[rough.particle_j]).sum()
    assert rough.coordination_number == pytest.approx(moving / (~held).sum())
    assert f"{held.sum()} spheres in all motions" in modal.describe(rough)
    assert modal.eigenmodes(rough, lowest=1).attributes["certified"]


def test_equal_parts_are_held_alike():
    """One column of a crystal stands for all, unless another one is held in other motions."""
    crystal = fcc(cells=(3, 1, 6))
    fixed = np.repeat((crystal.position[:, 2] > 0.8 * crystal.length)[:, None], 6, axis=1)
    held = replace(crystal, fixed=fixed)
    wave = modal.propagate(held, 1e-5)
    assert wave.repeats == 3
    whole = modal.propagate(held, 1e-5, whole=True)
    np.testing.assert_allclose(
        wave.signals.layer_displacement, whole.signals.layer_displacement, atol=1e-18
    )
    other = fixed.copy()
    other[0, 3:] = True
    assert modal.propagate(replace(crystal, fixed=other), 1e-5).repeats == 1
    dense = (2 * np.pi * modal.eigenmodes(held, all=True).frequency) ** 2
    assert abs(dense - squares(held)).max() < 1e-12 * dense[-1]


def test_clumps_are_held_as_a_whole():
    chain = column(4)
    body = np.array([1, 1, 0, 0])
    fixed = np.zeros((4, 6), bool)
    fixed[:2] = True
    clumps = joined(replace(chain, fixed=fixed), body)
    assert clumps.held.tolist() == [True, False, False]
    fixed[1] = False
    with refusal("held_bodies"):
        joined(replace(chain, fixed=fixed), body)
