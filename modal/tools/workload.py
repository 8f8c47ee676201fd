"""Estimate the time and memory of long computations, and refuse them if too large."""

import sys
import time
from typing import Any

import numpy as np

from modal.tools.display import duration, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.memory import memory_at_hand, peak_memory

MAX_SECONDS = 86400.0
"""Largest time, s, of a computation on this machine; a longer one is refused: a day is hardly
intended."""
MIN_ANNOUNCED_SECONDS = 20.0
"""Least estimated time, s, that is printed on a terminal before the work starts: a user would not
wait so long without asking."""


def refuse_endless(
    task: str, operator: Any, *, products: float, bytes_needed: float, remedy: str
) -> None:
    """Raise UnavailableError if products K u would take more than a day or the free memory.

    The `operator`, a `modal.system.operator.ContactOperator`, is timed in one product. The message
    begins with the `task`, as in "a wave of 10 s", and ends with the `remedy`.
    """
    motion = np.zeros(operator.shape[0])
    started = time.perf_counter()
    operator.apply(motion)
    seconds = products * (time.perf_counter() - started)
    if seconds > MIN_ANNOUNCED_SECONDS and sys.stderr.isatty():
        cost = f"about {products:.2g} products with K, {duration(seconds)}"
        print(f"{task}: {cost}, {quantity(bytes_needed, 'B', 3)} more", file=sys.stderr, flush=True)
    refuse_above(
        seconds, bytes_needed, f"{task} takes about {products:.2g} products with K,", remedy
    )


def refuse_above(
    seconds: float,
    bytes_needed: float,
    task: str,
    remedy: str,
    longest: float | None = None,
) -> None:
    """Raise UnavailableError if an estimate is above the `longest` time, s, or the free memory.

    The default of `longest` is a day. The message begins with the `task`, as in "a wave takes", and
    ends with the `remedy`; if `seconds` is 0 the message states the memory alone.
    """
    if longest is None:
        longest = MAX_SECONDS
    free = memory_at_hand()
    if seconds <= longest and not bytes_needed > free:
        return
    if seconds:
        task += f" {duration(seconds)} here, and"
    raise UnavailableError(
        "too_large",
        f"{task} {quantity(bytes_needed, 'B', 3)} of memory ({quantity(free, 'B', 3)} are free)",
        remedy=remedy,
    )


def refuse_above_memory(bytes_needed: float, task: str, remedy: str) -> None:
    """Raise UnavailableError if a computation needs more than the free memory.

    The message is as in `refuse_above`.
    """
    refuse_above(0.0, bytes_needed, f"{task} takes", remedy)


def out_of_memory(error: MemoryError) -> InputError:
    """Return the error for a task that ran out of memory.

    The message has the size of the array from numpy's error, and the present free memory.
    """
    wanted = str(error).replace("\n", " ").rstrip(". ")
    detail = f" ({wanted})" if wanted else ""
    return InputError(
        "out_of_memory",
        f"the memory does not suffice{detail}",
        f"{quantity(peak_memory(), 'B', 3)} were in use and "
        f"{quantity(memory_at_hand(), 'B', 3)} are free",
        "take a smaller packing, ask for less, or raise the limit of memory",
    )
