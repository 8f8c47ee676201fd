"""Loops over contacts or spheres, compiled by numba where it is installed: to import loads it."""

import os
import sys
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any

from modal.tools import slabs
from modal.tools.errors import InputError

_THREADS = os.environ.get("NUMBA_NUM_THREADS", "1")
if _THREADS.strip().lstrip("+-").isdecimal() and int(_THREADS) < 1:
    raise InputError(
        "thread_count",
        f"the environment has NUMBA_NUM_THREADS={_THREADS}, of which numba can make no thread",
        remedy="set it to 1 or more, or unset it",
    )
try:
    import numba

    from modal.tools.loop_cache import kept
except ImportError:
    numba = None
prange = numba.prange if numba else range
if numba and "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    # TBB, numba's own first choice, loses memory with each short loop, and the more time the more
    # loops there were: 12,000 steps of 6,000 spheres take 7 s with OpenMP, over 100 with it.
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]

Loop = Callable[..., Any]


_PARENT_HAD_THREADS = False
"""Whether this process was forked from one whose threads for loops ran: here they do not."""


def _after_fork() -> None:
    """Note in a forked process whether numba had started its threads before."""
    global _PARENT_HAD_THREADS
    with suppress(ValueError):  # they were not started
        numba.threading_layer()
        _PARENT_HAD_THREADS = True


if numba and hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def threads_for(spheres: int) -> int:
    """How many threads a loop over so many spheres takes; results are the same to the bit.

    One where more are not worth their start, and in a process that was forked from one with
    threads. OMP_NUM_THREADS bounds them as NUMBA_NUM_THREADS does.
    """
    if spheres < slabs.ENOUGH or _PARENT_HAD_THREADS:
        return 1
    _start_threads()
    return int(numba.get_num_threads())


@cache
def _start_threads() -> None:
    """Start numba's threads, as many as the environment allows; InputError where there are none."""
    try:
        most = numba.get_num_threads()
    except ValueError as error:
        raise InputError(
            "threading_layer",
            "numba cannot start its threads",
            str(error).replace("\n", " "),
            "unset NUMBA_THREADING_LAYER and NUMBA_THREADING_LAYER_PRIORITY",
        ) from None
    asked = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]  # of nested loops the first
    if asked.isdecimal() and int(asked) > 0:
        numba.set_num_threads(min(most, int(asked)))


def elementwise(function: Loop) -> Loop:
    """The function itself, of numbers or of arrays; compiled loops may call it from now on."""
    return numba.extending.register_jitable(function) if numba else function


def inlined(function: Loop) -> Loop:
    """The same, written into the loop that calls it: a gather or scatter of a few numbers."""
    return numba.extending.register_jitable(inline="always")(function) if numba else function


def fingerprint(*modules: ModuleType) -> str:
    """What tells this file and those of `modules` from their former states.

    It stands in the names of compiled loops that call functions of other files: numba keeps loops
    in a cache, tells them apart by name and by their own file, and would not notice such a change.
    """
    files = [__file__, *(str(module.__file__) for module in modules)]
    return f"{zlib.crc32(b''.join(Path(file).read_bytes() for file in files)):08x}"


def compiled(
    function: Loop,
    place: int,
    of: str,
    own: Mapping[str, Any] = MappingProxyType({}),
    *,
    fastmath: bool = False,
) -> Loop:
    """A loop over slabs, compiled for few spheres and for threads.

    Argument `place` has the spheres; `of` is the `fingerprint` of what it calls, `own` what stands
    in place of its module's functions, by their names. Many spheres
    always take the loop for threads, be it with one of them: another compilation might round
    otherwise. Only in a process that was forked from one with threads they cannot: numba's OpenMP
    ends it.
    """
    by_threads = _renamed(function, f"{of}_by_threads", own)
    few = kept(_renamed(function, of, own), fastmath=fastmath)
    many = kept(by_threads, fastmath=fastmath, parallel=True)

    def loop(*given: Any) -> Any:
        spheres = len(given[place])
        if spheres < slabs.ENOUGH or _PARENT_HAD_THREADS:
            return few(*given)
        threads_for(spheres)
        return many(*given)

    return loop


def _renamed(function: Any, ending: str, own: Mapping[str, Any]) -> FunctionType:
    other = FunctionType(function.__code__, function.__globals__ | own)
    other.__name__ = other.__qualname__ = f"{function.__name__}_{ending}"
    return other


def compiled_part(
    function: Loop,
    of: str,
    own: Mapping[str, Any] = MappingProxyType({}),
    *,
    fastmath: bool | set[str] = False,
) -> Loop:
    """What a loop does with one slab, compiled; `of` and `own` as in `compiled`.

    `fastmath` may name what is allowed, as {"contract"}: a product and a sum rounded together where
    the processor has them in one.
    """
    return kept(_renamed(function, of, own), fastmath=fastmath)


def by_parts(some: Loop, by_arrays: Loop) -> Loop:
    """A loop over spheres, compiled, whose parts may share the cores; else `by_arrays`.

    `some` takes the first sphere of a part, the one behind its last, the number of the part, and
    what the loop is given, whose first array has a row for each sphere.
    """
    if numba is None:
        return by_arrays
    of = fingerprint(sys.modules[some.__module__])
    return compiled(_by_parts, 0, f"{some.__name__}_{of}", {"_some": compiled_part(some, of)})


def _some(first, last, part, *given):
    """What is done with a part: each loop has its own in this place."""


def _by_parts(*given):
    count = len(given[0])
    for part in prange(slabs.SLABS):
        _some(part * count // slabs.SLABS, (part + 1) * count // slabs.SLABS, part, *given)


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
