"""What a long computation will take, known before it starts; refused where that is too much."""

import sys
import time
from typing import Any

import numpy as np

from modal.tools.display import duration, quantity
from modal.tools.errors import InputError, UnavailableError
from modal.tools.memory import memory_at_hand, peak_memory

LONGEST = 86400.0
"""Seconds on this machine above which a computation is refused: a day."""

ANNOUNCED = 20.0
"""Seconds from which on an estimate is said on a terminal before the work starts."""


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
        raise UnavailableError(
            "too_large",
            f"{task} {quantity(bytes_needed, 'B', 3)} of memory "
            f"({quantity(at_hand, 'B', 3)} are free)",
            remedy=f"{remedy}",
        )


def refuse_above_memory(bytes_needed: float, task: str, remedy: str) -> None:
    """InputError where a computation needs more than the free memory; words as `refuse_above`."""
    refuse_above(0.0, bytes_needed, f"{task} takes", remedy)


def out_of_memory(error: MemoryError) -> InputError:
    """Return the refusal for a task that found too little memory as it ran.

    numpy says of an array how large it was to be; what is free is that of now.
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
