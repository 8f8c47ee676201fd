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

RADIUS, LENGTH = 1e-3, 1.98e-3
WALL = {"none": [5e-3, 9e-3], "lower": [0.0, 9e-3], "both": [0.0, LENGTH]}
"""Where the walls are, of a sphere that touches so many of them."""


def sample(touches: str) -> Sample:
    """One sphere, above, on, or between walls that it overlaps by 1e-5 m each."""
    low, high = WALL[touches]
    height = low + RADIUS * 2 if touches == "none" else 0.5 * LENGTH
    place = np.array([[2 * RADIUS, 2 * RADIUS, height]])
    return Sample(place, np.full(2, 8 * RADIUS), np.array([low, high]), 0.1, radius=RADIUS)


def two_apart(touches: str) -> Network:
    """Two spheres that touch nothing, half a period apart: the cell repeats itself."""
    one = sample("none").network()
    twice = {name: np.repeat(data, 2, axis=0) for name, data in one.bodies().items()}
    twice["position"][1, 0] += 4 * RADIUS
    return replace(one, **twice)


def write(folder: Path, touches: str) -> list[Path]:
    """Its files: as a sample and as a network."""
    write_sample(folder / "one.sample.h5", sample(touches))
    write_network(folder / "one.network.h5", sample(touches).network())
    return [folder / "one.sample.h5", folder / "one.network.h5"]


COMMANDS = [
    *(["info"], ["modes", "--all"], ["modes"], ["modes", "--highest", "1"]),
    *(["modes", "--between", "1", "1e9"], ["modes", "--all", "--translations-only"]),
    *(["modes", "--all", "--pre-stress", "full"], ["modes", "--all", "--sliding", "slip"]),
    *(["count", "--at", "1", "1e9"], ["density"], ["wave", "--duration", "1e-5"], ["moduli"]),
    *(["wave", "--duration", "1e-5", "--nonlinear"], ["wave", "--point", "0"], ["response"]),
    *(["export", "-o", "x.vtu"], ["relax", "-o", "x.sample.h5"]),
    ["tile", "--repeat", "2", "2", "-o", "x.network.h5"],
]


@pytest.mark.parametrize("touches", WALL)
def test_every_command_of_one_sphere_gives_an_answer_or_one_line(
    touches, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    for path in write(tmp_path, touches):
        for command, *options in COMMANDS:
            status = main([command, str(path), *options])
            said = capsys.readouterr()
            assert status in (0, 2, 3), command
            if status == 2:
                assert said.err.splitlines()[-1].startswith("error: ") and not said.out, command
        assert analyse(["measure", str(path), "--quick"]) in (0, 3)
        capsys.readouterr()


def test_motions_of_one_sphere():
    """Free it has six without energy; each wall is a spring along z and, at an arm, one aside."""
    free = modal.eigenmodes(sample("none").network(), all=True)
    assert len(free.frequency) == free.floppy_modes == 6 and (free.frequency == 0).all()
    for touches, walls in (("lower", 1), ("both", 2)):
        network = sample(touches).network()
        kn, kt = network.stiffness_normal.sum(), network.stiffness_tangential.sum()
        mass, inertia = network.mass[0], network.inertia[0]
        arm = (RADIUS + 0.5 * LENGTH) / 2  # to the middle of the overlap
        # Along x and y, against turns about y and x: a wall's spring at an arm couples both; two
        # opposite walls do not.
        coupling = kt * arm * (2 - walls)
        stiffness = np.array([[kt, coupling], [coupling, kt * arm**2]])
        root = np.sqrt(np.array([mass, inertia]))
        aside = np.linalg.eigvalsh(stiffness / np.outer(root, root)).clip(0)
        exact = np.sort(np.sqrt([kn / mass, 0, *aside, *aside])) / (2 * np.pi)
        modes = modal.eigenmodes(network, all=True)
        assert modes.frequency == pytest.approx(exact, rel=1e-9, abs=1e-6 * exact[-1])
        assert modes.floppy_modes == (exact < 1e-6 * exact[-1]).sum()


@pytest.mark.parametrize("pre_stress", ["none", "normal", "full"])
def test_two_spheres_that_touch_nothing_have_twelve_motions(pre_stress):
    modes = modal.eigenmodes(two_apart("none"), all=True, pre_stress=pre_stress)
    assert len(modes.frequency) == modes.floppy_modes == 12


def test_forces_on_one_sphere_between_walls_by_arrays():
    """Both walls push it equally; the way without numba."""
    packing = sample("both")
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
