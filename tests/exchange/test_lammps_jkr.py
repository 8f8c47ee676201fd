"""Contacts of `granular jkr` against LAMMPS itself: forces while spheres part, and across gaps."""

from __future__ import annotations

import numpy as np
import packings
import pytest
from lammps_runs import import_written, make_script, needs_lammps, run_lammps, write_data
from refusals import refusal

from modal.exchange.registry import import_packing
from modal.packing.contact_law import Material
from modal.packing.contact_models import laws_of

pytestmark = needs_lammps

PULLED = """units si
atom_style sphere
boundary f f f
newton off
comm_modify vel yes
region box block -0.01 0.01 -0.01 0.01 -0.01 0.01
create_box 1 box
create_atoms 1 single 0 0 0
create_atoms 1 single 0.001998 0 0
set group all diameter 0.002
set group all density 2500
pair_style granular
pair_coeff * * jkr 1e9 0 0.2 0.5 tangential mindlin NULL 0 0.3
group mover id 2
timestep 1e-7
fix move mover move linear 0.1 0.05 0
fix hold all nve/noforce
neigh_modify every 1 delay 0 check no
compute ends all property/local patom1 patom2 cutoff type
compute forces all pair/local dist force p1 p2 p3 p4 cutoff type
dump pull all local 1 pull index c_forces[1] c_forces[2] c_forces[6]
dump_modify pull format float %.17g
run 300
"""
"""Two spheres of 1 mm that are drawn apart, obliquely, 10 nm a step."""


def test_jkr_and_its_friction_are_those_of_lammps_up_to_the_largest_pull(tmp_path):
    """Compare forces at each step; LAMMPS breaks where ours goes on to the longest gap."""
    run_lammps(tmp_path, PULLED)
    frames = (tmp_path / "pull").read_text().split("c_forces[6]")[1:]
    rows = [frame.split()[:4] for frame in frames if frame.split()[:1] == ["1"]]
    table = np.array(rows, float)[:, 1:]
    distance, force, shear = table[table[:, 1] != 0].T
    radius = 0.5e-3
    law, _ = laws_of(Material(1e9, 0.2, 2500, "jkr 1"))
    overlap = 2e-3 - distance
    pull = 1.5 * np.pi * radius
    # Round-off of positions of 2 mm, 4e-19 m, times stiffnesses of 4e4 N/m.
    np.testing.assert_allclose(force, law.normal_force(overlap, radius), rtol=0, atol=1e-13)
    limit = 0.3 * law.friction_force(overlap, radius)
    assert (shear <= limit * (1 + 1e-9)).all()
    # The radius at touch L has the cube 2 pi w R*^2 / E*; y^3 = 3/4 at the largest pull.
    largest = np.cbrt(2 * np.pi * radius**2 / law.effective_young) ** 2 / radius
    overlap_of_pull = largest * (0.75 ** (4 / 3) - 0.75 ** (1 / 3))
    step = 1e-8
    assert overlap_of_pull <= overlap.min() < overlap_of_pull + 2 * step
    assert force.min() == pytest.approx(-pull, rel=1e-3)
    assert law.rupture_distance(radius) > -2 * overlap_of_pull
    sliding = shear > limit * (1 - 1e-9)
    assert sliding.sum() > 50
    assert (force[sliding] < 0).any()


def test_jkr_contacts_across_gaps_are_read_or_refused(tmp_path):
    """Compare the forces that LAMMPS has written with those of the law at the overlaps."""
    packing = packings.polydisperse(True, n=60)
    write_data(packing, tmp_path / "start.data")
    run_lammps(tmp_path, make_script(packing, "jkr"))
    network = import_written(tmp_path).network
    assert (network.overlap < 0).any()
    assert (network.stiffness_normal > 0).all()
    sticky = Material(6e10, 0.2, 2500, "jkr 600")
    law, _ = laws_of(sticky)
    radii = network.radius[network.particle_i], network.radius[network.particle_j]
    expected = law.normal_force(network.overlap, radii[0] * radii[1] / sum(radii))
    # Round-off of positions of some mm, 1e-18 m, times stiffnesses of 1e7 N/m.
    np.testing.assert_allclose(network.force_normal, expected, rtol=0, atol=1e-10)
    with refusal("contacts_across_gaps"):
        import_packing(tmp_path / "mine.atoms", log=tmp_path / "log.lammps")
    log = tmp_path / "log.lammps"
    log.write_text(log.read_text().replace("cutoff type", "cutoff radius"))
    with refusal("contacts_across_gaps"):
        import_written(tmp_path)
