"""Encode arrays of numbers as text for a page: small integers in base64.

A displacement has 16 bits for each component, in steps of 1/32,767 of the largest: 35,201 spheres
at 100 times make 9 MB of text, their contacts 2 MB.
"""

import base64

import numpy as np

STEPS = 32767
"""Number of steps of a displacement from zero to the largest."""
SHADES = 255
"""Number of steps of a colour from zero to the largest."""
COLOUR_PERCENTILE = 99
"""Percentile of a quantity that has the last colour: a few extreme spheres leave the colours of all
others as they are."""


def code_numbers(values: np.ndarray, kind: str) -> str:
    """Return numbers in base64, converted to a NumPy type such as `<i2`."""
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode()


def code_displacements(values: np.ndarray, largest: float) -> str:
    """Return displacements, m, in base64, in integer steps of `largest` / 32,767."""
    return code_numbers(np.round(values / largest * STEPS), "<i2")


def code_shades(values: np.ndarray) -> tuple[str, float]:
    """Return positive values (n,) in base64 as shades, and the value of the last shade.

    The last shade stands for the percentile `COLOUR_PERCENTILE` and for larger values.
    """
    top = 0.0
    if len(values):
        top = float(np.percentile(values, COLOUR_PERCENTILE))
    if top <= 0:
        top = 1.0
    return code_numbers(np.clip(values / top * SHADES, 0, SHADES), "u1"), top


def round_numbers(values: np.ndarray) -> list[float]:
    """Return numbers with five digits, more than a plot shows."""
    return [float(f"{value:.5g}") for value in values]
