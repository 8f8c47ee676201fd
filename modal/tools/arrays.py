"""Define types of arrays by their numbers; docstrings that use them give shapes and units."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Complex = NDArray[np.complex128]
Ints = NDArray[np.integer[Any]]
"""Indices and counts, of 4 bytes, as in files, or of 8, with which numpy counts."""
Bools = NDArray[np.bool_]
Array = NDArray[Any]
"""Numbers of a kind that is known at run time only, such as a dataset read by its name."""
