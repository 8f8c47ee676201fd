"""Cut a packing into slabs along z, every other one of which can be computed at the same time.

Slabs that are not neighbours share no sphere. The ends of the slabs depend only on the packing, and
even slabs are always computed before odd ones: sums are added in the same order by any number of
threads. Contacts across a period along z are the last slab, an odd one, between the even slabs at
both ends.
"""

import numpy as np

from modal.tools.arrays import Ints

ENOUGH = 5000
"""Least number of spheres for which threads are used: with fewer, starting the threads takes
longer."""
SLABS = 16
"""Largest number of slabs: more slabs share the work more evenly, fewer have longer runs."""


def slab_bounds(reach: Ints) -> Ints:
    """Return the first row of each slab, and the number of rows at the end.

    `reach` (n,) ascends: it is the last row that touches a row or an earlier one. A slab touches
    only the slabs before and after it.
    """
    n = len(reach)
    min_rows = -(-n // SLABS)
    bounds = [0, min(min_rows, n)]
    while bounds[-1] < n:
        # The reach of the slab before the last ends where the next one begins.
        end_of_reach = int(reach[bounds[-1] - 1]) + 1
        bounds.append(min(max(bounds[-1] + min_rows, end_of_reach), n))
    return np.array(bounds)


def slabs_of(ends: Ints, n: int, crossing: int = 0) -> Ints:
    """Return the first contact of each slab, and the number of contacts at the end.

    With `n` spheres numbered along z a slab shares spheres only with the next slab: two even slabs
    share no sphere, nor do two odd ones. The contacts `ends` (m, 2) are sorted by the first end,
    the last `crossing` ones, across a period along z, apart from the others. Packings that are too
    small for threads have one slab.
    """
    one_slab = np.array([0, len(ends)])
    if n < ENOUGH:
        return one_slab
    inside, across = np.split(ends, [len(ends) - crossing])
    starts = np.append(0, np.bincount(inside[:, 0], minlength=n).cumsum())
    reach = np.arange(n)
    (rows,) = np.nonzero(np.diff(starts))
    reach[rows] = np.maximum(rows, np.maximum.reduceat(inside[:, 1], starts[rows]))
    reach = np.maximum.accumulate(reach)
    bounds = slab_bounds(reach).tolist()
    if crossing == 0:
        return starts[bounds]
    if len(bounds) % 2 == 1:
        # The last slab but one becomes even, so that the slab across the period is odd.
        del bounds[-2]
    highest_below = across.min(axis=1).max()
    lowest_above = across.max(axis=1).min()
    alone = len(bounds) > 3 and highest_below < bounds[1] and lowest_above > reach[bounds[-2] - 1]
    return np.append(starts[bounds], len(ends)) if alone else one_slab
