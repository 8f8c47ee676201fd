"""Compute the geometry and the motion at contacts of moving spheres, and their shear forces.

A contact with history has a shear force. In a step, this force is turned with the contact and with
the mean spin of the two spheres; kt times the shear displacement of the step is added, also in the
first step of a contact; and the force is cut at the friction limit. With Hertz and Mindlin this is
the law of YADE term by term (its `ScGeom`, without the variant against ratcheting, and
`Law2_ScGeom_MindlinPhys_Mindlin`), and that of `modal.system.contacts` with finite increments.

A contact that resists rolling or twisting also has a moment. The moment is turned like the shear
force. The stiffnesses against rolling and twisting times the relative rotation in the step are
added. The parts of the moment across and along the normal are cut at their limits.

The law is written once, for numbers and for arrays: the compiled loop over contacts
(`modal.dem.forces`) and numpy (`modal.dem.forces_by_arrays`) both call it. A vector is a tuple or
an array (x, y, z), whose components are numbers or have the shape (m,).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from modal.tools.arrays import Floats, Ints
from modal.tools.loops import cross, dot, elementwise, plus

UPRIGHT = np.zeros(2)
"""Displacement along x and y, m, of the upper end of a period along z that is perpendicular to x
and y."""
PERIODS, SOURCE, LEAN, TURN = range(4)
"""Rows of the array that describes the change of a cell in a step, see `ShearStep`."""


class Geometry(NamedTuple):
    """Positions of spheres and walls, and the list of their contacts.

    position (n, 3), m. ends (m, 2): the two spheres i and j of a contact, or a sphere and the code
    of a wall. shift (m, 3): the periods by which j is displaced, 0 for walls. cell (5,), m: the
    three periods, and how far the one along z leans along x and y. walls (2,), m: z of source and
    receiver wall. radius (n,), m.
    """

    position: Floats
    ends: Ints
    shift: Ints
    cell: Floats
    walls: Floats
    radius: Floats


class ShearStep(NamedTuple):
    """The motion in a time step, and the history of contacts, which the step updates.

    velocity (n, 6), m/s and rad/s. time_step, s. change (4, 3): the row `PERIODS` is the change of
    the periods in the step, m; `SOURCE` is the displacement of the source wall, m; `LEAN` is the
    change of the lean of the period along z, m; `TURN` has the spin of the wall, rad/s, and the x
    and y, m, of its axis of rotation along z. friction: coefficient mu. normal (m, 3): unit vectors
    from i to j, 0 for open contacts. shear (m, 3), N: forces on i.

    work (m, 2), J: the energy that the shear force of each contact has stored, and the energy that
    slip has dissipated, by the trapezoidal rule; (0, 2) if energies are not recorded. When the
    overlap and with it the stiffness change, the law keeps the force: the stored energy is
    therefore the sum of the work, and not a function of the force.

    moment (m, 3), N m: moments on i of contacts that resist turning, whose work is counted with
    that of the shear forces; None if no contact resists turning. rolling, twisting: coefficients
    whose product with friction force and effective radius bounds the parts of a moment across and
    along the normal.
    """

    velocity: Floats
    time_step: float
    change: Floats
    friction: float
    normal: Floats
    shear: Floats
    work: Floats
    moment: Floats | None = None
    rolling: float = 0.0
    twisting: float = 0.0


class Totals(NamedTuple):
    """Sums over all contacts.

    normal_force, contact_force, N: sums of the magnitudes of the normal force and of the whole
    force; the latter is 0 without history. touching, sliding: numbers of contacts. virial, N m:
    principal stresses times the volume. elastic_energy, J, of normal forces. stiffness, N/m, of
    normal forces. source, receiver, N: forces on the walls; in a cell without walls `source` is the
    force across its period along z. source_torque, receiver_torque, N m: about the line of
    `ShearStep.change`.
    """

    normal_force: float
    contact_force: float
    touching: float
    sliding: float
    virial_x: float
    virial_y: float
    virial_z: float
    elastic_energy: float
    stiffness: float
    source_x: float
    source_y: float
    source_z: float
    receiver_x: float
    receiver_y: float
    receiver_z: float
    source_torque: float
    receiver_torque: float


class RelativeMotion(NamedTuple):
    """Relative motion of the two ends of a contact; all four fields are vectors.

    approach: velocity of j minus velocity of i, m/s. spin_sum: sum of the spins of both ends,
    rad/s. spin_j: spin of j, rad/s. gained: change in the step of the periods that the contact
    crosses, m.
    """

    approach: Any
    spin_sum: Any
    spin_j: Any
    gained: Any


@elementwise
def shear_increment(normal, lever, longer, motion, time_step):
    """Return the shear displacement of a contact in a step, a vector, m.

    `lever`, m, is the distance from the centre of sphere i to the middle of the overlap; the
    distance of sphere j is larger by `longer`, m, which is 0 for equal spheres.
    """
    moved = plus(motion.approach, lever, cross(normal, motion.spin_sum))
    moved = plus(moved, longer, cross(normal, motion.spin_j))
    moved = plus(motion.gained, time_step, moved)
    return plus(moved, -dot(moved, normal), normal)


@elementwise
def split_moment(moment, normal):
    """Return the parts of a moment across and along the contact normal, N m: rolling, twisting."""
    along = dot(moment, normal)
    twisting = (along * normal[0], along * normal[1], along * normal[2])
    return plus(moment, -1.0, twisting), twisting


@elementwise
def relative_turn(motion, time_step):
    """Return the rotation of j minus that of i in a step, a vector, rad."""
    spin_i = plus(motion.spin_sum, -1.0, motion.spin_j)
    spin = plus(motion.spin_j, -1.0, spin_i)
    return time_step * spin[0], time_step * spin[1], time_step * spin[2]


@elementwise
def cut_back(vector, share):
    """Return a vector times a share, the part of a force or moment that friction allows."""
    return share * vector[0], share * vector[1], share * vector[2]


@elementwise
def turn_shear(shear, normal_before, normal, spin_sum, time_step):
    """Return the shear force, N, turned with the contact normal, then with the ends' mean spin.

    With s the shear force and n the normals, s becomes s + (n_before x n) x s, and then turns about
    n by the mean spin along it. The result is zero for a contact that has just closed.
    """
    shear = plus(plus(shear, dot(shear, normal_before), normal), -dot(shear, normal), normal_before)
    angle = 0.5 * time_step * dot(normal_before, spin_sum)
    return plus(shear, angle, cross(normal_before, shear))


@elementwise
def friction_share(shear, limit):
    """Return the share of a shear force that friction allows: below 1 if the contact slides."""
    size = np.sqrt(dot(shear, shear))
    return np.minimum(1.0, limit / np.maximum(size, 1e-300))


@elementwise
def shear_work(before, trial, after, stiffness):
    """Return the energies, J, that shear stores in a contact and slip dissipates, in one step.

    `before` and `after` are the forces, N, `trial` is the force without slip.
    """
    mean = plus((0.5 * before[0], 0.5 * before[1], 0.5 * before[2]), 0.5, after)
    stored = dot(mean, plus(after, -1.0, before)) / stiffness
    dissipated = dot(mean, plus(trial, -1.0, after)) / stiffness
    return stored, dissipated
