"""Move clumps: spheres that are rigid bodies together, in the leapfrog steps of single spheres.

The centres of mass move as single spheres do (`modal.dem.leapfrog`): strained with the cell, damped
as Cundall's local damping does. Rotations follow D. Fincham, Mol. Simul. 8, 165 (1992), as in YADE:
angular momentum and spin are half a step ahead, and the orientation in between is predicted from
the present spin. Without torque the angular momentum is constant to round-off.

The velocity of each sphere is its displacement in the step divided by the time step, so that normal
and shear forces follow from the same motion.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modal.dem.contacts import MovingContacts
from modal.dem.leapfrog import Step, advance_along_axis, damp
from modal.packing.sample import Sample
from modal.tools.arrays import Floats


class ClumpMotion:
    """The clumps of a sample in motion.

    Parameters
    ----------
    sample : Sample
        The packing at the start, with `body`, `arm` and the inertia of the bodies.
    contacts : MovingContacts
        The contacts of the sample; each step updates their positions and arms.
    velocity : ndarray (n, 6)
        Velocities of the spheres, m/s and rad/s; each step updates them.
    rates : ndarray (3,)
        Strain rates of the cell, 1/s.

    Attributes
    ----------
    centre, velocity : ndarray (k, 3)
        Position, m, and velocity, m/s, of the centres of mass.
    angular_momentum : ndarray (k, 3)
        Angular momentum of the clumps, kg m^2/s.
    """

    def __init__(
        self, sample: Sample, contacts: MovingContacts, velocity: Floats, rates: Floats
    ) -> None:
        clumps = sample.clumps
        assert clumps is not None
        self._contacts = contacts
        self._body = clumps.body
        self._mass = clumps.mass[:, None]
        self._moments, axes = np.linalg.eigh(clumps.tensor)
        self._mean_moment = self._moments.mean(axis=1)[:, None]
        self._rotation = axes
        self._local_arm = np.einsum("nji,nj->ni", axes[self._body], clumps.arm)
        first = clumps.first_members
        self.centre = contacts.position[first] - clumps.arm[first]
        # Each sphere lies in the cell, perhaps as another image than that at its clump's centre.
        from_centre = contacts.position - self.centre[self._body] - clumps.arm
        self._image = np.round(from_centre / contacts.lengths)
        self._spin = velocity[first, 3:].copy()
        self.velocity = velocity[first, :3] - np.cross(self._spin, clumps.arm[first])
        self.angular_momentum = np.einsum("nij,nj->ni", clumps.tensor, self._spin)
        self._residue = np.zeros(self.centre.shape)
        contacts.arm = clumps.arm.copy()

    @property
    def tensor(self) -> Floats:
        """Tensors of inertia (k, 3, 3) in the axes of the packing, kg m^2."""
        return np.einsum("kia,ka,kja->kij", self._rotation, self._moments, self._rotation)

    def loads(self) -> Floats:
        """Return the force and torque (k, 6), N and N m, of the last contacts on each clump."""
        arm = self._contacts.arm
        assert arm is not None
        load = self._contacts.load
        force = load[:, :3]
        torque = load[:, 3:] + np.cross(arm, force)
        on_spheres = np.hstack([force, torque])
        count = len(self._mass)
        sums = [np.bincount(self._body, column, count) for column in on_spheres.T]
        return np.column_stack(sums)

    def advance(self, velocity: Floats, step: Step) -> None:
        """Move all clumps and their spheres by one leapfrog step.

        `velocity` (n, 6) of the spheres is updated in place.
        """
        dt = step.dt
        load = self.loads()
        motion = (self.centre, self.velocity, self._residue)
        acceleration = load[:, :3] / self._mass
        self.centre, self.velocity, self._residue = advance_along_axis(motion, acceleration, step)
        angular_acceleration = damp(load[:, 3:] / self._mean_moment, self._spin, dt, step.damping)
        torque = angular_acceleration * self._mean_moment
        present_spin = self._spin_of(self.angular_momentum + 0.5 * dt * torque, self._rotation)
        halfway = Rotation.from_rotvec(0.5 * dt * present_spin).as_matrix() @ self._rotation
        self.angular_momentum += dt * torque
        self._spin = self._spin_of(self.angular_momentum, halfway)
        self._rotation = Rotation.from_rotvec(dt * self._spin).as_matrix() @ self._rotation
        contacts = self._contacts
        contacts.arm = np.einsum("nij,nj->ni", self._rotation[self._body], self._local_arm)
        position = self.centre[self._body] + contacts.arm
        position += self._image * contacts.lengths * (1 + dt * step.rates)
        velocity[:, :3] = (position - contacts.position) / dt
        velocity[:, 3:] = self._spin[self._body]
        contacts.position[:] = position

    def _spin_of(self, angular_momentum: Floats, rotation: Floats) -> Floats:
        """Return the spins (k, 3), rad/s, of bodies with given angular momenta and orientations."""
        local = np.einsum("kia,ki->ka", rotation, angular_momentum) / self._moments
        spin: Floats = np.einsum("kia,ka->ki", rotation, local)
        return spin
