"""Forces of frictionless spheres between two flat walls, all of which may move.

They are what a minimiser needs: forces, the virial (stress times volume), energy, contacts.
"""

from __future__ import annotations

import numpy as np

from modal.dem.downhill import longest_ways
from modal.dem.forces import TOTALS, UPRIGHT, WITHOUT_HISTORY, forces_by_loop
from modal.dem.near_contacts import contacts_in_reach, near_enough, still_complete
from modal.packing.sample import Sample
from modal.tools.slabs import slabs_of

SKIN = 0.1
"""Reach of the list of pairs beyond touch, diameters; a compromise of its length and its life."""
NO_SUMS = np.zeros(0)
"""In place of the stiffness of each sphere, which is not asked for."""


class NearContacts:
    """Contacts that touch or may soon touch, good until spheres have come closer by the skin."""

    def __init__(
        self, position: np.ndarray, lengths: np.ndarray, radius: np.ndarray, whole: bool = False
    ) -> None:
        self.radius, self.skin = float(radius.max()), SKIN * float(radius.mean())
        self.made_at, self.made_lengths = position.copy(), lengths.copy()
        reach = 2 * (self.radius + self.skin)
        contacts = contacts_in_reach(position, lengths, reach, whole)
        if radius.min() < self.radius:
            contacts = near_enough(contacts, position, lengths, radius, self.skin)
        self.ends, self.shift = contacts
        self.slabs = slabs_of(self.ends, len(position))

    def holds(self, position: np.ndarray, lengths: np.ndarray) -> bool:
        """Whether nothing outside the list can touch at these positions, (n, 3) m."""
        stretch = lengths / self.made_lengths
        largest = longest_ways(position, self.made_at, stretch).max()
        return still_complete(self.skin / self.radius, stretch, largest, self.radius)


class CentralForces:
    """Forces of a sample whose spheres and lengths move; `of` updates every attribute.

    force (n, 3), N; stiffness (n,), N/m, the sum of each sphere's contacts, of spheres of several
    sizes alone; virial (3,), N m, the stresses times the volume; energy, J; mean_force, N, and
    mean_stiffness, N/m, of the `contacts` present.
    """

    def __init__(self, sample: Sample) -> None:
        self.radius = np.full(len(sample.position), sample.sizes)
        self.stiffness = NO_SUMS if sample.radii is None else np.zeros(len(self.radius))
        self._laws, self._whole = sample.laws, sample.periodic_z
        self.force = np.zeros(sample.position.shape)
        self.rebuilt = 0
        self._near: NearContacts | None = None

    def of(self, position: np.ndarray, lengths: np.ndarray) -> CentralForces:
        """At `position` (n, 3), m, brought back into the cell's periods when pairs are sought.

        lengths (3,), m: lateral periods and the distance of the walls, the lower one at z = 0, or
        the period along z of a sample without walls.
        """
        if self._near is None or not self._near.holds(position, lengths):
            axes = 3 if self._whole else 2
            position[:, :axes] %= lengths[:axes]
            self._near = NearContacts(position, lengths, self.radius, self._whole)
            self.rebuilt += 1
        totals = forces_by_loop(
            self._near.slabs,
            position,
            self._near.ends,
            self._near.shift,
            np.append(lengths, UPRIGHT),
            np.array([0.0, lengths[2]]),
            self.radius,
            self._laws,
            *WITHOUT_HISTORY,
            self.force,
            self.stiffness,
        )
        of = dict(zip(TOTALS, totals.tolist(), strict=True))
        self.virial, self.energy, self.contacts = totals[4:7], of["energy"], int(of["touching"])
        self.mean_force = of["normal force"] / max(self.contacts, 1)
        self.mean_stiffness = of["stiffness"] / max(self.contacts, 1)
        return self

    @property
    def residual(self) -> float:
        """Mean net force on a sphere over the mean contact force; infinite without contacts."""
        if self.contacts == 0:
            return np.inf
        return float(np.sqrt((self.force**2).sum(axis=1)).mean() / self.mean_force)
