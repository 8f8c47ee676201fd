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

from modal.dem.clump_places import ClumpPlaces
from modal.dem.contacts import MovingContacts
from modal.dem.leapfrog import Step, advance_along_axis, damp
from modal.packing.sample import Sample
from modal.tools.arrays import Floats, Ints


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
    velocity : ndarray (k, 3)
        Velocities of the centres of mass, m/s.
    angular_momentum : ndarray (k, 3)
        Angular momentum of the clumps, kg m^2/s.
    push : ndarray (k, 6) or None
        Forces and torques of a source on the clumps, N and N m.
    """

    def __init__(
        self, sample: Sample, contacts: MovingContacts, velocity: Floats, rates: Floats
    ) -> None:
        clumps = sample.clumps
        assert clumps is not None
        self._contacts = contacts
        self._places = ClumpPlaces(contacts)
        self._mass = clumps.mass[:, None]
        self._moments, self._axes = np.linalg.eigh(clumps.tensor)
        self._mean_moment = self._moments.mean(axis=1)[:, None]
        first = clumps.first_members
        self._spin = velocity[first, 3:].copy()
        self.velocity = velocity[first, :3] - np.cross(self._spin, clumps.arm[first])
        self.angular_momentum = np.einsum("nij,nj->ni", clumps.tensor, self._spin)
        self._residue = np.zeros(self.centre.shape)
        self._start = self.centre.copy()
        self.push: Floats | None = None

    @property
    def centre(self) -> Floats:
        """Positions (k, 3) of the centres of mass, m."""
        return self._places.centre

    @property
    def velocities(self) -> Floats:
        """Velocities of the centres and spins (k, 6), m/s and rad/s, half a step ahead."""
        return np.hstack([self.velocity, self._spin])

    def spheres_carried(self, grains: Ints) -> Ints:
        """Return the indices of the spheres that the source carries with these clumps."""
        return self._places.spheres_carried(grains)

    def carry(self, grains: Ints, displacement: Floats) -> None:
        """Move the centres of clumps, by their indices, by a `displacement` (3,), m."""
        self._places.centre[grains] += displacement

    def displacement(self) -> Floats:
        """Return the displacements (k, 3), m, of the centres from their positions at the start."""
        return self.centre - self._start

    def kinetic_energy(self, before: Floats, after: Floats) -> float:
        """Return the kinetic energy, J, from the `velocities` (k, 6) before and after a state."""
        translation = (self._mass * before[:, :3] * after[:, :3]).sum()
        axes = self._places.rotation @ self._axes
        local_before = np.einsum("kia,ki->ka", axes, before[:, 3:])
        local_after = np.einsum("kia,ki->ka", axes, after[:, 3:])
        rotation = (self._moments * local_before * local_after).sum()
        return 0.5 * float(translation + rotation)

    def advance(self, velocity: Floats, step: Step) -> None:
        """Move all clumps and their spheres by one leapfrog step.

        `velocity` (n, 6) of the spheres is updated in place.
        """
        dt = step.dt
        load = self._contacts.grain_load
        if self.push is not None:
            load = load + self.push
        places = self._places
        motion = (places.centre, self.velocity, self._residue)
        acceleration = load[:, :3] / self._mass
        places.centre, self.velocity, self._residue = advance_along_axis(motion, acceleration, step)
        angular_acceleration = damp(load[:, 3:] / self._mean_moment, self._spin, dt, step.damping)
        torque = angular_acceleration * self._mean_moment
        present_spin = self._spin_of(self.angular_momentum + 0.5 * dt * torque, places.rotation)
        halfway = Rotation.from_rotvec(0.5 * dt * present_spin).as_matrix() @ places.rotation
        self.angular_momentum += dt * torque
        self._spin = self._spin_of(self.angular_momentum, halfway)
        places.turn(dt * self._spin)
        velocity[:, :3] = places.place_spheres(dt, 1 + dt * step.rates)
        velocity[:, 3:] = self._spin[places.body]

    def _spin_of(self, angular_momentum: Floats, rotation: Floats) -> Floats:
        """Return the spins (k, 3), rad/s, of bodies with these momenta and rotations."""
        axes = rotation @ self._axes
        local = np.einsum("kia,ki->ka", axes, angular_momentum) / self._moments
        spin: Floats = np.einsum("kia,ka->ki", axes, local)
        return spin
