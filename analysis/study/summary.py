"""What stands on top of the study's page: what is there and what is not, and the main numbers."""

from __future__ import annotations

import numpy as np

from analysis.case_tables import number
from analysis.page import list_html
from analysis.paper import stated
from analysis.rows import Row
from analysis.study.target_rules import numbers_of
from analysis.study.targets import Answer

HEADLINES = 2, 6, 22, 30
"""Cases whose numbers stand in the summary: the crystal, dense, medium and loose at 100 kPa."""


def summary(rows: list[Row], found: list[Answer], missing: list[int], failed: list[str]) -> str:
    """How many cases and targets, what is missing, the energy books, and the headline numbers."""
    runs = [row for row in rows if row.record == "yade"]
    met = sum(answer.met == "yes" for answer in found)
    lines = [
        f"{len(rows)} of {len(rows) + len(missing)} cases are there, {len(runs)} of them with a "
        "YADE run.",
        f"{met} of {len(found)} targets are met.",
    ]
    if missing:
        lines.append(f"No packing of case {numbers_of(missing)}.")
    lines += _absent(rows)
    lines.append(_samples(rows))
    unsettled = [row.name for row in rows if row.unsettled]
    if unsettled:
        lines.append(f"Not settled: {', '.join(unsettled)}.")
    open_ = [answer.id for answer in found if answer.met != "yes"]
    if open_:
        lines.append(f"Not met: {', '.join(open_)}; the column why says why.")
    lines += _books(runs)
    lines += [_headline(row) for row in rows if row.number in HEADLINES]
    return list_html(lines + failed)


def _absent(rows: list[Row]) -> list[str]:
    """Which products are not there, of which cases, and what stands in their place."""
    instead = {
        "signals": "the linear wave stands in, as `record` says",
        "highest.modes": "f_max is computed for this page",
        "modes": "no resonances by modes, no chi_z",
        "response": "the gain is computed for this page",
        "density": "no density of states",
        "structure": "no ridge, no scattering",
    }
    found = []
    for kind, text in instead.items():
        cases = [row.number for row in rows if kind in row.absent and row.number is not None]
        if cases:
            found.append(f"Absent: {kind} of case {numbers_of(cases)}; {text}.")
    return found


def _samples(rows: list[Row]) -> str:
    """Of which cases the scatter of samples is known."""
    several = [row for row in rows if row.packings > 1 and row.number is not None]
    if not several:
        return "One sample a case: no error of the sample is known."
    cases = numbers_of(row.number for row in several if row.number is not None)
    return (
        f"Scatter of {max(r.packings for r in several)} samples: of case {cases}; others have one."
    )


def _books(runs: list[Row]) -> list[str]:
    """How well the energy of the YADE waves is accounted for."""
    gaps = {row.name: abs(row.value("energy_gap")) for row in runs}
    gaps = {name: gap for name, gap in gaps.items() if np.isfinite(gap)}
    if not gaps:
        return []
    worst = max(gaps, key=lambda name: gaps[name])
    text = f"Energy books of {len(gaps)} of {len(runs)} YADE waves close to {gaps[worst]:.1e} of "
    return [f"{text}the source wall's work or better ({worst}); asked for is 1e-3."]


def _headline(row: Row) -> str:
    """V_P and f_low-pass of a case, and what the paper has."""
    edge = number(row.values["f_low_pass_2_khz"])
    paper = stated("threshold_2", row.number)
    who = "YADE" if row.record == "yade" else "linear wave"
    text = f"{row.label}, {who}: V_P {number(row.values['v_p_first_peaks_m_per_s'])} m/s by first "
    text += "peaks, f_low-pass "
    text += f"{edge or 'unknown'} kHz" + (f" (the paper: {paper:g})" if paper else "")
    text += f"; V_P of long waves, linear {number(row.values['v_p_long_waves_linear_m_per_s'])} m/s"
    return f"{text}; f_max {number(row.values['f_max_khz'], 5)} kHz."
