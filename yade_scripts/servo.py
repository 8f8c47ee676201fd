"""Stress-controlled compression: stresses of a scene, and its motion at a control's rates."""

import numpy as np
from yade import Matrix3, O
from yade.utils import getStress, unbalancedForce

from modal.tools.errors import InputError
from yade_scripts.scene import before_motion, cell_side, wall_faces
from yade_scripts.state import build_scene, read_scene, resume_cell

MARGIN = 0.1
"""Reach of the collider around each sphere, radii."""


def principal_stresses(n):
    """Stresses (xx, yy, zz) of the sample between its walls, Pa, compression positive.

    YADE sums force times branch over all contacts, with the branch of a wall contact from the
    centre of the wall's box; the true one goes from the wall's face straight to the sphere.
    """
    (side_x, side_y), (low, high) = cell_side(), wall_faces(n)
    volume = side_x * side_y * (high - low)
    total = np.array([getStress(volume)[k][k] for k in range(3)])
    box_centres = 0.0
    for wall, face in ((n, low), (n + 1, high)):
        for contact in O.interactions.withBody(wall):
            if not contact.isReal:
                continue
            first = contact.id1 == wall
            ball = O.bodies[contact.id2 if first else contact.id1].state.pos
            force = np.array(contact.phys.normalForce + contact.phys.shearForce)
            branch = np.array(O.bodies[contact.id1].state.pos - O.bodies[contact.id2].state.pos)
            branch -= np.array(O.cell.hSize * contact.cellDist)
            straight = np.array([0, 0, (face - ball[2]) * (1 if first else -1)])
            box_centres = box_centres + force * (branch - straight)
    return -(total - box_centres / volume)


def wall_stresses(n, axis=2):
    """Stress on source and receiver wall along an axis, Pa; along z their pressure."""
    side_x, side_y = cell_side()
    source, receiver = (O.forces.f(wall, sync=True)[axis] for wall in (n, n + 1))
    return -source / (side_x * side_y), receiver / (side_x * side_y)


def deform(n, rates):
    """Deform the cell at the rates (xx, yy, zz), 1/s; the walls follow along z and only there.

    The integrator multiplies every velocity by 1 + rate dt and adds the jump of the rate times
    position, also for the walls. They are set to what that turns into rate times position along z
    and into none across, so that errors do not add up.
    """
    now = np.array([O.cell.velGrad[axis, axis] for axis in range(3)])
    O.cell.velGrad = Matrix3(rates[0], 0, 0, 0, rates[1], 0, 0, 0, rates[2])
    for wall in (n, n + 1):
        state = O.bodies[wall].state
        position = np.array(state.pos)
        velocity = (np.array([0, 0, rates[2]]) - (rates - now)) * position / (1 + O.dt * now)
        state.vel = tuple(velocity.tolist())


class Scene:
    """A sample in motion under the control of a stage, as `modal.preparation.compression` asks."""

    def __init__(self, sample, stage):
        self._bare, self._n, self.steps = sample, len(sample.position), 0
        self._control = stage.control
        build_scene(sample, margin=MARGIN, damping=stage.damping)
        before_motion(self._follow)

    def _follow(self):
        deform(self._n, self._control.follow(self.stress()))

    def advance(self, count, dt, every):
        """`count` steps of `dt`, s, with the rates set `every` so many of them."""
        O.dt, O.labeledEngine("control").iterPeriod = dt, every
        if not self.steps:
            resume_cell()
        O.run(count, wait=True)
        self.steps += count
        if not np.isfinite(self._control.stress).all():
            raise InputError("input", "the stress is not finite", remedy="unstable time step")

    def stress(self):
        """Principal stresses (3,), Pa."""
        return principal_stresses(self._n)

    def unbalanced(self):
        """Mean residual force on a sphere over the mean contact force."""
        return unbalancedForce(useMaxForce=False)

    def sample(self, *, moving):
        """The sample as it is now."""
        return read_scene(self._bare, moving=moving)
