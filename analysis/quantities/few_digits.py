"""Estimate the error of quantities if overlaps are known to few digits.

The errors were measured on packings of 300, 400 and 500 spheres whose positions were rounded. If e
is the error of the overlaps (root mean square divided by the median), the bulk and the shear
modulus were off by at most 1.2 e^2 + 0.1 e, velocities by half of this, the highest frequency by e
/ 8, the coordination number by 0.15 e, attenuation and quality by e. Moduli have a further error
(`modal.elasticity.few_digits`). For spheres from a scan, errors follow from the moduli and the
coordination number at other tolerances (`modal.packing.scan`).
"""

from dataclasses import replace

import numpy as np

from analysis.caveats import Caveat
from analysis.steps import Step
from analysis.value import Value
from modal.elasticity.few_digits import COVERAGE_FACTOR
from modal.elasticity.static_response import elastic_moduli
from modal.packing.network import Network
from modal.packing.precision import is_scanned, other_packings, overlap_error
from modal.packing.scan import Scan

MODULI_ERROR_PER_SQUARED_ERROR = 1.2
"""Quadratic term of the relative error of moduli, divided by e^2."""
MODULI_ERROR_PER_ERROR = 0.1
"""Linear term of the relative error of moduli, divided by e."""
FREQUENCY_ERROR_PER_ERROR = 1 / 8
"""Relative error of the highest frequency, divided by e."""
COORDINATION_ERROR_PER_ERROR = 0.15
"""Relative error of the coordination number, divided by e."""
WITHOUT_OVERLAPS = ("void_ratio", "crystalline_share")
"""Quantities that follow from radii and positions, not from overlaps."""


def relative_error_by_digits(network: Network, name: str, unit: str) -> float:
    """Return the relative error of a quantity that few digits of overlaps cause.

    `unit` is the unit of the quantity. The error is 0 if all digits are known.
    """
    if name in WITHOUT_OVERLAPS:
        return 0.0
    if is_scanned(network):
        return _relative_error_of_scan(network, name, unit)
    error = overlap_error(network)
    if not error:
        return 0.0
    moduli = MODULI_ERROR_PER_SQUARED_ERROR * error**2 + MODULI_ERROR_PER_ERROR * error
    if name == "coordination":
        return COORDINATION_ERROR_PER_ERROR * error
    if unit == "Pa":
        return moduli
    if unit == "m/s":
        return moduli / 2
    if unit == "Hz":
        return max(moduli / 2, FREQUENCY_ERROR_PER_ERROR * error)
    return error


def _relative_error_of_scan(network: Network, name: str, unit: str) -> float:
    """Return the relative error of a quantity for scanned spheres, due to the assumptions."""
    if name == "coordination":
        return _coordination_error(network)
    moduli: float = network.cached("error of a scan", lambda: elastic_moduli(network).error)
    if unit == "m/s":
        return moduli / 2
    return moduli


def _coordination_error(network: Network) -> float:
    """Return the relative error of the coordination number of scanned spheres."""
    changes = [
        other.coordination_number / network.coordination_number - 1
        for other in other_packings(network)
    ]
    return COVERAGE_FACTOR * float(np.sqrt(np.mean(np.square(changes))))


def part_of_moduli_error(network: Network) -> str:
    """Return the name of the part of a value's error that the error of the moduli is.

    That of scanned spheres comes from the assumptions about their contacts.
    """
    return "digits" if is_scanned(network) else "fit"


def with_digits(value: Value, network: Network, name: str, unit: str) -> Value:
    """Return the value with the error that few digits of overlaps cause, and a caveat.

    A value that follows from the moduli of scanned spheres has this error already.
    """
    if not value.known or name in WITHOUT_OVERLAPS:
        return value
    scan = Scan.of(network.study)
    if scan is not None:
        caveat = Caveat("scanned", {"tolerance": scan.tolerance, "stress": scan.stress})
        if "digits" in value.parts:
            return value.with_caveats(caveat)
        numbers = {"scan_tolerance": scan.tolerance}
    else:
        error = overlap_error(network)
        caveat = Caveat("few_digits", {"error": error})
        numbers = {"overlap_error": error}
    relative = relative_error_by_digits(network, name, unit)
    if not relative:
        return value
    numbers["relative_error"] = relative
    parts = dict(value.parts) | {"digits": relative * np.abs(value.value)}
    steps = (*value.steps, Step("limit", "digits", numbers))
    return replace(value, parts=parts, steps=steps).with_caveats(caveat)
