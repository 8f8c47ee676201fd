"""End a program at Ctrl-C with one line and status 130, at any time.

Python's KeyboardInterrupt would print a traceback while modules are still being loaded, and would
be lost in compiled code and while an object is deleted.
"""

import os
import signal
from contextlib import suppress
from pathlib import Path
from types import FrameType

UNFINISHED: set[Path] = set()
"""Partial files that this process is writing, which are removed when it is interrupted."""
INTERRUPTED_STATUS = 130
"""Exit status of a program that Ctrl-C ends, as shells have it."""


def end_at_interrupt() -> None:
    """Let Ctrl-C end the program from here on, unless the shell ignores it for a background job."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def _end(number: int, frame: FrameType | None) -> None:
    """Remove partial files, print a line and end the process."""
    for path in list(UNFINISHED):
        with suppress(OSError):
            path.unlink(missing_ok=True)
    message = b"interrupted; files are whole or absent\n"
    with suppress(OSError):
        if os.isatty(2):
            message = b"\r\033[K" + message  # in place of a progress bar
        os.write(2, message)
    os._exit(INTERRUPTED_STATUS)
