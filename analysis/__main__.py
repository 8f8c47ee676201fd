"""`python -m analysis`: from products to tables, figures and one report, see `analysis.cli`."""

import sys
from collections.abc import Sequence

from modal.__main__ import begin

__all__ = ["main"]

USED_FOR = {
    "matplotlib": ("matplotlib", "draws"),
    "pandas": ("pandas", "groups the results of a study"),
    "yaml": ("pyyaml", "reads a study"),
    "jinja2": ("jinja2", "fills the page of a study"),
}
"""Modules that some commands need: their packages, and what these do."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; without `argv` as a program of its own, which Ctrl-C ends in one line."""
    if argv is None:
        begin()
    from analysis.cli.main import main as run

    try:
        return run(argv)
    except ModuleNotFoundError as error:
        if error.name not in USED_FOR:
            raise
        package, use = USED_FOR[error.name]
        print(f"error: {package} is absent, which {use}; pip install {package}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
