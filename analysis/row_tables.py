"""Tables of the whole study, from the rows of its cases."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from analysis.rows import PERCENT, Row
from analysis.study import number
from analysis.table import Table


def table_1(rows: list[Row], seeds: list[Row]) -> Table:
    """One row a case, its numbers and their errors: of the estimator and of the choice of chain.

    `sample_error` columns are the standard deviation over the case's packings of other seeds, where
    there are any.
    """
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
    header = ["case", "name", "packing", "mu_comp", "stress_pa", "record", "settled"]
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
        ]
        twins = [row, *(r for r in seeds if r.number == row.number)]
        for name in names:
            line += [_csv(row.value(name)), _csv(row.error(name), 3)]
            if name in scattered and seeds:
                values = np.array([twin.value(name) for twin in twins])
                known = values[np.isfinite(values)]
                line.append(_csv(float(np.std(known, ddof=1)), 3) if len(known) > 1 else "")
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
    """Table 1 as the paper has it, values with their errors, missing plateaus marked."""
    lines = []
    for row in rows:
        line = [str(row.number or row.name), f"{row.mu_comp:g}", f"{row.stress / 1e3:g}"]
        for _, name in SEEN:
            text = number(row.values.get(name, np.nan))
            percent = re.search(r"f_low_pass_(\d)", name)
            bare = percent and text and not row.flat.get(percent[1])
            line.append(f"{text} *" if bare else text)
        lines.append([*line, row.record, "yes" if not row.unsettled else "no"])
    header = ["case", "mu_comp", "stress, kPa", *(head for head, _ in SEEN), "record", "settled"]
    title = "Table 1 (± of the estimator and of the choice of the chain; * on no plateau)"
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
    """Energy books of the YADE runs, and how far each is from the linear wave."""
    header = [
        "case", "drift", "to friction", "gap to the wall's work", "contacts opened", "slid",
        "YADE less linear, layers", "passages of the record",
    ]  # fmt: skip
    names = ("energy_drift", "energy_to_friction", "energy_gap", "contacts_opened", "contacts_slid")
    lines = []
    for row in rows:
        if row.record == "yade":
            cells = [f"{row.value(n):.2g}" if np.isfinite(row.value(n)) else "" for n in names]
            off = row.value("yade_less_linear_layers")
            passages = f"{row.value('record_passages'):.2f}"
            share = f"{100 * off:.2f} %" if np.isfinite(off) else ""
            lines.append([str(row.number or row.name), *cells, share, passages])
    return Table("Energy of the YADE waves", header, lines)


def table_of_scattering(rows: list[Row]) -> Table:
    """Mean free path at f_low-pass and the Ioffe-Regel frequency, with the width's power."""
    header = [
        "case", "e", "Ioffe-Regel frequency, kHz", "over f_low-pass 2 %",
        "mean free path at f_low-pass, D", "gain maximum 1, order", "gain maximum 5, order",
    ]  # fmt: skip
    lines = []
    for row in rows:
        limit, two = row.value("ioffe_regel_khz"), row.value("f_low_pass_2_linear_khz")
        orders = row.curves["gain_orders"][0]
        cells = [limit, limit / two, row.value("free_path_at_f_low_pass_over_d")]
        places = [float(orders[k]) if len(orders) > k else np.nan for k in (0, 4)]
        text = [number(value, 3) for value in (row.value("void_ratio"), *cells, *places)]
        lines.append([str(row.number or row.name), *text])
    return Table("Scattering, and the order of the gain's maxima", header, lines)


def table_of_choices(found: dict[str, list[list[str]]]) -> Table:
    """f_low-pass by each choice of the rule, of several cases by their label, side by side."""
    header = ["f_low-pass, kHz", *found]
    rows = [
        [cells[0][0], *(cell[1] for cell in cells)] for cells in zip(*found.values(), strict=True)
    ]
    title = "The low-pass frequency under each choice of the rule"
    return Table(title, header, [row for row in rows if any(row[1:])])
