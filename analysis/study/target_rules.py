"""How each of the paper's numbers is looked for among the rows, and what is said of it.

A rule takes the rows by their number and returns a `Finding`. Where it speaks of several cases, the
value is the one that is furthest from what the paper has, and `why` names the others' range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from analysis.comparable import of_one_producer, of_three_packings, spread_of_highest
from analysis.paper import COORDINATION_AT_1_KPA, STATED, STRESSES
from analysis.rows import Row, groups_of, law_of
from analysis.study.frictions import powers

CRYSTALS, RANDOM = range(1, 5), range(5, 33)


@dataclass(frozen=True)
class Finding:
    """What a target's rule found: value and error, whether it is met, and why (or why not).

    `off`: how far the value is from what the paper has, where that is one number.
    """

    value: float
    error: float
    met: bool
    why: str
    off: str = ""


def absent(what: str) -> Finding:
    """A number that no case gives, and what is not there."""
    return Finding(np.nan, np.nan, False, f"not measured: {what}")


def numbers_of(cases: Iterable[int]) -> str:
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
    case: int,
    name: str,
    wanted: float,
    within: float,
    *,
    relative: bool = True,
    plateau: str = "",
) -> Callable[[dict[int, Row]], Finding]:
    """One case's number within so much of a value; `within` in parts of it, or in its unit.

    With `plateau`, a threshold in per cent, it counts only where that stands on one.
    """

    def find(rows: dict[int, Row]) -> Finding:
        if case not in rows or not np.isfinite(rows[case].value(name)):
            return absent(missing(rows, [case], name))
        row = rows[case]
        value = row.value(name)
        off = value - wanted
        met = abs(off) <= within * (wanted if relative else 1)
        by = f"{100 * off / wanted:+.2f} %" if relative else f"{off:+.4f}"
        why = f"off by {by}"
        if plateau:
            why += f", {'YADE' if row.record == 'yade' else 'linear wave: no YADE run'}"
            if not row.flat.get(plateau, False):
                met, why = False, f"{why}; on no plateau, where the rule has no answer"
        if row.unsettled:
            met, why = False, f"{why}; state not settled: {row.unsettled}"
        return Finding(value, row.spread(name), met, why, by)

    return find


def rounds(case: int, name: str, wanted: float, digits: int) -> Callable[[dict[int, Row]], Finding]:
    """One case's number that rounds to the stated digits."""

    def find(rows: dict[int, Row]) -> Finding:
        if case not in rows or not np.isfinite(rows[case].value(name)):
            return absent(missing(rows, [case], name))
        value = rows[case].value(name)
        met = round(value, digits) == wanted
        by = f"{100 * (value / wanted - 1):+.2f} %"
        why = f"rounds to {value:.{digits}f}"
        return Finding(value, rows[case].spread(name), met, why, by)

    return find


def missing(rows: dict[int, Row], cases: Iterable[int], name: str) -> str:
    """What is not there for a number of these cases."""
    away = [n for n in cases if n not in rows]
    blank = [n for n in cases if n in rows and not np.isfinite(rows[n].value(name))]
    parts = [f"no packing of case {numbers_of(away)}"] if away else []
    kinds = sorted({kind for n in blank for kind in rows[n].absent})
    if blank:
        text = f"case {numbers_of(blank)} does not give it"
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
            return absent(missing(rows, cases, name))
        if np.isfinite(middle):
            worst = max(seen, key=lambda n: abs(seen[n] - middle))
        else:
            worst = min(seen, key=lambda n: seen[n] if np.isinf(high) else -seen[n])
        outside = [n for n, value in seen.items() if not low <= value <= high]
        least, most = min(seen.values()), max(seen.values())
        why = f"case {numbers_of(seen)}: {least:.5g} to {most:.5g}"
        if outside:
            why += f"; outside: case {numbers_of(outside)}"
        if len(seen) < len(cases):
            why += "; " + missing(rows, cases, name)
        met = not outside and len(seen) == len(cases)
        return Finding(seen[worst], rows[worst].spread(name), met, why)

    return find


def crystal_exponent(rows: dict[int, Row]) -> Finding:
    """V_P of the crystals by first peaks is the sixth root of the stress, within 0.002."""
    members = [rows[n] for n in CRYSTALS if n in rows]
    name, producer = of_one_producer(members, "v_p_first_peaks")
    members = [row for row in members if np.isfinite(row.value(name))]
    law = law_of(members, "stress_pa", name)
    if len(members) < 2 or not np.isfinite(law.exponent):
        return absent(missing(rows, CRYSTALS, name))
    off = law.exponent - 1 / 6
    met = abs(off) <= 0.002 and len(members) == len(CRYSTALS)
    why = f"over case {numbers_of(row.number for row in members)}, first peaks, {producer}"
    if len(members) < len(CRYSTALS):
        why += "; " + missing(rows, CRYSTALS, name)
    return Finding(law.exponent, law.error, met, why, f"{off:+.4f}")


