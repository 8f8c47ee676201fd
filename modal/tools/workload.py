"""What a long computation will take, known before it starts; refused where that is too much."""

from __future__ import annotations

import os
import resource
import sys
import time
from contextlib import suppress
from typing import Any

import numpy as np

from modal.tools.display import duration, quantity
from modal.tools.errors import InputError

LONGEST = 86400.0
"""Seconds on this machine above which a computation is refused: a day."""

ANNOUNCED = 20.0
"""Seconds from which on an estimate is said on a terminal before the work starts."""


def memory_at_hand() -> float:
    """Physical memory that is free, or what Slurm has granted this job if that is less, bytes."""
    return min(_free_memory(), _granted_memory())


def _free_memory() -> float:
    """Of the machine, bytes; where only its size is told, that; else infinite."""
    with suppress(OSError), open("/proc/meminfo") as file:  # Linux
        for line in file:
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (OSError, ValueError):
        return np.inf


def _granted_memory() -> float:
    """By Slurm, bytes, which is less than its node has; 0 of a node is all of it."""
    of_node = float(os.environ.get("SLURM_MEM_PER_NODE", 0))
    each = float(os.environ.get("SLURM_MEM_PER_CPU", 0))
    megabytes = of_node or each * float(os.environ.get("SLURM_CPUS_ON_NODE", 1))
    return megabytes * 2**20 or np.inf


def peak_memory() -> int:
    """Peak resident memory of this process so far, bytes.

    Linux hands a parent's `ru_maxrss` on to the programs that it starts; VmHWM is this program's.
    """
    with suppress(OSError), open("/proc/self/status") as file:  # Linux
        for line in file:
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024)


def refuse_endless(
    task: str, operator: Any, *, products: float, bytes_needed: float, remedy: str
) -> None:
    """InputError where so many products K u would take more than a day, or more than the memory.

    `operator` as `modal.system.operator.ContactOperator`, compiled already: one product is
    timed. The message begins with the `task`, as in "a wave of 10 s", and ends with the `remedy`.
    """
    motion = np.zeros(operator.shape[0])
    started = time.perf_counter()
    operator.apply(motion)
    seconds = products * (time.perf_counter() - started)
    if seconds > ANNOUNCED and sys.stderr.isatty():
        said = f"about {products:.2g} products with K, {duration(seconds)}"
        print(f"{task}: {said}, {quantity(bytes_needed, 'B', 3)} more", file=sys.stderr, flush=True)
    refuse_above(
        seconds, bytes_needed, f"{task} takes about {products:.2g} products with K,", remedy
    )


def refuse_above(
    seconds: float, bytes_needed: float, task: str, remedy: str, longest: float | None = None
) -> None:
    """InputError where an estimate is above the `longest` time (a day), or the free memory.

    The message begins with the `task`, as in "a wave takes", and ends with the `remedy`.
    """
    at_hand = memory_at_hand()
    if seconds <= (LONGEST if longest is None else longest) and bytes_needed <= at_hand:
        return
    raise InputError(
        f"{task} {duration(seconds)} here, and {quantity(bytes_needed, 'B', 3)} of memory "
        f"({quantity(at_hand, 'B', 3)} are free); {remedy}"
    )


def refuse_above_memory(bytes_needed: float, task: str, remedy: str) -> None:
    """InputError where a computation needs more than the free memory; words as `refuse_above`."""
    at_hand = memory_at_hand()
    if bytes_needed > at_hand:
        raise InputError(
            f"{task} takes {quantity(bytes_needed, 'B', 3)} of memory "
            f"({quantity(at_hand, 'B', 3)} are free); {remedy}"
        )
