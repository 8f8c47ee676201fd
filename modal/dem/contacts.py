"""Contacts of spheres that move: which pairs are near, and the history of those that touch.

The list of nearby pairs holds while no sphere has gone far; a new one takes over the normals and
shear forces of the contacts that go on. The law itself is `modal.dem.forces`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal.dem.forces import TOTALS, UPRIGHT, forces_by_loop
from modal.dem.near_contacts import contacts_in_reach, near_enough
from modal.packing.neighbours import tangents
from modal.packing.sample import Sample
from modal.tools.slabs import slabs_of

SKIN = 0.02
"""Reach of the list of pairs beyond touch, diameters of the largest sphere: it holds while no
sphere has gone by half."""
STILL = np.zeros((4, 3))
"""Change of a cell whose periods and walls rest."""


def _numbers(i: np.ndarray, j: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """One number for each contact by its ends and periods."""
    number = i.astype(np.int64)
    # Walls are -1 and -2; periods are small, a sphere reaches few images of another.
    number = (number << 22) + j + 2
    for axis in range(3):
        number = (number << 6) + shift[:, axis].astype(np.int64) + 32
    return number


def _matching(old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the contacts that are in both, in `old` and in `new`."""
    _, before, after = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return before, after


class MovingContacts:
    """The contacts of a sample, kept through its motions.

    After each `move`: load (n, 6), N and N m, the net force and torque on each sphere; stiffness
    (n,), N/m, the sum of its kn; mean_force, N; the numbers touching and sliding; virial (3,), N m,
    the principal stresses times the volume; mean_contact, N, of normal and shear force together;
    on_walls (2, 6), N and N m, the forces on source and receiver wall and their torques about z;
    elastic_energy, J, of the normal forces. `work` (m, 2), J, is what shear forces have stored and
    slip has dissipated so far, see `modal.dem.forces`; nothing of that is noted unless `books` are
    kept.
    position (n, 3), m, is not brought back into the cell; side (2,) and walls (2,), m, may be
    strained in place; `whole` cells are periodic along z too, between the `walls`, with a period
    that leans by `lean` (2,), m, along x and y; largest, smallest, m, of the radii. `friction`
    limits the shear forces, the sample's own by default; `skin` is the reach of the list,
    diameters.
    """

    def __init__(
        self,
        sample: Sample,
        friction: float | None = None,
        *,
        skin: float = SKIN,
        stiffness: bool = True,
        books: bool = False,
    ) -> None:
        network = sample.network()
        n = network.n_particles
        self._sample, self.friction = sample, sample.friction if friction is None else friction
        self.side = sample.periods
        self.walls, self.whole = np.array(sample.walls, float), sample.periodic_z
        self.lean = UPRIGHT
        self.skin = skin
        self._laws = sample.laws
        self._radius = np.full(n, sample.sizes)
        self.largest, self.smallest = float(self._radius.max()), float(self._radius.min())
        self.position = sample.position.copy()
        self.load, self.stiffness = np.zeros((n, 6)), np.zeros(n if stiffness else 0)
        self._ends = np.column_stack([network.particle_i, network.particle_j])
        self._shift = network.require("cell_shift", "list of contacts").astype(int)
        self._normal = network.normal.copy()
        self._shear = network.require("force_tangential", "history of contacts").copy()
        self._first = _numbers(self._ends[:, 0], self._ends[:, 1], self._shift)
        self.work = np.zeros((network.n_contacts if books else 0, 2))
        self._left = [(self._first[:0], self._ends[:0], np.zeros(0))]
        if books:
            self.work[:, 0] = (self._shear**2).sum(axis=1) / (2 * network.stiffness_tangential)
        self.seek()
        self.touch(np.zeros((n, 6)), 0.0)

    def seek(self) -> None:
        """List the pairs in reach, with the history of those that touch."""
        inside, turns = self._wrapped()
        inside[:, 2] -= self.walls[0]
        lengths, reach = self.lengths, 2 * self.largest * (1 + self.skin)
        ends, shift = contacts_in_reach(inside, lengths, reach, self.whole)
        if self.smallest < self.largest:
            skin = self.largest * self.skin
            ends, shift = near_enough((ends, shift), inside, lengths, self._radius, skin)
        # Periods between the places as they are, which are not brought back into the cell.
        pair = ends[:, 1] >= 0
        shift[pair] += (turns[ends[pair, 0]] - turns[ends[pair, 1]]).astype(np.int8)
        before_ends, before_shift = self._ends, self._shift
        self._ends, self._shift = ends, shift
        touched = self._normal.any(axis=1)
        old = _numbers(before_ends[:, 0], before_ends[:, 1], before_shift)
        new = _numbers(ends[:, 0], ends[:, 1], shift)
        before, after = _matching(old[touched], new)
        normal, shear = self._normal[touched], self._shear[touched]
        self._normal, self._shear = np.zeros((2, len(ends), 3))
        self._normal[after], self._shear[after] = normal[before], shear[before]
        if len(self.work):
            work, self.work = self.work, np.zeros((len(ends), 2))
            self.work[after] = work[touched][before]
            # A contact that is open has nothing stored; what it has dissipated stays in the books.
            gone = ~touched & (work[:, 1] != 0)
            self._left.append((old[gone], before_ends[gone], work[gone, 1]))
        self._slabs = slabs_of(self._ends, len(self.position))
        self._sought_at = self.position.copy()

    @property
    def lengths(self) -> np.ndarray:
        """Shape (3,), m: of the lateral cell, and from wall to wall or of the period along z."""
        return np.array([*self.side, self.walls[1] - self.walls[0]])

    def _wrapped(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 3) inside the cell, m, and the periods (n, 3) that were taken off."""
        position, turns = self.position.copy(), np.zeros(self.position.shape, int)
        turns[:, :2] = np.floor(position[:, :2] / self.side)
        if self.whole:
            turns[:, 2] = np.floor((position[:, 2] - self.walls[0]) / self.lengths[2])
            position[:, 2] -= turns[:, 2] * self.lengths[2]
        position[:, :2] -= turns[:, :2] * self.side
        return position, turns

    def move(self, motion: np.ndarray) -> None:
        """Move the spheres by `motion` (n, 6), m and rad, by less than `SKIN` diameters at once."""
        self.position += motion[:, :3]
        if abs(self.position - self._sought_at).max() > 0.5 * self.skin * self.largest:
            self.seek()
        self.touch(motion, 1.0)

    def touch(self, velocity: np.ndarray, dt: float, change: np.ndarray = STILL) -> None:
        """Forces at the present positions, where `velocity` (n, 6) has led in `dt`, s.

        `change` (4, 3) is what the periods have gained by the same step, m, the way that the source
        wall has gone, what the lean of the period along z has gained, and how the wall turns: see
        `modal.dem.forces`.
        """
        totals = forces_by_loop(
            self._slabs,
            self.position,
            self._ends,
            self._shift,
            np.append(self.lengths, self.lean),
            self.walls,
            self._radius,
            self._laws,
            velocity,
            dt,
            change,
            self.friction,
            self._normal,
            self._shear,
            self.work,
            self.load,
            self.stiffness,
        )
        of = dict(zip(TOTALS, totals.tolist(), strict=True))
        self.touching, self.sliding = int(of["touching"]), int(of["sliding"])
        self.mean_force = of["normal force"] / max(self.touching, 1)
        self.mean_contact = of["contact force"] / max(self.touching, 1)
        self.virial, self.on_walls = totals[4:7], np.zeros((2, 6))
        self.on_walls[:, :3], self.on_walls[:, 5] = totals[9:15].reshape(2, 3), totals[15:]
        self.elastic_energy = of["energy"]

    def level_shear(self) -> None:
        """Take the part along the contact off every shear force, as a sample does.

        Turning keeps a force across its contact to first order; over many steps a part along it of
        second order gathers.
        """
        along = (self._shear * self._normal).sum(axis=1)
        self._shear -= along[:, None] * self._normal

    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the contacts of the start that still touch: in the sample's order, and here."""
        (touching,) = np.nonzero(self._normal.any(axis=1))
        ends, shift = self._ends[touching], self._shift[touching]
        rows, here = _matching(self._first, _numbers(ends[:, 0], ends[:, 1], shift))
        return rows, touching[here]

    def slip_book(self) -> tuple[np.ndarray, np.ndarray]:
        """Ends (k, 2) of all contacts that have slid, and J (k,) that slip has dissipated in each.

        In no order; those that have come and gone since the start are among them.
        """
        _, ends, lost = self._slips()
        return ends, lost

    def slip_work(self) -> np.ndarray:
        """Shape (m,), J: what slip has dissipated in each contact of the start, in their order."""
        number, _, energy = self._slips()
        lost = np.zeros(len(self._first))
        rows, here = _matching(self._first, number)
        lost[rows] = energy[here]
        return lost

    def _slips(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers (k,), ends (k, 2) and energies (k,), J, of all contacts that have slid."""
        slid = self.work[:, 1] != 0
        ends, shift = self._ends[slid], self._shift[slid]
        here = _numbers(ends[:, 0], ends[:, 1], shift), ends, self.work[slid, 1]
        numbers, ends, energy = map(np.concatenate, zip(*self._left, here, strict=True))
        number, first, which = np.unique(numbers, return_index=True, return_inverse=True)
        return number, ends[first], np.bincount(which, energy, len(number))

    @property
    def slipped(self) -> float:
        """What slip has dissipated so far, J, if `books` are kept."""
        return float(self.work[:, 1].sum() + sum(energy.sum() for _, _, energy in self._left))

    def pairs(self) -> np.ndarray:
        """Shape (k, 2): the two spheres of each contact that there is, or that may soon be."""
        return self._ends[self._ends[:, 1] >= 0]

    def numbers(self) -> tuple[int, int]:
        """Contacts between spheres, and with the walls."""
        walls = self._normal.any(axis=1) & (self._ends[:, 1] < 0)
        return self.touching - int(walls.sum()), int(walls.sum())

    def sample(self) -> Sample:
        """The sample as it is now, at rest."""
        position, turns = self._wrapped()
        bare = replace(
            self._sample,
            position=position,
            side=np.where(self._sample.periodic_sides, self.side, self._sample.side),
            walls=self.walls.copy(),
            shear=None,
            velocity=None,
            angular_velocity=None,
            strain_rate=None,
        )
        contact = bare.contacts()
        i, j = self._ends.T.astype(int)
        shift, pair = self._shift.astype(int), j >= 0
        shift[pair] += turns[j[pair]] - turns[i[pair]]
        here = _numbers(contact.particle_i, contact.particle_j, contact.cell_shift)
        before, after = _matching(_numbers(i, j, shift), here)
        force = np.zeros((len(here), 3))
        force[after] = self._shear[before]
        first, second = tangents(contact.normal)
        shear = np.column_stack([(force * first).sum(axis=1), (force * second).sum(axis=1)])
        return replace(bare, shear=shear)
