"""How far a long loop has come: a bar on a terminal, a line a minute in a log.

Both go to standard error, so that results can be read from standard output.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

WIDTH = 32
"""Characters of the bar."""
BAR_INTERVAL, LOG_INTERVAL = 0.2, 60.0
"""Seconds between two drawings of the bar, and between two lines of a log."""


def progress(count: int, label: str) -> Iterator[int]:
    """The numbers 0 ... count - 1, while standard error shows how far they have come.

    A loop that ends within a minute leaves nothing in a log.
    """
    terminal = sys.stderr.isatty()
    interval = BAR_INTERVAL if terminal else LOG_INTERVAL
    start = last = time.monotonic()
    try:
        for k in range(count):
            yield k
            now = time.monotonic()
            if now - last <= interval:
                continue
            last, part = now, (k + 1) / count
            told = f"{100 * part:3.0f} %, {time_left((now - start) * (1 / part - 1))} left"
            if terminal:
                sys.stderr.write(f"\r{label} [{'#' * int(WIDTH * part):<{WIDTH}}] {told} ")
            else:
                sys.stderr.write(f"{label}: step {k + 1} of {count}, {told}\n")
            sys.stderr.flush()
    finally:
        if terminal:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()


def time_left(seconds: float) -> str:
    """A time to go, in the unit that suits it.

    >>> time_left(45.2), time_left(600.0), time_left(9000.0)
    ('45 s', '10 min', '2.5 h')
    """
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"
