"""The wave at finite amplitude: against an ODE solver, the linear wave, its books, YADE."""

from dataclasses import replace

import numpy as np
import pytest
from places import SHEARED
from refusals import refusal
from scipy.integrate import solve_ivp

import modal
from modal.__main__ import main
from modal.dem import contacts
from modal.dem.forces import forces_by_loop
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.dem.motion import Dynamics
from modal.packing import crystal as gallery
from modal.packing.contact_law import RADIUS
from modal.packing.neighbours import tangents
from modal.packing.network import SOURCE_WALL
from modal.packing.rattlers import force_bearing
from modal.packing.sample import Sample, read_sample, sample_of_network, write_sample
from modal.packing.state import net_forces
from modal.preparation.relax import relax
from modal.system.contacts import terms_of
from modal.system.imposed import TURN, WallMoves, put_on
from modal.waves.motions import Pulse, step
from modal.waves.signals import read_signals
from modal.waves.sources import Plane, Point, Wall

DURATION = 4e-4
"""In which a wave crosses the column of forty spheres, s."""


@pytest.fixture(scope="module")
def column():
    return gallery.column(40)


@pytest.fixture(scope="module")
def rested():
    """Return 150 spheres with friction, at rest."""
    sample, balance = relax(read_sample(SHEARED))
    assert balance.at_rest
    return sample


def of_ode(network, motion, duration):
    """Compute displacements (nt, n) of a column of Hertz spheres by DOP853, of eighth order."""
    overlap = network.overlap
    force = network.force_normal
    mass = network.mass[0]

    def rates(t, state):
        u, v = np.split(state, 2)
        wall = motion.displacement(np.array([t]))[0]
        positions = np.concatenate([[wall], u, [0.0]])
        # The contacts from below: with the source wall, between spheres, with the receiver wall.
        order = [0, *range(1, len(u)), len(u)]
        deep = np.maximum(overlap[order] + positions[:-1] - positions[1:], 0)
        push = force[order] * (deep / overlap[order]) ** 1.5
        return np.concatenate([v, (push[:-1] - push[1:]) / mass])

    times = 1e-6 * np.arange(round(duration * 1e6) + 1)
    solution = solve_ivp(
        rates, (0, times[-1]), np.zeros(2 * len(network.mass)), "DOP853", times, rtol=1e-11,
        atol=1e-18, max_step=1e-6,
    )  # fmt: skip
    return solution.y[: len(network.mass)].T


def off(record, expected):
    return abs(record - expected).max() / abs(expected).max()


def test_column_against_an_ode_solver_and_the_order_of_the_step(column):
    """Push a column by 0.4 of an overlap, at which the linear wave is far off.

    The reported error is above the true one.
    """
    motion = Pulse(0.2 * column.overlap[1], 2e4)
    expected = of_ode(column, motion, DURATION)

    def found(**options):
        return modal.propagate(
            column, DURATION, nonlinear=True, motion=motion, friction=0.3, interval=1e-6, **options
        )

    wave = found(tolerance=1e-4)
    assert off(wave.signals.chain_displacement, expected) < 1e-4
    linear = modal.propagate(column, DURATION, motion=motion, interval=1e-6).signals
    assert wave.error < 1e-4 < off(linear.chain_displacement, expected)
    errors = [off(found(time_step=dt).signals.chain_displacement, expected) for dt in (2e-7, 1e-7)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.05)
    # Nothing opens or slides: all of the wall's work is in the wave, to second order of the step.
    balance = wave.signals.balance
    assert balance.closes
    assert abs(balance.gap) < 1e-5
    assert balance.slid == balance.opened == 0


@pytest.fixture(scope="module")
def endless():
    """Return 150 spheres at rest in a cell without walls."""
    sample, balance = relax(sample_of_network(modal.random_packing(150, periodic=True), 0.3))
    assert balance.at_rest
    assert sample.periodic_z
    return sample


