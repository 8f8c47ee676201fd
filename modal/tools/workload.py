"""What a long computation will take, known before it starts; refused where that is too much."""

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
    """Physical memory that is free, or what Slurm has granted this job if that is less, bytes.

    Where only the size of the machine's memory is told, that; else infinite. Slurm's 0 a node is
    all of it.
    """
    free = np.inf
    with suppress(OSError, ValueError):
        free = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    with suppress(OSError, StopIteration), open("/proc/meminfo") as file:  # Linux
        free = next(1024.0 * int(line.split()[1]) for line in file if "MemAvailable:" in line)
    of_node, each, cores = (
        float(os.environ.get(f"SLURM_{name}", usual))
        for name, usual in (("MEM_PER_NODE", 0), ("MEM_PER_CPU", 0), ("CPUS_ON_NODE", 1))
    )
    return min(free, (of_node or each * cores) * 2**20 or np.inf)


def peak_memory() -> int:
    """Peak resident memory of this process so far, bytes.

    Linux hands a parent's `ru_maxrss` on to the programs that it starts; VmHWM is this program's.
    """
    with suppress(OSError, StopIteration), open("/proc/self/status") as file:  # Linux
        return next(1024 * int(line.split()[1]) for line in file if line.startswith("VmHWM:"))
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
    task = f"{task} takes about {products:.2g} products with K,"
    refuse_above(seconds, bytes_needed, task, remedy)


def refuse_above(
    seconds: float, bytes_needed: float, task: str, remedy: str, longest: float | None = None
) -> None:
    """InputError where an estimate is above the `longest` time (a day), or the free memory.

    The message begins with the `task`, as in "a wave takes", and ends with the `remedy`; without
    `seconds` memory alone is told.
    """
    at_hand = memory_at_hand()
    if not seconds <= (LONGEST if longest is None else longest) or bytes_needed > at_hand:
        task += f" {duration(seconds)} here, and" if seconds else ""
        raise InputError(
            f"{task} {quantity(bytes_needed, 'B', 3)} of memory "
            f"({quantity(at_hand, 'B', 3)} are free); {remedy}"
        )


def refuse_above_memory(bytes_needed: float, task: str, remedy: str) -> None:
    """InputError where a computation needs more than the free memory; words as `refuse_above`."""
    refuse_above(0.0, bytes_needed, f"{task} takes", remedy)
