"""Keep the contacts of spheres that move: the list of near pairs, and the history of contacts.

The list of near pairs is valid until a sphere has moved far. A new list takes over the normals and
shear forces of the contacts that still exist. The forces are computed in `modal.dem.forces`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.dem.contact_step import UPRIGHT, Geometry, ShearStep, split_moment
from modal.dem.forces import forces_by_loop
from modal.dem.near_contacts import contacts_in_reach, longest_paths
from modal.packing.contact_models import acts_across_gaps
from modal.packing.neighbours import contact_keys
from modal.packing.network import Network
from modal.packing.sample import Sample
from modal.tools.arrays import Bools, Floats, Ints
from modal.tools.errors import InputError
from modal.tools.loops import dot
from modal.tools.slabs import SLABS, slabs_of

SKIN = 0.03
"""Initial distance beyond touch up to which pairs are listed, in diameters of the largest
sphere."""
MAX_SKIN = 0.24
"""Largest distance beyond touch up to which pairs are listed, in diameters of the largest sphere:
long lists cost time in every step."""
MIN_LIST_STEPS = 50
"""Number of steps below which a list of pairs has been valid too shortly: the next list reaches
twice as far."""
UNCHANGED_CELL = np.zeros((4, 3))
"""Change of a cell whose periods and walls do not move, see `modal.dem.contact_step.ShearStep`."""


class _Slips(NamedTuple):
    """Contacts that have slid: keys (k,), ends (k, 2), and the energies dissipated (k,), J."""

    key: Ints
    ends: Ints
    energy: Floats


def _match_rows(old: Ints, new: Ints) -> tuple[Ints, Ints]:
    """Return the rows, in `old` and in `new`, of the keys that are in both."""
    _, rows_old, rows_new = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return rows_old, rows_new


def energy_of_moments(network: Network) -> Floats:
    """Return the energy (m,), J, that contacts store in their moments; 0 for a zero stiffness."""
    purpose = "energy of moments"
    moment = network.require("moment", purpose)
    rolling, twisting = split_moment(moment.T, network.normal.T)
    energy = np.zeros(network.n_contacts)
    parts = ((rolling, "stiffness_rolling"), (twisting, "stiffness_twisting"))
    for part, name in parts:
        stiffness = network.require(name, purpose)
        has_stiffness = stiffness > 0
        energy += np.where(
            has_stiffness, 0.5 * dot(part, part) / np.where(has_stiffness, stiffness, 1.0), 0.0
        )
    return energy


class MovingContacts:
    """The contacts of a sample while its spheres move.

    Position, side and walls may be changed in place between two calls of `touch`. A call of `touch`
    computes `load` and the attributes listed after it.

    Parameters
    ----------
    sample : Sample
        The packing at the start.
    friction : float, optional
        Coefficient that limits the shear forces; the sample's own by default. Coefficients against
        rolling and twisting are scaled alike.
    skin : float, default `SKIN`
        Reach of the list of pairs beyond touch, in diameters of the largest sphere.
    history : bool, default True
        Whether contacts have shear forces, which follow from the motion. Normal forces follow from
        the positions alone.
    stiffness : bool, default True
        Whether to sum the stiffnesses of each sphere.
    track_energy : bool, default False
        Whether to record `work`.

    Attributes
    ----------
    position : ndarray (n, 3)
        Centres, m; spheres that leave the cell are not brought back.
    side, walls : ndarray (2,)
        Lateral periods, and z of source and receiver wall, m.
    periodic_z : bool
        Whether there is a period along z in place of the walls.
    lean : ndarray (2,)
        How far the period along z leans along x and y, m.
    radius : ndarray (n,)
        Radii, m; `largest` and `smallest` are their extremes.
    max_step : float
        Largest displacement of a sphere in one step, m; infinite by default.
    body : ndarray of int (n,) or None
        Number of each sphere's clump, if the grains are clumps.
    rotation : ndarray (k, 3, 3) or None
        Rotation of each clump from its orientation in the sample.
    arm : ndarray (n, 3) or None
        Vector from the centre of mass of its clump to each sphere, m.
    load : ndarray (n, 6) or (n, 3)
        Net force, N, and with history the torque, N m, on each sphere; zero along held motions.
    on_held : ndarray, as `load`
        Force and torque of the contacts along the held motions of each sphere; the support that
        holds the sphere bears them.
    stiffness : ndarray (n,) or (0,)
        Sum of the normal stiffnesses of each sphere, N/m.
    mean_force, mean_contact, mean_stiffness : float
        Means over contacts: of the normal force, of the whole force, N, and of kn, N/m.
    touching, sliding : int
        Numbers of contacts.
    virial : ndarray (3,)
        Principal stresses times the volume, N m.
    on_walls : ndarray (2, 6)
        Forces on source and receiver wall, N, and their torques about z, N m.
    elastic_energy : float
        Energy of the normal forces, J.
    work : ndarray (m, 2)
        Energy that the shear force of each listed contact has stored, and energy that slip has
        dissipated, J, as in `modal.dem.contact_step.ShearStep`; (0, 2) unless `track_energy`.
        Moments are included.
    """

    def __init__(
        self,
        sample: Sample,
        friction: float | None = None,
        *,
        skin: float = SKIN,
        history: bool = True,
        stiffness: bool = True,
        track_energy: bool = False,
    ) -> None:
        n = len(sample.position)
        self._sample = sample
        self.friction = sample.friction if friction is None else friction
        self._turning_share = 1.0
        if sample.friction > 0:
            self._turning_share = self.friction / sample.friction
        self.side = sample.periods
        self.walls = np.array(sample.walls, float)
        self.periodic_z = sample.periodic_z
        self.lean = UPRIGHT
        self.skin = skin
        self.max_step = math.inf
        self._laws = sample.laws
        self.radius = np.full(n, sample.sizes)
        self.largest = float(self.radius.max())
        self.smallest = float(self.radius.min())
        # Contacts that act across a gap must stay in the list: a pair's gap is shared by two.
        pair_gap, wall_gap = sample.rupture_distances
        self._gap = max(pair_gap / 2, wall_gap) / self.largest
        self.position = sample.position.copy()
        self.body = sample.body
        self.arm = None if sample.arm is None else sample.arm.copy()
        self.rotation = None if sample.body is None else np.tile(np.eye(3), (sample.grains, 1, 1))
        self.load = np.zeros((n, 6 if history else 3))
        self.on_held = np.zeros((n, 6 if history else 3))
        self.stiffness = np.zeros(n if stiffness else 0)
        self._history = history
        self._tracks_energy = history and track_energy
        self.work = np.zeros((0, 2))
        if history:
            self._read_history()
        self._list_steps = MIN_LIST_STEPS
        self._moved = 0.0
        self._paths = np.empty(SLABS)
        self._list_pairs()
        self.touch()

    def _read_history(self) -> None:
        """Take the contacts and shear forces from the sample."""
        network = self._sample.sphere_network()
        self._ends = np.column_stack([network.particle_i, network.particle_j])
        self._shift = network.require("cell_shift", "list of contacts").astype(int)
        self._normal = network.normal.copy()
        self._shear = network.require("force_tangential", "history of contacts").copy()
        self._moment = None
        if self._sample.resists_turning:
            self._moment = network.require("moment", "history of contacts").copy()
        self._key_at_start = contact_keys(self._ends[:, 0], self._ends[:, 1], self._shift)
        self._slips_of_open = [_Slips(self._key_at_start[:0], self._ends[:0], np.zeros(0))]
        if self._tracks_energy:
            self.work = np.zeros((network.n_contacts, 2))
            self.work[:, 0] = (self._shear**2).sum(axis=1) / (2 * network.stiffness_tangential)
            if self._moment is not None:
                self.work[:, 0] += energy_of_moments(network)

    def _list_pairs(self) -> None:
        """List the pairs within reach, with the normals and shear forces of those that touch."""
        if self._list_steps < MIN_LIST_STEPS:
            self.skin = max(self.skin, min(2 * self.skin, MAX_SKIN))
        inside, periods = self._wrap_positions()
        inside[:, 2] -= self.walls[0]
        skin = self.largest * (self.skin + self._gap)
        ends, shift = contacts_in_reach(inside, self.lengths, self.radius, skin, self.periodic_z)
        body = self.body
        if body is not None:
            outer = (body[ends[:, 0]] != body[np.maximum(ends[:, 1], 0)]) | (ends[:, 1] < 0)
            ends = ends[outer]
            shift = shift[outer]
        crossing = int((shift[:, 2] != 0).sum())
        # Periods between the actual positions, which are not brought back into the cell.
        i, j = ends.T
        outside = np.asarray(periods.any(axis=1))
        partner = np.maximum(j, 0)  # a wall has no place among the spheres
        rows = np.flatnonzero((j >= 0) & (outside[i] | outside[partner]))
        shift[rows] += (periods[i[rows]] - periods[j[rows]]).astype(np.int8)
        if self._history:
            self._transfer_history(ends, shift)
        self._ends = ends
        self._shift = shift
        self._slabs = slabs_of(ends, len(self.position), crossing)
        self._listed_position = self.position.copy()
        self._listed_lengths = self.lengths
        self._listed_walls = self.walls.copy()
        self._list_steps = 0
        self._moved = math.hypot(*self.lean)

    def _transfer_history(self, ends: Ints, shift: Ints) -> None:
        """Copy the normals and shear forces of contacts that still exist to a new list of pairs."""
        touched = self._normal.any(axis=1)
        old_keys = contact_keys(self._ends[:, 0], self._ends[:, 1], self._shift)
        new_keys = contact_keys(ends[:, 0], ends[:, 1], shift)
        before, after = _match_rows(old_keys[touched], new_keys)
        normal = self._normal[touched]
        shear = self._shear[touched]
        self._normal = np.zeros((len(ends), 3))
        self._shear = np.zeros((len(ends), 3))
        self._normal[after] = normal[before]
        self._shear[after] = shear[before]
        if self._moment is not None:
            moment = self._moment[touched]
            self._moment = np.zeros((len(ends), 3))
            self._moment[after] = moment[before]
        if self._tracks_energy:
            work = self.work
            self.work = np.zeros((len(ends), 2))
            self.work[after] = work[touched][before]
            # An open contact stores nothing, but what it has dissipated is still counted.
            open_slid = ~touched & (work[:, 1] != 0)
            slips = _Slips(old_keys[open_slid], self._ends[open_slid], work[open_slid, 1])
            self._slips_of_open.append(slips)

    @property
    def lengths(self) -> Floats:
        """Return the lateral periods and the distance of the walls, or the period in z, (3,), m."""
        return np.array([*self.side, self.walls[1] - self.walls[0]])

    def _wrap_positions(self) -> tuple[Floats, Ints]:
        """Return the positions (n, 3) inside the cell, m, and the periods (n, 3) subtracted."""
        position = self.position.copy()
        periods = np.zeros(self.position.shape, int)
        periods[:, :2] = np.floor(position[:, :2] / self.side)
        if self.periodic_z:
            periods[:, 2] = np.floor((position[:, 2] - self.walls[0]) / self.lengths[2])
            position[:, 2] -= periods[:, 2] * self.lengths[2]
        position[:, :2] -= periods[:, :2] * self.side
        return position, periods

    def move(self, motion: Floats) -> None:
        """Displace the spheres by `motion` (n, 6), m and rad, without a time step."""
        self.position += motion[:, :3]
        self.touch(motion, 1.0)

    def touch(
        self, velocity: Floats | None = None, dt: float = 0.0, change: Floats = UNCHANGED_CELL
    ) -> None:
        """Compute the forces at the present positions.

        The last step of `dt`, s, had the velocities `velocity` (n, 6); `change` (4, 3) is the
        change of the cell in this step, see `modal.dem.contact_step.ShearStep`. InputError if a
        sphere has moved by more than `max_step`.
        """
        self._update_list(dt)
        geometry = Geometry(
            self.position,
            self._ends,
            self._shift,
            np.append(self.lengths, self.lean),
            self.walls,
            self.radius,
        )
        step = None
        if self._history:
            if velocity is None:
                velocity = np.zeros(self.load.shape)
            step = ShearStep(
                velocity,
                dt,
                change,
                self.friction,
                self._normal,
                self._shear,
                self.work,
                self._moment,
                self._turning_share * self._sample.rolling,
                self._turning_share * self._sample.twisting,
            )
        totals = forces_by_loop(self._slabs, geometry, self._laws, step, self.load, self.stiffness)
        if self._sample.fixed is not None:
            fixed = self._sample.fixed[:, : self.load.shape[1]]
            self.on_held = np.where(fixed, self.load, 0.0)
            self.load[fixed] = 0.0
        self.touching = int(totals.touching)
        self.sliding = int(totals.sliding)
        count = max(self.touching, 1)
        self.mean_force = totals.normal_force / count
        self.mean_stiffness = totals.stiffness / count
        self.mean_contact = self.mean_force
        if self._history:
            self.mean_contact = totals.contact_force / count
        self.virial = np.array([totals.virial_x, totals.virial_y, totals.virial_z])
        self.on_walls = np.zeros((2, 6))
        self.on_walls[0, :3] = totals.source_x, totals.source_y, totals.source_z
        self.on_walls[1, :3] = totals.receiver_x, totals.receiver_y, totals.receiver_z
        self.on_walls[:, 5] = totals.source_torque, totals.receiver_torque
        self.elastic_energy = totals.elastic_energy

    def _update_list(self, dt: float) -> None:
        """Make a new list of pairs if pairs that are not listed may touch by now.

        `dt` is the last time step, s.
        """
        stretch = self.lengths / self._listed_lengths
        longest_paths(self.position, self._listed_position, stretch, self._paths)
        moved = float(self._paths.max())
        # A list is made with an upright period along z; walls move by themselves.
        wall_paths = abs(self.walls - stretch[2] * self._listed_walls)
        moved += math.hypot(*self.lean) + float(wall_paths.max())
        # Both are paths since the list was made: the longest one has grown by their difference.
        if not moved - self._moved < self.max_step:
            raise InputError(
                "unstable_step",
                f"a sphere moves by more than its radius in one step of {dt:.3g} s",
                "the motion is unstable",
                "take a smaller fraction",
            )
        self._moved = moved
        self._list_steps += 1
        # Of spheres of several sizes the list reaches the skin of the largest beyond the touch of
        # each pair, which holds longer than for two of the largest. Two spheres beyond the reach
        # are at least (D + skin D) s - 2 u apart by now, a sphere and a wall half as far.
        reach = 1 + self._gap
        if not (reach + self.skin) * min(1.0, stretch.min()) - moved / self.largest >= reach:
            self._list_pairs()

    def stress(self) -> Floats:
        """Return the principal stresses (3,), Pa, compression positive, at the last `touch`."""
        virial = self.virial
        if self.arm is not None:
            # Branch vectors join the centres of mass.
            virial = virial - (self.load[:, :3] * self.arm).sum(axis=0)
        stress: Floats = virial / self.lengths.prod()
        return stress

    def unbalanced(self) -> float:
        """Return mean net force on a grain divided by mean contact force; inf without contacts."""
        if self.touching == 0:
            return math.inf
        net_force = np.sqrt((self.grain_load[:, :3] ** 2).sum(axis=1))
        return float(net_force.mean() / self.mean_contact)

    @property
    def grain_load(self) -> Floats:
        """Net force, N, and torque, N m, on each grain (k, 6): spheres, or clumps."""
        if self.body is None or self.arm is None:
            return self.load
        force = self.load[:, :3]
        torque = self.load[:, 3:] + np.cross(self.arm, force)
        columns = np.hstack([force, torque]).T
        return np.column_stack([np.bincount(self.body, column) for column in columns])

    @property
    def grain_radius(self) -> Floats:
        """Radii (k,), m, of spheres of the volumes of the grains."""
        mass = self._sample.body_mass
        if mass is None:
            return self.radius
        radius: Floats = np.cbrt(mass / self._sample.material.density / (4 / 3 * np.pi))
        return radius

    def level_shear(self) -> None:
        """Subtract from every shear force its part along the contact normal.

        Turning keeps a force perpendicular to its contact to first order; over many steps a part
        along the normal, of second order, builds up. The shear forces that a sample stores have no
        such part.
        """
        along = (self._shear * self._normal).sum(axis=1)
        self._shear -= along[:, None] * self._normal

    def opened_contacts(self) -> Bools:
        """Return which contacts (m,) of the start are open now, in the order of the sample."""
        touching = self._normal.any(axis=1)
        ends = self._ends[touching]
        shift = self._shift[touching]
        return ~np.isin(self._key_at_start, contact_keys(ends[:, 0], ends[:, 1], shift))

    def slips(self) -> tuple[Ints, Floats, Ints]:
        """Return ends (k, 2), dissipated energy (k,), J, and row (k,) of contacts that have slid.

        Contacts that have opened, or come and gone, since the start are included; they are in no
        particular order. A row is the index of the contact in the sample, or -1 for a contact that
        the sample did not have.
        """
        slid = self.work[:, 1] != 0
        ends = self._ends[slid]
        shift = self._shift[slid]
        listed = _Slips(contact_keys(ends[:, 0], ends[:, 1], shift), ends, self.work[slid, 1])
        all_slips = [*self._slips_of_open, listed]
        key, first, which = np.unique(
            np.concatenate([slips.key for slips in all_slips]),
            return_index=True,
            return_inverse=True,
        )
        ends = np.concatenate([slips.ends for slips in all_slips])[first]
        energies = np.concatenate([slips.energy for slips in all_slips])
        energy = np.asarray(np.bincount(which, energies, len(key)), float)
        rows = np.full(len(key), -1)
        rows_at_start, matched = _match_rows(self._key_at_start, key)
        rows[matched] = rows_at_start
        return ends, energy, rows

    @property
    def slipped(self) -> float:
        """Return the energy, J, that slip has dissipated so far; 0 unless `track_energy`."""
        of_open = sum(slips.energy.sum() for slips in self._slips_of_open)
        return float(self.work[:, 1].sum() + of_open)

    def sample(self) -> Sample:
        """Return a sample with the present positions and contacts, at rest."""
        position, periods = self._wrap_positions()
        bare = replace(
            self._sample,
            position=position,
            side=np.where(self._sample.periodic_sides, self.side, self._sample.side),
            walls=self.walls.copy(),
            shear=None,
            moment=None,
            velocity=None,
            angular_velocity=None,
            strain_rate=None,
        )
        tensor = self._sample.body_tensor
        if tensor is not None and self.rotation is not None:
            turned = self.rotation @ tensor @ self.rotation.transpose(0, 2, 1)
            bare = replace(bare, arm=self.arm, body_tensor=turned)
        if not self._history:
            return bare
        i, j = self._ends.T.astype(int)
        shift = self._shift.astype(int)
        pair = j >= 0
        shift[pair] += periods[j[pair]] - periods[i[pair]]
        listed_keys = contact_keys(i, j, shift)
        if acts_across_gaps(self._laws[0]):
            touched = self._normal.any(axis=1)
            bare.acting = np.isin(bare.pairs_in_reach().keys, listed_keys[touched])
        contact = bare.contacts()
        before, after = _match_rows(listed_keys, contact.keys)
        force = np.zeros((len(contact.overlap), 3))
        force[after] = self._shear[before]
        moment = None
        if self._moment is not None:
            moment = np.zeros((len(contact.overlap), 3))
            moment[after] = self._moment[before]
        return replace(bare, shear=contact.along(force), moment=moment)