@pytest.fixture(scope="module")
def pillar():
    """Return single spheres and triangles of spheres in turn, without periods, in exact balance.

    Friction holds each sphere of a triangle between two single ones: its forces are vertical and
    off its centre, and turn with the spheres.
    """
    overlap = 1e-6
    lean = np.radians(37.0)
    axis = np.array([3, 4.5, 0]) * RADIUS
    bare = Sample(np.empty((0, 3)), np.full(2, 8 * RADIUS), np.zeros(2), friction=1.0)
    pair, wall = bare.laws
    load = 3 * pair.normal_force(overlap, RADIUS / 2) / np.cos(lean)
    low = RADIUS - wall.overlap_of_force(load, RADIUS)
    out, rise = (2 * RADIUS - overlap) * np.array([np.sin(lean), np.cos(lean)])
    positions = [[0, 0, low]]
    for k in range(4):
        turns = 0.7 * k + 2 * np.pi / 3 * np.arange(3)
        z = low + (2 * k + 1) * rise
        positions += [[out * np.cos(turn), out * np.sin(turn), z] for turn in turns]
        positions.append([0, 0, z + rise])
    walls = np.array([0, positions[-1][2] + low])
    sample = replace(bare, position=positions + axis, walls=walls, periodic_sides=(False, False))
    network = sample.network()
    n = network.normal
    shear = network.force_normal[:, None] * (n - [0, 0, 1] / n[:, 2:])
    sample.shear = np.column_stack([(shear * across).sum(axis=1) for across in tangents(n)])
    assert abs(net_forces(sample.network())).max() < 1e-10
    return sample


@pytest.mark.parametrize(
    ("packing", "source", "direction"),
    [
        *(("rested", "wall", direction) for direction in "zx"),
        *(("rested", "plane", direction) for direction in "zx"),
        *(("rested", "point", direction) for direction in ("z", "y", "torsion")),
        *(("endless", "plane", direction) for direction in "zx"),
        *(("endless", "point", direction) for direction in ("x", "torsion")),
        *(("pillar", source, "torsion") for source in ("wall", "plane", "point")),
    ],
)
def test_small_waves_are_the_linear_wave(request, packing, source, direction):
    """Check that the difference from the full tangent is proportional to the amplitude.

    The larger amplitude is 4e-3 of an overlap, or 4e-4 without walls, where contacts are looser. A
    sphere is pushed so that it moves about as far; a rotation moves points three radii from the
    axis by as much. All spheres that bear force are compared.
    """
    sample = request.getfixturevalue(packing)
    network = sample.network()
    walls = packing != "endless"
    bearing = force_bearing(network)
    kn = network.stiffness_normal.mean()
    # A torque of kn D size / 5 turns a sphere by some size / R.
    size = {"torsion": kn * RADIUS}.get(direction, 10 * kn) if source == "point" else 1.0
    if source != "point" and direction == "torsion":
        size = 1 / (3 * RADIUS)
    source_object = {
        "wall": Wall(),
        "plane": Plane(sample.walls.mean() + 1e-4),
        "point": Point(10 if packing == "pillar" else 70),
    }[source]
    differences = []
    time_step = 8e-9 if packing == "pillar" else 2e-8
    near = not walls and direction != "torsion"
    for amplitude in (1e-10, 1e-11) if near else (1e-9, 1e-10):
        options = {
            "motion": Pulse(amplitude * size, 1e5),
            "direction": direction,
            "source": source_object,
        }
        options |= {"particles": True, "interval": 1e-6}
        pair = [
            modal.propagate(sample, 2.5e-5, **options, **method).signals
            for method in ({"nonlinear": True, "time_step": time_step}, {"pre_stress": "full"})
        ]
        names = ["layer_displacement"] * (packing != "pillar") + ["receiver_stress"] * walls
        names += ["source_stress"] * (source != "point")
        relative_differences = [off(*(getattr(wave, name) for wave in pair)) for name in names]
        relative_differences.append(off(*(wave.particle_displacement[:, bearing] for wave in pair)))
        differences.append(relative_differences)
    assert (np.array(differences[0]) < 2e-2).all()
    # What is left of a tenth is the error of the time step, 2e-5 of these waves.
    assert (np.array(differences[1]) < 0.12 * np.array(differences[0]) + 5e-5).all()


