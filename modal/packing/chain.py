"""Find the chain of touching particles that joins the two walls along a nearly straight line."""

import numpy as np

from modal.packing.ends import bodies_at_end
from modal.packing.network import Network
from modal.tools.arrays import Floats, Ints
from modal.tools.errors import UnavailableError

TIE_TOLERANCE = 1e-9
"""Relative difference of path costs below which they count as equal: round-off."""


def wall_to_wall_chain(network: Network) -> Ints:
    """Return the particles (nc,) from source to receiver wall, each touching the next.

    Walls may be flat or rough (`modal.packing.ends`); held bodies are not part of the chain.

    This is the path through the contacts that stays closest to a vertical line: a step costs its
    length times 1 + (lateral distance from the line / diameter)^2. The line starts at the particle
    at the source wall nearest to the middle of the cross-section. Raises UnavailableError if there
    is no path.
    """
    return network.cached("chain", lambda: _chain(network))


def _chain(network: Network) -> Ints:
    """Find the chain as `wall_to_wall_chain` does, without the cache."""
    i = network.particle_i
    j = network.particle_j
    start = bodies_at_end(network, "source")
    goal = bodies_at_end(network, "receiver")
    if len(start) == 0 or len(goal) == 0:
        raise UnavailableError(
            "no_walls",
            "the network has no contact with both walls",
            remedy="a chain needs the two walls",
        )
    xy = network.position[:, :2]
    middle = 0.5 * (xy.min(axis=0) + xy.max(axis=0))
    off_middle = np.linalg.norm(xy[start] - middle, axis=1)
    # Of equally near particles the first one.
    rounded = np.round(off_middle / network.radius.max(), 6)
    first = int(start[np.lexsort((start, rounded))[0]])

    offset = network.position - network.position[first]
    offset[:, 2] = 0.0
    offset -= np.round(network.in_periods(offset)) @ network.period_vectors
    offset = offset[:, :2]
    weight = 1 + (offset**2).sum(axis=1) / (2 * network.radius) ** 2
    pair = ~network.with_held
    length = np.linalg.norm(network.lever_i - network.lever_j, axis=1)[pair]
    return _find_cheapest_path((i[pair], j[pair]), length, weight, first, goal)


def _find_cheapest_path(
    ends: tuple[Ints, Ints], length: Floats, weight: Floats, first: int, goal: Ints
) -> Ints:
    """Return the cheapest path from `first` to one of `goal`; UnavailableError if there is none.

    A step costs the `length` (m,) of its contact, m, times the `weight` (n,) of the particle that
    it reaches.
    """
    import scipy.sparse as sp  # the DEM program's own Python may lack scipy
    from scipy.sparse.csgraph import dijkstra

    i, j = ends
    begin = np.concatenate([i, j])
    end = np.concatenate([j, i])
    cost = np.concatenate([length, length]) * weight[end]
    # Pairs that touch twice must not have their costs added up: the cheaper contact counts.
    order = np.lexsort((cost, end, begin))
    begin = begin[order]
    end = end[order]
    cost = cost[order]
    is_first = (np.diff(begin, prepend=-1) != 0) | (np.diff(end, prepend=-1) != 0)
    n = len(weight)
    graph = sp.csr_matrix((cost[is_first], (begin[is_first], end[is_first])), shape=(n, n))
    distance = dijkstra(graph, indices=first)
    nearest = float(distance[goal].min(initial=np.inf))
    if not np.isfinite(nearest):
        raise UnavailableError(
            "carries_no_wave",
            "no chain of contacts joins the two walls",
            remedy="the packing carries no wave",
        )
    here = int(goal[np.argmin(_round_ties(distance[goal], nearest))])

    # Back along the shortest path; of equally short ones the nearest, then the first particle.
    columns = graph.tocsc()
    path = [here]
    while here != first:
        column = slice(columns.indptr[here], columns.indptr[here + 1])
        before = columns.indices[column]
        cost_through = distance[before] + columns.data[column]
        on_shortest_path = cost_through <= distance[here] * (1 + TIE_TOLERANCE)
        # Each step comes nearer to the first particle, or the way back would not end.
        nearer = distance[before] < distance[here]
        before = np.sort(before[on_shortest_path & nearer])
        if not len(before):
            raise UnavailableError(
                "no_levers",
                f"a contact of particle {here} has levers of no length",
                "no chain goes through it",
                "give the vectors from the centres to the contact point",
            )
        here = int(before[np.argmin(_round_ties(distance[before], distance[here]))])
        path.append(here)
    return np.array(path[::-1])


def _round_ties(distance: Floats, scale: float) -> Floats:
    """Return distances rounded so that those that differ only by round-off become equal."""
    if scale <= 0:
        return distance
    return np.round(distance / (scale * TIE_TOLERANCE))
