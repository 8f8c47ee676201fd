"""Compute the tangent of YADE's contact law by central differences of YADE's own forces.

    yade -n -x -j1 yade_scripts/tangent.py SAMPLE.sample.h5 OUT.h5

Every particle is moved by +h and by -h along each axis and rotated about it, all others at rest,
and the forces and torques on this particle and its neighbours are read. Sliding is suppressed. The
tests of modal/system/contacts.py use this script for some hundred particles.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    # Inside YADE __file__ is YADE itself; the script is its first argument.
    sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, Quaternion, Vector3

from modal.formats.hdf5 import atomic_h5, put
from modal.packing.sample import read_sample
from modal.tools.errors import InputError
from yade_scripts.scene import finish
from yade_scripts.state import build_scene

STEP = 5e-11
"""Displacement h, m; rotations are h / radius. Both errors, (h / overlap)^2 / 24 and
eps radius / h, are below 1e-8."""
TIME_STEP = 1e-9
"""Time step, s; forces depend only on its product with the velocity."""
NO_SLIDING = 1e6
"""Coefficient of friction that no contact reaches."""


class Tangent:
    """Stiffness of the present scene, with all motions prescribed and without sliding.

    Parameters
    ----------
    spheres : iterable of int
        Ids of the bodies that are moved.
    radius : float
        Radius, m, by which a displacement is divided to obtain a rotation.
    """

    def __init__(self, spheres, radius):
        self.index = {body: k for k, body in enumerate(spheres)}
        self.radius = radius
        O.dt = TIME_STEP
        for body in O.bodies:
            body.state.blockedDOFs = "xyzXYZ"
            body.state.vel = body.state.angVel = Vector3(0, 0, 0)
        self.contacts = {body.id: [] for body in O.bodies}
        for contact in O.interactions:
            if contact.isReal:
                contact.phys.tangensOfFrictionAngle = NO_SLIDING
                # A copy: the law rotates the vector that it holds.
                contact_and_shear = (contact, Vector3(contact.phys.shearForce))
                for body in (contact.id1, contact.id2):
                    self.contacts[body].append(contact_and_shear)
        self.position = {body.id: Vector3(body.state.pos) for body in O.bodies}
        self.orientation = {body.id: Quaternion(body.state.ori) for body in O.bodies}

    def find_neighbours(self, p):
        """Return the ids of sphere p and of the spheres that touch it, ascending."""
        neighbours = {p}
        for contact, _ in self.contacts[p]:
            neighbours |= {contact.id1, contact.id2}
        return sorted(neighbours & self.index.keys())

    def compute_loads(self, p, axis, step, bodies):
        """Return forces and torques (len(bodies), 6) after a motion of sphere p.

        The sphere is displaced by `step`, m, along axis 0 to 2, or rotated by `step`, rad, about
        axis 3 to 5. The law uses the new position or orientation and the velocity that has led to
        it. Afterwards the sphere is put back and the shear forces, which depend on the path, are
        restored.
        """
        state = O.bodies[p].state
        motion = np.zeros(3)
        motion[axis % 3] = step
        if axis < 3:
            state.pos = self.position[p] + Vector3(*motion)
            state.vel = (state.pos - self.position[p]) / TIME_STEP
        else:
            state.angVel = Vector3(*motion) / TIME_STEP
            state.ori = Quaternion(Vector3(*np.eye(3)[axis - 3]), step) * self.orientation[p]
        O.step()
        loads = np.array([[*O.forces.f(k, sync=True), *O.forces.t(k, sync=True)] for k in bodies])
        state.vel = state.angVel = Vector3(0, 0, 0)
        state.pos = self.position[p]
        state.ori = self.orientation[p]
        O.step()
        for contact, shear in self.contacts[p]:
            contact.phys.shearForce = shear
            if hasattr(contact.phys, "shearElastic"):
                contact.phys.shearElastic = shear
        return loads

    def compute_columns(self, p):
        """Return the row and column indices and the values of the six columns of sphere p."""
        bodies = self.find_neighbours(p)
        numbers = np.array([self.index[body] for body in bodies])
        rows = (6 * numbers[:, None] + np.arange(6)).ravel()
        values = []
        for axis in range(6):
            if axis < 3:
                step = STEP
                # Positions are rounded; this is the true distance of the two positions.
                coordinate = self.position[p][axis]
                distance = (coordinate + step) - (coordinate - step)
            else:
                step = STEP / self.radius
                distance = 2 * step
            forward = self.compute_loads(p, axis, step, bodies)
            backward = self.compute_loads(p, axis, -step, bodies)
            values.append(-(forward - backward).ravel() / distance)
        columns = np.repeat(6 * self.index[p] + np.arange(6), len(rows))
        return np.tile(rows, 6), columns, np.concatenate(values)

    def write(self, path):
        """Write K, minus the loads divided by the motion, as rows, columns and values.

        Each particle has six rows, as in modal/system/assembly.py.
        """
        columns_of_spheres = [self.compute_columns(p) for p in self.index]
        rows, columns, values = zip(*columns_of_spheres, strict=True)
        with atomic_h5(path) as file:
            put(file, "row", np.concatenate(rows), "1")
            put(file, "column", np.concatenate(columns), "1")
            put(file, "value", np.concatenate(values), "N/m, N, N m")


def main():
    """Read a sample, differentiate its forces, and write the tangent.

    Raises InputError for a user's mistake.
    """
    if len(sys.argv) != 3:
        raise InputError("arguments", "two arguments needed", "SAMPLE.sample.h5 OUT.h5")
    sample = read_sample(sys.argv[1])
    build_scene(sample, margin=0.01, damping=0.0)
    Tangent(range(len(sample.position)), sample.radius).write(sys.argv[2])


if __name__ == "__main__":
    finish(main)
