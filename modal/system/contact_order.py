"""Contacts in the order in which the loops of `modal.system.loops` go through them.

They are sorted along z by their lower sphere, whatever the numbers of the spheres: both bodies of a
contact are then still in the cache from the contacts before. Slabs of them share the cores
(`modal.tools.loops`), and pieces of a slab say which spheres are met there for the first time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.packing.columns import PART
from modal.packing.network import Network
from modal.system.contacts import carried, centre_distance, terms_of
from modal.tools.arrays import Floats, Ints
from modal.tools.slabs import slabs_of

ACROSS = 64
"""Diameters: a wider packing is worked through in columns so wide, whose layers a cache holds."""
PIECE = 256
"""Contacts of a piece: with all that they touch, a few pieces fit into the cache next to a core."""
CENTRAL = 16 * np.finfo(float).eps
"""Part of a lever across its normal that is round-off, relative to the longest lever."""


@dataclass(frozen=True)
class OrderedContacts:
    """Contacts in the order of the loops, m of them; lengths in m, stiffnesses in N/m.

    rows (m, 7): normal, kn - kt, kt, and how far the two levers reach along the normal, the second
    one backwards; ends (m, 2) int32, walls negative. lateral (m,): -N / l of a pre-stress, else
    None. aside (m, 6): the parts of both levers across the normal, None where all levers lie along
    it. rolling (m, 2): kr and kw - kr, N m/rad, None where nothing resists rolling.

    slabs (s + 1,): the piece with which each begins, and their number p. pieces (p + 1, 2): the
    first contact of each, and its first sphere in `fresh` (n,) int32, the spheres by the piece that
    touches them first, those without contacts behind them all.
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
    def of(cls, network: Network, pre_stress: str) -> OrderedContacts:
        """The contacts of a network; `pre_stress` none or normal."""
        order, slabs = _order_along_z(network)
        ends, rows = np.empty((len(order), 2), np.int32), np.empty((len(order), 7))
        lateral = None
        pressed = carried(network, terms_of(pre_stress)).get("force_normal")
        if pressed is not None:
            lateral = -pressed[order] / centre_distance(network)[order]
        levers = (network.lever_i, 1.0), (network.lever_j, -1.0)
        longest, furthest_off = np.zeros(2), np.zeros(2)
        # A part at a time: what is in between takes little memory.
        for first in range(0, len(order), PART):
            part = slice(first, first + PART)
            here, own = order[part], rows[part]
            ends[part, 0], ends[part, 1] = network.particle_i[here], network.particle_j[here]
            own[:, 0:3] = normal = network.normal[here]
            own[:, 4] = network.stiffness_tangential[here]
            own[:, 3] = network.stiffness_normal[here] - own[:, 4]
            for k, (lever, sign) in enumerate(levers):
                along, off = _along_and_off(lever[here], normal)
                own[:, 5 + k] = sign * along
                longest[k] = abs(along).max(initial=longest[k])
                furthest_off[k] = abs(off).max(initial=furthest_off[k])
        aside = None
        if (furthest_off > CENTRAL * longest).any():
            across = [_along_and_off(lever, network.normal)[1][order] for lever, _ in levers]
            aside = np.hstack(across)
        rolling = None
        kr, kw = network.stiffness_rolling, network.stiffness_twisting
        if kr is not None and kw is not None:
            rolling = np.column_stack([kr, kw - kr])[order]
        in_pieces = _pieces(ends, slabs, network.n_particles)
        return cls(rows, ends, *in_pieces, lateral, aside, rolling)

    def renumbered(self) -> tuple[OrderedContacts, Ints]:
        """The same with the spheres numbered as the loops meet them, and their former numbers (n,).

        What is gathered for one contact then lies beside what the contacts before have gathered.
        """
        met = np.arange(len(self.fresh), dtype=np.int32)
        number = np.empty_like(met)
        number[self.fresh] = met
        sphere = self.ends >= 0
        ends = self.ends.copy()
        ends[sphere] = number[self.ends[sphere]]
        return replace(self, ends=ends, fresh=met), self.fresh


def _along_and_off(lever: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """How far levers (k, 3) reach along the normals (k, 3), (k,), and the rest of them (k, 3)."""
    along = np.einsum("ci,ci->c", lever, normal)
    return along, lever - along[:, None] * normal


def _order_along_z(network: Network) -> tuple[Ints, Ints]:
    """Contacts (m,) slab by slab along z, and where the slabs begin, (s + 1,)."""
    n, z = network.n_particles, network.position[:, 2]
    rank = np.empty(n, np.int32)
    rank[np.argsort(z, kind="stable")] = np.arange(n, dtype=np.int32)
    first = rank[network.particle_i]
    second = np.where(network.with_wall, first, rank[network.partner])
    lower = np.minimum(first, second)
    order = np.argsort(lower, kind="stable")
    slabs = slabs_of(np.column_stack([lower, np.maximum(first, second)])[order], n)
    # In a wide packing a layer fills more than a cache: it is cut into columns.
    width = ACROSS * 2 * network.radius.mean()
    at = network.position[:, :2] - network.position[:, :2].min(axis=0)
    columns = np.maximum(np.rint(at.max(axis=0) / width), 1)
    if columns.prod() > 1:
        place = np.minimum(at * (columns / at.max(axis=0)), columns - 1).astype(np.int32)
        column = (place[:, 0] * int(columns[1]) + place[:, 1])[network.particle_i[order]]
        slab = np.repeat(np.arange(len(slabs) - 1), np.diff(slabs))
        order = order[np.lexsort((column, slab))]
    return order, slabs


def _pieces(ends: Ints, slabs: Ints, n: int) -> tuple[Ints, Ints, Ints]:
    """`slabs` in pieces, pieces and fresh spheres as in `OrderedContacts`.

    `ends` (m, 2) of the contacts in their order, `slabs` (s + 1,) the first contact of each.
    """
    starts = [np.arange(a, b, PIECE) for a, b in zip(slabs[:-1], slabs[1:], strict=True)]
    first = np.concatenate([*starts, slabs[-1:]])
    in_slabs, count = np.searchsorted(first, slabs), len(first) - 1
    # The even slabs come before the odd ones.
    odd = np.repeat(np.arange(len(slabs) - 1) % 2, np.diff(in_slabs))
    turn = np.append(np.argsort(odd, kind="stable"), count)
    when = np.argsort(turn)[:-1]
    earliest = np.full(n, count)
    for end in ends.T:
        pair = end >= 0
        np.minimum.at(earliest, end[pair], np.repeat(when, np.diff(first))[pair])
    piece = turn[earliest]
    fresh = np.argsort(piece, kind="stable").astype(np.int32)
    return (
        in_slabs,
        np.column_stack([first, np.searchsorted(piece[fresh], np.arange(count + 1))]),
        fresh,
    )
