"""Keep the places of clumps and put their spheres where rigid bodies have them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from modal.dem.contacts import MovingContacts
from modal.tools.arrays import Floats, Ints


class ClumpPlaces:
    """The centres of mass and the rotations of the clumps of moving contacts.

    Parameters
    ----------
    contacts : MovingContacts
        The contacts of a sample of clumps, whose spheres are placed by `place_spheres`.

    Attributes
    ----------
    body : ndarray (n,) of int
        Number of each sphere's clump.
    centre : ndarray (k, 3)
        Positions of the centres of mass, m.
    rotation : ndarray (k, 3, 3)
        Rotations from the orientations in the sample.
    image : ndarray (n, 3)
        Periods from where a sphere is in its clump to where it is in the cell.
    """

    def __init__(self, contacts: MovingContacts) -> None:
        body, arm, rotation = contacts.body, contacts.arm, contacts.rotation
        assert body is not None and arm is not None and rotation is not None
        self._contacts = contacts
        self.body = body
        self.rotation = rotation
        self._arm_at_start = np.einsum("nji,nj->ni", rotation[body], arm)
        _, first = np.unique(body, return_index=True)
        self.centre = contacts.position[first] - arm[first]
        # Each sphere lies in the cell, perhaps as another image than that at its clump's centre.
        from_centre = contacts.position - self.centre[body] - arm
        self.image = np.round(from_centre / contacts.lengths)

    def spheres_carried(self, grains: Ints) -> Ints:
        """Return the indices of the spheres that the source carries with clumps (k,) of these.

        The images of their members beyond the period along z stay, and those of other clumps that
        lie on this side of it go along.
        """
        side = np.isin(self.body, grains) - self.image[:, 2]
        return np.flatnonzero(side == 1)

    def turn(self, angle: Floats) -> None:
        """Turn the clumps by rotation vectors (k, 3), rad."""
        self.rotation = Rotation.from_rotvec(angle).as_matrix() @ self.rotation

    def place_spheres(self, dt: float, stretch: Floats | float = 1.0) -> Floats:
        """Place the spheres of all clumps, and return their velocities (n, 3) in a step `dt`, s.

        `stretch` (3,) is by how much the step lengthens the cell.
        """
        contacts = self._contacts
        contacts.rotation = self.rotation
        contacts.arm = np.einsum("nij,nj->ni", self.rotation[self.body], self._arm_at_start)
        position = self.centre[self.body] + contacts.arm
        position += self.image * contacts.lengths * stretch
        position[:, :2] += self.image[:, 2:] * contacts.lean
        velocity: Floats = (position - contacts.position) / dt
        contacts.position[:] = position
        return velocity
