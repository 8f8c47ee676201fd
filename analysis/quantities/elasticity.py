"""Elastic moduli, from the springs' static response."""

from __future__ import annotations

from analysis.measuring import Measuring
from analysis.quantities.registry import quantity
from analysis.value import Value


def _of(packing: Measuring, value: float) -> Value:
    moduli = packing.moduli
    caveats = (*moduli.remarks(), *packing.of_one_sample)
    return Value(value, "Pa", {"solver": value * moduli.error}, caveats)


@quantity("bulk_modulus", "Pa", "bulk modulus of the packing, mean over directions")
def bulk_modulus(packing: Measuring) -> Value:
    """Of the bulk, where walls bound the packing."""
    return _of(packing, packing.moduli.bulk_modulus)


@quantity("shear_modulus", "Pa", "shear modulus of the packing, mean over directions")
def shear_modulus(packing: Measuring) -> Value:
    """Of the bulk, where walls bound the packing."""
    return _of(packing, packing.moduli.shear_modulus)
