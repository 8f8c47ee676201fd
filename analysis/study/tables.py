"""Tables of the whole study, from the rows of its cases."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from analysis.case_tables import number
from analysis.comparable import of_three_packings, spread_of_highest
from analysis.measures.estimate import Estimate
from analysis.rows import PERCENT, Row
from analysis.table import Table
from modal.waves.energy_balance import CLOSED


def table_1(rows: list[Row]) -> Table:
    """One row a case, its numbers and their errors: of the estimator and of the choice of chain.

    `sample_error` columns are the standard deviation over the case's packings, its own and those of
    other seeds, where any case has some; by YADE alone or by the linear wave alone, as all have it.
    """
    seeds = any(row.samples for row in rows)
    first = [
        "v_p_first_peaks_m_per_s",
        *(f"f_low_pass_{p}_khz" for p in PERCENT.values()),
        *(f"lambda_{p}_over_d" for p in PERCENT.values()),
        "f_max_khz",
    ]
    others = sorted({name for row in rows for name in row.values} - set(first))
    others = [name for name in _in_order(rows) if name in others]
    plain = ["void_ratio", "coordination_number"]
    names = [*plain, *first, *(name for name in others if name not in plain)]
    scattered = [*plain, *first]
    header = ["case", "name", "packing", "mu_comp", "stress_pa", "record", "settled", "packings"]
    for name in names:
        header += [name, f"{name}_error"]
        if name in scattered and seeds:
            header.append(f"{name}_sample_error")
    header += [f"plateau_{p}" for p in PERCENT.values()] + ["absent"]
    lines = []
    for row in rows:
        line = [
            "" if row.number is None else str(row.number),
            row.name,
            "fcc" if row.crystal else "random",
            f"{row.mu_comp:g}",
            f"{row.stress:g}",
            row.record,
            row.unsettled or "yes",
            str(row.packings),
        ]
        for name in names:
            line += [_csv(row.value(name)), _csv(row.error(name), 3)]
            if name in scattered and seeds:
                line.append(_csv(row.samples.get(name, np.nan), 3))
        line += ["yes" if row.flat.get(p) else "no" for p in PERCENT.values()]
        line.append(" ".join(row.absent))
        lines.append(line)
    return Table("Table 1: specification and results of the cases", header, lines)


def _in_order(rows: list[Row]) -> list[str]:
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row.values)
    return list(names)


def _csv(value: float, digits: int = 7) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else ""


SEEN: tuple[tuple[str, str], ...] = (
    ("e", "void_ratio"),
    ("Z", "coordination_number"),
    ("V_P first peaks, m/s", "v_p_first_peaks_m_per_s"),
    ("f_low-pass 2 %, kHz", "f_low_pass_2_khz"),
    ("f_low-pass 1 %, kHz", "f_low_pass_1_khz"),
    ("lambda/D 2 %", "lambda_2_over_d"),
    ("lambda/D 1 %", "lambda_1_over_d"),
    ("f_max, kHz", "f_max_khz"),
)
"""Columns of Table 1 on the page, after the paper; the CSV has all."""


def table_1_seen(rows: list[Row]) -> Table:
    """Table 1 as the paper has it, values with their errors, missing plateaus marked.

    Where a case has packings of other seeds, ± is their scatter if that is larger.
    """
    lines = []
    for row in rows:
        line = [str(row.number or row.name), f"{row.mu_comp:g}", f"{row.stress / 1e3:g}"]
        for _, name in SEEN:
            text = number(Estimate(row.value(name), row.spread(name)))
            percent = re.search(r"f_low_pass_(\d)", name)
            bare = percent and text and not row.flat.get(percent[1])
            line.append(f"{text} *" if bare else text)
        many = str(row.packings) if row.packings > 1 else "one"
        lines.append([*line, row.record, "yes" if not row.unsettled else "no", many])
    header = ["case", "mu_comp", "stress, kPa", *(head for head, _ in SEEN)]
    header += ["record", "settled", "samples"]
    title = (
        "Table 1 (± of estimator, chain and, of several samples, their scatter; * on no plateau)"
    )
    return Table(title, header, lines)


def table_2_of(found: Sequence[Table]) -> Table:
    """Table 2 of several cases side by side, from that of each."""
    header, columns = ["r"], [[str(r + 1) for r in range(10)]]
    for one in found:
        if not one.rows:
            continue
        header += list(one.header[1:])
        columns += [list(c) for c in list(zip(*one.rows, strict=True))[1:]]
    rows = [list(row) for row in zip(*columns, strict=True)] if len(columns) > 1 else []
    return Table("Table 2: resonant frequencies and wave numbers under 100 kPa", header, rows)


def table_of_energy(rows: list[Row]) -> Table:
    """Energy books of the YADE runs, and how far each is from the linear wave of its springs."""
    header = [
        "case", "drift", "to friction", "gap to the wall's work", "closed (1e-3)",
        "contacts opened", "slid", "YADE less linear (layers; FCC: chain)", "passages recorded",
    ]  # fmt: skip
    books, contacts = ("energy_drift", "energy_to_friction", "energy_gap"), ("opened", "slid")
    lines = []
    for row in rows:
        if row.record != "yade":
            continue
        gap, off = row.value("energy_gap"), row.value("yade_less_linear_layers")
        closed = ("yes" if abs(gap) <= CLOSED else "no") if np.isfinite(gap) else ""
        lines.append(
            [
                str(row.number or row.name),
                *(_plain(row.value(name), ".2g") for name in books),
                closed,
                *(_plain(row.value(f"contacts_{name}"), ".0f") for name in contacts),
                _plain(100 * off, ".2f", " %"),
                _plain(row.value("record_passages"), ".2f"),
            ]
        )
    return Table("Energy of the YADE waves", header, lines)


def _plain(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if np.isfinite(value) else ""


def table_of_scattering(rows: list[Row]) -> Table:
    """The low-pass without a threshold: ridge's width, mean free path, Ioffe-Regel frequency.

    And, of all cases, the orders of the gain's first and fifth maximum: 1/2 and 9/2 where the
    source wall is free of stress.
    """
    header = [
        "case", "e", "stress, kPa", "f_low-pass 2 %, linear wave, kHz", "Ioffe-Regel, kHz",
        "over f_low-pass", "mean free path at f_low-pass, D", "power of the width there", "±",
        "gain maximum 1, order", "gain maximum 5, order",
    ]  # fmt: skip
    lines = []
    for row in rows:
        limit, two = row.value("ioffe_regel_khz"), row.value("f_low_pass_2_linear_khz")
        orders = row.curves["gain_orders"][0]
        cells = [row.value("void_ratio"), row.stress / 1e3, two, limit, limit / two]
        cells += [row.value("free_path_at_f_low_pass_over_d"), row.value("ridge_width_power")]
        cells += [row.error("ridge_width_power")]
        cells += [float(orders[k]) if len(orders) > k else np.nan for k in (0, 4)]
        lines.append([str(row.number or row.name), *(number(value, 3) for value in cells)])
    return Table("Scattering, and the order of the gain's maxima", header, lines)


def table_of_highest(rows: list[Row]) -> Table:
    """f_max of the crystal and of the packings at each stress, and how far they are apart."""
    three, every = spread_of_highest(of_three_packings(rows)), spread_of_highest(rows)
    frictions = sorted({row.mu_comp for row in rows if not row.crystal})
    header = ["stress, kPa", "FCC, kHz", *(f"mu_comp {mu:g}" for mu in frictions)]
    header += ["FCC, 0 and 0.4 apart, %", "all apart, %", "packings"]
    lines = []
    for stress in sorted({float(f"{row.stress:.3g}") for row in rows}):
        members = [row for row in rows if float(f"{row.stress:.3g}") == stress]
        top = {None if row.crystal else row.mu_comp: row.value("f_max_khz") for row in members}
        line = [f"{stress / 1e3:g}"]
        line += [_plain(top.get(mu, np.nan), ".2f") for mu in (None, *frictions)]
        line += [_plain(apart.get(stress, np.nan), ".2f") for apart in (three, every)]
        lines.append([*line, str(len(members))])
    return Table("Highest natural frequency, and its spread at each stress", header, lines)


def table_of_density(rows: list[Row]) -> Table:
    """D(f) / f^2 of the density of states against the contacts that hold a sphere."""
    header = [
        "case", "stress, kPa", "contacts a force-bearing sphere",
        "D f_max^3 / f^2 at a tenth of f_max", "largest", "at, kHz", "at, over f_max",
    ]  # fmt: skip
    lines = []
    for row in rows:
        if "excess" not in row.curves:
            continue
        at = row.value("excess_peak_khz")
        cells = [row.stress / 1e3, row.value("coordination_number_bearing")]
        cells += [row.value("excess_at_a_tenth"), row.value("excess_peak"), at]
        cells.append(at / row.value("f_max_khz"))
        lines.append([str(row.number or row.name), *(number(value, 3) for value in cells)])
    return Table("Density of states over that of plane waves", header, lines)


def table_of_choices(found: dict[str, list[list[str]]]) -> Table:
    """f_low-pass by each choice of the rule, of several cases by their label, side by side."""
    header = ["f_low-pass, kHz", *found]
    rows = [
        [cells[0][0], *(cell[1] for cell in cells)] for cells in zip(*found.values(), strict=True)
    ]
    title = "The low-pass frequency under each choice of the rule"
    return Table(title, header, [row for row in rows if any(row[1:])])