@pytest.mark.parametrize(
    ("packing", "source"),
    [
        *(("rested", source) for source in ("wall z", "wall y", "step z", "step y")),
        *(("endless", source) for source in ("plane z", "plane x", "point z", "point torsion")),
        *(("pillar", source) for source in ("wall torsion", "plane torsion")),
    ],
)
def test_energy_adds_up_where_contacts_slide_and_open(request, packing, source):
    """Check the balance of energy of waves of a third of an overlap.

    There are packings with and without walls, a wall that stays displaced, and torsion. The energy
    of slip is compared contact by contact, with those that the wave has closed, to the round-off of
    a sum of thousands.
    """
    (kind, direction) = source.split()
    sample = request.getfixturevalue(packing)
    network = sample.network()
    size = 2.5e-7
    if kind == "point":
        size *= 20 * network.stiffness_normal.mean() * (RADIUS if direction == "torsion" else 1)
    elif direction == "torsion":
        size /= 2 * RADIUS
    source_object = {"plane": Plane(sample.walls.mean() + 1e-4), "point": Point(70)}.get(
        kind, Wall()
    )
    motion = step(size, 1e-5) if kind == "step" else Pulse(size, 1e5)
    wave = modal.propagate(
        sample, 1e-4 if packing == "rested" else 5e-5, nonlinear=True, motion=motion,
        direction=direction, time_step=2e-8 if packing != "rested" else 4e-8, source=source_object,
    )  # fmt: skip
    work, kinetic, stored, dissipated = wave.energy.T
    assert abs(kinetic + stored + dissipated - work).max() < 1e-3 * abs(work).max()
    assert (np.diff(dissipated) >= 0).all()
    assert dissipated[-1] > 1e-3 * work.max()
    ends = wave.signals.slip_ends
    energy = wave.signals.slip_energy
    assert energy.sum() == pytest.approx(dissipated[-1], rel=1e-12, abs=0)
    if packing != "rested":
        return
    assert (wave.dissipated > 0).sum() > 20
    assert dissipated[-1] > 0.05 * work.max()
    assert wave.opened.any() or direction == "y"
    # Those of the start are the network's, one by one; the wave has closed the others.
    pairs = zip(network.particle_i, network.particle_j, strict=True)
    number = {pair: c for c, pair in enumerate(pairs)}
    of_start = np.zeros(network.n_contacts)
    for pair, dissipated_there in zip(map(tuple, ends), energy, strict=True):
        if pair in number:
            of_start[number[pair]] += dissipated_there
    assert np.allclose(of_start, wave.dissipated, rtol=1e-12, atol=0)
    assert 0.95 * dissipated[-1] < wave.dissipated.sum() < dissipated[-1]


def test_crystal_one_sphere_wide_is_the_wider_one():
    """Compare spheres that touch their own images with a wider crystal.

    The difference from the linear wave is that of the contact law.
    """
    waves = []
    for wide in (1, 2):
        crystal = gallery.fcc(cells=(wide, wide, 12))
        options = {"motion": Pulse(1e-10, 1e5), "interval": 1e-6}
        wave = modal.propagate(
            crystal, 4e-5, nonlinear=True, friction=0.3, time_step=2e-8, **options
        ).signals
        linear = modal.propagate(crystal, 4e-5, pre_stress="full", **options).signals
        assert off(wave.chain_displacement, linear.chain_displacement) < 3e-4
        waves.append(wave.receiver_stress)
    assert off(*waves) < 1e-7


def test_energy_of_a_tiny_wave_adds_up(rested):
    """Check the balance of a wave of 1e-5 of an overlap.

    Its energy is 1e-10 of what contacts store at rest, which is rounded at 1e-16. Positions are
    rounded in each step; slip follows from velocities and is not affected. If the rounding
    accumulated, the carried shear forces would seem to do work: 3e-2 here.
    """
    options = {"motion": Pulse(1e-11, 1e5), "time_step": 2e-8}
    balance = modal.propagate(rested, 5e-5, nonlinear=True, **options).signals.balance
    assert abs(balance.gap) < 5e-3


def test_command_writes_the_file_of_the_linear_wave(rested, tmp_path, printed, one_line):
    sample = str(tmp_path / "rested.sample.h5")
    product = str(tmp_path / "wave.signals.h5")
    write_sample(sample, rested)
    words = f"wave {sample} --nonlinear --amplitude 1e-8 --duration 5e-5 --direction x -o {product}"
    words += f" --plane {rested.walls.mean()} --interval 1e-6"
    output = printed(*words.split())
    signals = read_signals(product, of_any_source=True)
    assert signals.direction == "x"
    assert signals.source.startswith("plane")
    assert len(signals.time) == output["times"] == 51
    assert signals.balance.closes
    assert abs(output["energy_gap"]) < 1e-3
    assert output["time_step_error"] < 1e-3
    # Held by friction nothing slides; what slip takes is over what the source gave in all.
    slip = output["contacts_slid"], output["dissipated_share"]
    output = printed(*words.split(), "--friction", 1e9)
    assert output["contacts_slid"] == output["dissipated_share"] == 0 < slip[0]
    energy = signals.balance.work
    assert slip[1] == pytest.approx(signals.slip_energy.sum() / energy, rel=1e-9)
    one_line(main, ["wave", sample, "--nonlinear", "--friction", 0], code="friction")


