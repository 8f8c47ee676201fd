"""Notice that another package named `modal` is installed, before it is used.

PyPI's `modal` is an unrelated package; pip lets it replace this project's package without a
warning.
"""

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

OUR_NAME = '__distribution__ = "granular-wave-modes"'
"""Line of `modal/__init__.py` by which our package is known; the file is read, not run."""


def describe_other_modal() -> str | None:
    """Return a line that names a package that replaces this project's `modal`, or None."""
    spec = find_spec("modal")
    remedy = "pip uninstall modal, then pip install --force-reinstall granular-wave-modes"
    if spec is None or not spec.origin:
        return f"error: no package modal, which belongs to granular-wave-modes; {remedy}"
    if OUR_NAME in Path(spec.origin).read_text(encoding="utf-8", errors="replace"):
        return None
    return f"error: {spec.origin} is another package named modal, in the place of ours; {remedy}"


def run(argv: Sequence[str] | None = None, package: str = "modal") -> int:
    """Run one command of `modal` or `analysis` and return its exit status.

    The status is 2, with one line on stderr, if another package named `modal` is found.
    """
    other = describe_other_modal()
    if other:
        print(other, file=sys.stderr)
        return 2
    from modal.__main__ import main

    return main(argv, package)
