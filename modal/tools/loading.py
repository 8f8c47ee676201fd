"""What makes libraries load in less time: no look for garbage, and nothing that is not used.

Libraries make objects by the hundred thousand as they are loaded, and hardly any garbage. To look
through them again and again takes a tenth of a short command's time, and a last time as the program
ends a fifth.
"""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import LazyLoader, find_spec, module_from_spec


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


def when_used(name: str) -> None:
    """Have a module of a package, as "numpy.f2py", loaded when something of it is first used.

    Nothing where it is loaded, or absent.
    """
    package, _, part = name.rpartition(".")
    spec = None if name in sys.modules else find_spec(name)
    if spec is None or spec.loader is None:
        return
    spec.loader = LazyLoader(spec.loader)
    module = sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    setattr(sys.modules[package], part, module)


# At the end of the program its memory goes back as a whole, what is garbage and what is not.
atexit.register(gc.freeze)
