"""The FCC crystal between flat walls as a YADE scene; shared by the sample and the wave run."""

import math
from pathlib import Path

from yade import O
from yade.utils import box, sphere
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

from modal.hertz_mindlin import GLASS, RADIUS, overlap_of_force

ROOT = Path(__file__).resolve().parents[1]
WALL_HALF_THICKNESS = RADIUS


def place_fcc(width, layers, stress, friction):
    """Place the crystal with the overlaps that balance `stress` (Pa); returns a dict of its sizes.

    Sphere ids are 0 ... n-1, layer by layer; the source wall is n, the receiver wall n + 1. YADE
    gives a sphere on a box the effective radius R/2 of two spheres; the wall's Young's modulus
    E / (sqrt(2) - 1) turns that into the flat wall of the same material, for kn and ks alike.
    """
    if width < 3:
        raise ValueError(f"width {width}: YADE needs at least 3 spheres a side (single contacts)")
    overlap = 0.0
    for _ in range(100):
        spacing = 2 * RADIUS - overlap
        force = stress * spacing**2 / (2 * math.sqrt(2))
        overlap = float(overlap_of_force(force, RADIUS / 2, GLASS))
    spacing = 2 * RADIUS - overlap
    wall_overlap = float(overlap_of_force(stress * spacing**2, RADIUS, GLASS))
    rise = spacing / math.sqrt(2)
    z0 = RADIUS - wall_overlap
    length = 2 * z0 + (layers - 1) * rise
    side = width * spacing

    angle = math.atan(friction)
    glass = FrictMat(
        young=GLASS.young, poisson=GLASS.poisson, density=GLASS.density, frictionAngle=angle
    )
    flat = FrictMat(
        young=GLASS.young / (math.sqrt(2) - 1),
        poisson=GLASS.poisson,
        density=GLASS.density,
        frictionAngle=angle,
    )
    O.materials.append([glass, flat])
    O.periodic = True
    # Along z the cell only has to be too long to matter.
    O.cell.hSize = [[side, 0, 0], [0, side, 0], [0, 0, length + 20 * RADIUS]]
    for layer in range(layers):
        shift = 0.5 * (layer % 2)
        for b in range(width):
            for a in range(width):
                centre = ((a + shift) * spacing, (b + shift) * spacing, z0 + layer * rise)
                O.bodies.append(sphere(centre, RADIUS, material=glass))
    half = WALL_HALF_THICKNESS
    for z in (-half, length + half):
        centre, extents = (side / 2, side / 2, z), (1.5 * side, 1.5 * side, half)
        O.bodies.append(box(centre, extents, fixed=True, material=flat))
    return {
        "n": width * width * layers,
        "side": side,
        "length": length,
        "area": side * side,
        "layers": layers,
        "width": width,
    }


def find_contacts(sizes):
    """Engines of a frictional, undamped scene; one vanishing step that finds every contact.

    The collider is then put to sleep: over a wave nobody moves by a millionth of a radius.
    """
    # The bounds of a sphere must stay below half a period, also where three spheres fill it: only
    # a thin margin (verletDist) is added to them.
    collider = InsertionSortCollider(
        [Bo1_Sphere_Aabb(), Bo1_Box_Aabb()],
        allowBiggerThanPeriod=True,
        sortAxis=2,
        verletDist=0.01 * RADIUS,
    )
    O.engines = [
        ForceResetter(),
        collider,
        InteractionLoop(
            [
                Ig2_Sphere_Sphere_ScGeom(avoidGranularRatcheting=False),
                Ig2_Box_Sphere_ScGeom(),
            ],
            [Ip2_FrictMat_FrictMat_MindlinPhys()],
            [Law2_ScGeom_MindlinPhys_Mindlin()],
        ),
        NewtonIntegrator(damping=0, gravity=(0, 0, 0)),
    ]
    O.dt = 1e-15
    O.step()
    collider.dead = True
    layers, per_layer = sizes["layers"], sizes["width"] ** 2
    expected = per_layer * (2 * layers + 4 * (layers - 1) + 2)
    found = O.interactions.countReal()
    if found != expected:
        raise ValueError(f"{found} contacts found, the crystal has {expected}")
