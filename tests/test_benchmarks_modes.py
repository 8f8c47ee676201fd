"""Samples of other sizes that the benchmarks make, and their fitted exponents."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import modes_scaling
from benchmarks.modes_scaling import exponent, resized
from benchmarks.report import write
from modal import gallery
from modal.assembly import stiffness_matrix
from modal.network import validate


def test_lower_part_keeps_its_stiffness():
    """K of the part is the block of K of the whole without the contacts that were cut."""
    whole = gallery.fcc(2, 10)
    # The cut must also turn contacts whose first particle is above it.
    i, j, pair = whole.particle_i.copy(), whole.particle_j.copy(), ~whole.with_wall
    pair[::2] = False
    whole.particle_i[pair], whole.particle_j[pair] = j[pair], i[pair]
    whole.normal[pair] *= -1
    whole.lever_i[pair], whole.lever_j[pair] = whole.lever_j[pair], whole.lever_i[pair]
    whole.cell_shift[pair] *= -1
    part = resized(whole, 20)
    validate(part)
    kept = np.sort(np.argsort(whole.position[:, 2], kind="stable")[:20])
    rows = (6 * kept[:, None] + np.arange(6)).ravel()
    ends = np.isin(np.column_stack([whole.particle_i, whole.particle_j]), [*kept, -1, -2])
    wanted = stiffness_matrix(whole.with_contacts(ends.all(axis=1)))[rows][:, rows]
    assert abs(stiffness_matrix(part) - wanted).max() <= 1e-12 * abs(wanted).max()


def test_larger_samples_are_copies():
    assert resized(gallery.fcc(2, 10), 240).n_particles == 240


def test_exponents_are_those_of_power_laws():
    rows = [{"curve": "a", "x": x, "seconds": 1e-6 * x**1.5, "mb": None} for x in (10, 100, 1000)]
    assert exponent(rows, "seconds") == pytest.approx(1.5)
    assert exponent(rows, "mb") is None
    assert exponent(rows[:1], "seconds") is None


@pytest.mark.slow
def test_scaling_of_small_packings(tmp_path):
    """Every task gives its point; counts and certificates are those of the modes themselves."""
    finding = modes_scaling.run(True, tmp_path)
    assert all(row["seconds"] > 0 for row in finding.rows), finding.rows
    lowest = [row for row in finding.rows if row["curve"].startswith("lowest")]
    assert all(row["result"].startswith("certified") for row in lowest)
    over_modes = [row["x"] for row in lowest if "spheres" in row["curve"]]
    assert over_modes == list(modes_scaling.MODES[True])
    assert len(finding.notes) == len({row["curve"] for row in finding.rows})
    assert write(finding, "modes_scaling", tmp_path).startswith("## Modes")
    assert (tmp_path / "modes_scaling.png").stat().st_size > 0
