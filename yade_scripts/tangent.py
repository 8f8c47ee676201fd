"""The tangent of YADE's contact law, by central differences of YADE's own forces.

    yade -n -x -j1 yade_scripts/tangent.py SAMPLE.sample.h5 OUT.h5

Every particle is moved by +h and by -h along each axis and turned about it, all else at rest; the
forces and torques on it and its neighbours are read. Sliding is suppressed. A tool for the tests of
modal/system/contacts.py, meant for some hundred particles.
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
"""h in m, and of a rotation h / radius: (h / overlap)^2 / 24 and eps radius / h are below 1e-8."""
TIME_STEP = 1e-9
"""s; only the product of velocity and time step enters the law."""
NO_SLIDING = 1e6
"""Coefficient of friction that no contact reaches."""


class Tangent:
    """Of the present scene, whose motions are all prescribed and whose sliding is suppressed.

    `spheres`: ids of the bodies that are moved; `radius`, m, sets the size of a rotation.
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
                # A copy: the law turns the vector that it holds.
                kept = (contact, Vector3(contact.phys.shearForce))
                for body in (contact.id1, contact.id2):
                    self.contacts[body].append(kept)
        self.start = {body.id: Vector3(body.state.pos) for body in O.bodies}
        self.turned = {body.id: Quaternion(body.state.ori) for body in O.bodies}

    def neighbours(self, p):
        """The sphere and those that it touches, without walls."""
        found = {p} | {k for c, _ in self.contacts[p] for k in (c.id1, c.id2) if k in self.index}
        return sorted(found)

    def loads(self, p, axis, step, bodies):
        """Forces and torques (len(bodies), 6) with sphere p moved (axis 0-2) or turned (3-5).

        The law sees the new place or orientation and the velocity that has led there. Back at rest
        its shear forces are put as they were: they depend on the way.
        """
        state = O.bodies[p].state
        way = np.zeros(3)
        way[axis % 3] = step
        if axis < 3:
            state.pos = self.start[p] + Vector3(*way)
            state.vel = (state.pos - self.start[p]) / TIME_STEP
        else:
            state.angVel = Vector3(*way) / TIME_STEP
            state.ori = Quaternion(Vector3(*np.eye(3)[axis - 3]), step) * self.turned[p]
        O.step()
        found = np.array([[*O.forces.f(k, sync=True), *O.forces.t(k, sync=True)] for k in bodies])
        state.vel = state.angVel = Vector3(0, 0, 0)
        state.pos, state.ori = self.start[p], self.turned[p]
        O.step()
        for contact, shear in self.contacts[p]:
            contact.phys.shearForce = shear
            if hasattr(contact.phys, "shearElastic"):
                contact.phys.shearElastic = shear
        return found

    def columns(self, p):
        """Rows, columns and values of the six columns of sphere p."""
        bodies = self.neighbours(p)
        numbers = np.array([self.index[body] for body in bodies])
        rows, values = (6 * numbers[:, None] + np.arange(6)).ravel(), []
        for axis in range(6):
            step = STEP if axis < 3 else STEP / self.radius
            # Positions are rounded; this is how far apart the two places really are.
            here = self.start[p][axis % 3]
            apart = (here + step) - (here - step) if axis < 3 else 2 * step
            change = self.loads(p, axis, step, bodies) - self.loads(p, axis, -step, bodies)
            values.append(-change.ravel() / apart)
        columns = np.repeat(6 * self.index[p] + np.arange(6), len(rows))
        return np.tile(rows, 6), columns, np.concatenate(values)

    def write(self, path):
        """K, minus the forces per motion, six rows a particle as in modal/system/assembly.py."""
        parts = zip(*map(self.columns, self.index), strict=True)
        units = {"row": "1", "column": "1", "value": "N/m, N, N m"}
        with atomic_h5(path) as file:
            for (name, unit), values in zip(units.items(), parts, strict=True):
                put(file, name, np.concatenate(values), unit)


def main():
    """Read, differentiate, write; InputError for what the user can mend."""
    if len(sys.argv) != 3:
        raise InputError("input", "two arguments needed", "SAMPLE.sample.h5 OUT.h5")
    sample = read_sample(sys.argv[1])
    build_scene(sample, margin=0.01, damping=0.0)
    Tangent(range(len(sample.position)), sample.radius).write(sys.argv[2])


if __name__ == "__main__":
    finish(main)
