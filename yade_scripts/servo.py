"""Stress-controlled compression: stresses of a scene, and its strain rates from a control."""

import numpy as np
from yade import Matrix3, O
from yade.utils import getStress, unbalancedForce

from yade_scripts.scene import cell_side, wall_faces


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


def wall_stresses(n):
    """Pressure on source and receiver wall, Pa."""
    side_x, side_y = cell_side()
    area = side_x * side_y
    return -O.forces.f(n, sync=True)[2] / area, O.forces.f(n + 1, sync=True)[2] / area


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


class Drive:
    """Lets a control of `modal.preparation.strain_control` set the strain rates of the scene.

    To be called between forces and motion.
    """

    def __init__(self, n, control):
        self.n, self.control = n, control
        control.stress = principal_stresses(n)

    def __call__(self):
        """Measure the stresses and set the rates."""
        deform(self.n, self.control.follow(principal_stresses(self.n)))


def unbalanced():
    """Mean residual force on a sphere over the mean contact force."""
    return unbalancedForce(useMaxForce=False)
