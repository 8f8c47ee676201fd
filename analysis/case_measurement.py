"""Measure a case: all quantities that its files allow, and the curves that figures draw."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.case_columns import OF_CASE, OF_MODULI, RECORD_COPIES, SHOWN_GAIN_ORDERS
from analysis.case_result import CaseResult
from analysis.packing_data import PackingData, cached_on_packing
from analysis.quantities import QUANTITIES, gain, polarisation, spectrum
from analysis.quantities.case_files import HIGH_MODES_START_IN_F_MAX
from analysis.quantities.records import LOW_PASS, PERCENT, SHEAR
from analysis.quantities.scattering import whole_ridge
from analysis.quantities.velocity import longest
from analysis.value import Value

MAY_LACK = "signals", "highest.modes", "modes", "density", "structure", "response"
"""Kinds of files that a case may lack."""


@cached_on_packing
def measure_result(packing: PackingData) -> CaseResult:
    """Measure all quantities that a case's products allow, each of them once."""
    case = packing.case
    result = empty_result(packing)
    add_quantities(result, packing, OF_CASE)
    for percent in PERCENT:
        result.flat[percent] = result.flat[f"{percent}_{result.record}"]
    for name, source in RECORD_COPIES.items():
        result.values[name] = result.values[source.format(record=result.record)]
    result.texts["gain_height"] = gain.height(packing)
    above = HIGH_MODES_START_IN_F_MAX * spectrum.f_max(packing)
    result.texts["chi_z_high"] = polarisation.largest_chi(packing, above, np.inf)[1]
    _add_curves(packing, result)
    for kind in MAY_LACK:
        needed = not packing.crystal or kind not in ("density", "structure")
        if needed and not case.has(kind):
            result.absent.append(kind)
    result.notes += case.notes
    return result


def empty_result(packing: PackingData) -> CaseResult:
    """Return a result of a case that has no values yet."""
    friction = packing.mu_comp
    if packing.crystal:
        friction = 0.0
    record = "yade"
    if packing.yade is None:
        record = "linear"
    return CaseResult(
        number=packing.case.number,
        name=packing.case.name,
        label=packing.label,
        crystal=packing.crystal,
        stress=packing.stress,
        mu_comp=friction,
        record=record,
        unsettled=packing.unsettled,
    )


def add_quantities(result: CaseResult, packing: PackingData, names: Iterable[str]) -> None:
    """Measure quantities of a packing by name, and add them to its result.

    Quantities of S-waves and of moduli are left out if their files do not exist.
    """
    thresholds = {name: key for key, (name, _) in LOW_PASS.items()}
    recorded = {"", *packing.shear}
    for name in names:
        if name in OF_MODULI and not packing.case.has("moduli"):
            continue
        if SHEAR.get(name, "") not in recorded:
            continue
        value = QUANTITIES[name].measured(packing)
        result.values[name] = value
        if name in thresholds:
            result.flat[thresholds[name]] = value.plateau is True
        if value.known:
            continue
        column, _ = result.column_of(name, value.unit)
        for caveat in value.caveats:
            if caveat.code != "absent":
                result.notes.append(f"{column}: {caveat}")


def _add_curves(packing: PackingData, result: CaseResult) -> None:
    """Add the curves that figures over several cases draw."""
    spectrum_of_gain = gain.gain_of(packing)
    result.curves["gain"] = (spectrum_of_gain.frequency, spectrum_of_gain.gain)
    for order, height in enumerate(gain.orders(packing)[:SHOWN_GAIN_ORDERS], 1):
        result.values[f"gain_order_{order}"] = Value(float(height), "1", {"fit": np.nan})
    result.curves["first"] = (np.array([gain.first_resonance(packing)]),)
    result.curves["resonances"] = spectrum.standing_waves(packing)
    if packing.case.has("structure"):
        frequency, width, path = whole_ridge(packing).of_waves()
        diameter_time = packing.diameter / longest(packing, "linear").value
        result.curves["ridge"] = (frequency * diameter_time, width / frequency, path)
