"""What the comparison of two checkouts sees, and how far it lets chi_z of modes differ."""

from __future__ import annotations

import numpy as np
import pytest
import same_digits
from places import ROOT

import modal
from modal.modes.highest import highest_modes
from modal.modes.observables import chi_z, particle_motion
from modal.system.linear_system import LinearSystem, frequency_of


@pytest.fixture(scope="module")
def dense():
    """Problem of the sample that the script compares, its frequencies and its exact vectors."""
    system = LinearSystem.of(modal.read(ROOT / same_digits.SAMPLE))
    square, vector = np.linalg.eigh(system.scaled.toarray())
    return system, frequency_of(square), vector


def test_chi_z_of_lanczos_is_within_the_bound_of_its_residuals(dense):
    system, frequency, vector = dense
    modes = highest_modes(system, 5)
    mass = system.network.mass
    exact = chi_z(particle_motion(vector[:, -5:], system.root, 6))
    bound = same_digits.chi_z_bound(
        modes.frequency, modes.residual, modes.mode_shape, mass, frequency
    )
    assert (abs(modes.chi_z - exact) <= bound).all()
    assert bound.max() < 1e-3  # it says something


@pytest.mark.parametrize("size", [1e-12, 1e-9, 1e-6])
def test_bound_holds_for_whatever_a_vector_is_off_by(dense, size):
    """Off towards random vectors and towards the mode below, which hides best in the residual."""
    system, frequency, vector = dense
    matrix = system.scaled
    random = np.random.default_rng(1)
    for k in (-1, -3, -5):
        exact = vector[:, [k]]
        for aside in (random.standard_normal(exact.shape), vector[:, [k - 1]]):
            aside = aside - exact * (exact.T @ aside)
            off = exact + size * aside / np.linalg.norm(aside)
            off /= np.linalg.norm(off)
            square = (off.T @ (matrix @ off)).item()
            residual = np.linalg.norm(matrix @ off - square * off) / square
            shape = particle_motion(off, system.root, 6)
            bound = same_digits.chi_z_bound(
                frequency_of(np.array([square])),
                np.array([residual]),
                shape,
                system.network.mass,
                frequency,
            )
            moved = abs(chi_z(shape) - chi_z(particle_motion(exact, system.root, 6)))
            assert moved <= bound


def test_a_row_that_is_new_hides_no_other(tmp_path, capsys):
    """Cells are compared by the row's and the column's names, curves by panel and label."""
    table = 'quantity,"here"\n"V_P, m/s",776.4\n"e, wall to wall",0.35 ± 0.01\n'
    heads = '# {"picture": {}}\n# {"panel": {"ylabel": "f"}}\n# {"series": {"label": "YADE"}}\n'
    texts = {
        "before": {"table.csv": table, "figure.csv": heads + "panel,series,x,y,z\n0,0,1,2,\n"},
        "after": {
            "table.csv": table.replace("0.35", "0.36") + "new,1\n",
            "figure.csv": heads + "panel,series,x,y,z\n0,0,1,3,\n",
        },
    }
    for side, files in texts.items():
        (tmp_path / side).mkdir()
        for name, text in files.items():
            (tmp_path / side / name).write_text(text)
    before, after = tmp_path / "before", tmp_path / "after"
    assert same_digits.compare(before, before, ROOT)
    capsys.readouterr()
    assert not same_digits.compare(before, after, ROOT)
    said = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert said == [
        "figure.csv: 0.0e+00",
        "f | YADE: 3.3e-01",
        "table.csv: 0.0e+00",
        "e, wall to wall | here: 2.8e-02",
        "new | here: after alone",
    ]
