"""`python -m analysis`: from products to tables, figures and one report, see `analysis.cli`."""

from __future__ import annotations

import sys

from analysis.cli.main import main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
