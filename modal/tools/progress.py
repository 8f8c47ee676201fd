"""How far a long loop has come: a bar on a terminal, a line a minute in a log.

Both go to standard error, so that results can be read from standard output.
"""

import math
import sys
import time
from collections.abc import Generator

from modal.tools.display import duration

WIDTH = 32
"""Characters of the bar."""
BAR_INTERVAL, LOG_INTERVAL = 0.2, 60.0
"""Seconds between two drawings of the bar, and between two lines of a log."""


class Minute:
    """When a loop is to say what it is at: a minute after any loop of this run has said something.

    Loops that follow each other within a minute are one run, so that many in a row tell as well,
    but for those that end within a tenth of a minute.
    """

    _asked = _said = -math.inf

    def __init__(self) -> None:
        self._begun = now = time.monotonic()
        if now - Minute._asked > LOG_INTERVAL:
            Minute._said = now

    def passed(self, interval: float | None = None) -> bool:
        """Whether a minute, or the `interval`, s, has gone since something was said last."""
        now = Minute._asked = time.monotonic()
        interval = LOG_INTERVAL if interval is None else interval
        if now - Minute._said <= interval or now - self._begun <= interval / 10:
            return False
        Minute._said = now
        return True

    @classmethod
    def begin(cls) -> None:
        """A new run begins, which has said nothing yet."""
        cls._asked = -math.inf

    @staticmethod
    def tell(state: str) -> None:
        """A line on standard error about where the loop is."""
        print(state, file=sys.stderr, flush=True)


def progress(count: int, label: str) -> Generator[int, None, None]:
    """The numbers 0 ... count - 1, while standard error shows how far they have come.

    A run that ends within a minute leaves nothing in a log.
    """
    terminal = sys.stderr.isatty()
    before, after = ("\r\033[K", "") if terminal else ("", "\n")
    interval = BAR_INTERVAL if terminal else LOG_INTERVAL
    start, minute = time.monotonic(), Minute()
    try:
        for k in range(count):
            yield k
            if minute.passed(interval):
                part = (k + 1) / count
                left = duration((time.monotonic() - start) * (1 / part - 1))
                bar = f" [{'#' * int(WIDTH * part):<{WIDTH}}]"
                told = bar if terminal else f": step {k + 1} of {count},"
                told = f"{before}{label}{told} {100 * part:3.0f} %, {left} left"
                print(told, end=after, file=sys.stderr, flush=True)
    finally:
        print(before, end="", file=sys.stderr, flush=True)
