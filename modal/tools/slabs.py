"""Slabs of a packing along z, of which every other one can be worked on at once.

A loop over contacts is cut so that every other slab shares no sphere. Where the slabs end depends
on the packing alone, and the even ones always come before the odd ones: every sum is made in the
same order by any number of threads.
"""

import numpy as np

from modal.tools.arrays import Ints

ENOUGH = 5000
"""Spheres from which on threads are used."""
SLABS = 16
"""At most so many: more share the work more evenly, fewer leave more to do at once."""


def slabs_of(ends: Ints, n: int) -> Ints:
    """First contact of each slab, and the number of contacts; `ends` (m, 2) sorted by the first.

    With `n` spheres numbered along z a slab reaches its next neighbour at most: no two of the even
    ones share a sphere, nor of the odd ones. One slab where threads are never used.
    """
    if n < ENOUGH:
        return np.array([0, len(ends)])
    starts = np.append(0, np.bincount(ends[:, 0], minlength=n).cumsum())
    reach, (rows,) = np.arange(n), np.nonzero(np.diff(starts))
    reach[rows] = np.maximum(rows, np.maximum.reduceat(ends[:, 1], starts[rows]))
    reach = np.maximum.accumulate(reach)
    least = -(-n // SLABS)
    bounds = [0, min(least, n)]
    while bounds[-1] < n:
        # What the slab before the last reaches must end where the next one begins.
        bounds.append(min(max(bounds[-1] + least, int(reach[bounds[-1] - 1]) + 1), n))
    return starts[bounds]
