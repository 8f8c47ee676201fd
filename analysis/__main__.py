"""`python -m analysis`: from products to tables, figures and one report, see `analysis.cli`."""

import sys
from functools import partial

from analysis.shadowing import run

__all__ = ["main"]

main = partial(run, package="analysis")
"""Run one command; without arguments as a program of its own, which Ctrl-C ends in one line."""

if __name__ == "__main__":
    sys.exit(main())
