"""Where the project and the tests' data lie, whichever folder a test is in."""

from pathlib import Path

TESTS = Path(__file__).resolve().parent
ROOT = TESTS.parent
DATA = TESTS / "data"
PACKINGS = ROOT / "examples" / "packings"
"""Packings of other programs, as these have written them."""
SHEARED = DATA / "friction150.sample.h5"
"""A sample of 150 spheres with friction and its shear forces."""
