"""Cut a packing into slabs along z, every other one of which can be computed at the same time.

Slabs that are not neighbours share no sphere. The ends of the slabs depend only on the packing, and
even slabs are always computed before odd ones: sums are added in the same order by any number of
threads.
"""

import numpy as np

from modal.tools.arrays import Ints

ENOUGH = 5000
"""Least number of spheres for which threads are used: with fewer, starting the threads takes
longer."""
SLABS = 16
"""Largest number of slabs: more slabs share the work more evenly, fewer have longer runs."""


def slabs_of(ends: Ints, n: int) -> Ints:
    """Return the first contact of each slab, and the number of contacts at the end.

    `ends` (m, 2) are sorted by the first. With `n` spheres numbered along z a slab shares spheres
    only with the next slab: two even slabs share no sphere, nor do two odd ones. Packings that are
    too small for threads have one slab.
    """
    if n < ENOUGH:
        return np.array([0, len(ends)])
    starts = np.append(0, np.bincount(ends[:, 0], minlength=n).cumsum())
    reach = np.arange(n)
    (rows,) = np.nonzero(np.diff(starts))
    reach[rows] = np.maximum(rows, np.maximum.reduceat(ends[:, 1], starts[rows]))
    reach = np.maximum.accumulate(reach)
    min_spheres = -(-n // SLABS)
    bounds = [0, min(min_spheres, n)]
    while bounds[-1] < n:
        # The reach of the slab before the last ends where the next one begins.
        end_of_reach = int(reach[bounds[-1] - 1]) + 1
        bounds.append(min(max(bounds[-1] + min_spheres, end_of_reach), n))
    return starts[bounds]
