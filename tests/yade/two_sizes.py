"""A scene of two sizes between facets, or under a Wall, with the linear law; run inside YADE.

    yade -n -x -j1 two_sizes.py ROOT NETWORK.network.h5 K.h5 [KIND]

KIND is cohesive, pulled, clump, wall or save. Spheres are jostled so that contacts shear; then the
scene is exported, and its tangent measured.
"""

import random
import sys

sys.path.insert(0, sys.argv[1])

from yade import O, Quaternion, wrapper
from yade.utils import facet, sphere, wall

from yade_scripts.export_scene import export_scene
from yade_scripts.scene import finish
from yade_scripts.tangent import Tangent

KIND = (sys.argv[4:] or [""])[0]
glass = {"young": 1e9, "poisson": 0.4, "density": 2500, "frictionAngle": 0.5}
if KIND in ("cohesive", "pulled"):
    binder = {"normalCohesion": 1e12, "shearCohesion": 1e12, "momentRotationLaw": True}
    O.materials.append(wrapper.CohFrictMat(**glass, **binder, alphaKr=0.3, alphaKtw=0.7))
else:
    O.materials.append(wrapper.FrictMat(**glass))
# Two facets cover the floor; bodies before the spheres, so that ids are not indices.
# Their common edge lies between spheres: one that rests on an edge has a contact with each side.
corners = ((-9e-3, -1e-2, 0), (2.1e-2, -1e-2, 0), (2.1e-2, 2e-2, 0), (-9e-3, 2e-2, 0))
TOP = 0.98e-3 + 1.8e-3 + 1.28e-3


def plane(z):
    """Return two facets over all spheres."""
    a, b, c, d = ((x, y, z) for x, y, _ in corners)
    O.bodies.append([facet([a, b, c]), facet([a, c, d])])


plane(0)
small = 1e-3
large = 1.3e-3
for a in range(3):
    for b in range(3):
        O.bodies.append(sphere((1.97e-3 * a, 1.96e-3 * b, 0.98e-3), small))
for a in range(2):
    centre = (1.97e-3 * (a + 0.5), 1.96e-3 * (a + 0.5), 0.98e-3 + 1.8e-3)
    O.bodies.append(sphere(centre, large))
if KIND == "wall":
    O.bodies.append(wall((0, 0, TOP), axis=2))
else:
    plane(TOP)
O.engines = [
    wrapper.ForceResetter(),
    wrapper.InsertionSortCollider(
        [wrapper.Bo1_Sphere_Aabb(), wrapper.Bo1_Facet_Aabb(), wrapper.Bo1_Wall_Aabb()]
    ),
    wrapper.InteractionLoop(
        [
            wrapper.Ig2_Sphere_Sphere_ScGeom6D(avoidGranularRatcheting=False),
            wrapper.Ig2_Facet_Sphere_ScGeom6D(),
            wrapper.Ig2_Wall_Sphere_ScGeom(),
        ],
        [
            wrapper.Ip2_FrictMat_FrictMat_FrictPhys(),
            wrapper.Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(setCohesionNow=True),
        ],
        [
            wrapper.Law2_ScGeom_FrictPhys_CundallStrack(),
            wrapper.Law2_ScGeom6D_CohFrictPhys_CohesionMoment(),
        ],
    ),
    wrapper.NewtonIntegrator(damping=0.3, gravity=(0, 0, 0)),
]


def main():
    """Shake, export, and differentiate."""
    chance = random.Random(1)
    spheres = [body.id for body in O.bodies if hasattr(body.shape, "radius")]
    O.dt = 1e-8
    for body in spheres:
        state = O.bodies[body].state
        state.vel = [chance.gauss(0, 0.01) for _ in range(3)]
        state.angVel = [chance.gauss(0, 10) for _ in range(3)]
    O.run(300, wait=True)
    if KIND == "pulled":  # draw a corner sphere away from its neighbours by twice an overlap
        O.bodies[spheres[0]].state.vel = (-6e3, -6e3, 0)
        O.step()
    for body in spheres:
        state = O.bodies[body].state
        state.vel = state.angVel = (0, 0, 0)
        # Shear stays; moments, which follow from orientations, go: a network does not carry them.
        state.ori = Quaternion(1, 0, 0, 0)
    O.dt = 1e-15
    O.step()
    O.step()
    if KIND == "clump":
        export_scene(sys.argv[3])
        O.bodies.clump([spheres[0], spheres[9], spheres[10]])
    if KIND == "save":
        O.save(sys.argv[3])
    export_scene(sys.argv[2])
    if KIND in ("", "cohesive"):
        Tangent(spheres, small).write(sys.argv[3])


finish(main)