def refuse_wave(code, sample, **options):
    with refusal(code):
        modal.propagate(sample, 1e-5, **options)


def test_sample_in_motion_is_refused(rested):
    moving = replace(rested, velocity=np.ones_like(rested.position))
    refuse_wave("in_motion", moving, nonlinear=True)


def test_network_without_friction_is_refused(column):
    refuse_wave("no_friction", column, nonlinear=True)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"friction": 0.0}, "friction"),
        ({"time_step": 1e-5}, "time_step"),
        ({"pre_stress": "full"}, "option_of_other_wave"),
        ({"direction": "torsion"}, "torsion_of_periods"),
    ],
    ids=["friction", "time step", "pre-stress", "torsion"],
)
def test_option_that_a_nonlinear_wave_cannot_have_is_refused(rested, options, code):
    refuse_wave(code, rested, nonlinear=True, **options)


def test_period_along_z_is_not_turned(endless):
    pillar_without_walls = replace(endless, periodic_sides=(False, False), shear=None)
    plane = Plane(endless.walls.mean())
    refuse_wave(
        "torsion_of_periods",
        pillar_without_walls,
        nonlinear=True,
        direction="torsion",
        source=plane,
    )


def test_cell_without_walls_has_no_source_wall(endless):
    refuse_wave("no_source_wall", endless, nonlinear=True)


def test_linear_wave_takes_no_friction(column):
    refuse_wave("option_of_other_wave", column, friction=0.3)


def test_loop_and_arrays_turn_alike(pillar, monkeypatch):
    """Compare the compiled loop with arrays for a wall and a plane that turn, with slip."""
    for source in (Wall(), Plane(pillar.walls.mean() + 1e-4)):
        options = {"motion": Pulse(1e-4, 1e5), "direction": "torsion", "time_step": 5e-8}
        waves = []
        for compute in (forces_by_loop, forces_by_arrays):
            monkeypatch.setattr(contacts, "forces_by_loop", compute)
            waves.append(modal.propagate(pillar, 2e-5, nonlinear=True, source=source, **options))
        loop, arrays = (wave.signals for wave in waves)
        assert waves[0].dissipated.any()
        # Each step rounds the positions, 1e-16 of 1e-2 m, over motions of 1e-7 m.
        for name in ("source_stress", "receiver_stress", "chain_displacement"):
            assert off(getattr(loop, name), getattr(arrays, name)) < 1e-8, name


def test_a_turning_wall_with_shear_feels_differences_of_the_law(rested):
    """Compare forces on spheres and torque on a turning wall with differences of the law.

    The wall turns, or the spheres move at random. Central differences by 1e-7 rad and 1e-10 m leave
    rounding alone: of forces of 1 N, 1e-9 and 1e-6 of the change. Without the shear forces at the
    wall both would be off by 2e-5 and 8e-5.
    """
    network = rested.network()
    sample = replace(rested, friction=1e3)
    assert abs(network.force_tangential[network.particle_j == SOURCE_WALL]).max() > 0.1
    u = np.random.default_rng(1).standard_normal((network.n_particles, 6))
    u[:, 3:] /= RADIUS

    def forces(angle, size):
        moving = Dynamics(sample)
        moving.axis = network.cell_size[:2] / 2
        moving.velocity[:] = size * u
        moving.contacts.position += size * u[:, :3]
        moving.place_source(angle * np.eye(6)[TURN])
        moving.find_forces(1.0)
        return np.append(moving.contacts.load, moving.holding_load()[TURN])

    wall = put_on(network, terms_of("full"), WallMoves(SOURCE_WALL, TURN))
    by_turn = (forces(1e-7, 0) - forces(-1e-7, 0)) / 2e-7
    push = wall.push.toarray()[:, 0]
    assert by_turn[:-1] == pytest.approx(push, abs=1e-9 * abs(push).max())
    assert by_turn[-1] == pytest.approx(wall.held[0, 0], rel=1e-9)
    by_motion = (forces(0, 1e-10) - forces(0, -1e-10)) / 2e-10
    assert by_motion[-1] == pytest.approx(-(wall.pull.T @ u.ravel())[0], rel=1e-6)
