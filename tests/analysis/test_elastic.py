"""V_P and V_S by moduli, modes and waves: on the crystal all three are Eq. 6's and its S-wave's."""

import numpy as np
import pytest

import modal
from analysis.__main__ import main
from analysis.estimators.shear_lattice import ShearLattice
from analysis.estimators.structure_factor import standing_waves
from analysis.packings.elastic import HEADER, row, standing_velocity, travelling_velocity
from modal.formats.hdf5 import InputError
from modal.packing.network_file import write_network
from modal.theory.fcc import FccLattice

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
