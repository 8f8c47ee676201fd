"""How many digits a program has written, and what the last of them is worth."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from modal.tools.arrays import Floats

SHORT_MANTISSA_BITS = 16
"""Number of bits; a number whose mantissa fits into these bits counts as exact. Of numbers that
were rounded to the 24 bits of single precision only one in 2^8 has so short a mantissa."""
MIN_DOUBLE_PRECISION_DIGITS = 9
"""Least number of significant digits of a number that needs double precision."""
SINGLE_PRECISION_DIGITS = 7
"""Significant decimal digits of a number in single precision."""
MAX_SINGLE_PRECISION = 1e38
"""Number above which numbers overflow in single precision."""


def count_significant_digits(texts: Sequence[str]) -> int:
    """Return the largest number of significant digits in texts; 7 for single precision.

    >>> count_significant_digits(["0.01200", "1.25e-3", "7"])
    4
    >>> count_significant_digits(["0.10000000149011612"])
    7
    >>> count_significant_digits(["5.0000000000000000e-01"])  # exact in any precision
    17
    """
    digits = count_written_digits(texts)
    if digits < MIN_DOUBLE_PRECISION_DIGITS:
        return digits
    numbers = []
    for text in texts:
        try:
            number = float(text)
        except ValueError:
            continue
        if abs(number) < MAX_SINGLE_PRECISION:
            numbers.append(number)
    if numbers and are_rounded_to_single_precision(np.array(numbers)):
        return SINGLE_PRECISION_DIGITS
    return digits


def count_written_digits(texts: Iterable[str]) -> int:
    """Return the largest number of digits in a text, without leading zeros; at least 1."""
    most = 1
    for text in texts:
        mantissa = text.strip().lower().partition("e")[0].lstrip("+-")
        most = max(most, len(mantissa.replace(".", "").lstrip("0")))
    return most


def are_rounded_to_single_precision(values: Floats) -> bool:
    """Tell whether numbers (n,) were rounded to single precision.

    All numbers must fit into single precision, and at least one must use the last bits of its
    mantissa: numbers such as 8 or 0.375 are exact in any precision and prove nothing.
    """
    if (values.astype(np.float32) != values).any():
        return False
    mantissa, _ = np.frexp(values)
    scaled = mantissa * 2.0**SHORT_MANTISSA_BITS
    return bool((scaled != np.round(scaled)).any())


def last_digit_unit(values: Floats, digits: int) -> float:
    """Return the unit of the last of `digits` significant digits of the largest number.

    >>> last_digit_unit(np.array([0.0144, 0.002]), 6)
    1e-07
    """
    largest = float(abs(values).max(initial=0.0))
    if largest == 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(largest)) - digits + 1)
    return max(float(unit), float(np.spacing(largest)))
