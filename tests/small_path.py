"""Loading paths of 100 spheres, with friction and without."""

from modal.__main__ import main

SHAPE = ["pack", "--spheres", "100", "--aspect", "1.3"]
SMALL = [*SHAPE, "--friction", "0.4"]
STRESS_OPTIONS = {"0.4": ["--stress", "1e4", "1e5"], "0": ["--stress", "1e7", "1e6"]}
"""Stresses of a path with friction and of one without, by the friction."""
WRITTEN_STATUSES = 0, 3
"""Exit statuses of a path whose states are written; few spheres do not reach each of them."""


def pack(folder, *options):
    """Return the exit status of a small path with friction."""
    return main([*SMALL, *options, "-o", str(folder)])
