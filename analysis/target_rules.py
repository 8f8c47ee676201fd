"""How each of the paper's numbers is looked for among the rows, and what is said of it.

A rule takes the rows by their number and returns a `Finding`. Where it speaks of several cases, the
value is the one that is furthest from what the paper has, and `why` names the others' range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from analysis.paper import COORDINATION_AT_1_KPA, RANGES, STATED
from analysis.rows import Row, groups_of, law_of

CRYSTALS, RANDOM = range(1, 5), range(5, 33)


@dataclass(frozen=True)
class Finding:
    """What a target's rule found: value and error, whether it is met, and why (or why not)."""

    value: float
    error: float
    met: bool
    why: str


def _absent(what: str) -> Finding:
    return Finding(np.nan, np.nan, False, f"not measured: {what}")


def _numbers(cases: Iterable[int]) -> str:
    """Cases as 1-4, 7."""
    found: list[list[int]] = []
    for n in sorted(cases):
        if found and n == found[-1][-1] + 1:
            found[-1].append(n)
        else:
            found.append([n])
    return ", ".join(f"{run[0]}-{run[-1]}" if len(run) > 1 else str(run[0]) for run in found)


def paper(key: str, case: int) -> float:
    """What the paper states of a case, in its unit."""
    return next(entry.value for entry in STATED if entry.id == key and case in entry.cases)


def near(
    case: int, name: str, wanted: float, within: float, *, relative: bool = True
) -> Callable[[dict[int, Row]], Finding]:
    """One case's number within so much of a value; `within` in parts of it, or in its unit."""

    def find(rows: dict[int, Row]) -> Finding:
        if case not in rows or not np.isfinite(rows[case].value(name)):
            return _absent(_missing(rows, [case], name))
        row = rows[case]
        value = row.value(name)
        off = value - wanted
        met = abs(off) <= within * (wanted if relative else 1)
        why = f"off by {100 * off / wanted:+.2f} %" if relative else f"off by {off:+.4f}"
        if row.unsettled:
            met, why = False, f"{why}; state not settled: {row.unsettled}"
        return Finding(value, row.error(name), met, why)

    return find


def rounds(case: int, name: str, wanted: float, digits: int) -> Callable[[dict[int, Row]], Finding]:
    """One case's number that rounds to the stated digits."""

    def find(rows: dict[int, Row]) -> Finding:
        if case not in rows or not np.isfinite(rows[case].value(name)):
            return _absent(_missing(rows, [case], name))
        value = rows[case].value(name)
        met = round(value, digits) == wanted
        return Finding(value, rows[case].error(name), met, f"rounds to {value:.{digits}f}")

    return find


def _missing(rows: dict[int, Row], cases: Iterable[int], name: str) -> str:
    """What is not there for a number of these cases."""
    away = [n for n in cases if n not in rows]
    blank = [n for n in cases if n in rows and not np.isfinite(rows[n].value(name))]
    parts = [f"no packing of case {_numbers(away)}"] if away else []
    kinds = sorted({kind for n in blank for kind in rows[n].absent})
    if blank:
        text = f"case {_numbers(blank)} does not give it"
        parts.append(text + (f" (absent: {', '.join(kinds)})" if kinds else ""))
    return "; ".join(parts) or "nothing to measure it on"


def all_within(
    cases: Iterable[int],
    name: str,
    low: float,
    high: float,
    *,
    aim: float | None = None,
) -> Callable[[dict[int, Row]], Finding]:
    """Numbers of several cases, all within bounds; the value is the furthest from `aim`."""
    cases = list(cases)
    middle = 0.5 * (low + high) if aim is None else aim

    def find(rows: dict[int, Row]) -> Finding:
        seen = {n: rows[n].value(name) for n in cases if n in rows}
        seen = {n: value for n, value in seen.items() if np.isfinite(value)}
        if not seen:
            return _absent(_missing(rows, cases, name))
        if np.isfinite(middle):
            worst = max(seen, key=lambda n: abs(seen[n] - middle))
        else:
            worst = min(seen, key=lambda n: seen[n] if np.isinf(high) else -seen[n])
        outside = [n for n, value in seen.items() if not low <= value <= high]
        least, most = min(seen.values()), max(seen.values())
        why = f"case {_numbers(seen)}: {least:.5g} to {most:.5g}"
        if outside:
            why += f"; outside: case {_numbers(outside)}"
        if len(seen) < len(cases):
            why += "; " + _missing(rows, cases, name)
        met = not outside and len(seen) == len(cases)
        return Finding(seen[worst], rows[worst].error(name), met, why)

    return find


