"""Put contacts into the order in which the loops of `modal.system.loops` go through them.

Contacts are sorted along z by their lower sphere, independent of the numbers of the spheres, and
those across a period along z come last. Both bodies of a contact are then usually still in the
cache. Each core computes slabs of contacts (`modal.tools.loops`). A slab consists of pieces; each
piece lists the spheres whose first contact is in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from modal.packing.columns import PART
from modal.packing.network import Network
from modal.system.contacts import PreStress, carried, centre_distance, terms_of
from modal.tools.arrays import Floats, Ints
from modal.tools.slabs import slabs_of

COLUMN_WIDTH_IN_DIAMETERS = 64
"""Width, in diameters, of the columns in which a wider packing is processed, so that their layers
fit into a cache."""
CONTACTS_PER_PIECE = 256
"""Number of contacts of a piece: a few pieces, with the spheres that they touch, fit into the cache
of a core."""
MAX_ROUND_OFF_ACROSS = 16 * np.finfo(float).eps
"""Largest component of a lever across its normal, divided by the longest lever, that is
round-off."""


class OrderedContacts(NamedTuple):
    """The m contacts of n spheres in the order of the loops; lengths in m, stiffnesses in N/m.

    Attributes
    ----------
    rows : ndarray (m, 7)
        Normal vector, kn - kt, kt, and the components of the two levers along the normal, the
        second one negated.
    ends : ndarray (m, 2) of int32
        Indices of the two bodies; walls are negative.
    slabs : ndarray (s + 1,)
        Index of the first piece of each slab, and the number p of pieces.
    pieces : ndarray (p + 1, 2)
        Index of the first contact of each piece, and the first index into `fresh`.
    fresh : ndarray (n,) of int32
        The spheres, sorted by the piece with their first contact; spheres without contacts are at
        the end.
    lateral : ndarray (m,) or None
        -N / l of a normal pre-stress: normal force divided by the distance of centres, N/m.
    aside : ndarray (m, 6) or None
        Components of both levers across the normal; None if all levers are parallel to the normals.
    rolling : ndarray (m, 2) or None
        kr and kw - kr, N m/rad; None if no contact resists rolling.
    """

    rows: Floats
    ends: Ints
    slabs: Ints
    pieces: Ints
    fresh: Ints
    lateral: Floats | None
    aside: Floats | None
    rolling: Floats | None

    @classmethod
    def from_network(cls, network: Network, pre_stress: PreStress) -> OrderedContacts:
        """Order the contacts of a network; `pre_stress` is "none" or "normal"."""
        order, slabs = _order_along_z(network)
        ends = np.empty((len(order), 2), np.int32)
        rows = np.empty((len(order), 7))
        lateral = None
        normal_force = carried(network, terms_of(pre_stress)).get("force_normal")
        if normal_force is not None:
            lateral = -normal_force[order] / centre_distance(network)[order]
        longest = np.zeros(2)
        longest_across = np.zeros(2)
        # Contacts are taken part by part, so that intermediate arrays take little memory.
        for first in range(0, len(order), PART):
            part = slice(first, first + PART)
            contacts = order[part]
            normal = network.normal[contacts]
            ends[part, 0] = network.particle_i[contacts]
            ends[part, 1] = network.particle_j[contacts]
            part_rows = rows[part]
            part_rows[:, 0:3] = normal
            part_rows[:, 4] = network.stiffness_tangential[contacts]
            part_rows[:, 3] = network.stiffness_normal[contacts] - part_rows[:, 4]
            levers = (network.lever_i[contacts], network.lever_j[contacts])
            for k, lever in enumerate(levers):
                along, across = _split_levers(lever, normal)
                part_rows[:, 5 + k] = along
                longest[k] = abs(along).max(initial=longest[k])
                longest_across[k] = abs(across).max(initial=longest_across[k])
            part_rows[:, 6] *= -1.0
        aside = None
        if (longest_across > MAX_ROUND_OFF_ACROSS * longest).any():
            _, across_i = _split_levers(network.lever_i, network.normal)
            _, across_j = _split_levers(network.lever_j, network.normal)
            aside = np.hstack([across_i[order], across_j[order]])
        rolling = None
        kr = network.stiffness_rolling
        kw = network.stiffness_twisting
        if kr is not None and kw is not None:
            rolling = np.column_stack([kr, kw - kr])[order]
        pieces = _cut_into_pieces(ends, slabs, network.n_particles)
        return cls(rows, ends, *pieces, lateral, aside, rolling)

    def renumbered(self) -> tuple[OrderedContacts, Ints]:
        """Return the contacts with spheres numbered in the order of the loops, and the old numbers.

        The motions of spheres that a loop reads one after the other are then adjacent in memory.
        The former numbers have the shape (n,).
        """
        in_order = np.arange(len(self.fresh), dtype=np.int32)
        number = np.empty_like(in_order)
        number[self.fresh] = in_order
        is_sphere = self.ends >= 0
        ends = self.ends.copy()
        ends[is_sphere] = number[self.ends[is_sphere]]
        return self._replace(ends=ends, fresh=in_order), self.fresh


def _split_levers(lever: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Split levers (k, 3) into their component along the normals, (k,), and the rest, (k, 3)."""
    along = np.einsum("ci,ci->c", lever, normal)
    return along, lever - along[:, None] * normal


