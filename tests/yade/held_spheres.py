"""Scenes whose spheres do not all move freely; run inside YADE.

    yade -n -x -j1 held_spheres.py ROOT CODES.json

writes the held motions of each scene, as letters, or the code with which it is refused.

    yade -n -x -j1 held_spheres.py ROOT OUT.network.h5 [ends]

exports a scene that is refused, or with "ends" a column between two fixed spheres, as a script of a
user does.
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, sys.argv[1])

from yade import O, wrapper
from yade.utils import sphere, wall

from modal.tools.errors import InputError
from yade_scripts.export import network_of_scene
from yade_scripts.export_scene import export_scene

RADIUS = 1e-3
NEWTON = {"damping": 0}


def column(count=4, **newton):
    """Return spheres on each other along z, none held, with their contacts."""
    O.reset()
    O.materials.append(wrapper.FrictMat(young=1e8, poisson=0.3, density=2600, frictionAngle=0.5))
    for k in range(count):
        O.bodies.append(sphere((0, 0, 1.999 * RADIUS * k), RADIUS))
    O.engines = [
        wrapper.ForceResetter(),
        wrapper.InsertionSortCollider([wrapper.Bo1_Sphere_Aabb(), wrapper.Bo1_Wall_Aabb()]),
        wrapper.InteractionLoop(
            [wrapper.Ig2_Sphere_Sphere_ScGeom(), wrapper.Ig2_Wall_Sphere_ScGeom()],
            [wrapper.Ip2_FrictMat_FrictMat_FrictPhys()],
            [wrapper.Law2_ScGeom_FrictPhys_CundallStrack()],
        ),
        wrapper.NewtonIntegrator(**NEWTON, **newton),
    ]
    O.dt = 1e-15


def fixed():
    O.bodies[0].state.blockedDOFs = "xyzXYZ"


def not_dynamic():
    O.bodies[3].dynamic = False


def without_turns():
    for body in O.bodies:
        body.state.blockedDOFs = "XYZ"


def one_motion():
    O.bodies[2].state.blockedDOFs = "y"


def held_clump():
    number = O.bodies.clump([0, 1])
    O.bodies[number].state.blockedDOFs = "xyzXYZ"


def half_held_clump():
    number = O.bodies.clump([0, 1])
    O.bodies[number].state.blockedDOFs = "z"


def free_clump_of_a_fixed_sphere():
    """Return a clump that YADE moves, though a member of it is held."""
    O.bodies[0].state.blockedDOFs = "xyzXYZ"
    number = O.bodies.clump([0, 1])
    O.bodies[number].state.blockedDOFs = ""


def moved():
    O.engines += [wrapper.TranslationEngine(ids=[0], velocity=0, translationAxis=(0, 0, 1))]


def moved_and_blocked():
    fixed()
    moved()


def moved_no_more():
    O.engines += [
        wrapper.TranslationEngine(ids=[0], velocity=0, translationAxis=(0, 0, 1), dead=True)
    ]


def turned_in_a_group():
    engine = wrapper.RotationEngine(angularVelocity=0)
    O.engines += [wrapper.CombinedKinematicEngine(ids=[3]) + engine]


def strained():
    O.engines += [wrapper.UniaxialStrainer(posIds=[3], negIds=[0])]


def outside_the_mask():
    O.engines[-1].mask = 2
    for body in O.bodies:
        body.groupMask = 3
    O.bodies[1].groupMask = 1


def on_a_wall():
    """Return a scene with a Wall that does not move, which is what a network's wall is."""
    O.bodies.append(wall((0, 0, -0.999 * RADIUS), axis=2))


SCENES = (
    *(fixed, not_dynamic, without_turns, one_motion, held_clump, half_held_clump),
    *(free_clump_of_a_fixed_sphere, moved, moved_and_blocked, moved_no_more, turned_in_a_group),
    *(strained, outside_the_mask, on_a_wall),
)


def held_in(change):
    """Return the held motions of the bodies of a scene, or the code with which it is refused."""
    column()
    change()
    engines = O.engines
    O.engines = engines[:4]  # nothing else moves them while contacts are found
    O.step()
    O.engines = engines
    try:
        network = network_of_scene()
    except InputError as error:
        return error.code
    words = []
    for free in network.free_motions:
        letters = [letter for letter, is_free in zip("xyzXYZ", free, strict=True) if not is_free]
        words.append("".join(letters) or "-")
    return " ".join(words)


OUT = Path(sys.argv[2])
if OUT.suffix == ".json":
    OUT.write_text(json.dumps({change.__name__: held_in(change) for change in SCENES}))
else:
    column()
    if sys.argv[3:] == ["ends"]:
        fixed()
        not_dynamic()
    else:
        moved()
    O.step()
    export_scene(OUT)
    print("went on")
