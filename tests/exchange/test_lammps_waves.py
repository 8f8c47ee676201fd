"""Waves in an imported packing against those of LAMMPS in the same spheres."""

from __future__ import annotations

import numpy as np
import packings
import pytest
from lammps_runs import (
    SMOOTH,
    WALLS,
    import_written,
    make_script,
    needs_lammps,
    run_lammps,
    write_data,
)
from oracles import stepped

from modal.packing.layers import Layers
from modal.waves.motions import read_motion

pytestmark = needs_lammps

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
    write_data(packing, tmp_path / "start.data", speed=0.1)
    low, high = packing.wall_position.tolist()
    wall = f"fix wall all wall/gran {SMOOTH} zplane"
    heights = {}
    for sways in (True, False):
        swaying = f"wiggle z {amplitude!r} {period!r}" if sways else ""
        script = make_script(packing, law).replace("run 200", REST).replace(WALLS[law], SMOOTH)
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
        run_lammps(tmp_path, script)
        frames = (tmp_path / "heights").read_text().split("id z")[1:]
        tables = (np.loadtxt(frame.split("ITEM")[0].splitlines()) for frame in frames)
        heights[sways] = np.array([table[:, 1] for table in tables])
    network = import_written(tmp_path).network
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
