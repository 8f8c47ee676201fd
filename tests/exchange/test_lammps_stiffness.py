"""Imported packings against LAMMPS itself: its stresses, and finite differences of its forces.

The stiffness matrix with the terms of each law, against LAMMPS' forces after one sphere has moved
or turned by 1e-10 m (an arc of 1e-10 m), to both sides. A step of 1e-10 m against overlaps of 1e-5
m and more leaves an error of some 1e-10 of its square, and round-off 1e-16 of forces of some 10 N
against changes of 1e-3 N: 1e-12.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import packings
import pytest
from lammps_runs import (
    LAWS,
    import_written,
    make_script,
    move_commands,
    needs_lammps,
    read_stiffness,
    run_lammps,
    write_data,
)
from program_files import misfit

from modal.cli.importing import summary_of
from modal.packing.state import stress_tensor, volume_between_walls
from modal.system.contacts import TANGENTS

pytestmark = needs_lammps


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("periodic_z", [True, False])
def test_stress_and_stiffness_are_those_of_lammps(tmp_path, law, periodic_z):
    """Compare spheres of radii 1:3, glass and steel, in 3 periods or between walls."""
    packing = packings.polydisperse(periodic_z, n=60)
    write_data(packing, tmp_path / "start.data")
    spheres = np.arange(0, 60, 6)
    if not periodic_z:
        spheres[:4] = packing.particle_i[packing.with_wall][[0, 1, -2, -1]]
    run_lammps(tmp_path, make_script(packing, law) + move_commands(spheres))
    result = import_written(tmp_path)
    network = result.network
    summary = summary_of(result)
    assert not any("are taken" in remark for remark in summary["remarks"])
    # LAMMPS leaves the walls out of its stress, divides by the volume of its box, writes 17 digits
    # and sums some hundred contacts. Without its walls' contacts the packing has free surfaces,
    # and `stress_tensor` divides by what it fills.
    log = (tmp_path / "log.lammps").read_text()
    printed = re.findall(r"Pzz *\n *\d+ +(\S+) +(\S+) +(\S+)", log)
    pairs = network.some(~network.with_wall)
    box = float(network.cell_size.prod())
    alone = np.diag(stress_tensor(pairs)) * volume_between_walls(pairs) / box
    expected = [row for row in np.array(printed, float) if np.allclose(alone, row, rtol=1e-12)]
    assert expected

    friction = np.array([law_of_pair.friction for law_of_pair in result.laws])
    limit = friction[result.law] * network.force_normal
    near = np.linalg.norm(network.force_tangential, axis=1) > 0.9 * limit
    ends = np.concatenate([network.particle_i[near], network.partner[near]])
    rows = [k for k, sphere in enumerate(spheres) if sphere not in ends]
    assert len(rows) >= 3
    columns = np.concatenate([6 * k + np.arange(6) for k in rows])
    expected = read_stiffness(tmp_path / "forces", spheres)[:, columns]
    rows_of_k = np.concatenate([6 * spheres[k] + np.arange(6) for k in rows])

    error = misfit(network, expected, rows_of_k, TANGENTS["law"])
    assert error < 1e-4
    for name in ("stiffness_rolling", "stiffness_twisting"):
        stiffness = getattr(network, name)
        assert (stiffness is None) == ("rolling" not in LAWS[law][1])
        if stiffness is not None:  # and each of these, which may not be off by a hundredth
            stiffer = replace(network, **{name: 1.01 * stiffness})
            assert misfit(stiffer, expected, rows_of_k, TANGENTS["law"]) > 2 * error, name
    # Each term of this law counts: without it the error is larger.
    for term in summary["terms_of_the_law_over_springs"]:
        remaining = tuple(kind for kind in TANGENTS["law"] if kind != term)
        assert misfit(network, expected, rows_of_k, remaining) > 2 * error, term
