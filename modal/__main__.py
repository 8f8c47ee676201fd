"""`python -m modal`: the command line, see `modal.cli`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from modal.tools.interrupted import end_at_interrupt

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; without `argv` as a program of its own, which Ctrl-C ends in one line."""
    if argv is None:
        end_at_interrupt()  # before what takes time to load
    from modal.cli.main import main as run

    return run(argv)


if __name__ == "__main__":
    sys.exit(main())
