"""Compute stresses of a YADE scene, and deform it at the strain rates of a control."""

import numpy as np
from yade import Matrix3, O
from yade.utils import getStress, unbalancedForce

from modal.tools.errors import InputError
from yade_scripts.scene import call_before_motion, cell_side, wall_faces
from yade_scripts.state import build_scene, read_scene, resume_cell

MARGIN = 0.1
"""Distance around each sphere in which YADE's collider looks for contacts, in radii."""


def principal_stresses(n):
    """Return the stresses (xx, yy, zz) of the sample between its walls, Pa, compression positive.

    YADE sums the products of force and branch vector over all contacts. The branch vector of a
    contact with a wall begins at the centre of the wall's box; it is corrected here to begin at the
    wall's face, perpendicular to it.
    """
    side_x, side_y = cell_side()
    low, high = wall_faces(n)
    volume = side_x * side_y * (high - low)
    uncorrected = np.array([getStress(volume)[k][k] for k in range(3)])
    excess = np.zeros(3)
    for wall, face in ((n, low), (n + 1, high)):
        for contact in O.interactions.withBody(wall):
            if contact.isReal:
                force = np.array(contact.phys.normalForce + contact.phys.shearForce)
                excess += force * _compute_branch_error(contact, wall, face)
    return -(uncorrected - excess / volume)


def _compute_branch_error(contact, wall, face):
    """Return YADE's branch vector (3,), m, of a contact with a wall minus the true one.

    `wall` is the id of the wall's box, `face` the z of its face, m.
    """
    is_wall_first = contact.id1 == wall
    sphere_id = contact.id2 if is_wall_first else contact.id1
    sphere_height = O.bodies[sphere_id].state.pos[2]
    branch = np.array(O.bodies[contact.id1].state.pos - O.bodies[contact.id2].state.pos)
    branch -= np.array(O.cell.hSize * contact.cellDist)
    sign = 1 if is_wall_first else -1
    return branch - np.array([0, 0, (face - sphere_height) * sign])


def wall_stresses(n, axis=2):
    """Return the stress on source and receiver wall along an axis, Pa; along z their pressure."""
    side_x, side_y = cell_side()
    source = O.forces.f(n, sync=True)[axis]
    receiver = O.forces.f(n + 1, sync=True)[axis]
    return -source / (side_x * side_y), receiver / (side_x * side_y)


def deform(n, rates):
    """Deform the cell at the rates (xx, yy, zz), 1/s; the walls follow along z only.

    The integrator multiplies every velocity by 1 + rate dt and adds the jump of the rate multiplied
    by the position, also for the walls. Therefore the velocities of the walls are set so that the
    result is the rate multiplied by the position along z, and zero laterally, without accumulating
    errors.
    """
    present_rates = np.array([O.cell.velGrad[axis, axis] for axis in range(3)])
    O.cell.velGrad = Matrix3(rates[0], 0, 0, 0, rates[1], 0, 0, 0, rates[2])
    wall_rates = np.array([0, 0, rates[2]])
    for wall in (n, n + 1):
        state = O.bodies[wall].state
        position = np.array(state.pos)
        velocity = (wall_rates - (rates - present_rates)) * position / (1 + O.dt * present_rates)
        state.vel = tuple(velocity.tolist())


class Scene:
    """A sample in YADE's motion under the control of a stage.

    The methods are those of `modal.preparation.protocol.MovingPacking`.
    """

    def __init__(self, sample, stage):
        self.steps = 0
        self._sample = sample
        self._n = len(sample.position)
        self._control = stage.control
        build_scene(sample, margin=MARGIN, damping=stage.damping)
        call_before_motion(self._follow)

    def _follow(self):
        deform(self._n, self._control.follow(self.stress()))

    def advance(self, count, dt, every):
        """Take `count` steps of `dt`, s; set strain rates every `every` steps."""
        O.dt = dt
        O.labeledEngine("control").iterPeriod = every
        if not self.steps:
            resume_cell()
        O.run(count, wait=True)
        self.steps += count
        if not np.isfinite(self._control.stress).all():
            raise InputError(
                "unstable_step",
                "the stress is not finite",
                "the time step is unstable",
                "take a smaller fraction",
            )

    def stress(self):
        """Return the principal stresses (3,), Pa, compression positive."""
        return principal_stresses(self._n)

    def unbalanced(self):
        """Return the mean net force on a sphere divided by the mean contact force."""
        return unbalancedForce(useMaxForce=False)

    def sample(self, *, moving):
        """Return the present sample; with velocities and strain rate if `moving`."""
        return read_scene(self._sample, moving=moving)
