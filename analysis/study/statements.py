"""Which of the paper's statements on the low-pass frequency each rule for it meets.

The paper states numbers that follow from a threshold on a map (section 5.1): f_low-pass of two
cases, what another threshold changes, wavelengths, and how f_low-pass grows with V_P. Each rule is
held against all of them, by one producer throughout.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.paper import RANGES, stated
from analysis.rows import Row
from analysis.study.frictions import powers
from analysis.table import Table

RULES = {
    "": "one chain, maximum of the whole map",
    "own_": "one chain, each particle's own maximum",
    "layers_": "means of layers, maximum of the whole map",
}
"""Part of a column's name (`analysis.rows.MAPS`), and what the rule is called."""
PRODUCERS = {"yade": "YADE", "linear": "linear wave"}
WITHIN, CRYSTAL_WITHIN, ALIKE, EDGE_WITHIN = 0.10, 0.015, 0.05, 0.01
"""Relative: of 21.9 kHz, of 138.1 kHz, of 2 and 3 % to each other, of sqrt 2."""


def statements(rows: Iterable[Row]) -> Table:
    """A row for each rule and producer; a cell is `yes` or `no`, and the number that decides."""
    rows = list(rows)
    low, high = (_limits(key) for key in ("lambda_over_d", "lambda_over_d_1"))
    header = [
        "rule", "record", "random cases", f"case 6: {stated('threshold_2', 6):g} kHz, within 10 %",
        "2 and 3 % alike (within 5 %)", "1 % further off than 3 %",
        f"lambda 2 %: {low[0]:g}-{low[1]:g} D", f"lambda 1 %: {high[0]:g}-{high[1]:g} D",
        "slope over V_P: 1.2-1.4", "slope grows with e",
        f"FCC: {stated('threshold_2', 2):g} kHz, within 1.5 %",
        "FCC: lambda = sqrt 2 D, within 1 %",
    ]  # fmt: skip
    lines = []
    for rule, text in RULES.items():
        for producer, who in PRODUCERS.items():
            name = f"{rule}{producer}"
            if any(np.isfinite(row.value(f"f_low_pass_2_{name}_khz")) for row in rows):
                lines.append([text, who, *_cells(rows, name, producer, low, high)])
    if any(np.isfinite(row.value("ioffe_regel_khz")) for row in rows):
        lines.append(_ioffe_regel(rows))
    return Table("The paper's statements on f_low-pass, and which rule meets them", header, lines)


def _limits(key: str) -> tuple[float, float]:
    found = next(limits for limits in RANGES if limits.id == key)
    return found.low, found.high


def _cells(
    rows: list[Row],
    name: str,
    producer: str,
    two: tuple[float, float],
    one: tuple[float, float],
) -> list[str]:
    """What a rule makes of each statement."""
    column = f"f_low_pass_{{}}_{name}_khz".format
    random = [row for row in rows if not row.crystal and np.isfinite(row.value(column(2)))]
    three = np.array([row.value(column(3)) / row.value(column(2)) for row in random])
    single = np.array([row.value(column(1)) / row.value(column(2)) for row in random])
    known = np.isfinite(three) & np.isfinite(single)
    three, single = three[known], single[known]
    return [
        str(len(random)),
        _near(rows, 6, column(2), WITHIN),
        _share(abs(three - 1) <= ALIKE, three),
        _share(single - 1 > 1 - three, single),
        *(
            _inside([row.value(f"lambda_{percent}_{name}_over_d") for row in random], limits)
            for percent, limits in ((2, two), (1, one))
        ),
        *_slopes(random, f"v_p_first_peaks_{producer}_m_per_s", column(2)),
        _near(rows, 2, column(2), CRYSTAL_WITHIN),
        _crystal_wavelength(rows, column(2)),
    ]


def _ioffe_regel(rows: list[Row]) -> list[str]:
    """The threshold-free limit; it has no percentages, and of a crystal no value."""
    random = [row for row in rows if np.isfinite(row.value("ioffe_regel_khz"))]
    slopes = _slopes(random, "v_p_first_peaks_linear_m_per_s", "ioffe_regel_khz")
    near = _near(rows, 6, "ioffe_regel_khz", WITHIN)
    count = str(len(random))
    return ["Ioffe-Regel, no threshold", "modes", count, near, "", "", "", "", *slopes, "", ""]


def _said(met: bool, text: str) -> str:
    return f"{'yes' if met else 'no'}: {text}"


def _near(rows: list[Row], case: int, name: str, within: float) -> str:
    """A case's number and how far it is from the stated f_low-pass."""
    row = next((row for row in rows if row.number == case), None)
    wanted = stated("threshold_2", case)
    if row is None or wanted is None or not np.isfinite(row.value(name)):
        return ""
    off = row.value(name) / wanted - 1
    return _said(abs(off) <= within, f"{row.value(name):.4g} kHz ({100 * off:+.1f} %)")


def _share(met: np.ndarray, ratio: np.ndarray) -> str:
    """How many cases meet it, and the range of the frequencies over those at 2 %."""
    if len(met) == 0:
        return ""
    span = f"{ratio.min():.2f} to {ratio.max():.2f} of 2 %"
    return _said(bool(met.all()), f"{met.sum()} of {len(met)}, {span}")


def _inside(values: list[float], limits: tuple[float, float]) -> str:
    """How many are inside, and the range of all."""
    known = np.array([value for value in values if np.isfinite(value)])
    if len(known) == 0:
        return ""
    inside = (known >= limits[0]) & (known <= limits[1])
    text = f"{inside.sum()} of {len(known)}, {known.min():.3g} to {known.max():.3g}"
    return _said(bool(inside.all()), text)


def _slopes(random: list[Row], velocity: str, edge: str) -> list[str]:
    """Powers of f_low-pass over V_P of each friction: inside 1.2 to 1.4, and growing with e."""
    found = powers(random, velocity, edge)
    if found is None:
        return ["", ""]
    low, high = _limits("slope")
    inside = (found.power >= low) & (found.power <= high)
    least, most = found.power.min(), found.power.max()
    text = f"{inside.sum()} of {len(inside)} frictions, {least:.2f} to {most:.2f}"
    slope, error = found.trend
    grows = f"{slope:+.1f}" + (f" ± {error:.1g}" if np.isfinite(error) else "")
    return [_said(bool(inside.all()), text), _said(found.grows, grows) if len(inside) > 2 else ""]


def _crystal_wavelength(rows: list[Row], name: str) -> str:
    """Wavelength of the crystals where the rule puts the end of their band, by Eq. 7: 2 V / pi f.

    Relative to the theory's, which is sqrt 2 D; Eq. 7 has a wavelength beyond the band's end too.
    """
    edge = np.array([row.value("band_edge_theory_khz") for row in rows if row.crystal])
    found = np.array([row.value(name) for row in rows if row.crystal])
    known = np.isfinite(edge) & np.isfinite(found)
    if not known.any():
        return ""
    over = edge[known] / found[known] * 2**0.5
    worst = float(over[np.argmax(abs(over - 2**0.5))])
    met = abs(worst / 2**0.5 - 1) <= EDGE_WITHIN
    return _said(met, f"{worst:.3f} D, the furthest of {known.sum()}")
