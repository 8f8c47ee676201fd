"""The chain of touching particles that joins source and receiver wall along a straight line."""

from __future__ import annotations

import heapq

import numpy as np

from modal.network import RECEIVER_WALL, SOURCE_WALL, Network
from modal.storage import InputError


def wall_to_wall_chain(network: Network) -> np.ndarray:
    """Shape (nc,): particles from the source wall to the receiver wall, each touching the next.

    The path through the contacts that stays closest to a vertical line: a step costs its length
    times 1 + (lateral distance from the line / diameter)^2. The line starts at the source-wall
    particle nearest to the middle of the cross-section. InputError where no path exists.
    """
    i, j = network.particle_i, network.particle_j
    start = np.unique(i[j == SOURCE_WALL])
    goal = set(i[j == RECEIVER_WALL].tolist())
    if len(start) == 0 or not goal:
        raise InputError("the network has no contact with both walls; a chain needs the two walls")
    xy = network.position[:, :2]
    middle = 0.5 * (xy.min(axis=0) + xy.max(axis=0))
    distance = np.linalg.norm(xy[start] - middle, axis=1)
    first = int(start[np.lexsort((start, np.round(distance / network.radius[0], 6)))[0]])

    offset = xy - xy[first]
    for axis in (0, 1):
        if network.cell_periodic[axis]:
            period = network.cell_size[axis]
            offset[:, axis] -= period * np.round(offset[:, axis] / period)
    weight = 1 + (offset**2).sum(axis=1) / (2 * network.radius) ** 2

    neighbours: list[list[tuple[int, float]]] = [[] for _ in range(network.n_particles)]
    lengths = np.linalg.norm(network.lever_i - network.lever_j, axis=1)
    for a, b, length in zip(i.tolist(), j.tolist(), lengths.tolist(), strict=True):
        if b >= 0:
            neighbours[a].append((b, length))
            neighbours[b].append((a, length))

    best = {first: 0.0}
    came_from: dict[int, int] = {}
    queue = [(0.0, first)]
    while queue:
        cost, here = heapq.heappop(queue)
        if cost > best[here]:
            continue
        if here in goal:
            path = [here]
            while path[-1] in came_from:
                path.append(came_from[path[-1]])
            return np.array(path[::-1])
        for there, length in neighbours[here]:
            total = cost + length * weight[there]
            if total < best.get(there, np.inf) * (1 - 1e-12):
                best[there], came_from[there] = total, here
                heapq.heappush(queue, (total, there))
    raise InputError("no chain of contacts joins the two walls; the packing carries no wave")
