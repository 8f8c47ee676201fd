"""Ctrl-C ends a program with one line and status 130, wherever it comes.

As an exception it would be a traceback while the program's modules are still loaded, and be lost
where Python cannot hand one on: in what compiled code has called, and as an object is deleted.
"""

import os
import signal
from contextlib import suppress
from pathlib import Path
from types import FrameType

UNFINISHED: set[Path] = set()
"""Partial files that this process is writing, which are removed when it is interrupted."""


def end_at_interrupt() -> None:
    """From here on; not in a job in the background, for which the shell has Ctrl-C ignored."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: FrameType | None) -> None:
    for path in list(UNFINISHED):
        with suppress(OSError):
            path.unlink(missing_ok=True)
    with suppress(OSError):
        wiped = b"\r\033[K" if os.isatty(2) else b""  # a bar of progress
        os.write(2, wiped + b"interrupted; files are whole or absent\n")
    os._exit(130)