def _velocity(rows: Iterable[Row]) -> str:
    """First peaks of YADE where all of these cases have them, else of the linear wave of all."""
    rows = list(rows)
    name = "v_p_first_peaks_yade_m_per_s"
    if rows and all(np.isfinite(row.value(name)) for row in rows):
        return name
    return "v_p_first_peaks_linear_m_per_s"


def crystal_exponent(rows: dict[int, Row]) -> Finding:
    """V_P of the crystals by first peaks is the sixth root of the stress, within 0.002."""
    members = [rows[n] for n in CRYSTALS if n in rows]
    name = _velocity(members)
    law = law_of(members, "stress_pa", name)
    if len(members) < 2 or not np.isfinite(law.exponent):
        return _absent(_missing(rows, CRYSTALS, name))
    wanted = 1 / 6
    met = abs(law.exponent - wanted) <= 0.002 and len(members) == len(CRYSTALS)
    why = f"over case {_numbers(row.number for row in members)}, {_said(name)}"
    return Finding(law.exponent, law.error, met, why)


def _said(name: str) -> str:
    return "first peaks of " + ("YADE" if "yade" in name else "the linear wave")


def random_exponents(rows: dict[int, Row]) -> Finding:
    """b > 1/6 in each friction, and grows with the void ratio at the lowest stress."""
    found = []
    for members in groups_of(r for n, r in rows.items() if n in RANDOM).values():
        name = _velocity(members)
        law = law_of(members, "stress_pa", name)
        if len(members) > 1 and np.isfinite(law.exponent):
            found.append((members[0].value("void_ratio"), law, len(members)))
    if not found:
        return _absent(_missing(rows, RANDOM, "v_p_first_peaks_m_per_s"))
    found.sort(key=lambda entry: entry[0])
    exponents = [law.exponent for _, law, _ in found]
    least = int(np.argmin(exponents))
    grows = all(
        b > a - 2 * np.hypot(np.nan_to_num(one.error), np.nan_to_num(two.error))
        for (a, b), (_, one, _), (_, two, _) in zip(
            zip(exponents[:-1], exponents[1:], strict=True), found[:-1], found[1:], strict=True
        )
    )
    grows = grows and exponents[-1] > exponents[0]
    whole = len(found) == 7 and all(count == 4 for *_, count in found)
    text = ", ".join(f"{b:.3f} (e {e:.3f})" for b, (e, *_) in zip(exponents, found, strict=True))
    why = f"b over e at the lowest stress: {text}; {'grows' if grows else 'does not grow'} with e"
    if not whole:
        why += f"; {len(found)} of 7 frictions, not all of them over four stresses"
    met = min(exponents) > 1 / 6 and grows and whole
    return Finding(exponents[least], found[least][1].error, met, why)


def slopes(rows: dict[int, Row]) -> Finding:
    """Slope of log f_low-pass over log V_P for each friction."""
    found = []
    for members in groups_of(r for n, r in rows.items() if n in RANDOM).values():
        name = _velocity(members)
        producer = "yade" if "yade" in name else "linear"
        law = law_of(members, name, f"f_low_pass_2_{producer}_khz")
        if len(members) > 1 and np.isfinite(law.exponent):
            found.append((members[0].value("void_ratio"), law, len(members)))
    if not found:
        return _absent(_missing(rows, RANDOM, "f_low_pass_2_khz"))
    found.sort(key=lambda entry: entry[0])
    slopes = [law.exponent for _, law, _ in found]
    inside = [1.2 <= slope <= 1.4 for slope in slopes]
    worst = int(np.argmax(abs(np.array(slopes) - 1.3)))
    text = ", ".join(f"{b:.2f} (e {e:.3f})" for b, (e, *_) in zip(slopes, found, strict=True))
    why = f"slope over e at the lowest stress: {text}; {sum(inside)} of {len(found)} inside"
    whole = len(found) == 7 and all(count == 4 for *_, count in found)
    if not whole:
        why += f"; {len(found)} of 7 frictions, not all of them over four stresses"
    return Finding(slopes[worst], found[worst][1].error, all(inside) and whole, why)


def spread_of_highest(rows: dict[int, Row]) -> Finding:
    """Largest over smallest f_max of FCC, friction 0 and 0.4 at one stress, less one, in %."""
    found, missing = {}, []
    for k, stress in enumerate((1e4, 1e5, 1e6, 1e7)):
        cases = [1 + k, 5 + k, 29 + k]
        values = [rows[n].value("f_max_khz") for n in cases if n in rows]
        values = [value for value in values if np.isfinite(value)]
        if len(values) == 3:
            found[stress] = 100 * (max(values) / min(values) - 1)
        else:
            missing += [n for n in cases if n not in rows]
    if not found:
        return _absent(_missing(rows, missing, "f_max_khz"))
    text = ", ".join(f"{value:.2f} at {stress / 1e3:g} kPa" for stress, value in found.items())
    worst = max(found.values())
    met = worst < 3 and len(found) == 4
    why = f"in %: {text}" + (f"; no packing of case {_numbers(missing)}" if missing else "")
    if worst >= 3:
        why += "; the most crowded sphere of each sample decides f_max"
    return Finding(worst, np.nan, met, why)


