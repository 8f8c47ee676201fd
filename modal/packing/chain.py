"""The chain of touching particles that joins source and receiver wall along a straight line."""

import numpy as np

from modal.packing.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import UnavailableError

TIE = 1e-9
"""Relative difference of path costs below which they count as equal."""


def wall_to_wall_chain(network: Network) -> Ints:
    """Shape (nc,): particles from the source wall to the receiver wall, each touching the next.

    The path through the contacts that stays closest to a vertical line: a step costs its length
    times 1 + (lateral distance from the line / diameter)^2. The line starts at the source-wall
    particle nearest to the middle of the cross-section. InputError where no path exists.
    """
    return network.cached("chain", lambda: _chain(network))


def _chain(network: Network) -> Ints:
    i, j = network.particle_i, network.particle_j
    start = np.unique(i[j == SOURCE_WALL])
    goal = np.unique(i[j == RECEIVER_WALL])
    if len(start) == 0 or len(goal) == 0:
        raise UnavailableError(
            "the network has no contact with both walls; a chain needs the two walls",
            code="no_walls",
        )
    xy = network.position[:, :2]
    middle = 0.5 * (xy.min(axis=0) + xy.max(axis=0))
    off_middle = np.linalg.norm(xy[start] - middle, axis=1)
    first = int(start[np.lexsort((start, np.round(off_middle / network.radius.max(), 6)))[0]])

    offset = xy - xy[first]
    for axis in (0, 1):
        if network.cell_periodic[axis]:
            period = network.cell_size[axis]
            offset[:, axis] -= period * np.round(offset[:, axis] / period)
    weight = 1 + (offset**2).sum(axis=1) / (2 * network.radius) ** 2
    pair = j >= 0
    length = np.linalg.norm(network.lever_i - network.lever_j, axis=1)[pair]
    return _cheapest((i[pair], j[pair]), length, weight, first, goal)


def _cheapest(
    ends: tuple[Ints, Ints], length: Floats, weight: Floats, first: int, goal: Ints
) -> Ints:
    """The cheapest path from `first` to one of `goal`; InputError where there is none.

    A step costs the `length` (m,) of its contact, m, times the `weight` (n,) of where it leads.
    """
    import scipy.sparse as sp  # the DEM program's own Python may lack scipy
    from scipy.sparse.csgraph import dijkstra

    i, j = ends
    come, go = np.concatenate([i, j]), np.concatenate([j, i])
    cost = np.concatenate([length, length]) * weight[go]
    # Pairs that touch twice must not have their costs added up: the cheaper contact counts.
    order = np.lexsort((cost, go, come))
    come, go, cost = come[order], go[order], cost[order]
    once = (np.diff(come, prepend=-1) != 0) | (np.diff(go, prepend=-1) != 0)
    graph = sp.csr_matrix((cost[once], (come[once], go[once])), shape=2 * (len(weight),))
    distance = dijkstra(graph, indices=first)
    nearest = float(distance[goal].min(initial=np.inf))
    if not np.isfinite(nearest):
        raise UnavailableError(
            "no chain of contacts joins the two walls; the packing carries no wave",
            code="carries_no_wave",
        )
    here = int(goal[np.argmin(_rounded(distance[goal], nearest))])

    # Back along the shortest path; of equally short ones the nearest, then the first particle.
    back = graph.tocsc()
    path = [here]
    while here != first:
        column = slice(back.indptr[here], back.indptr[here + 1])
        before = back.indices[column]
        fits = distance[before] + back.data[column] <= distance[here] * (1 + TIE)
        # Each step comes nearer to the first particle, or the way back would not end.
        before = np.sort(before[fits & (distance[before] < distance[here])])
        if not len(before):
            raise UnavailableError(
                f"a contact of particle {here} has levers of no length: no chain goes through it; "
                "give the vectors from the centres to the contact point",
                code="no_levers",
            )
        here = int(before[np.argmin(_rounded(distance[before], distance[here]))])
        path.append(here)
    return np.array(path[::-1])


def _rounded(distance: Floats, scale: float) -> Floats:
    """Distances in units in which those that differ by round-off only are equal."""
    return np.round(distance / (scale * TIE)) if scale > 0 else distance
