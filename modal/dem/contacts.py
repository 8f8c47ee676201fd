"""Contacts of spheres that move: which pairs are near, and the history of those that touch.

The list of nearby pairs holds while no sphere has gone far; a new one takes over the normals and
shear forces of the contacts that go on. The law itself is `modal.dem.forces`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from modal.dem.forces import TOTALS, UPRIGHT, forces_by_loop
from modal.dem.near_contacts import contacts_in_reach, longest_ways
from modal.packing.sample import Sample
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError
from modal.tools.slabs import SLABS, slabs_of

SKIN, WIDEST = 0.03, 0.24
"""First and largest reach of the list of pairs beyond touch, diameters of the largest sphere. A
list that has lasted fewer than `LIFE` steps is followed by one of twice the reach: long ones cost
time in every step."""
LIFE = 50
STILL = np.zeros((4, 3))
"""Change of a cell whose periods and walls rest."""


def _numbers(i: Ints, j: Ints, shift: Ints) -> Ints:
    """One number for each contact by its ends and periods."""
    number = i.astype(np.int64)
    # Walls are -1 and -2; periods are small, a sphere reaches few images of another.
    number = (number << 22) + j + 2
    for axis in range(3):
        number = (number << 6) + shift[:, axis].astype(np.int64) + 32
    return number


def _matching(old: Ints, new: Ints) -> tuple[Ints, Ints]:
    """Rows of the contacts that are in both, in `old` and in `new`."""
    _, before, after = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return before, after


class MovingContacts:
    """The contacts of a sample, kept through its motions.

    After each `touch`: load (n, 6), N and N m, the net force and torque on each sphere; stiffness
    (n,), N/m, the sum of its kn; mean_force, N, and mean_stiffness, N/m; the numbers touching and
    sliding; virial (3,), N m, the principal stresses times the volume; mean_contact, N, of normal
    and shear force together; on_walls (2, 6), N and N m, the forces on source and receiver wall and
    their torques about z; elastic_energy, J, of the normal forces. `work` (m, 2), J, is what shear
    forces have stored and slip has dissipated so far, see `modal.dem.forces`; nothing of that is
    noted unless `books` are kept. Without `history` contacts have normal forces alone, which
    follow from the positions: load is (n, 3) then.
    position (n, 3), m, is not brought back into the cell; side (2,) and walls (2,), m, may be
    strained in place; `whole` cells are periodic along z too, between the `walls`, with a period
    that leans by `lean` (2,), m, along x and y; radius (n,), m, the largest, the smallest.
    `friction` limits the shear forces, the sample's own by default; `skin` is the reach of the
    list, diameters; `most`, m, is how far a sphere may go at once.
    """

    def __init__(
        self,
        sample: Sample,
        friction: float | None = None,
        *,
        skin: float = SKIN,
        history: bool = True,
        stiffness: bool = True,
        books: bool = False,
    ) -> None:
        n = len(sample.position)
        self._sample, self.friction = sample, sample.friction if friction is None else friction
        self.side = sample.periods
        self.walls, self.whole = np.array(sample.walls, float), sample.periodic_z
        self.lean = UPRIGHT
        self.skin, self.most = skin, math.inf
        self._laws = sample.laws
        self.radius = np.full(n, sample.sizes)
        self.largest, self.smallest = float(self.radius.max()), float(self.radius.min())
        self.position = sample.position.copy()
        self.load = np.zeros((n, 6 if history else 3))
        self.stiffness = np.zeros(n if stiffness else 0)
        self._history, self.work = history, np.zeros((0, 2))
        if history:
            self._begin(books)
        self._age, self.moved, self._ways = LIFE, 0.0, np.empty(SLABS)
        self.seek()
        self.touch()

    def _begin(self, books: bool) -> None:
        """The history that the sample has."""
        network = self._sample.network()
        self._ends = np.column_stack([network.particle_i, network.particle_j])
        self._shift = network.require("cell_shift", "list of contacts").astype(int)
        self._normal = network.normal.copy()
        self._shear = network.require("force_tangential", "history of contacts").copy()
        self._first = _numbers(self._ends[:, 0], self._ends[:, 1], self._shift)
        self._left = [(self._first[:0], self._ends[:0], np.zeros(0))]
        if books:
            self.work = np.zeros((network.n_contacts, 2))
            self.work[:, 0] = (self._shear**2).sum(axis=1) / (2 * network.stiffness_tangential)

    def seek(self) -> None:
        """List the pairs in reach, with the history of those that touch."""
        if self._age < LIFE:
            self.skin = max(self.skin, min(2 * self.skin, WIDEST))
        inside, turns = self._wrapped()
        inside[:, 2] -= self.walls[0]
        skin = self.largest * self.skin
        ends, shift = contacts_in_reach(inside, self.lengths, self.radius, skin, self.whole)
        # Periods between the places as they are, which are not brought back into the cell.
        (i, j), gone = ends.T, np.asarray(turns.any(axis=1))
        partner = np.maximum(j, 0)  # a wall has no place among the spheres
        rows = np.flatnonzero((j >= 0) & (gone[i] | gone[partner]))
        shift[rows] += (turns[i[rows]] - turns[j[rows]]).astype(np.int8)
        if self._history:
            self._take_over(ends, shift)
        self._ends, self._shift = ends, shift
        self._slabs = slabs_of(ends, len(self.position))
        self._sought_at, self._sought_in = self.position.copy(), (self.lengths, self.walls.copy())
        self._age, self.moved = 0, math.hypot(*self.lean)

    def _take_over(self, ends: Ints, shift: Ints) -> None:
        """Give a new list the history of the contacts that go on."""
        touched = self._normal.any(axis=1)
        old = _numbers(self._ends[:, 0], self._ends[:, 1], self._shift)
        before, after = _matching(old[touched], _numbers(ends[:, 0], ends[:, 1], shift))
        normal, shear = self._normal[touched], self._shear[touched]
        self._normal, self._shear = np.zeros((2, len(ends), 3))
        self._normal[after], self._shear[after] = normal[before], shear[before]
        if len(self.work):
            work, self.work = self.work, np.zeros((len(ends), 2))
            self.work[after] = work[touched][before]
            # A contact that is open has nothing stored; what it has dissipated stays in the books.
            gone = ~touched & (work[:, 1] != 0)
            self._left.append((old[gone], self._ends[gone], work[gone, 1]))

    @property
    def lengths(self) -> Floats:
        """Shape (3,), m: of the lateral cell, and from wall to wall or of the period along z."""
        return np.array([*self.side, self.walls[1] - self.walls[0]])

    def _wrapped(self) -> tuple[Floats, Ints]:
        """Positions (n, 3) inside the cell, m, and the periods (n, 3) that were taken off."""
        position, turns = self.position.copy(), np.zeros(self.position.shape, int)
        turns[:, :2] = np.floor(position[:, :2] / self.side)
        if self.whole:
            turns[:, 2] = np.floor((position[:, 2] - self.walls[0]) / self.lengths[2])
            position[:, 2] -= turns[:, 2] * self.lengths[2]
        position[:, :2] -= turns[:, :2] * self.side
        return position, turns

    def move(self, motion: Floats) -> None:
        """Move the spheres by `motion` (n, 6), m and rad, at once."""
        self.position += motion[:, :3]
        self.touch(motion, 1.0)

    def touch(
        self, velocity: Floats | None = None, dt: float = 0.0, change: Floats = STILL
    ) -> None:
        """Forces at the present positions, where `velocity` (n, 6) has led in `dt`, s.

        `change` (4, 3) is what the periods have gained by the same step, m, the way that the source
        wall has gone, what the lean of the period along z has gained, and how the wall turns: see
        `modal.dem.forces`. InputError where a sphere has gone further than `most`.
        """
        self._keep_complete(dt)
        if velocity is None:
            velocity = np.zeros(self.load.shape)
        law = velocity, dt, change, self.friction
        totals = forces_by_loop(
            self._slabs,
            self.position,
            self._ends,
            self._shift,
            np.append(self.lengths, self.lean),
            self.walls,
            self.radius,
            self._laws,
            # All that slip asks for is None where there is none.
            *((*law, self._normal, self._shear, self.work) if self._history else [None] * 7),
            self.load,
            self.stiffness,
        )
        of = dict(zip(TOTALS, totals.tolist(), strict=True))
        self.touching, self.sliding = int(of["touching"]), int(of["sliding"])
        count = max(self.touching, 1)
        self.mean_force, self.mean_stiffness = of["normal force"] / count, of["stiffness"] / count
        self.mean_contact = of["contact force"] / count if self._history else self.mean_force
        self.virial, self.on_walls = totals[4:7], np.zeros((2, 6))
        self.on_walls[:, :3], self.on_walls[:, 5] = totals[9:15].reshape(2, 3), totals[15:]
        self.elastic_energy = of["energy"]

    def _keep_complete(self, dt: float) -> None:
        """Seek the pairs anew where others may touch by now."""
        lengths, walls = self._sought_in
        stretch = self.lengths / lengths
        longest_ways(self.position, self._sought_at, stretch, self._ways)
        moved = float(self._ways.max())
        # A list is sought with a period that stands upright; walls have their own ways.
        moved += math.hypot(*self.lean) + float(abs(self.walls - stretch[2] * walls).max())
        # Both are ways since the list was made: by their difference the farthest one has grown.
        if not moved - self.moved < self.most:
            raise InputError(
                "input",
                f"a sphere moves by more than its radius in one step of {dt:.3g} s",
                "the motion is unstable",
                "take a smaller fraction",
            )
        self.moved = moved
        self._age += 1
        # Of spheres of several sizes the list goes the skin of the largest beyond each pair's own
        # touch, which holds longer than of two of the largest. Two spheres beyond the reach are
        # (D + skin D) s - 2 u apart or more by now, a sphere and a wall half as far.
        if not (1 + self.skin) * min(1.0, stretch.min()) - moved / self.largest >= 1:
            self.seek()

    def stress(self) -> Floats:
        """Principal stresses (3,), Pa, compression positive, of the forces found last."""
        stress: Floats = self.virial / self.lengths.prod()
        return stress

    def unbalanced(self) -> float:
        """Mean net force on a sphere over the mean contact force; infinite without contacts."""
        if self.touching == 0:
            return math.inf
        return float(np.sqrt((self.load[:, :3] ** 2).sum(axis=1)).mean() / self.mean_contact)

    def level_shear(self) -> None:
        """Take the part along the contact off every shear force, as a sample does.

        Turning keeps a force across its contact to first order; over many steps a part along it of
        second order gathers.
        """
        along = (self._shear * self._normal).sum(axis=1)
        self._shear -= along[:, None] * self._normal

    def opened(self) -> Bools:
        """Shape (m,) bool: which contacts of the start are open, in the sample's order."""
        touching = self._normal.any(axis=1)
        ends, shift = self._ends[touching], self._shift[touching]
        return ~np.isin(self._first, _numbers(ends[:, 0], ends[:, 1], shift))

    def slips(self) -> tuple[Ints, Floats, Ints]:
        """All contacts that have slid: ends (k, 2), J (k,) that slip has dissipated, and rows (k,).

        In no order; those that have come and gone since the start are among them. The rows are
        those in the sample's order, -1 of contacts that it did not have.
        """
        slid = self.work[:, 1] != 0
        ends, shift = self._ends[slid], self._shift[slid]
        here = _numbers(ends[:, 0], ends[:, 1], shift), ends, self.work[slid, 1]
        numbers, ends, energy = map(np.concatenate, zip(*self._left, here, strict=True))
        number, first, which = np.unique(numbers, return_index=True, return_inverse=True)
        rows = np.full(len(number), -1)
        of_start, at = _matching(self._first, number)
        rows[at] = of_start
        return ends[first], np.asarray(np.bincount(which, energy, len(number)), float), rows

    @property
    def slipped(self) -> float:
        """What slip has dissipated so far, J, if `books` are kept."""
        return float(self.work[:, 1].sum() + sum(energy.sum() for _, _, energy in self._left))

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
        if not self._history:
            return bare
        contact = bare.contacts()
        i, j = self._ends.T.astype(int)
        shift, pair = self._shift.astype(int), j >= 0
        shift[pair] += turns[j[pair]] - turns[i[pair]]
        here = _numbers(contact.particle_i, contact.particle_j, contact.cell_shift)
        before, after = _matching(_numbers(i, j, shift), here)
        force = np.zeros((len(here), 3))
        force[after] = self._shear[before]
        return replace(bare, shear=contact.along(force))