def chi_high(rows: dict[int, Row]) -> Finding:
    """Largest chi_z of the chain above 15 kHz, of the modes at hand."""
    if 6 not in rows or not np.isfinite(rows[6].value("chi_z_above_15_khz")):
        return _absent(_missing(rows, [6], "chi_z_above_15_khz"))
    value = rows[6].value("chi_z_above_15_khz")
    every = rows[6].value("chi_z_above_15_khz_all")
    seen = rows[6].texts.get("chi_z_above_15_khz", "")
    why = f"of the chain, {seen}; of all particles {every:.3f}: the chain is a small draw of them"
    return Finding(value, np.nan, abs(value - paper("chi_high", 6)) < 0.05, why)


def gain(rows: dict[int, Row]) -> Finding:
    """The largest gain is above 1; its height is the resolution's, which is said."""
    cases = [2, 3, 4, 6, 7, 8]
    seen = {n: rows[n].value("gain_maximum") for n in cases if n in rows}
    if not seen:
        return _absent(_missing(rows, cases, "gain_maximum"))
    worst = min(seen, key=lambda n: seen[n])
    why = f"case {_numbers(seen)}: {min(seen.values()):.3g} to {max(seen.values()):.3g}, at "
    why += f"{rows[worst].texts.get('gain_height', 'its resolution')}: the resolution decides it"
    if len(seen) < len(cases):
        why += "; " + _missing(rows, cases, "gain_maximum")
    met = min(seen.values()) > 1 and len(seen) == len(cases)
    return Finding(seen[worst], np.nan, met, why)


def dem_edge(rows: dict[int, Row]) -> Finding:
    """The paper's rule within 1.5 %, and the unbiased estimate within 0.5 %, of one case."""
    wanted = paper("threshold_2", 2)
    if 2 not in rows or not np.isfinite(rows[2].value("f_low_pass_2_yade_khz")):
        return _absent(_missing(rows, [2], "f_low_pass_2_yade_khz"))
    row = rows[2]
    ruled, edge = row.value("f_low_pass_2_yade_khz"), row.value("band_edge_yade_khz")
    by_rule, by_edge = 100 * (ruled / wanted - 1), 100 * (edge / wanted - 1)
    why = (
        f"2 % rule at 5-15 % of the length, record of {row.value('record_passages'):.2f} passages: "
        f"{by_rule:+.2f} %; unbiased {edge:.2f} kHz: {by_edge:+.2f} %"
    )
    met = abs(by_rule) <= 1.5 and abs(by_edge) <= 0.5
    return Finding(ruled, row.error("f_low_pass_2_yade_khz"), met, why)


def wavelengths(percent: str) -> Callable[[dict[int, Row]], Finding]:
    """lambda_low-pass / D of the random cases by a threshold, with what else the paper may mean."""
    limits = next(
        r for r in RANGES if r.id == ("lambda_over_d" if percent == "2" else "lambda_over_d_1")
    )
    plain = all_within(RANDOM, f"lambda_{percent}_over_d", limits.low, limits.high)

    def find(rows: dict[int, Row]) -> Finding:
        found = plain(rows)
        wave = [n for n in RANDOM if n in rows and rows[n].record == "linear"]
        bare = [n for n in RANDOM if n in rows and not rows[n].flat.get(percent, False)]
        why = found.why
        if wave:
            why += f"; linear wave in case {_numbers(wave)}"
        if bare:
            why += f"; no plateau at {percent} % in case {_numbers(bare)}"
        if percent == "2":
            own = [rows[n].value("lambda_2_own_over_d") for n in RANDOM if n in rows]
            own = [value for value in own if np.isfinite(value)]
            if own:
                why += f"; relative to each particle's maximum {min(own):.3g} to {max(own):.3g}"
        return Finding(found.value, found.error, found.met, why)

    return find


def coordination(mu_comp: float, within: float, states: dict[float, Row]) -> Finding:
    """Mean coordination number at 1 kPa, of the state of a friction."""
    row = states.get(mu_comp)
    if row is None:
        return _absent(f"no packing of friction {mu_comp:g} at 1 kPa")
    value = row.value("coordination_number")
    off = value - COORDINATION_AT_1_KPA[mu_comp]
    met, why = abs(off) <= within and not row.unsettled, f"off by {off:+.3f}"
    if row.unsettled:
        why += f"; state not settled: {row.unsettled}"
    return Finding(value, row.error("coordination_number"), met, why)
