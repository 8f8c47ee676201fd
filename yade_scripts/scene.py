"""Spheres between flat walls in a laterally periodic cell, as a YADE scene."""

import math
import os
import sys
import traceback
from pathlib import Path

import numpy as np
from yade import O
from yade.utils import PyRunner, box, sphere
from yade.wrapper import (
    Bo1_Box_Aabb,
    Bo1_Sphere_Aabb,
    ForceResetter,
    FrictMat,
    Ig2_Box_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    NewtonIntegrator,
)

import __main__
from modal.formats.provenance import is_current, set_aside
from modal.packing.contact_law import GLASS, RADIUS, Elasticity
from modal.tools.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
WALL_HALF_THICKNESS = RADIUS
NO_TIME = 1e-15
"""A time step, s, in which nothing moves; a step of zero gives undefined displacements."""


def products_folder():
    """Folder of products: the environment variable WAVE_PRODUCTS, or products/."""
    return Path(os.environ.get("WAVE_PRODUCTS", ROOT / "products"))


def already_there(path, made, read):
    """Whether a product need not be made again; one that is stale or damaged is set aside."""
    if is_current(path, made, read=read):
        print(f"{path}: already there")
        return True
    set_aside(path)
    return False


def of_a_wall(spheres, wall):
    """What a box must be made of to resist `spheres` as a flat `wall` does; both `Elasticity`.

    YADE gives a sphere on a box the effective radius R/2 of two spheres, where a flat wall has R:
    the box takes part with sqrt(2) times the moduli, 1/E* = (1 - nu^2)/E + (1 - nu'^2)/E', and G*
    alike. Of the same material that is a box of E / (sqrt(2) - 1). A wall more than 1 + sqrt(2)
    times stiffer than the spheres takes a negative modulus, which is a number in that sum.
    """
    if wall is None:
        return Elasticity(spheres.young / (math.sqrt(2) - 1), spheres.poisson)
    ours, flat = spheres.moduli, spheres.against(wall)
    # Twice the moduli of two equal bodies is what one of them adds to the sum.
    young, shear = (
        1 / (1 / (math.sqrt(2) * there) - 1 / (2 * here))
        for here, there in zip(ours, flat, strict=True)
    )
    # young = E / (1 - nu^2) and shear = E / (2 (1 + nu) (2 - nu)), for E and nu.
    ratio = young / shear
    poisson = (ratio - 4) / (ratio - 2)
    return Elasticity(young * (1 - poisson**2), poisson)


def place(
    position, side, walls, friction, radius=RADIUS, *, glass=GLASS, densities=None, wall=None
):
    """Spheres of the study's glass, ids 0 ... n-1, and the walls, ids n (source) and n + 1.

    `position` (n, 3), `radius` of all or of each (n,), `side` (2,) of the periodic cell, `walls`
    (2,): z of the wall faces; m. `densities` (n,), kg/m^3, and the `wall` where they are not those
    of the `glass`.
    """
    box_material = of_a_wall(glass, wall)
    angle = {"frictionAngle": math.atan(friction)}
    elastic = {"young": glass.young, "poisson": glass.poisson} | angle
    each_density = np.broadcast_to(glass.density if densities is None else densities, len(position))
    solids = {rho: FrictMat(density=rho, **elastic) for rho in np.unique(each_density).tolist()}
    flat = FrictMat(
        young=box_material.young, poisson=box_material.poisson, density=glass.density, **angle
    )
    O.materials.append([*solids.values(), flat])
    O.periodic = True
    # Along z the cell only has to be too long to matter.
    height = walls[1] - walls[0] + 20 * RADIUS
    O.cell.hSize = [[side[0], 0, 0], [0, side[1], 0], [0, 0, height]]
    each = np.broadcast_to(radius, len(position)).tolist()
    columns = np.asarray(position).tolist(), each, each_density.tolist()
    for centre, size, rho in zip(*columns, strict=True):
        O.bodies.append(sphere(centre, size, material=solids[rho]))
    half = WALL_HALF_THICKNESS
    for z in (walls[0] - half, walls[1] + half):
        centre, extents = (side[0] / 2, side[1] / 2, z), (1.5 * side[0], 1.5 * side[1], half)
        O.bodies.append(box(centre, extents, fixed=True, material=flat))


def set_engines(*, margin=0.01, damping=0.0):
    """Engines of a scene with friction; the collider looks `margin` radii around each sphere.

    With walls that are boxes the collider's first sort must run along z, or it misses contacts.
    Lever arms are those of the law's torques (no "ratcheting" variant), so that energy is kept.
    """
    O.engines = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Box_Aabb()],
            allowBiggerThanPeriod=True,
            sortAxis=2,
            verletDist=margin * RADIUS,
            label="collider",
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False), Ig2_Box_Sphere_ScGeom()],
            [Ip2_FrictMat_FrictMat_MindlinPhys()],
            [Law2_ScGeom_MindlinPhys_Mindlin()],
            label="contacts",
        ),
        NewtonIntegrator(damping=damping, gravity=(0, 0, 0), label="newton"),
    ]


def before_motion(work=None):
    """Call `work`, in place of what was called there before, between forces and motion.

    At every step, or each `iterPeriod` of the engine "control". YADE looks for what it calls among
    the names of the main script.
    """
    __main__.before_motion = work
    runner = PyRunner(command="before_motion()", iterPeriod=1, label="control")
    O.engines = [
        *(engine for engine in O.engines if not isinstance(engine, PyRunner | NewtonIntegrator)),
        *([runner] if work else []),
        O.labeledEngine("newton"),
    ]


def find_contacts(expected=None):
    """Steps without motion that find every contact; InputError unless `expected` many.

    The second one lets a velocity gradient, if one was set, take effect.
    """
    O.dt = NO_TIME
    O.step()
    O.step()
    found = O.interactions.countReal()
    if expected is not None and found != expected:
        raise InputError("input", f"{found} contacts found in YADE, the packing has {expected}")


def wall_faces(n):
    """z of the faces of source and receiver wall, m; n is the number of spheres."""
    half = WALL_HALF_THICKNESS
    return O.bodies[n].state.pos[2] + half, O.bodies[n + 1].state.pos[2] - half


def cell_side():
    """Lateral size of the periodic cell, (2,), m."""
    return O.cell.hSize[0][0], O.cell.hSize[1][1]


def finish(main):
    """Run `main` and end the process with its status: 2 and one line for a user's mistake.

    Anything else that went wrong is told with its place, status 1.
    """
    try:
        refused_in_one_line(main)
        status = 0
    except Exception:
        traceback.print_exc()
        status = 1
    _end(status)


def refused_in_one_line(work):
    """Do `work`; end the process with one line and status 2 for a user's mistake."""
    try:
        work()
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        _end(2)


def _end(status):
    """End the process with a status, which YADE's own exit would turn into 0."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
