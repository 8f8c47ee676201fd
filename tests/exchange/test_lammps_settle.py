"""The packing that `examples/lammps/settle.lmp` makes: as asked for, at rest, and measurable."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from lammps_runs import INCLUDE, LAMMPS, needs_lammps

import analysis
import modal
import modal.__main__
from modal.packing.rattlers import force_bearing
from modal.packing.state import net_forces
from modal.packing.weight import noted_gravity

pytestmark = needs_lammps

SPHERES = 200
WIDTH = 6.4e-3
STRESS = 1e6


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the folder of a run, with the network that `import` writes."""
    folder = tmp_path_factory.mktemp("settle")
    for file in (INCLUDE, INCLUDE.with_name("settle.lmp")):
        shutil.copy(file, folder)
    values = {"spheres": SPHERES, "width": WIDTH, "stress": STRESS, "keep_gravity": "yes"}
    command = [LAMMPS, "-in", "settle.lmp", "-screen", "none"]
    for name, value in values.items():
        command += ["-var", name, str(value)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    log = folder / "log.lammps"
    assert done.returncode == 0, log.read_text()[-500:] + done.stderr
    assert "WARNING" not in log.read_text()
    options = [
        "--contacts",
        folder / "settled.contacts",
        "--log",
        log,
        "-o",
        folder / "x.network.h5",
    ]
    arguments = ["import", folder / "settled.atoms", *options]
    assert modal.__main__.main([str(word) for word in arguments]) == 0
    return folder


@pytest.fixture(scope="module")
def network(folder):
    return modal.read(folder / "x.network.h5")


def test_lid_has_the_stress_that_was_asked_for_and_printed(folder, network):
    """Compare the forces of the lid with LAMMPS' sum, and of the floor with lid and weight."""
    (printed,) = re.findall(
        r"^stress of the lid (\S+) Pa", (folder / "log.lammps").read_text(), re.M
    )
    area = WIDTH**2
    floor, lid = (
        network.force_normal[network.particle_j == wall].sum() / area for wall in (-1, -2)
    )
    assert network.n_particles == SPHERES
    # The files have 17 digits, and the wall forces of some tens of spheres are summed.
    assert lid == pytest.approx(float(printed), rel=1e-12)
    # The lid stops within 1e-3 of its stress, and the packing creeps on a little.
    assert lid == pytest.approx(STRESS, rel=3e-3)
    weight = 9.81 * network.mass.sum() / area
    assert floor == pytest.approx(lid + weight, rel=1e-3)


def test_each_sphere_is_in_balance(network):
    """Add the weight to the contact forces on each sphere: LAMMPS says how much may be left."""
    gravity = noted_gravity(network)
    np.testing.assert_array_equal(gravity, [0, 0, -9.81])
    net_force = net_forces(network)[:, :3] + network.mass[:, None] * gravity
    bearing = force_bearing(network)
    size = np.linalg.norm(net_force[bearing], axis=1)
    assert size.mean() < 2e-4 * network.force_normal.mean()
    assert size.max() < 1e-2 * network.force_normal.mean()


def test_velocity_of_the_wave_is_that_of_the_modes_and_of_the_moduli(network):
    """Compare with 2 L f of the modes in which the column sways as half a wave along z.

    Disorder spreads that motion over several modes: their mean of f^2, each with its share.
    """
    modes = modal.eigenmodes(network, lowest=40)
    low, high = network.wall_position
    length = high - low
    half_wave = np.zeros((network.n_particles, 6))
    half_wave[:, 2] = np.sin(np.pi * (network.position[:, 2] - low) / length)
    inertia = np.concatenate(
        [
            np.repeat(network.mass[:, None], 3, axis=1),
            np.repeat(network.inertia[:, None], 3, axis=1),
        ],
        axis=1,
    )
    product = np.einsum("kij,ij,ij->k", modes.mode_shape, inertia, half_wave)
    share = product**2 / np.einsum("kij,kij,ij->k", modes.mode_shape, modes.mode_shape, inertia)
    velocity = 2 * length * np.sqrt(share @ modes.frequency**2 / share.sum())
    v_p = analysis.measure(network, quantities=["v_p"])["v_p"]
    assert abs(v_p.value - velocity) < 2 * v_p.error
    moduli = modal.elastic_moduli(network)
    density = network.mass.sum() / (WIDTH**2 * length)
    assert np.sqrt(moduli.stiffness[2, 2] / density) == pytest.approx(velocity, rel=0.1)


def test_commands_of_the_page_answer(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    for command in (
        "info x.network.h5 --json",
        "modes x.network.h5 --lowest 10 -o x.modes.h5",
        "wave x.network.h5 --pre-stress law --duration 2e-5 -o x.signals.h5",
    ):
        capsys.readouterr()
        assert modal.__main__.main(command.split()) == 0
        if command.startswith("info"):
            state = json.loads(capsys.readouterr().out)
            assert state["stress_pa"][2] == pytest.approx(STRESS, rel=1e-2)
