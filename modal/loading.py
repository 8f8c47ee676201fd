"""Garbage collection, where it would only look at what has just been loaded.

Libraries make objects by the hundred thousand as they are loaded, and hardly any garbage. To look
through them again and again takes a tenth of a short command's time, and a last time as the program
ends a fifth.
"""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def undisturbed() -> Iterator[None]:
    """While something is loaded: no search for garbage."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


# At the end of the program its memory goes back as a whole, what is garbage and what is not.
atexit.register(gc.freeze)
