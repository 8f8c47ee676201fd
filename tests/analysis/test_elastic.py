"""V_P and V_S by moduli, modes and waves: on the crystal all three are Eq. 6's and its S-wave's."""

import numpy as np
import pytest
from shear_lattice import ShearLattice

import modal
from analysis.__main__ import main
from analysis.estimators.structure_factor import standing_waves
from analysis.packings.elastic import HEADER, row, standing_velocity, travelling_velocity
from modal.elasticity.waves import isotropic_mean
from modal.packing.network import write_network
from modal.theory.fcc import FccLattice
from modal.tools.errors import InputError

CRYSTAL = FccLattice(1e5)
SPEEDS = {"z": CRYSTAL.velocity, "x": ShearLattice.of_crystal(CRYSTAL).velocity}


@pytest.fixture(scope="module")
def crystal():
    return modal.fcc(cells=(1, 1, 200))


@pytest.mark.parametrize("direction", ["x", "z"])
def test_velocities_of_the_crystal(crystal, direction):
    """Standing waves in the length that static walls leave: each wall is a spring in the row.

    The wave: its rule is off by 1e-4 on exact signals.
    """
    moduli = modal.elastic_moduli(crystal)
    at = {"z": (2, 2), "x": (4, 4)}[direction]
    length = crystal.length * moduli.stiffness[at] / moduli.whole[at]
    wanted = SPEEDS[direction]
    # Lines are looked for to a twentieth of the resolution, some 1e-3 of the eighth order.
    assert standing_velocity(crystal, direction, wanted, length) == pytest.approx(wanted, rel=2e-3)
    assert travelling_velocity(crystal, direction, wanted) == pytest.approx(wanted, rel=5e-4)


def test_a_line_that_is_not_found_is_no_velocity(monkeypatch):
    """At a resolution that blurs all lines into one; least squares never see what is not found."""
    fitted = []
    monkeypatch.setattr("numpy.polyfit", lambda *arguments: fitted.append(arguments))
    short = modal.fcc(cells=(2, 2, 6))
    assert np.isnan(standing_velocity(short, "z", 1e4, short.length)) and not fitted


def test_a_packing_without_stiffness_is_refused_by_its_velocities(tmp_path):
    crystal, path = modal.fcc(cells=(2, 2, 6)), tmp_path / "soft.network.h5"
    few = np.random.default_rng(1).random(crystal.n_contacts) < 0.2
    write_network(path, crystal.with_contacts(few | (crystal.particle_j < 0)))
    with pytest.raises(InputError, match=r"soft\.network\.h5: P- and S-waves of .* leave it out"):
        row(path)


def test_a_row_and_the_command(tmp_path, capsys, crystal):
    path = tmp_path / "crystal.network.h5"
    write_network(path, crystal)
    assert main(["elastic", str(path), "-o", str(tmp_path / "table.md")]) == 0
    capsys.readouterr()
    head, _, cells = (tmp_path / "table.md").read_text().splitlines()
    found = dict(zip(head.strip("| ").split(" | "), cells.strip("| ").split(" | "), strict=True))
    assert tuple(found) == HEADER == HEADER[: len(row(path))]
    assert float(found["V_S moduli, m/s"]) == pytest.approx(SPEEDS["x"], rel=1e-4)
    assert float(found["V_P moduli, m/s"]) == pytest.approx(SPEEDS["z"], rel=1e-4)
    K, G = float(found["K, MPa"]), float(found["G, MPa"])
    assert found["G / K"] == f"{G / K:.4g}"
    with pytest.raises(InputError, match="choose x, y or z"):
        standing_waves(crystal, np.array([1]), "w")


def test_moduli_over_coordination_number_of_the_crystal(tmp_path, capsys):
    """Closed form: twelve contacts, 18 forces less 6 balances a sphere; sqrt(2) spheres a D^3."""
    cell, path = modal.fcc(cells=(2, 2, 4), periodic_z=True), tmp_path / "cell.network.h5"
    write_network(path, cell)
    assert main(["coordination", str(path)]) == 0
    head, _, cells = capsys.readouterr().out.splitlines()
    found = dict(zip(head.strip("| ").split(" | "), cells.strip("| ").split(" | "), strict=True))
    numbers = {name: float(value) for name, value in found.items() if name not in ("packing",)}
    assert numbers["Z of force-bearing"] == 12
    # Spheres overlap by 4e-4 of the diameter here: the lattice is that much closer, in each length.
    assert numbers["indeterminacy h D^3"] == pytest.approx(12 * np.sqrt(2), rel=2e-3)
    K, G = isotropic_mean(CRYSTAL.stiffness)
    scale = 2 * CRYSTAL.radius / CRYSTAL.kn
    assert numbers["K D / k"] == pytest.approx(K * scale, rel=1e-3)
    assert numbers["G D / k"] == pytest.approx(G * scale, rel=1e-3)
    # Every sphere is a centre of symmetry: none leaves the mean strain, Voigt's bound is reached.
    assert numbers["K over affine"] == pytest.approx(1, abs=1e-3)
    assert numbers["G over affine"] == pytest.approx(1, abs=1e-3)
