"""Make two small packings in YADE and write them by each of YADE's own writers.

    yade -n -x -j1 yade_vtk.py

in the folder of the files, with the project on PYTHONPATH. VTKExporter writes spheres and contacts
as text (.vtk), VTKRecorder in binary (.vtu, .vtp; the step was taken out of their names),
export_scene the network as YADE holds it.

sheared: 40 spheres of several sizes in a cell whose periods are at angles, about 1 MPa.
pyramid: 14 spheres under gravity on a wall; the lowest nine are fixed.
"""

import json
import os

from yade import O, export, pack, utils
from yade.wrapper import (
    Bo1_Sphere_Aabb,
    Bo1_Wall_Aabb,
    ForceResetter,
    FrictMat,
    Ig2_Sphere_Sphere_ScGeom,
    Ig2_Wall_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    NewtonIntegrator,
    VTKRecorder,
)

from yade_scripts.export_scene import export_scene

O.materials.append(FrictMat(young=1e9, poisson=0.2, frictionAngle=0.3, density=2500))
side = 0.016
O.periodic = True
O.cell.hSize = [[side, 0, 0], [0, side, 0], [0, 0, side]]
spheres = pack.SpherePack()
spheres.makeCloud(
    (0, 0, 0), (side, side, side), rMean=0.0015, rRelFuzz=0.2, num=40, periodic=True, seed=3
)
spheres.toSimulation()
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()]),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys()],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    NewtonIntegrator(damping=0.4),
]
O.dt = 0.3 * utils.RayleighWaveTimeStep()
# Compress, then shear, then rest.
O.cell.velGrad = [[-200, 0, 0], [0, -200, 0], [0, 0, -200]]
while -utils.getStress().trace() / 3 < 1e6:
    O.run(20, True)
O.cell.velGrad = [[0, 0, 200], [0, 0, 0], [0, 0, 0]]
start = O.time
while O.time - start < 0.1 / 200:
    O.run(20, True)
O.cell.velGrad = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]
O.run(40000, True)
export_scene("yade_sheared.network.h5")
with open("yade_sheared.json", "w") as file:
    json.dump({"stress": [list(row) for row in utils.getStress()]}, file)


def write_vtk(name):
    """Write the scene by both writers, with names of one kind."""
    exporter = export.VTKExporter(name)
    exporter.exportSpheres(what=dict(mass="b.state.mass"))
    exporter.exportInteractions(
        what=dict(kn="i.phys.kn", ks="i.phys.ks", forceN="i.phys.normalForce.norm()")
    )
    os.rename(f"{name}-spheres-00000000.vtk", f"{name}.spheres.vtk")
    os.rename(f"{name}-intrs-00000000.vtk", f"{name}.contacts.vtk")
    # Of YADE 2023.02a it may end the process once the two files are written.
    VTKRecorder(fileName=f"{name}-", recorders=["spheres", "intr", "mass"])()


write_vtk("yade_sheared")
engines = O.engines
O.reset()
O.periodic = False
O.materials.append(FrictMat(young=1e7, poisson=0.2, frictionAngle=0.6, density=2500))
O.bodies.append(utils.wall(0, axis=2))
RADIUS = 0.001
for side, height in ((3, 1.0), (2, 1 + 2**0.5), (1, 1 + 2 * 2**0.5)):
    for a in range(side):
        for b in range(side):
            centre = (
                RADIUS * (2 * a - side),
                RADIUS * (2 * b - side),
                0.9999 * RADIUS * height,
            )
            O.bodies.append(utils.sphere(centre, RADIUS, fixed=side == 3))
engines[1].boundDispatcher.functors = [Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]
engines[2].geomDispatcher.functors = [Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()]
engines[3].gravity = (0, 0, -9.81)
O.engines = engines
O.dt = 0.2 * utils.RayleighWaveTimeStep()
O.run(40000, True)
export_scene("yade_pyramid.network.h5")
write_vtk("yade_pyramid")
