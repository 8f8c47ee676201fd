"""Spheres of a YADE scene that are not free to move as their contacts push them."""

from yade import O, wrapper

from modal.tools.errors import InputError

MOVERS = ("KinematicEngine", "CombinedKinematicEngine", "StepDisplacer")
"""Engines that move their `ids` whatever pushes these."""
LISTS = {"UniaxialStrainer": ("posIds", "negIds")} | {name: ("ids",) for name in MOVERS}
"""Names of the lists of ids of each engine that moves bodies."""


def refuse_held(bodies):
    """Raise InputError, which names the first one, unless all of these spheres move freely.

    A network's spheres do. A member of a clump moves as the clump does.
    """
    moved = _moved_by_engines()
    for body in bodies:
        mover = O.bodies[body.clumpId] if body.isClumpMember else body
        reason = moved.get(body.id) or moved.get(mover.id) or _why_held(mover)
        if reason:
            raise InputError(
                "held_bodies",
                f"sphere {body.id} does not move freely",
                f"{reason}",
                "a network knows no held spheres "
                "yet: put a Wall, Facet or Box in their place, or let them move freely "
                f"(O.bodies[{mover.id}].state.blockedDOFs = '') and come to rest",
            )


def _why_held(body):
    """What keeps a body from moving freely, or an empty text."""
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


def _moved_by_engines():
    """What moves bodies whatever pushes these, by their ids."""
    reasons = {}
    for engine in O.engines:
        if engine.dead:
            continue
        for name, lists in LISTS.items():
            if isinstance(engine, getattr(wrapper, name)):
                ids = [one for each in lists for one in getattr(engine, each)]
                reasons |= dict.fromkeys(ids, f"{type(engine).__name__} moves it")
    return reasons
