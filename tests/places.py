"""Folders of the project and of the tests' data."""

from pathlib import Path

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
DATA = TESTS / "data"
PACKINGS = ROOT / "examples" / "packings"
"""Packings of other programs, as those programs wrote them."""
SHEARED = DATA / "friction150.sample.h5"
"""A sample of 150 spheres with friction and its shear forces."""
