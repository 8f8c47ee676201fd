"""`python -m modal`: the command line, see `modal.cli`."""

from __future__ import annotations

import sys

from modal.cli.main import main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(main())
