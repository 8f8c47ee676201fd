"""How the paper's numbers on the low-pass frequency are looked for among the rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.case_tables import number
from analysis.comparable import of_one_producer
from analysis.measures.estimate import Estimate
from analysis.paper import RANGES
from analysis.rows import Row
from analysis.study.frictions import powers
from analysis.study.statements import RULES
from analysis.study.target_rules import (
    RANDOM,
    Finding,
    absent,
    all_within,
    missing,
    numbers_of,
    paper,
)


def slopes(rows: dict[int, Row]) -> Finding:
    """Slope of log f_low-pass over log V_P within each friction, all of them within 1.2 to 1.4."""
    random = [row for n, row in rows.items() if n in RANDOM]
    name, _ = of_one_producer(random, "v_p_first_peaks")
    edge, producer = of_one_producer(random, "f_low_pass_2")
    if "linear" in edge:
        name = of_one_producer([], "v_p_first_peaks")[0]
    found = powers(random, name, edge)
    if found is None:
        return absent(missing(rows, RANDOM, "f_low_pass_2_khz"))
    inside = (found.power >= 1.2) & (found.power <= 1.4)
    worst = int(np.argmax(abs(found.power - 1.3)))
    why = f"{producer}: {inside.sum()} of {len(inside)} inside; slope = {found}"
    flat = f"2_{producer.lower()}"
    bare = [row.number for row in random if not row.flat.get(flat, False)]
    if bare:
        why += f"; no plateau at 2 % in case {numbers_of(bare)}"
    if not inside.all():
        others = []
        for rule in list(RULES)[1:]:
            other = powers(random, name, f"f_low_pass_2_{rule}{producer.lower()}_khz")
            if other is not None:
                others.append(f"{RULES[rule]} {_span(other.power)}")
        limit = powers(random, name, "ioffe_regel_khz")
        if limit is not None:
            others.append(f"Ioffe-Regel {_span(limit.power)}")
        why += "; by other rules: " + ", ".join(others) if others else ""
    met = bool(inside.all()) and found.whole
    return Finding(float(found.power[worst]), float(found.error[worst]), met, why)


def dem_edge(rows: dict[int, Row]) -> Finding:
    """The paper's rule within 1.5 %, and the unbiased estimate within 0.5 %, of one case."""
    wanted = paper("threshold_2", 2)
    if 2 not in rows or not np.isfinite(rows[2].value("f_low_pass_2_yade_khz")):
        return absent(missing(rows, [2], "f_low_pass_2_yade_khz"))
    row = rows[2]
    ruled, edge = row.value("f_low_pass_2_yade_khz"), row.value("band_edge_yade_khz")
    by_rule, by_edge = 100 * (ruled / wanted - 1), 100 * (edge / wanted - 1)
    why = (
        f"2 % rule at 5-15 % of the length, record of {row.value('record_passages'):.2f} passages: "
        f"{by_rule:+.2f} %; unbiased {edge:.2f} kHz: {by_edge:+.2f} %"
    )
    met = abs(by_rule) <= 1.5 and abs(by_edge) <= 0.5
    return Finding(ruled, row.spread("f_low_pass_2_yade_khz"), met, why, f"{by_rule:+.2f} %")


def wavelengths(percent: str) -> Callable[[dict[int, Row]], Finding]:
    """lambda_low-pass / D of the random cases by a threshold, with what else the paper may mean."""
    limits = next(
        r for r in RANGES if r.id == ("lambda_over_d" if percent == "2" else "lambda_over_d_1")
    )
    plain = all_within(RANDOM, f"lambda_{percent}_over_d", limits.low, limits.high)

    def find(rows: dict[int, Row]) -> Finding:
        found = plain(rows)
        seen = [rows[n] for n in RANDOM if n in rows]
        wave = [row.number for row in seen if row.record == "linear"]
        bare = [row.number for row in seen if not row.flat.get(percent, False)]
        why = found.why + _outside(seen, f"lambda_{percent}_over_d", limits.low, limits.high)
        why += f"; linear wave in case {numbers_of(wave)}" if wave else "; YADE"
        if bare:
            why += f"; no plateau at {percent} % in case {numbers_of(bare)}"
        for rule in list(RULES)[1:]:
            own = [row.value(f"lambda_{percent}_{rule}{row.record}_over_d") for row in seen]
            known = np.array([value for value in own if np.isfinite(value)])
            if len(known):
                inside = ((known >= limits.low) & (known <= limits.high)).sum()
                why += f"; {RULES[rule]}: {_span(known)}, {inside} of {len(known)} inside"
        return Finding(found.value, found.error, found.met and not bare, why)

    return find


def _span(values: np.ndarray) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


def _outside(seen: list[Row], name: str, low: float, high: float) -> str:
    """Each case outside with its error, and of how many the range is within twice that."""
    outside = [row for row in seen if not low <= row.value(name) <= high]
    outside = [row for row in outside if np.isfinite(row.value(name))]
    if not outside:
        return ""
    each = [
        f"{row.number}: {number(Estimate(row.value(name), row.spread(name)))}" for row in outside
    ]
    off = [max(row.value(name) - high, low - row.value(name)) for row in outside]
    near = sum(gap <= 2 * row.spread(name) for gap, row in zip(off, outside, strict=True))
    return f" ({', '.join(each)}; {near} of them by less than twice their error)"
