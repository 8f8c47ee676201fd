"""The tangent of YADE's contact law at a sample, by central differences of YADE's own forces.

    yade -n -x -j1 yade_scripts/finite_differences.py SAMPLE.sample.h5 OUT.h5

Every particle is moved by +h and by -h along each axis and turned about it, all else at rest; the
forces and torques on it and its neighbours are read. OUT holds the matrix K, minus the forces per
motion, as row, column, value (N/m, N, N m), six rows a particle as in modal/stiffness/matrices.py.
Sliding is suppressed. A tool for the tests of modal/stiffness/pre_stress.py, meant for some hundred
particles.
"""

import sys
from pathlib import Path

# Inside YADE __file__ is YADE itself; the script is its first argument.
sys.path.insert(0, str(Path(sys.argv[0]).resolve().parents[1]))

import numpy as np
from yade import O, Vector3

from modal.formats.hdf5 import InputError, atomic_h5, put
from modal.packing.sample import read_sample
from yade_scripts.scene import finish
from yade_scripts.state import build_scene

STEP = 5e-11
"""h in m, and of a rotation h / radius: (h / overlap)^2 / 24 and eps radius / h are below 1e-8."""
TIME_STEP = 1e-9
"""s; only the product of velocity and time step enters the law."""
NO_SLIDING = 1e6
"""Coefficient of friction that no contact reaches."""


class Scene:
    """The sample in YADE, every motion prescribed."""

    def __init__(self, sample):
        build_scene(sample, margin=0.01, damping=0.0)
        self.n = len(sample.position)
        self.radius = sample.radius
        O.dt = TIME_STEP
        for body in O.bodies:
            body.state.blockedDOFs = "xyzXYZ"
            body.state.vel = body.state.angVel = Vector3(0, 0, 0)
        self.contacts = [[] for _ in range(self.n + 2)]
        for contact in O.interactions:
            if contact.isReal:
                contact.phys.tangensOfFrictionAngle = NO_SLIDING
                # A copy: the law turns the vector that it holds.
                kept = (contact, Vector3(contact.phys.shearForce))
                for body in (contact.id1, contact.id2):
                    self.contacts[body].append(kept)
        self.start = [Vector3(body.state.pos) for body in O.bodies]

    def neighbours(self, p):
        """The particle and those that it touches, without walls."""
        found = {p} | {k for c, _ in self.contacts[p] for k in (c.id1, c.id2) if k < self.n}
        return sorted(found)

    def loads(self, p, axis, step, bodies):
        """Forces and torques (len(bodies), 6) with particle p moved (axis 0-2) or turned (3-5).

        The law sees the new place and the velocity that has led there. Back at rest its shear
        forces are put as they were: they depend on the way.
        """
        state = O.bodies[p].state
        way = np.zeros(3)
        way[axis % 3] = step
        if axis < 3:
            state.pos = self.start[p] + Vector3(*way)
            state.vel = (state.pos - self.start[p]) / TIME_STEP
        else:
            state.angVel = Vector3(*way) / TIME_STEP
        O.step()
        found = np.array([[*O.forces.f(k, sync=True), *O.forces.t(k, sync=True)] for k in bodies])
        state.vel = state.angVel = Vector3(0, 0, 0)
        state.pos = self.start[p]
        O.step()
        for contact, shear in self.contacts[p]:
            contact.phys.shearElastic = contact.phys.shearForce = shear
        return found

    def columns(self, p):
        """Rows, columns and values of the six columns of particle p."""
        bodies = self.neighbours(p)
        rows = (6 * np.array(bodies)[:, None] + np.arange(6)).ravel()
        entries = []
        for axis in range(6):
            step = STEP if axis < 3 else STEP / self.radius
            # Positions are rounded; this is how far apart the two places really are.
            here = self.start[p][axis % 3]
            apart = (here + step) - (here - step) if axis < 3 else 2 * step
            change = self.loads(p, axis, step, bodies) - self.loads(p, axis, -step, bodies)
            values = -change.ravel() / apart
            entries.append((rows, np.full(len(rows), 6 * p + axis), values))
        return [np.concatenate(parts) for parts in zip(*entries, strict=True)]


def main():
    """Read, differentiate, write; InputError for what the user can mend."""
    if len(sys.argv) != 3:
        raise InputError("two arguments needed: SAMPLE.sample.h5 OUT.h5")
    sample = read_sample(sys.argv[1])
    scene = Scene(sample)
    parts = [scene.columns(p) for p in range(scene.n)]
    row, column, value = (np.concatenate(values) for values in zip(*parts, strict=True))
    with atomic_h5(sys.argv[2]) as file:
        put(file, "row", row, "1")
        put(file, "column", column, "1")
        put(file, "value", value, "N/m, N, N m")
    print(f"{sys.argv[2]}: {6 * scene.n} columns, {len(O.interactions)} contacts")


finish(main)
