"""`python -m modal`: the command line, see `modal.cli`."""

import atexit
import gc
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import LazyLoader, find_spec, module_from_spec

from modal.tools.interrupted import end_at_interrupt

__all__ = ["main"]


def main(argv: Sequence[str] | None = None, package: str = "modal") -> int:
    """Run one command; without `argv` as a program of its own, which Ctrl-C ends in one line."""
    if argv is None:
        begin()
    status: int = import_module(f"{package}.cli.main").main(argv)
    return status


def begin() -> None:
    """Be a program of one's own: before what takes time to load."""
    end_at_interrupt()
    # Libraries make objects by the hundred thousand and hardly any garbage: fewer looks for it, and
    # none as the program ends, which after compiled loops would take 0.3 s.
    gc.set_threshold(100_000)
    atexit.register(gc.freeze)
    _load_when_used("f2py", "testing")


def _load_when_used(*parts: str) -> None:
    """Have these parts of numpy loaded when something of them is used, in this program alone.

    scipy asks numpy for each of its parts; these take a sixth of a short command's time.
    """
    import numpy

    for part in parts:
        spec = find_spec(f"numpy.{part}")
        if spec and spec.loader and spec.name not in sys.modules:
            spec.loader = LazyLoader(spec.loader)
            module = sys.modules[spec.name] = module_from_spec(spec)
            spec.loader.exec_module(module)
            setattr(numpy, part, module)


if __name__ == "__main__":
    sys.exit(main())
