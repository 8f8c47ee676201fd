"""Networks of one or two spheres: every command gives an answer or one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import modal
from analysis.cli.main import main as analyse
from modal.cli.main import main
from modal.dem.contact_step import Geometry
from modal.dem.forces_by_arrays import forces_by_arrays
from modal.packing.network import Network, write_network
from modal.packing.sample import Sample, write_sample

RADIUS = 1e-3
LENGTH = 1.98e-3
"""Distance of two walls that a sphere overlaps by 1e-5 m each, m."""
WALLS = {"none": [5e-3, 9e-3], "lower": [0.0, 9e-3], "both": [0.0, LENGTH]}
"""Heights of the walls by those that the sphere touches, m."""


def make_sample(touches: str) -> Sample:
    """Return one sphere above, on, or between walls."""
    low, high = WALLS[touches]
    height = 0.5 * LENGTH
    if touches == "none":
        height = low + RADIUS * 2
    position = np.array([[2 * RADIUS, 2 * RADIUS, height]])
    return Sample(position, np.full(2, 8 * RADIUS), np.array([low, high]), 0.1, radius=RADIUS)


def make_two_spheres() -> Network:
    """Return two spheres that touch nothing, half a period apart."""
    network = make_sample("none").network()
    bodies = {name: np.repeat(data, 2, axis=0) for name, data in network.bodies().items()}
    bodies["position"][1, 0] += 4 * RADIUS
    return replace(network, **bodies)


@pytest.fixture(scope="module", params=["sample", "network"])
def kind(request) -> str:
    return request.param


@pytest.fixture(scope="module", params=WALLS)
def path(request, kind, tmp_path_factory) -> Path:
    """Return the file of one sphere, as a sample or as a network."""
    folder = tmp_path_factory.mktemp("sphere")
    sample = make_sample(request.param)
    path = folder / f"one.{kind}.h5"
    if kind == "sample":
        write_sample(path, sample)
    else:
        write_network(path, sample.network())
    return path


COMMANDS = [
    "info",
    "modes --all",
    "modes",
    "modes --highest 1",
    "modes --between 1 1e9",
    "modes --all --translations-only",
    "modes --all --pre-stress full",
    "modes --all --sliding slip",
    "count --at 1 1e9",
    "density",
    "wave --duration 1e-5",
    "moduli",
    "wave --duration 1e-5 --nonlinear",
    "wave --point 0",
    "response",
    "export -o x.vtu",
    "relax -o x.sample.h5",
    "tile --repeat 2 2 -o x.network.h5",
    "cement --cement 1e9 0.5 -o x.network.h5",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_command_of_one_sphere_gives_an_answer_or_one_line(
    command, path, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    verb, *options = command.split()
    status = main([verb, str(path), *options])
    printed = capsys.readouterr()
    assert status in (0, 2, 3)
    if status == 2:
        assert printed.err.splitlines()[-1].startswith("error: ")
        assert printed.out == ""


def test_one_sphere_is_measured(path, capsys):
    assert analyse(["measure", str(path), "--quick"]) in (0, 3)


def test_free_sphere_has_six_motions_without_energy():
    modes = modal.eigenmodes(make_sample("none").network(), all=True)
    assert modes.frequency.tolist() == [0.0] * 6
    assert modes.floppy_modes == 6


@pytest.mark.parametrize(("touches", "walls"), [("lower", 1), ("both", 2)])
def test_motions_of_one_sphere_at_walls(touches, walls):
    """Compare with a spring along z at each wall and, at an arm, one along x and y.

    A spring at an arm couples displacements along x and y with rotations about y and x; two
    opposite walls do not.
    """
    network = make_sample(touches).network()
    kn = network.stiffness_normal.sum()
    kt = network.stiffness_tangential.sum()
    mass = network.mass[0]
    arm = (RADIUS + 0.5 * LENGTH) / 2  # to the middle of the overlap
    coupling = kt * arm * (2 - walls)
    stiffness = np.array([[kt, coupling], [coupling, kt * arm**2]])
    root = np.sqrt(np.array([mass, network.inertia[0]]))
    lateral = np.linalg.eigvalsh(stiffness / np.outer(root, root)).clip(0)
    exact = np.sort(np.sqrt([kn / mass, 0, *lateral, *lateral])) / (2 * np.pi)
    modes = modal.eigenmodes(network, all=True)
    assert modes.frequency == pytest.approx(exact, rel=1e-9, abs=1e-6 * exact[-1])
    assert modes.floppy_modes == (exact < 1e-6 * exact[-1]).sum()


@pytest.mark.parametrize("pre_stress", ["none", "normal", "full"])
def test_two_spheres_that_touch_nothing_have_twelve_motions(pre_stress):
    modes = modal.eigenmodes(make_two_spheres(), all=True, pre_stress=pre_stress)
    assert len(modes.frequency) == modes.floppy_modes == 12


def test_forces_on_one_sphere_between_walls_by_arrays():
    """Find equal forces of both walls from the computation that serves without numba."""
    packing = make_sample("both")
    network = packing.network()
    load = np.zeros((1, 6))
    geometry = Geometry(
        position=network.position,
        ends=np.array([[0, -1], [0, -2]]),
        shift=np.zeros((2, 3), np.int8),
        cell=np.array([*packing.lengths, 0.0, 0.0]),
        walls=packing.walls,
        radius=network.radius,
    )
    sums = forces_by_arrays(None, geometry, packing.laws, None, load, np.zeros(0))
    assert sums.normal_force == pytest.approx(network.force_normal.sum(), rel=1e-9)
    assert abs(load).max() < 1e-9 * sums.normal_force
