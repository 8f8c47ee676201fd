"""Tasks that the tests measure, each in a process of its own that knows no tests."""

import time

import numpy as np


def hundred_megabytes():
    """Write to memory of this size and give it back: a task for `measured`."""
    return lambda: int(np.ones(100_000_000 // 8).sum())


def nothing_to_do():
    """Return at once: a task for `measured`."""
    return lambda: None


def waiting():
    """Wait: a task for `measured`."""
    return lambda: time.sleep(0.5)
