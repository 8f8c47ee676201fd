"""Loops over contacts or spheres, compiled by numba where it is installed.

A loop over contacts is cut into slabs: every other slab shares no sphere (`slabs_of`), so that
these can be worked on at once. Where the slabs end depends on the packing alone, and the even ones
always come before the odd ones: every sum is made in the same order by any number of threads.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from modal.formats.arrays import Ints

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


def slabs_of(ends: Ints, n: int) -> Ints:
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


def threads_for(spheres: int) -> int:
    """How many threads a loop over so many spheres takes; results are the same to the bit.

    One where more are not worth their start. On cores that other programs use a thread waits for
    its turn in every step: OMP_NUM_THREADS=1, which docs/command_line.md recommends there, bounds
    the threads as NUMBA_NUM_THREADS does.
    """
    if spheres < ENOUGH:
        return 1
    allowed = os.environ.get("OMP_NUM_THREADS", "")
    if allowed.isdigit() and 0 < int(allowed) < numba.get_num_threads():
        numba.set_num_threads(int(allowed))
    return int(numba.get_num_threads())


def _keep_tbb() -> None:
    """Never give back numba's module for TBB: on busy cores that waits for ever for its threads.

    It would be given back at the very end of the program, whose threads end with it anyway.
    """
    pool = sys.modules.get("numba.np.ufunc.tbbpool")
    if pool is not None:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(pool))


atexit.register(_keep_tbb)


def elementwise(function: Loop) -> Loop:
    """The function itself, of numbers or of arrays; compiled loops may call it from now on."""
    return numba.extending.register_jitable(function) if numba else function


def fingerprint(*modules: ModuleType) -> str:
    """What tells this file and those of `modules` from their former states.

    It stands in the names of compiled loops that call functions of other files: numba keeps loops
    in a cache, tells them apart by name and by their own file, and would not notice such a change.
    """
    files = [__file__, *(str(module.__file__) for module in modules)]
    return f"{zlib.crc32(b''.join(Path(file).read_bytes() for file in files)):08x}"


def compiled(function: Loop, place: int, of: str, *, fastmath: bool = False) -> Loop:
    """A loop over slabs, compiled for few spheres and for threads.

    Argument `place` has the spheres; `of` is the `fingerprint` of what it calls. Many spheres
    always take the loop for threads, be it with one of them: another compilation might round
    otherwise.
    """
    given: dict[str, Any] = {"cache": True, "fastmath": fastmath}
    few = numba.njit(**given)(_renamed(function, of))
    many = numba.njit(**given, parallel=True)(_renamed(function, f"{of}_by_threads"))

    def loop(*given: Any) -> Any:
        spheres = len(given[place])
        if spheres < ENOUGH:
            return few(*given)
        threads_for(spheres)
        return many(*given)

    return loop


def _renamed(function: Any, ending: str) -> FunctionType:
    other = FunctionType(function.__code__, function.__globals__)
    other.__name__ = other.__qualname__ = f"{function.__name__}_{ending}"
    return other


def compiled_part(function: Loop, of: str, *, fastmath: bool = False) -> Loop:
    """What a loop does with one slab, compiled; `of` as in `compiled`."""
    return numba.njit(cache=True, fastmath=fastmath)(_renamed(function, of))


@elementwise
def dot(a, b):
    """Scalar product of two vectors (x, y, z)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@elementwise
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@elementwise
def plus(a, factor, b):
    """a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]
