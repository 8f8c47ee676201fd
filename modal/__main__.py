"""The command line, `python -m modal`; the commands are in `modal.cli`."""

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec

from modal.tools.interrupted import end_at_interrupt

__all__ = ["main"]

OBJECTS_BETWEEN_COLLECTIONS = 100_000
"""Number of new objects after which Python collects garbage; its own default is 700."""


def main(argv: Sequence[str] | None = None, package: str = "modal") -> int:
    """Run one command and return the exit status.

    Without `argv` the function reads the process's command line, and Ctrl-C ends the process with
    one line.
    """
    if argv is None:
        prepare_process()
    status: int = import_module(f"{package}.cli.main").main(argv)
    return status


def prepare_process() -> None:
    """Let Ctrl-C end the process in one line, collect garbage less often, delay imports."""
    end_at_interrupt()
    # Libraries make objects by the hundred thousand and hardly any garbage: collect it less often,
    # and not at the end of the program, which after compiled loops would take 0.3 s.
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    atexit.register(gc.freeze)
    _load_when_used("f2py", "testing")


def _load_when_used(*parts: str) -> None:
    """Delay loading parts of numpy until they are used, in this program alone.

    scipy refers to each part of numpy when it is imported, which loads that part. Loading all parts
    takes a sixth of a short command's time.
    """
    import numpy

    for part in parts:
        spec = find_spec(f"numpy.{part}")
        if spec and spec.loader and spec.name not in sys.modules:
            spec.loader = LazyLoader(spec.loader)
            module = module_from_spec(spec)
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
            setattr(numpy, part, module)


if __name__ == "__main__":
    sys.exit(main())
