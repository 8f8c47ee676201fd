"""Loops over contacts or spheres, compiled by numba where it is installed.

A loop is cut into slabs: every other slab of contacts shares no sphere (`slabs_of`), so that these
can be worked on at once. Sums over slabs are the same for any number of threads.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from modal.packing import contact_law

try:
    import numba
except ImportError:
    numba = None
prange = numba.prange if numba else range

Loop = Callable[..., Any]
ENOUGH = 5000
"""Spheres from which on threads are used."""
SLABS = 16
"""At most so many: more share the work more evenly, fewer leave more to do at once."""
LAW = f"{zlib.crc32(Path(contact_law.__file__).read_bytes()):08x}"
"""Stands in the names of the compiled loops: numba keeps them in a cache, tells them apart by name
and by their own file alone, and would not notice that the law in another file has changed."""


def slabs_of(ends: np.ndarray, n: int) -> np.ndarray:
    """First contact of each slab, and the number of contacts; `ends` (m, 2) sorted by the first.

    With `n` spheres numbered along z a slab reaches its next neighbour at most: no two of the even
    ones share a sphere, nor of the odd ones. One slab where threads are never used.
    """
    if n < ENOUGH:
        return np.array([0, len(ends)])
    starts = np.searchsorted(ends[:, 0], np.arange(n + 1))
    reach = np.arange(n)
    np.maximum.at(reach, ends[:, 0], ends[:, 1])
    reach = np.maximum.accumulate(reach)
    least = -(-n // SLABS)
    bounds = [0, min(least, n)]
    while bounds[-1] < n:
        # What the slab before the last reaches must end where the next one begins.
        bounds.append(min(max(bounds[-1] + least, int(reach[bounds[-1] - 1]) + 1), n))
    return starts[bounds]


def by_threads(spheres: int) -> bool:
    """Whether threads are worth their start, and allowed; results are the same to the bit.

    On cores that other programs use a thread waits for its turn in every step, so that
    OMP_NUM_THREADS=1, which the README asks for there, holds here as well.
    """
    many = spheres >= ENOUGH and os.environ.get("OMP_NUM_THREADS") != "1"
    return many and numba.get_num_threads() > 1


def elementwise(function: Loop) -> Loop:
    """The function itself, of numbers or of arrays; compiled loops may call it from now on."""
    return numba.extending.register_jitable(function) if numba else function


def compiled(function: Loop, place: int) -> Loop:
    """A loop over slabs, compiled for one thread and for more; argument `place` has the spheres."""
    one = numba.njit(cache=True)(_renamed(function, LAW))
    more = numba.njit(cache=True, parallel=True)(_renamed(function, f"{LAW}_by_threads"))

    def loop(*given: Any) -> Any:
        return (more if by_threads(len(given[place])) else one)(*given)

    return loop


def _renamed(function: Any, ending: str) -> FunctionType:
    other = FunctionType(function.__code__, function.__globals__)
    other.__name__ = other.__qualname__ = f"{function.__name__}_{ending}"
    return other


def compiled_part(function: Loop) -> Loop:
    """What a loop does with one slab, compiled."""
    return numba.njit(cache=True)(_renamed(function, LAW))
