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
from functools import cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from modal.tools.arrays import Ints
from modal.tools.loading import undisturbed

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

    One where more are not worth their start. OMP_NUM_THREADS bounds the threads as
    NUMBA_NUM_THREADS does; where neither is set, cores that other programs use are left to them:
    a thread that waits for its turn holds up every step.
    """
    if spheres < ENOUGH:
        return 1
    _bound_threads()
    return int(numba.get_num_threads())


@cache
def _bound_threads() -> None:
    """Once, when the program first needs threads."""
    given = [os.environ.get(f"{name}_NUM_THREADS", "") for name in ("OMP", "NUMBA")]
    asked = [int(text) for text in given if text.isdigit() and int(text) > 0]
    numba.set_num_threads(min(numba.get_num_threads(), *asked or [free_cores()]))


def free_cores(load: Path = Path("/proc/loadavg")) -> int:
    """Cores, at least one, that no other program wants now and wanted over the last minute.

    All where that cannot be known. A program that has just ended still counts in the mean over the
    last minute, and one that starts for a moment in what runs now: only both together count.
    """
    cores = int(numba.config.NUMBA_NUM_THREADS)
    try:
        mean, _, _, tasks, _ = load.read_text().split()
        others = min(round(float(mean)), int(tasks.split("/")[0]) - 1)
    except (OSError, ValueError):
        return cores
    return max(cores - others, 1)


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
            return called(few, *given)
        threads_for(spheres)
        return called(many, *given)

    return loop


def called(function: Any, *given: Any) -> Any:
    """What a function gives; if numba compiles it, its first call is what loads most of numba."""
    if getattr(function, "overloads", True):
        return function(*given)
    with undisturbed():
        return function(*given)


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
