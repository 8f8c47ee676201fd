"""Spheres of a YADE scene that do not move freely under their contact forces."""

from yade import O, wrapper

from modal.tools.errors import InputError

MOVED_IDS = {
    "UniaxialStrainer": ("posIds", "negIds"),
    "KinematicEngine": ("ids",),
    "CombinedKinematicEngine": ("ids",),
    "StepDisplacer": ("ids",),
}
"""Engines that move bodies whatever forces act on these, with their lists of ids."""


def refuse_held(bodies):
    """Raise InputError, which names the first one, unless all of these spheres move freely.

    All spheres of a network move freely. A member of a clump moves as the clump does.
    """
    engine_reasons = _find_moved_bodies()
    for body in bodies:
        mover = O.bodies[body.clumpId] if body.isClumpMember else body
        reason = (
            engine_reasons.get(body.id) or engine_reasons.get(mover.id) or _describe_hold(mover)
        )
        if reason:
            raise InputError(
                "held_bodies",
                f"sphere {body.id} does not move freely",
                f"{reason}, and a network has no held spheres",
                "put a Wall, Facet or Box in their place, or let them move freely "
                f"(O.bodies[{mover.id}].state.blockedDOFs = '') and come to rest",
            )


def _describe_hold(body):
    """Return what keeps a body from moving freely, or an empty text."""
    kind = "its clump" if body.isClump else "it"
    blocked = body.state.blockedDOFs
    if blocked:
        return f"{kind} has blockedDOFs {blocked!r}"
    for engine in O.engines:
        if not isinstance(engine, wrapper.NewtonIntegrator) or engine.dead:
            continue
        if engine.mask > 0 and not engine.mask & body.groupMask:
            return f"{kind} is outside the mask of NewtonIntegrator"
    return ""


def _find_moved_bodies():
    """Return a text for each body that an engine moves, by its id."""
    reasons = {}
    for engine in O.engines:
        if engine.dead:
            continue
        for engine_name, list_names in MOVED_IDS.items():
            if not isinstance(engine, getattr(wrapper, engine_name)):
                continue
            for list_name in list_names:
                for body_id in getattr(engine, list_name):
                    reasons[body_id] = f"{type(engine).__name__} moves it"
    return reasons
