"""Every number that the paper states of the cases at hand, ours beside it, and how far apart.

A report of any cases has this table; it judges nothing. Which of the numbers the whole study must
meet, by what rule, is in `analysis.study.targets`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.estimators.damped_transform import mode_dispersion
from analysis.estimators.power_law import power_law
from analysis.measures import Measures, groups
from analysis.paper import stated, stated_range

HEADER = ["case", "quantity", "here", "paper", "difference"]
GAIN = "gain at its first maximum"
CHI = (
    ("chi_low", "below 10 kHz, chain", 0.0, 1e4),
    ("chi_high", "above 15 kHz, chain", 1.5e4, np.inf),
    ("chi_high", "above 15 kHz, all particles", 1.5e4, np.inf),
)
"""Id, what the paper looks at, Hz; the modes at hand may be of a part of it, which is said."""
NEAR_STRESS = 1.01
"""Stresses within a per cent are one stress."""


def _lowest(m: Measures) -> float:
    modes = m.case.modes
    return np.nan if modes is None else modes.frequency[0] / 1e3


def _resonance(m: Measures, r: int) -> float:
    f = m.resonances[0] / 1e3
    return float(f[r - 1]) if m.case.is_crystal and len(f) >= r else np.nan


def _modal_edge(m: Measures) -> float:
    modes = m.case.modes
    if modes is None or modes.resonance_shape is None:
        return np.nan
    shape = modes.resonance_shape
    found = mode_dispersion(modes.resonance_frequency, shape, m.case.lattice.distance)
    return found.low_pass_frequency / 1e3


def _translations(m: Measures) -> float:
    only = m.case.translations
    return np.nan if only is None else only.frequency[-1] / m.case.lattice.low_pass_frequency


SINGLE: tuple[tuple[str, str, Callable[[Measures], float]], ...] = (
    ("particles", "particles", lambda m: float(m.case.network.n_particles)),
    ("length_over_d", "length / D", lambda m: m.case.network.length / m.case.diameter),
    ("void_ratio", "void ratio", lambda m: m.void_ratio),
    ("f_min", "lowest natural frequency, kHz", _lowest),
    ("f_max", "highest natural frequency, kHz", lambda m: m.f_max / 1e3),
    ("f_1", "P resonance r = 1, kHz", lambda m: _resonance(m, 1)),
    ("f_200", "P resonance r = 200, kHz", lambda m: _resonance(m, 200)),
    ("resonances", "number of P resonances", lambda m: float(len(m.resonances[0]) or np.nan)),
    ("f_low_pass", "f_low-pass, Eq. 10, kHz", lambda m: m.case.lattice.low_pass_frequency / 1e3),
    ("f_low_pass_modal", "f_low-pass, modes, kHz", _modal_edge),
    ("threshold_2", "f_low-pass, 2 % rule, YADE, kHz", lambda m: m.passband.of_yade[0].value / 1e3),
    ("threshold_2", "f_low-pass, 2 % rule, linear, kHz", lambda m: m.low_pass[0].value / 1e3),
    ("threshold_2", "f_low-pass, unbiased, YADE, kHz", lambda m: m.yade_band_edge / 1e3),
    ("lambda_edge", "lambda / D at the band edge, linear", lambda m: m.edge_wavelength[0]),
    ("lambda_edge", "lambda / D at the band edge, YADE", lambda m: m.edge_wavelength[1]),
    ("lambda_over_d", "lambda_low-pass / D, 2 %, YADE", lambda m: m.yade_wavelength(0)),
    ("lambda_over_d", "lambda_low-pass / D, 2 %, linear", lambda m: m.low_pass_wavelength(0)),
    ("lambda_over_d_1", "lambda_low-pass / D, 1 %, YADE", lambda m: m.yade_wavelength(1)),
    ("lambda_over_d_1", "lambda_low-pass / D, 1 %, linear", lambda m: m.low_pass_wavelength(1)),
    ("translations_only", "f_max without rotations / f_low-pass", _translations),
)
"""Id in `analysis.paper`, heading, and how it is measured."""


def deviations(cases: list[Measures]) -> list[list[str]]:
    """Rows under `HEADER`; what the files do not tell is said to be not measured."""
    rows = []
    for m in cases:
        for key, head, measure in SINGLE:
            row = _row(m.case.label, key, head, m.case.compared_case, partial(measure, m))
            if row is None or ("YADE" in head and m.case.signals is None):
                continue
            if "unbiased" in head and not m.case.is_crystal:
                continue
            rows.append(row)
        for key, which, low, high in CHI:
            value, seen = m.largest_chi(low, high, which.endswith("chain"))
            head = f"largest chi_z {which}" + (f" ({seen})" if seen else "")
            row = _row(m.case.label, key, head, m.case.compared_case, partial(float, value))
            rows += [row] if row else []
        limits = stated_range("gain_maximum", m.case.compared_case)
        if limits is not None and m.gain_height:
            verdict = "the resolution's: no verdict"
            rows.append([m.case.label, GAIN, m.gain_height, limits.text, verdict])
    for name, members in groups(cases).items():
        if len(members) < 2:
            continue
        stress = np.array([m.case.stress for m in members])
        case = members[0].case.compared_case
        for producer, peak, edge in (
            ("YADE", lambda m: m.yade_first_peak.value, lambda m: m.passband.of_yade[0].value),
            ("linear wave", lambda m: m.first_peak.value, lambda m: m.low_pass[0].value),
        ):
            peaks = np.array([peak(m) for m in members])
            if np.isfinite(peaks).sum() < 2:
                continue
            edges = np.array([edge(m) for m in members])
            text = f"exponent of V_P against stress, {producer}"
            of_stress, of_edges = power_law(stress, peaks), power_law(peaks, edges)
            rows.append(_row(name, "exponent", text, case, partial(getattr, of_stress, "exponent")))
            text = f"slope of f_low-pass over V_P, logarithms, {producer}"
            rows.append(_row(name, "slope", text, case, partial(getattr, of_edges, "exponent")))
    rows = [row for row in rows if row]
    return rows + _spread(cases)


def _row(
    label: str, key: str, head: str, case: int, measure: Callable[[], float]
) -> list[str] | None:
    value, limits = stated(key, case), stated_range(key, case)
    if value is None and limits is None:
        return None
    own = measure()
    here = f"{own:.5g}" if np.isfinite(own) else ""
    if value is not None:
        off = f"{100 * (own / value - 1):+.2f} %" if here else "not measured"
        return [label, head, here, f"{value:.5g}", off]
    inside = "inside" if limits.low <= own <= limits.high else "outside"
    return [label, head, here, limits.text, inside if here else "not measured"]


def _spread(cases: list[Measures]) -> list[list[str]]:
    """How far the highest frequencies at one stress are apart, where FCC and random are there."""
    rows = []
    for m in cases:
        same = [o for o in cases if 1 / NEAR_STRESS < o.case.stress / m.case.stress < NEAR_STRESS]
        if len({o.case.is_crystal for o in same}) < 2 or m is not same[0]:
            continue
        top = [o.f_max for o in same]
        text = f"{m.case.stress / 1e3:g} kPa, {len(same)} cases"
        spread = 100 * (max(top) / min(top) - 1)
        row = _row(
            text, "f_max_spread", "spread of f_max, %", m.case.compared_case, partial(float, spread)
        )
        if row:
            rows.append(row)
    return rows
