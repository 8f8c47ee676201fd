"""Tasks that the tests measure, each in a process of its own that knows no tests."""

import time

import numpy as np


def hundred_megabytes():
    """Task for `measured`: memory that is written to, given back at the end."""
    return lambda: int(np.ones(100_000_000 // 8).sum())


def nothing_to_do():
    """Task for `measured`."""
    return lambda: None


def waiting():
    """Task for `measured`."""
    return lambda: time.sleep(0.5)
