"""Build YADE scenes of spheres between flat walls in a laterally periodic cell."""

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
"""Half the thickness of the boxes that are walls, m; any size will do."""
TINY_TIME_STEP = 1e-15
"""Time step, s, in which nothing moves; a step of zero gives undefined displacements."""
CELL_MARGIN_RADII = 20
"""Length of the cell along z beyond the walls: long enough not to matter."""
MODULUS_FACTOR = math.sqrt(2)
"""Factor on the moduli of a contact with a wall. It makes up for the effective radius that YADE
uses for a box."""


def products_folder():
    """Return the folder of products: the environment variable WAVE_PRODUCTS, or products/."""
    return Path(os.environ.get("WAVE_PRODUCTS", ROOT / "products"))


def is_product_current(path, made, read):
    """Return whether a product is current; a stale or damaged file is renamed."""
    if is_current(path, made, read=read):
        print(f"{path}: already there")
        return True
    set_aside(path)
    return False


def compute_box_material(spheres, wall):
    """Return the material of a box that acts on `spheres` like a flat `wall` of another material.

    All materials are `Elasticity`; `wall` is None for a wall of the spheres' material. YADE gives a
    sphere on a box the effective radius R/2 of two spheres, where a flat wall has R. The contact
    therefore needs sqrt(2) times the moduli, 1/E* = (1 - nu^2)/E + (1 - nu'^2)/E', and G* likewise.
    For a wall of the spheres' material this is a box of E / (sqrt(2) - 1). A wall more than 1 +
    sqrt(2) times stiffer than the spheres needs a negative modulus, which is valid in this sum.
    """
    if wall is None:
        return Elasticity(spheres.young / (MODULUS_FACTOR - 1), spheres.poisson)
    equal_contact = spheres.moduli
    wall_contact = spheres.against(wall)
    plane_young = _compute_box_modulus(equal_contact[0], wall_contact[0])
    plane_shear = _compute_box_modulus(equal_contact[1], wall_contact[1])
    # plane_young = E / (1 - nu^2) and plane_shear = E / (2 (1 + nu) (2 - nu)), solved for nu.
    ratio = plane_young / plane_shear
    poisson = (ratio - 4) / (ratio - 2)
    return Elasticity(plane_young * (1 - poisson**2), poisson)


def _compute_box_modulus(equal_modulus, wall_modulus):
    """Return the Young's or shear modulus of a box, Pa.

    `equal_modulus` is the effective modulus of a contact of two spheres, `wall_modulus` that of a
    contact of a sphere with the wall.
    """
    # Twice the modulus of two equal bodies is what one of them adds to the sum of compliances.
    return 1 / (1 / (MODULUS_FACTOR * wall_modulus) - 1 / (2 * equal_modulus))


def place(
    position, side, walls, friction, radius=RADIUS, *, glass=GLASS, densities=None, wall=None
):
    """Add spheres, with ids 0 ... n - 1, and walls, with ids n (source) and n + 1 (receiver).

    Parameters
    ----------
    position : array (n, 3)
        Centres, m.
    side : sequence of 2 float
        Lateral size of the periodic cell, m.
    walls : sequence of 2 float
        z of the wall faces, m.
    friction : float
        Coefficient of friction.
    radius : float or array (n,)
        Radius of all spheres or of each, m.
    glass : Material
        Material of the spheres.
    densities : array (n,), optional
        Density of each sphere, kg/m^3, if it is not that of `glass`.
    wall : Elasticity, optional
        Material of the walls, if it is not `glass`.
    """
    count = len(position)
    box_material = compute_box_material(glass, wall)
    friction_angle = math.atan(friction)
    sphere_densities = np.broadcast_to(glass.density if densities is None else densities, count)
    sphere_materials = {}
    for density in np.unique(sphere_densities).tolist():
        sphere_materials[density] = FrictMat(
            density=density,
            young=glass.young,
            poisson=glass.poisson,
            frictionAngle=friction_angle,
        )
    wall_material = FrictMat(
        density=glass.density,
        young=box_material.young,
        poisson=box_material.poisson,
        frictionAngle=friction_angle,
    )
    O.materials.append([*sphere_materials.values(), wall_material])
    O.periodic = True
    height = walls[1] - walls[0] + CELL_MARGIN_RADII * RADIUS
    O.cell.hSize = [[side[0], 0, 0], [0, side[1], 0], [0, 0, height]]
    centres = np.asarray(position).tolist()
    radii = np.broadcast_to(radius, count).tolist()
    for centre, sphere_radius, density in zip(
        centres, radii, sphere_densities.tolist(), strict=True
    ):
        O.bodies.append(sphere(centre, sphere_radius, material=sphere_materials[density]))
    half = WALL_HALF_THICKNESS
    extents = (1.5 * side[0], 1.5 * side[1], half)
    for z in (walls[0] - half, walls[1] + half):
        centre = (side[0] / 2, side[1] / 2, z)
        O.bodies.append(box(centre, extents, fixed=True, material=wall_material))


def set_engines(*, margin=0.01, damping=0.0):
    """Set the engines of a scene with friction.

    The collider searches `margin` radii around each sphere; `damping` is the local damping.

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


def call_before_motion(action=None):
    """Let YADE call `action` between computing forces and moving spheres; None calls nothing.

    The action replaces an earlier one.

    It is called at every step, or at each `iterPeriod` of the engine "control". YADE searches the
    names of the main script for the functions that it calls.
    """
    __main__.before_motion = action
    engines = []
    for engine in O.engines:
        if not isinstance(engine, PyRunner | NewtonIntegrator):
            engines.append(engine)
    if action:
        engines.append(PyRunner(command="before_motion()", iterPeriod=1, label="control"))
    engines.append(O.labeledEngine("newton"))
    O.engines = engines


def find_contacts(expected=None):
    """Take two steps without motion, which find every contact.

    The second one lets a velocity gradient, if one was set, take effect. Raises InputError if there
    are not `expected` contacts.
    """
    O.dt = TINY_TIME_STEP
    O.step()
    O.step()
    count = O.interactions.countReal()
    if expected is not None and count != expected:
        raise InputError(
            "other_contacts", f"{count} contacts found in YADE, the packing has {expected}"
        )


def wall_faces(n):
    """Return z of the faces of source and receiver wall, m; n is the number of spheres."""
    half = WALL_HALF_THICKNESS
    return O.bodies[n].state.pos[2] + half, O.bodies[n + 1].state.pos[2] - half


def cell_side():
    """Return the lateral sides (2,), m, of the periodic cell."""
    return O.cell.hSize[0][0], O.cell.hSize[1][1]


def finish(main):
    """Run `main` and end the process: status 2 and one line for a user's mistake.

    Any other error is printed as a traceback, with status 1.
    """
    try:
        exit_at_refusal(main)
        status = 0
    except Exception:
        traceback.print_exc()
        status = 1
    _exit(status)


def exit_at_refusal(action):
    """Call `action`; end the process with one line and status 2 for a user's mistake."""
    try:
        action()
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        _exit(2)


def _exit(status):
    """End the process with a status, which YADE's own exit would turn into 0."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
