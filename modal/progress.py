"""A progress bar on terminals; silent where standard error is a file or a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

WIDTH = 32
"""Characters of the bar."""


def progress(count: int, label: str) -> Iterator[int]:
    """The numbers 0 ... count - 1, while a bar on standard error shows how far they have come."""
    shown = sys.stderr.isatty() and count > 0
    start = last = time.monotonic()
    try:
        for k in range(count):
            yield k
            now = time.monotonic()
            if shown and now - last > 0.2:
                last, part = now, (k + 1) / count
                bar = "#" * int(WIDTH * part)
                left = (now - start) * (1 / part - 1)
                sys.stderr.write(
                    f"\r{label} [{bar:<{WIDTH}}] {100 * part:3.0f} %, {left:.0f} s left "
                )
                sys.stderr.flush()
    finally:
        if shown:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()
