"""Move clumps by dynamic relaxation until their net forces have vanished."""

from __future__ import annotations

import numpy as np

from modal.dem.clump_places import ClumpPlaces
from modal.dem.contacts import MovingContacts
from modal.dem.leapfrog import Step, advance_along_axis, damp
from modal.dem.motion import AT_REST, LOCAL_DAMPING, relaxation_masses
from modal.tools.arrays import Floats

COUPLING = 2.0
"""Factor of the masses of clumps. The mass matrix of a body's spheres, each with a mass in
proportion to its stiffness, couples displacement and rotation; twice its diagonal blocks bounds it
from above, and with it the stable time step."""


class DampedClumps:
    """Dynamic relaxation of clumps, as `modal.dem.motion.DampedMotion` of spheres.

    Parameters
    ----------
    contacts : MovingContacts
        The contacts of a sample of clumps at rest.
    """

    def __init__(self, contacts: MovingContacts) -> None:
        self._contacts = contacts
        self._places = ClumpPlaces(contacts)
        self._velocity = np.zeros((len(self._places.centre), 6))
        self._residue = np.zeros(self._places.centre.shape)

    def step(self) -> None:
        """Move all clumps by one time step, which is 1."""
        load = self._contacts.grain_load
        mass, inertia = self._masses()
        velocity = self._velocity
        motion = (self._places.centre, velocity[:, :3], self._residue)
        step = Step(AT_REST, AT_REST, 1.0, LOCAL_DAMPING)
        self._places.centre, velocity[:, :3], self._residue = advance_along_axis(
            motion, load[:, :3] / mass, step
        )
        velocity[:, 3:] += damp(load[:, 3:] / inertia, velocity[:, 3:], 1.0, LOCAL_DAMPING)
        self._turn_and_touch(velocity[:, 3:])

    def move(self, motion: Floats) -> None:
        """Move the clumps by `motion` (k, 6), m and rad, at once."""
        self._places.centre = self._places.centre + motion[:, :3]
        self._turn_and_touch(motion[:, 3:])

    def _turn_and_touch(self, angle: Floats) -> None:
        """Turn the clumps by rotation vectors (k, 3), rad, and compute the contacts' forces."""
        self._places.turn(angle)
        velocity = self._places.place_spheres(1.0)
        self._contacts.touch(np.hstack([velocity, angle[self._places.body]]), 1.0)

    def _masses(self) -> tuple[Floats, Floats]:
        """Return masses and moments of inertia (k, 1) with which a step of 1 is stable."""
        contacts = self._contacts
        assert contacts.arm is not None
        mass = relaxation_masses(contacts.stiffness)
        inertia = mass * (0.4 * contacts.radius**2 + (contacts.arm**2).sum(axis=1))
        body = self._places.body
        mass_of_clumps = np.asarray(COUPLING * np.bincount(body, mass), float)
        inertia_of_clumps = np.asarray(COUPLING * np.bincount(body, inertia), float)
        return mass_of_clumps[:, None], inertia_of_clumps[:, None]
