"""Rigid bodies of `fix rigid` against LAMMPS itself: mass, inertia, and their stiffness."""

from __future__ import annotations

import numpy as np
import packings
from lammps_runs import (
    import_written,
    make_script,
    move_commands,
    needs_lammps,
    read_stiffness,
    run_lammps,
    write_data,
)
from program_files import misfit
from scipy.spatial.transform import Rotation

from modal.system.assembly import assembled
from modal.system.contacts import TANGENTS

pytestmark = needs_lammps

BODIES = """compute b all rigid/local r mol mass x y z quatw quati quatj quatk inertiax inertiay &
inertiaz
dump b all local 1 bodies c_b[*]
dump_modify b format float %.17g
run 0
"""


def test_rigid_bodies_are_those_of_lammps(tmp_path):
    """Compare fifteen dumbbells of touching spheres among thirty free ones, periodic.

    Mass, centre and tensor (moments and axes) as `fix rigid/small` has them; the stiffness from
    differences of LAMMPS' forces and torques after the members were moved one by one. What carried
    forces do is taken off these, as `test_lammps_stiffness` has it for spheres.
    """
    packing = packings.polydisperse(True, n=60)
    write_data(packing, tmp_path / "start.data")
    body = np.zeros(60, int)
    numbered = "fix mol all property/atom mol ghost yes\nset group all mol 0\n"
    for i, j, shift in zip(packing.particle_i, packing.partner, packing.cell_shift, strict=True):
        if body[i] == body[j] == 0 and body.max() < 15:
            body[[i, j]] = body.max() + 1
            numbered += f"set atom {j + 1} image {' '.join(map(str, shift))}\n"
    numbered += "".join(f"set atom {k + 1} mol {b}\n" for k, b in enumerate(body))
    numbered += "neigh_modify exclude molecule/intra all\n"
    script = make_script(packing, "hooke").replace("run 200", f"{numbered}run 0")
    script = script.replace("sphere\n", "sphere\natom_modify map array\n", 1)
    script = script.replace("vel yes", "vel yes cutoff 8e-3")
    clumps = "unfix nve\ngroup clumps molecule > 0\nfix r clumps rigid/small molecule\n"
    at_rest = script.replace("unfix nve\n", clumps)
    at_rest = at_rest.replace("include", "variable bodies string mol\ninclude")
    run_lammps(tmp_path, at_rest + BODIES)
    network = import_written(tmp_path).network
    number = np.unique(body)[1:]
    assert network.n_particles == 45
    theirs = np.loadtxt((tmp_path / "bodies").read_text().splitlines()[9:])
    theirs = theirs[np.argsort(theirs[:, 0])]
    first = [np.flatnonzero(body == b)[0] for b in number]
    places = np.searchsorted(np.sort(np.concatenate([first, np.flatnonzero(body == 0)])), first)
    axes = Rotation.from_quat(theirs[:, [6, 7, 8, 5]]).as_matrix()
    tensor = axes @ (theirs[:, 9:, None] * axes.transpose(0, 2, 1))
    difference = network.position[places] - theirs[:, 2:5]
    difference -= np.round(difference / packing.cell_size) * packing.cell_size
    np.testing.assert_allclose(network.mass[places], theirs[:, 1], rtol=1e-12)
    assert abs(difference).max() < 1e-15
    # LAMMPS turns its axes in steps that leave some 1e-8 of a moment.
    size = np.trace(tensor, axis1=1, axis2=2).min()
    np.testing.assert_allclose(network.inertia_tensor[places], tensor, rtol=0, atol=1e-7 * size)

    spheres = np.flatnonzero(np.isin(body, number[:5]))
    run_lammps(tmp_path, script + move_commands(spheres))
    alone = import_written(tmp_path).network
    columns = np.concatenate([6 * k + np.arange(6) for k in spheres])
    law = assembled(alone, TANGENTS["law"]).tocsr()[:, columns].toarray()
    springs = assembled(alone, ()).tocsr()[:, columns].toarray()
    measured = read_stiffness(tmp_path / "forces", spheres) - law + springs

    index = np.unique(np.where(body > 0, body, -1 - np.arange(60)), return_inverse=True)[1]
    index = np.argsort(np.argsort([np.flatnonzero(index == k)[0] for k in range(45)]))[index]
    period = packing.cell_size
    arm = alone.position - network.position[index]
    arm -= np.round(arm / period) * period
    J = np.zeros((360, 270))
    for k, (b, a) in enumerate(zip(index, arm, strict=True)):
        J[6 * k : 6 * k + 6, 6 * b : 6 * b + 6] = np.eye(6)
        J[6 * k : 6 * k + 3, 6 * b + 3 : 6 * b + 6] = np.cross(np.eye(3), a).T
    body_columns = np.concatenate([6 * b + np.arange(6) for b in np.unique(index[spheres])])
    expected = J.T @ measured @ J[np.ix_(columns, body_columns)]
    # Round-off of forces, as above: 1e-12 N over 1e-10 m of stiffnesses of 1e6 N/m.
    assert misfit(network, expected, body_columns) < 1e-7
