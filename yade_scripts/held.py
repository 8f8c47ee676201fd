"""Find held motions of spheres in a YADE scene: blocked by the user, or moved by an engine."""

import numpy as np
from yade import O, wrapper

from modal.tools.errors import InputError

MOVED_IDS = {
    "UniaxialStrainer": ("posIds", "negIds"),
    "KinematicEngine": ("ids",),
    "CombinedKinematicEngine": ("ids",),
    "StepDisplacer": ("ids",),
}
"""Engines that move bodies whatever forces act on these, with their lists of ids."""
MOTIONS = "xyzXYZ"
"""Letters of `blockedDOFs`: displacements along x, y, z, and turns about them."""


def held_motions(bodies):
    """Return which motions of spheres are held, (n, 6) bool; None if all spheres move freely.

    A member of a clump moves as the clump does. Raises InputError, which names the first one, for a
    sphere that an engine moves although not all of its motions are blocked.
    """
    moving_engines = _find_moved_bodies()
    fixed = np.zeros((len(bodies), len(MOTIONS)), bool)
    for row, body in enumerate(bodies):
        mover = O.bodies[body.clumpId] if body.isClumpMember else body
        blocked = mover.state.blockedDOFs
        fixed[row] = [letter in blocked for letter in MOTIONS]
        if _is_outside_masks(mover):
            fixed[row] = True
        engine = moving_engines.get(body.id) or moving_engines.get(mover.id)
        if engine and not fixed[row].all():
            raise InputError(
                "held_bodies",
                f"{engine} moves sphere {body.id}",
                "which of its motions answer to forces is not known",
                f"block all of them (O.bodies[{mover.id}].state.blockedDOFs = '{MOTIONS}'), or let "
                "it move freely and come to rest",
            )
    return fixed if fixed.any() else None


def _is_outside_masks(body):
    """Return whether all integrators leave a body out by their masks."""
    newtons = [
        engine
        for engine in O.engines
        if isinstance(engine, wrapper.NewtonIntegrator) and not engine.dead
    ]
    return bool(newtons) and not any(
        newton.mask <= 0 or newton.mask & body.groupMask for newton in newtons
    )


def _find_moved_bodies():
    """Return the name of the engine that moves each body, by the body's id."""
    names = {}
    for engine in O.engines:
        if engine.dead:
            continue
        for engine_name, list_names in MOVED_IDS.items():
            if not isinstance(engine, getattr(wrapper, engine_name)):
                continue
            for list_name in list_names:
                for body_id in getattr(engine, list_name):
                    names[body_id] = type(engine).__name__
    return names
