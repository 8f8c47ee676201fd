"""How velocity and band edge of the crystals grow with stress, by theory, modes and signals."""

from __future__ import annotations

import numpy as np

from analysis import dispersion as disp
from analysis.products import Products
from modal.storage import InputError

Columns = dict[str, np.ndarray]


def power_law(stress: np.ndarray, value: np.ndarray) -> float:
    """Exponent b of value = a stress^b by least squares of the logarithms; NaN for one point."""
    known = np.isfinite(value)
    if known.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(stress[known]), np.log(value[known]), 1)[0])


def stress_rows(cases: list[Products]) -> Columns:
    """Stress (Pa), V_P (m/s) and f_low-pass (Hz) of each case by theory, modes and signals."""
    for case in cases:
        if not float(case.network.study.get("stress", 0)) > 0:
            raise InputError(f"{case.path('network')}: study has no stress; export it again")
    columns = {"stress_Pa": np.array([float(case.network.study["stress"]) for case in cases])}
    table = {"theory": [], "modal": [], "yade": []}
    for case in cases:
        chain, modes = case.chain, case.modes
        table["theory"].append((chain.velocity, chain.low_pass_frequency))
        found = None
        if modes is not None and modes.resonance_shape is not None:
            found = disp.mode_dispersion(
                modes.resonance_frequency, modes.resonance_shape, chain.distance
            )
        seen = None if case.signals is None else disp.chain_dispersion(case.signals)
        for name, result in (("modal", found), ("yade", seen)):
            pair = (result.velocity, result.low_pass_frequency) if result else (np.nan, np.nan)
            table[name].append(pair)
    for name, pairs in table.items():
        columns[f"velocity_{name}_m_per_s"], columns[f"f_low_pass_{name}_Hz"] = np.array(pairs).T
    return columns
