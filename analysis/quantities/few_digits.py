"""The error of quantities by overlaps that are known to few digits.

Measured on packings of 300, 400 and 500 spheres whose positions were rounded: by an error e of the
overlaps (root mean square over the median) the bulk and shear modulus were off by at most 1.2 e^2 +
0.1 e, velocities by half of it, the highest frequency by e/8, the coordination number by 0.15 e,
attenuation and quality by e. Moduli have an error of their own (`modal.elasticity.few_digits`).
"""

from dataclasses import replace

import numpy as np

from analysis.caveats import Caveat
from analysis.value import Value
from modal.packing.network import Network
from modal.packing.precision import overlap_error

OF_MODULI = (1.2, 0.1)
"""Relative error of moduli: these times e^2 and e."""
OF_HIGHEST = 1 / 8
"""Relative error of the highest frequency, over e."""
OF_COORDINATION = 0.15
"""Relative error of the coordination number, over e."""
UNMOVED = ("void_ratio", "crystalline_share")
"""Quantities that follow from radii and places, not from overlaps."""


def relative_error_by_digits(network: Network, name: str, unit: str) -> float:
    """Return the relative error of a quantity in this unit; 0 where digits move nothing."""
    error = overlap_error(network)
    if name in UNMOVED or not error:
        return 0.0
    moduli = OF_MODULI[0] * error**2 + OF_MODULI[1] * error
    if name == "coordination":
        return OF_COORDINATION * error
    if unit == "Pa":
        return moduli
    if unit == "m/s":
        return moduli / 2
    if unit == "Hz":
        return max(moduli / 2, OF_HIGHEST * error)
    return error


def with_digits(value: Value, network: Network, name: str, unit: str) -> Value:
    """Return the value with its error by the digits of overlaps, and a caveat that says so."""
    relative = relative_error_by_digits(network, name, unit)
    if not relative or not value.known:
        return value
    parts = dict(value.parts) | {"digits": relative * np.abs(value.value)}
    caveat = Caveat("few_digits", {"error": overlap_error(network)})
    return replace(value, parts=parts).with_caveats(caveat)
