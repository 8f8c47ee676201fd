"""Loops over contacts or spheres, compiled by numba where it is installed.

Importing this module loads numba.
"""

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
        f"the environment has NUMBA_NUM_THREADS={_THREADS}",
        "numba needs at least one thread",
        "set it to 1 or more, or unset it",
    )
try:
    import numba

    from modal.tools.loop_cache import compile_cached
except ImportError:
    numba = None
prange = numba.prange if numba else range
if numba and "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    # TBB, numba's own first choice, loses memory and time with each short loop: 12,000 steps of
    # 6,000 spheres take 7 s with OpenMP, and over 100 s with TBB.
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]

Loop = Callable[..., Any]


_PARENT_HAD_THREADS = False
"""Whether this process was forked from one that had started numba's threads: they do not run in the
fork, and OpenMP would end a process that starts them again."""


def _after_fork() -> None:
    """Store, in a forked process, whether its parent had started numba's threads."""
    global _PARENT_HAD_THREADS
    with suppress(ValueError):  # numba's error for threads that were not started
        numba.threading_layer()
        _PARENT_HAD_THREADS = True


if numba and hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def threads_for(spheres: int) -> int:
    """Return the number of threads for a loop over this many spheres.

    Results do not depend on this number.

    The number is one if starting more threads takes longer than they save, and in a process that
    was forked from one with threads. OMP_NUM_THREADS bounds it as NUMBA_NUM_THREADS does.
    """
    if spheres < slabs.ENOUGH or _PARENT_HAD_THREADS:
        return 1
    _start_threads()
    return int(numba.get_num_threads())


@cache
def _start_threads() -> None:
    """Start as many threads of numba as the environment allows.

    Raises InputError if numba cannot start any.
    """
    try:
        max_threads = numba.get_num_threads()
    except ValueError as error:
        raise InputError(
            "threading_layer",
            "numba cannot start its threads",
            str(error).replace("\n", " "),
            "unset NUMBA_THREADING_LAYER and NUMBA_THREADING_LAYER_PRIORITY",
        ) from None
    # A list has a number for each level of nested loops.
    outermost = os.environ.get("OMP_NUM_THREADS", "").split(",")[0]
    if outermost.isdecimal() and int(outermost) > 0:
        numba.set_num_threads(min(max_threads, int(outermost)))


def elementwise(function: Loop) -> Loop:
    """Return a function of numbers or of arrays, after making it callable from compiled loops."""
    if numba is None:
        return function
    return numba.extending.register_jitable(function)


def inlined(function: Loop) -> Loop:
    """Return the function, after telling numba to inline it into each loop that calls it.

    This suits a gather or scatter of a few numbers.
    """
    if numba is None:
        return function
    return numba.extending.register_jitable(inline="always")(function)


def fingerprint(*modules: ModuleType) -> str:
    """Return a checksum of this file and of those of `modules`.

    The names of compiled loops contain this checksum: numba's cache identifies a loop by its name
    and its own file, and would not notice a change in other files whose functions the loop calls.
    """
    files = [__file__, *(str(module.__file__) for module in modules)]
    return f"{zlib.crc32(b''.join(Path(file).read_bytes() for file in files)):08x}"


def compiled(
    function: Loop,
    spheres_argument: int,
    checksum: str,
    replacements: Mapping[str, Any] = MappingProxyType({}),
    *,
    fastmath: bool = False,
) -> Loop:
    """Return a loop over slabs in two compiled forms: for few spheres, and for several threads.

    Argument number `spheres_argument` has a row for each sphere; `checksum` is the `fingerprint` of
    the modules whose functions the loop calls; `replacements` replace functions of its module by
    their names. For many spheres the loop for threads is always used, even with one thread, because
    the other form might round differently. The exception is a process that was forked from one with
    threads, where numba's OpenMP would end the process.
    """
    few = compile_cached(_renamed(function, checksum, replacements), fastmath=fastmath)
    by_threads = _renamed(function, f"{checksum}_by_threads", replacements)
    many = compile_cached(by_threads, fastmath=fastmath, parallel=True)

    def loop(*args: Any) -> Any:
        spheres = len(args[spheres_argument])
        # numba finds the type of a plain tuple in a third of the time that a named one takes.
        plain = [tuple(each) if isinstance(each, tuple) else each for each in args]
        if spheres < slabs.ENOUGH or _PARENT_HAD_THREADS:
            return few(*plain)
        threads_for(spheres)
        return many(*plain)

    return loop


def _renamed(function: Any, ending: str, replacements: Mapping[str, Any]) -> FunctionType:
    """Return a copy of a function with an ending to its name and other functions in its module."""
    renamed = FunctionType(function.__code__, function.__globals__ | replacements)
    renamed.__name__ = f"{function.__name__}_{ending}"
    renamed.__qualname__ = renamed.__name__
    return renamed


def compiled_part(
    function: Loop,
    checksum: str,
    replacements: Mapping[str, Any] = MappingProxyType({}),
    *,
    fastmath: bool | set[str] = False,
) -> Loop:
    """Return the compiled function that a loop calls for each slab; arguments as in `compiled`.

    `fastmath` may name allowed optimisations, such as {"contract"}: the product and the sum of a x
    + b are then rounded once, if the processor has such an operation.
    """
    return compile_cached(_renamed(function, checksum, replacements), fastmath=fastmath)


def by_parts(part_loop: Loop, by_arrays: Loop) -> Loop:
    """Return a compiled loop over spheres whose parts may share the cores, or else `by_arrays`.

    `part_loop` is called with the first sphere of a part, the sphere after its last, the number of
    the part, and the arguments of the loop, the first of which has a row for each sphere. It gets
    the fields of a named tuple as single arguments: loops over threads take no tuples.
    """
    if numba is None:
        return by_arrays
    checksum = fingerprint(sys.modules[part_loop.__module__])
    replacements = {"_part_loop": compiled_part(part_loop, checksum)}
    loop_of_fields = compiled(_by_parts, 0, f"{part_loop.__name__}_{checksum}", replacements)

    def loop(*args: Any) -> Any:
        fields: list[Any] = []
        for argument in args:
            if isinstance(argument, tuple):
                fields.extend(argument)
            else:
                fields.append(argument)
        return loop_of_fields(*fields)

    return loop


def _part_loop(first, last, part, *args):
    """Mark the place of the function for one part, by which each loop replaces this one."""


def _by_parts(*args):
    """Call the function `_part_loop` for all parts of the spheres."""
    count = len(args[0])
    for part in prange(slabs.SLABS):
        first = part * count // slabs.SLABS
        last = (part + 1) * count // slabs.SLABS
        _part_loop(first, last, part, *args)


@elementwise
def dot(a, b):
    """Return the scalar product of two vectors (x, y, z)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@elementwise
def cross(a, b):
    """Return the vector product of two vectors (x, y, z)."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@elementwise
def plus(a, factor, b):
    """Return a + factor b of two vectors (x, y, z)."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]
