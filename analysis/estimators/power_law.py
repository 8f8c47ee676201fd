"""How velocity and band edge of the crystals grow with stress, by theory, modes and signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.case import Products
from analysis.estimators import damped_transform as disp
from modal.formats.hdf5 import InputError

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class PowerLaw:
    """y = factor x^exponent; the exponent's standard error, NaN from fewer than three points."""

    factor: float
    exponent: float
    error: float = np.nan

    def __str__(self) -> str:
        text = f"b = {self.exponent:.4f}"
        return f"{text} ± {self.error:.1g}" if np.isfinite(self.error) else text


def power_law(x: np.ndarray, y: np.ndarray) -> PowerLaw:
    """Least squares of the logarithms; NaN from a single x."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    known = np.isfinite(x) & np.isfinite(y)
    u, v = np.log(x[known]), np.log(y[known])
    if known.sum() < 2 or np.ptp(u) == 0:
        return PowerLaw(np.nan, np.nan)
    exponent, offset = np.polyfit(u, v, 1)
    error = np.nan
    if known.sum() > 2:
        left = v - exponent * u - offset
        error = np.sqrt(left @ left / (len(u) - 2) / ((u - u.mean()) ** 2).sum())
    return PowerLaw(float(np.exp(offset)), float(exponent), float(error))


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
