"""A periodic packing of glass spheres of several sizes, compressed to 1 MPa; run inside YADE.

    yade -n -x -j1 triaxial.py

writes triaxial.network.h5 beside itself. From YADE's own example of a periodic triaxial test, with
the export at its end.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[2]))  # this repository

from yade import O, wrapper
from yade.pack import SpherePack

from yade_scripts.export_scene import export_scene

O.materials.append(wrapper.FrictMat(young=60e9, poisson=0.2, density=2230, frictionAngle=0.3))
O.periodic = True
O.cell.hSize = [[0.016, 0, 0], [0, 0.016, 0], [0, 0, 0.032]]
cloud = SpherePack()
cloud.makeCloud((0, 0, 0), (0.016, 0.016, 0.032), rMean=1e-3, rRelFuzz=0.3, num=250, seed=1)
cloud.toSimulation()
control = wrapper.PeriTriaxController(
    goal=(-1e6, -1e6, -1e6),
    stressMask=7,
    dynCell=True,
    maxStrainRate=(100, 100, 100),
    maxUnbalanced=1e-6,
    relStressTol=1e-4,
    doneHook="O.pause()",
)
O.engines = [
    wrapper.ForceResetter(),
    wrapper.InsertionSortCollider([wrapper.Bo1_Sphere_Aabb()]),
    wrapper.InteractionLoop(
        # With lever arms of an energy, which YADE's default does not have.
        [wrapper.Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False)],
        [wrapper.Ip2_FrictMat_FrictMat_MindlinPhys()],
        [wrapper.Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    control,
    wrapper.NewtonIntegrator(damping=0.3),
]
O.dt = 1e-7
O.run(1_000_000, wait=True)
print(f"stress {control.stress}, step {O.iter}")
export_scene(str(Path(sys.argv[0]).with_name("triaxial.network.h5")))
