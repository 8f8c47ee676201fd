"""`python -m analysis`: from products to tables, figures and one report, see `analysis.cli`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from modal.tools.interrupted import end_at_interrupt

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; without `argv` as a program of its own, which Ctrl-C ends in one line."""
    if argv is None:
        end_at_interrupt()  # before what takes time to load
    from analysis.cli.main import main as run

    try:
        return run(argv)
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":
            raise
        print("error: matplotlib is absent, which draws; pip install matplotlib", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