def random_exponents(rows: dict[int, Row]) -> Finding:
    """b > 1/6 in each friction, and grows with the void ratio beyond twice its standard error."""
    random = [row for n, row in rows.items() if n in RANDOM]
    name, producer = of_one_producer(random, "v_p_first_peaks")
    found = powers(random, "stress_pa", name)
    if found is None:
        return absent(missing(rows, RANDOM, "v_p_first_peaks_m_per_s"))
    least = int(np.argmin(found.power))
    met = bool(found.power[least] > 1 / 6) and found.grows and found.whole
    value, error = float(found.power[least]), float(found.error[least])
    return Finding(value, error, met, f"{producer}: b = {found}")


def highest_apart(rows: dict[int, Row]) -> Finding:
    """Largest over smallest f_max of FCC, friction 0 and 0.4 at one stress, less one, in %."""
    cases = [first + k for k in range(len(STRESSES)) for first in (1, 5, 29)]
    found = spread_of_highest(of_three_packings(rows.values()))
    if not found:
        return absent(missing(rows, cases, "f_max_khz"))
    text = ", ".join(f"{value:.2f} at {stress / 1e3:g} kPa" for stress, value in found.items())
    worst = max(found.values())
    why = f"in %: {text}"
    if len(found) < len(STRESSES):
        why += "; " + missing(rows, cases, "f_max_khz")
    if worst >= 3:
        at = max(found, key=lambda stress: found[stress])
        three = [row for row in of_three_packings(rows.values()) if abs(row.stress / at - 1) < 0.01]
        each = (f"{row.group} {row.value('f_max_khz'):.2f}" for row in three)
        why += f"; at {at / 1e3:g} kPa {', '.join(each)} kHz"
        why += "; " + _who_moves([row for row in three if not row.crystal])
        powers_ = [
            f"{name} {law_of(m, 'stress_pa', 'f_max_khz').exponent:.4f}"
            for name, m in groups_of(of_three_packings(rows.values())).items()
        ]
        why += "; powers over stress: " + ", ".join(powers_)
    every = spread_of_highest(rows.values())
    why += f"; of all packings at most {max(every.values()):.2f}"
    return Finding(worst, np.nan, worst < 3 and len(found) == len(STRESSES), why)


def _who_moves(members: list[Row]) -> str:
    """In which spheres the highest modes of packings are: what decides f_max."""
    said = [
        f"case {row.number}: {row.value('f_max_spheres'):.0f}, {row.value('f_max_contacts'):.0f}"
        for row in members
        if np.isfinite(row.value("f_max_spheres"))
    ]
    if not said:
        return "the shapes of the highest modes are not there"
    return "spheres that move in the highest mode, contacts of the first: " + ", ".join(said)


def chi_high(rows: dict[int, Row]) -> Finding:
    """Largest chi_z of the chain at high frequencies, of the modes at hand."""
    if 6 not in rows or not np.isfinite(rows[6].value("chi_z_high")):
        return absent(missing(rows, [6], "chi_z_high"))
    value = rows[6].value("chi_z_high")
    every = rows[6].value("chi_z_high_all")
    seen = rows[6].texts.get("chi_z_high", "")
    mean, error = (f("chi_z_high_mean") for f in (rows[6].value, rows[6].error))
    why = f"of the chain, {seen}; of all particles {every:.3f}: the chain is a small draw of them"
    if np.isfinite(mean):
        why += f"; mean of the chain {mean:.3f} ± {error:.1g}, 1/3 without direction"
    return Finding(value, np.nan, abs(value - paper("chi_high", 6)) < 0.05, why)


def gain(rows: dict[int, Row]) -> Finding:
    """The largest gain is above 1; its height is the resolution's, which is said."""
    cases = [2, 3, 4, 6, 7, 8]
    seen = {n: rows[n].value("gain_maximum") for n in cases if n in rows}
    seen = {n: value for n, value in seen.items() if np.isfinite(value)}
    if not seen:
        return absent(missing(rows, cases, "gain_maximum"))
    worst = min(seen, key=lambda n: seen[n])
    why = f"case {numbers_of(seen)}: {min(seen.values()):.3g} to {max(seen.values()):.3g}, at "
    why += f"{rows[worst].texts.get('gain_height', 'its resolution')}: the resolution decides it"
    if len(seen) < len(cases):
        why += "; " + missing(rows, cases, "gain_maximum")
    met = min(seen.values()) > 1 and len(seen) == len(cases)
    return Finding(seen[worst], np.nan, met, why)


def coordination(
    mu_comp: float, within: float, states: dict[float, Row], rows: Iterable[Row] = ()
) -> Finding:
    """Mean coordination number at 1 kPa, of the state of a friction; `rows` are under more."""
    row = states.get(mu_comp)
    if row is None:
        return absent(f"no packing of friction {mu_comp:g} at 1 kPa")
    value = row.value("coordination_number")
    off = value - COORDINATION_AT_1_KPA[mu_comp]
    inside = abs(off) <= within
    why = f"off by {off:+.3f}"
    if row.unsettled:
        why += f", {'inside' if inside else 'outside'}, but the state has not settled: "
        why += row.unsettled
        above = [r for r in rows if not r.crystal and r.mu_comp == mu_comp and not r.unsettled]
        if above:
            low = min(above, key=lambda r: r.stress)
            number = low.value("coordination_number")
            why += f"; settled at {low.stress / 1e3:g} kPa: {number:.3f}"
    met = inside and not row.unsettled
    return Finding(value, row.spread("coordination_number"), met, why, f"{off:+.3f}")
