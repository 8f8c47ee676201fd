"""Show the progress of a long loop: a bar on a terminal, a line each minute in a log.

Both go to standard error, so that results can be read from standard output.
"""

import math
import sys
import time
from collections.abc import Generator

from modal.tools.display import duration

BAR_WIDTH = 32
"""Number of characters of the bar."""
BAR_INTERVAL = 0.2
"""Time between two drawings of the bar, s: smooth enough for the eye."""
LOG_INTERVAL = 60.0
"""Time between two lines of a log, s."""
CLEAR_LINE = "\r\033[K"
"""Return to the beginning of a terminal's line and clear it."""


class Minute:
    """A clock that decides when a loop reports: a minute after the last report.

    Loops that follow each other within a minute share the clock, so that many short loops in a row
    also report. The first tenth of a minute of a loop is silent.
    """

    _last_use = -math.inf
    _last_report = -math.inf

    def __init__(self) -> None:
        now = time.monotonic()
        self._start = now
        if now - Minute._last_use > LOG_INTERVAL:
            Minute._last_report = now

    def passed(self, interval: float | None = None) -> bool:
        """Return whether a minute, or the `interval`, s, has passed since the last report.

        If so, the clock starts again.
        """
        if interval is None:
            interval = LOG_INTERVAL
        now = time.monotonic()
        Minute._last_use = now
        if now - Minute._last_report <= interval or now - self._start <= interval / 10:
            return False
        Minute._last_report = now
        return True

    @classmethod
    def begin(cls) -> None:
        """Start the clock for a new series of loops."""
        cls._last_use = -math.inf

    @staticmethod
    def tell(state: str) -> None:
        """Print a line on standard error that says how far a loop has come."""
        print(state, file=sys.stderr, flush=True)


def progress(count: int, label: str) -> Generator[int, None, None]:
    """Yield 0 ... count - 1, while standard error shows how far the loop has come.

    A loop that ends within a minute writes nothing to a log.
    """
    on_terminal = sys.stderr.isatty()
    interval = BAR_INTERVAL if on_terminal else LOG_INTERVAL
    start = time.monotonic()
    minute = Minute()
    try:
        for k in range(count):
            yield k
            if minute.passed(interval):
                share = (k + 1) / count
                left = duration((time.monotonic() - start) * (1 / share - 1))
                end = f"{100 * share:3.0f} %, {left} left"
                if on_terminal:
                    bar = "#" * int(BAR_WIDTH * share)
                    print(
                        f"{CLEAR_LINE}{label} [{bar:<{BAR_WIDTH}}] {end}",
                        end="",
                        file=sys.stderr,
                        flush=True,
                    )
                else:
                    Minute.tell(f"{label}: step {k + 1} of {count}, {end}")
    finally:
        if on_terminal:
            print(CLEAR_LINE, end="", file=sys.stderr, flush=True)