def _order_along_z(network: Network) -> tuple[Ints, Ints]:
    """Return the contacts (m,) sorted along z, and the first contact of each slab, (s + 1,)."""
    n = network.n_particles
    z = network.position[:, 2]
    rank = np.empty(n, np.int32)
    rank[np.argsort(z, kind="stable")] = np.arange(n, dtype=np.int32)
    rank_i = rank[network.particle_i]
    rank_j = np.where(network.with_wall, rank_i, rank[network.partner])
    lower = np.minimum(rank_i, rank_j)
    upper = np.maximum(rank_i, rank_j)
    crosses = upper - lower > n // 2
    order = np.argsort(np.where(crosses, n, lower), kind="stable")
    slabs = slabs_of(np.column_stack([lower, upper])[order], n, int(crosses.sum()))
    # A layer of a wide packing is larger than a cache: the packing is cut into columns.
    width = COLUMN_WIDTH_IN_DIAMETERS * 2 * network.radius.mean()
    place = network.position[:, :2] - network.position[:, :2].min(axis=0)
    extent = place.max(axis=0)
    columns = np.maximum(np.rint(extent / width), 1)
    if columns.prod() > 1:
        index = np.minimum(place * (columns / extent), columns - 1).astype(np.int32)
        column_of_sphere = index[:, 0] * int(columns[1]) + index[:, 1]
        column = column_of_sphere[network.particle_i[order]]
        slab = np.repeat(np.arange(len(slabs) - 1), np.diff(slabs))
        order = order[np.lexsort((column, slab))]
    return order, slabs


class _Pieces(NamedTuple):
    """The fields `slabs`, `pieces` and `fresh` of `OrderedContacts`."""

    slabs: Ints
    pieces: Ints
    fresh: Ints


def _cut_into_pieces(ends: Ints, slabs: Ints, n: int) -> _Pieces:
    """Cut slabs into pieces, and find the piece that first touches each of the n spheres.

    `ends` (m, 2) are those of the ordered contacts, `slabs` (s + 1,) the first contact of each.
    """
    starts = [
        np.arange(first, last, CONTACTS_PER_PIECE)
        for first, last in zip(slabs[:-1], slabs[1:], strict=True)
    ]
    first_contact = np.concatenate([*starts, slabs[-1:]])
    first_piece = np.searchsorted(first_contact, slabs)
    n_pieces = len(first_contact) - 1
    # The loops go through the even slabs before the odd ones.
    odd = np.repeat(np.arange(len(slabs) - 1) % 2, np.diff(first_piece))
    piece_at_turn = np.append(np.argsort(odd, kind="stable"), n_pieces)
    turn_of_piece = np.argsort(piece_at_turn)[:-1]
    turn_of_contact = np.repeat(turn_of_piece, np.diff(first_contact))
    earliest_turn = np.full(n, n_pieces)
    for end in ends.T:
        is_sphere = end >= 0
        np.minimum.at(earliest_turn, end[is_sphere], turn_of_contact[is_sphere])
    piece = piece_at_turn[earliest_turn]
    fresh = np.argsort(piece, kind="stable").astype(np.int32)
    first_fresh = np.searchsorted(piece[fresh], np.arange(n_pieces + 1))
    return _Pieces(first_piece, np.column_stack([first_contact, first_fresh]), fresh)
