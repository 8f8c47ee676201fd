"""Tables 1 and 2 of the paper for the cases at hand, power laws, and what the rules' choices do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.deviations import HEADER, deviations
from analysis.estimators.low_pass import Edge
from analysis.estimators.power_law import power_law
from analysis.measures import Measures, groups
from analysis.measures.estimate import Estimate
from analysis.shear_table import table_of_shear
from analysis.table import Table
from modal.tools.errors import InputError

RESONANCES = 10
"""Rows of Table 2."""


QUANTITIES: tuple[tuple[str, Callable[[Measures], float | Estimate | str]], ...] = (
    ("stress, kPa", lambda m: f"{m.case.stress / 1e3:g}"),
    ("not settled, because", lambda m: m.case.unsettled),
    ("e", lambda m: m.void_ratio),
    ("Z", lambda m: m.coordination[0]),
    ("Z of force-bearing", lambda m: m.coordination[1]),
    ("V_P static, m/s", lambda m: m.static),
    ("V_P first peaks, YADE, m/s", lambda m: m.yade_first_peak),
    ("V_P first peaks, linear wave, m/s", lambda m: m.first_peak),
    ("V_P first peaks, linear wave, all columns (± scatter), m/s", lambda m: m.columns),
    ("V_P long waves, YADE, m/s", lambda m: m.yade_long_wave),
    ("V_P long waves, linear wave, m/s", lambda m: m.long_wave),
    ("V_P modes, 2 L f_1 (Eq. 4), m/s", lambda m: m.modal_first),
    ("V_P modes, kappa of Eq. 4, long waves, m/s", lambda m: m.modal),
    ("V_P modes, fitted kappa, long waves, m/s", lambda m: m.modal_fitted),
    ("phase velocity, walls, lambda L/5, m/s", lambda m: m.walls[0]),
    ("group velocity, walls, lambda L/5, m/s", lambda m: m.walls[1]),
    ("V_P EMT, its contacts, m/s", lambda m: m.effective[0]),
    ("V_P EMT, means e and Z, m/s", lambda m: m.effective[1]),
    ("f_low-pass 2 %, YADE, kHz", lambda m: chosen(m.passband.of_yade[0])),
    ("f_low-pass 1 %, YADE, kHz", lambda m: chosen(m.passband.of_yade[1])),
    ("f_low-pass 2 %, linear wave, kHz", lambda m: chosen(m.low_pass[0])),
    ("f_low-pass 1 %, linear wave, kHz", lambda m: chosen(m.low_pass[1])),
    (
        "f_low-pass 2 %, linear wave, all columns (± scatter), kHz",
        lambda m: said(m.passband.mean_of_columns),
    ),
    ("band edge, YADE, kHz", lambda m: m.yade_band_edge / 1e3),
    ("band edge, linear wave, kHz", lambda m: m.band_edge / 1e3),
    ("lambda/D at the band edge, linear wave", lambda m: m.edge_wavelength[0]),
    ("lambda/D at the band edge, YADE", lambda m: m.edge_wavelength[1]),
    ("lambda_low-pass/D 2 %, YADE", lambda m: m.yade_wavelength(0)),
    ("lambda_low-pass/D 1 %, YADE", lambda m: m.yade_wavelength(1)),
    ("lambda_low-pass/D 2 %, linear wave", lambda m: m.low_pass_wavelength(0)),
    ("lambda_low-pass/D 1 %, linear wave", lambda m: m.low_pass_wavelength(1)),
    ("mean free path at f_low-pass / D", lambda m: m.free_path),
    ("f_max, kHz", lambda m: m.f_max / 1e3),
    ("gain at its first maximum, at a resolution", lambda m: m.gain_height),
    ("first gain maximum over f_1", lambda m: m.gain_place),
    ("YADE, energy drift after the pulse", lambda m: m.of_balance("drift")),
    ("YADE, limit of the drift (none where contacts slid)", lambda m: m.of_balance("limit")),
    ("YADE, energy to friction after the pulse", lambda m: m.of_balance("friction")),
    ("YADE, energy and friction less the wall's work, over it", lambda m: m.of_balance("gap")),
    ("YADE, contacts opened", lambda m: m.of_balance("opened")),
    ("YADE, contacts slid", lambda m: m.of_balance("slid")),
)
"""Heading, and how it is measured."""


def in_khz(found: Edge) -> Estimate:
    """A threshold's frequency in kHz."""
    return Estimate(1e-3 * found.value, 1e-3 * found.error)


NONE = 1e-6
"""In parts of a value: an uncertainty that no reader is shown."""


def number(found: float | Estimate | str, digits: int = 4) -> str:
    """A value, to the first digit of its uncertainty where there is one, else to `digits`.

    Counts are whole; empty where there is no value. An uncertainty below `NONE` of the value, as of
    a natural frequency, is none for a reader.
    """
    if isinstance(found, str):
        return found
    value, error = (found.value, found.error) if isinstance(found, Estimate) else (found, np.nan)
    if not np.isfinite(value):
        return ""
    if not (np.isfinite(error) and error > NONE * abs(value)):
        return f"{value:.0f}" if value == round(value) else f"{value:.{digits}g}"
    error = float(f"{error:.0e}")  # one digit, which may carry: 0.96 is 1
    places = -int(np.floor(np.log10(error)))
    return f"{round(value, places):.{max(places, 0)}f} ± {error:.{max(places, 0)}f}"


def table_1(cases: list[Measures]) -> Table:
    """One row a quantity, one column a case: Table 1 in this project's form."""
    header = ["quantity", *(m.case.label for m in cases)]
    rows = [[head, *(number(measure(m)) for m in cases)] for head, measure in QUANTITIES]
    title = "Table 1: specification and results of the cases"
    return Table(title, header, [row for row in rows if any(row[1:])])


def table_2(cases: list[Measures]) -> Table:
    """f_r and kappa_r of the resonances r = 1 ... 10 of every case that has any.

    Of a random packing also the share of the standing wave that the mode bears. Where that is empty
    no mode bears it, and f_r is the ridge of the structure factor, whose lines are 1 kHz wide.
    """
    found = [m for m in cases if len(m.resonances[0])]
    header, columns = ["r"], [[str(r + 1) for r in range(RESONANCES if found else 0)]]
    for m in found:
        (f, kappa), label = m.resonances, m.case.label
        header += [f"f_r, kHz, {label}", f"kappa_r, rad/m, {label}"]
        columns += [[number(v) for v in f / 1e3], [number(v) for v in kappa]]
        if not m.case.is_crystal:
            header.append(f"share of the mode, {label}")
            share = np.empty(0) if m.standing is None else m.standing.share
            columns.append([f"{v:.2f}" for v in share])
    rows = [[(c[r : r + 1] or [""])[0] for c in columns] for r in range(len(columns[0]))]
    return Table("Table 2: resonant frequencies and wave numbers", header, rows)


def choices_of(m: Measures) -> list[list[str]]:
    """Each choice of the rule in words, and f_low-pass, kHz, by it."""
    return [[name, chosen(edge)] for name, edge in m.passband.choices()]


def table_of_choices(cases: list[Measures]) -> Table:
    """f_low-pass under every choice that the threshold rule leaves open."""
    columns = [m.passband.choices() for m in cases]
    bare = [not any(edge.flat for _, edge in choices) for choices in columns]
    header = ["f_low-pass, kHz: whose spectra, threshold"]
    header += [
        f"{m.case.label}{', on a plateau by no choice' * none}"
        for m, none in zip(cases, bare, strict=True)
    ]
    shown = [said if none else chosen for none in bare]
    rows = [
        [row[0][0], *(text(edge) for text, (_, edge) in zip(shown, row, strict=True))]
        for row in zip(*columns, strict=True)
    ]
    title = "The low-pass frequency under each choice of the rule (± half the quartile distance)"
    return Table(title, header, [row for row in rows if any(row[1:])])


def chosen(edge: Edge) -> str:
    """A frequency in kHz, marked where it stands on no plateau; where there is none, why."""
    text = number(in_khz(edge))
    return said(edge) if edge.flat or not text else f"{text}, no plateau"


def said(edge: Edge) -> str:
    """A frequency in kHz; where there is none, why."""
    return number(in_khz(edge)) or (f"none: {edge.why}" if edge.why else "")


def _laws(members: list[Measures]) -> list[tuple[str, str, np.ndarray, np.ndarray]]:
    """What is fitted over the cases of a group, each by one producer alone."""

    def column(measure: Callable[[Measures], float]) -> np.ndarray:
        return np.array([measure(m) for m in members])

    stress, e = column(lambda m: m.case.stress), column(lambda m: m.void_ratio)
    laws = [
        ("V_P long waves, YADE", "stress", stress, column(lambda m: m.yade_long_wave.value)),
        ("V_P long waves, linear wave", "stress", stress, column(lambda m: m.long_wave.value)),
        ("V_P static", "stress", stress, column(lambda m: m.static)),
        ("V_P EMT, its contacts", "stress", stress, column(lambda m: m.effective[0])),
        ("f_max", "stress", stress, column(lambda m: m.f_max)),
    ]
    for producer, peaks, edges in (
        (
            "YADE",
            column(lambda m: m.yade_first_peak.value),
            column(lambda m: m.passband.of_yade[0].value),
        ),
        (
            "linear wave",
            column(lambda m: m.first_peak.value),
            column(lambda m: m.low_pass[0].value),
        ),
    ):
        first, low_pass = f"V_P first peaks, {producer}", f"f_low-pass 2 %, {producer}"
        laws += [
            (first, "stress", stress, peaks),
            (f"{first}, / (2.17 - e)", "stress", stress, peaks / (2.17 - e)),
            (low_pass, "stress", stress, edges),
            (low_pass, first, peaks, edges),
        ]
    return laws


def table_of_fits(cases: list[Measures]) -> Table:
    """Power laws over the stresses of each group, with standard errors and numbers of cases.

    V_P = a stress^b; for random packings also V_P = a (2.17 - e) stress^b, the form of Hardin and
    Richart (J. Soil Mech. Found. Div. 89(1), 33, 1963), which takes the change of e off.
    """
    rows = []
    for name, members in groups(cases).items():
        for what, over, x, y in _laws(members):
            law = power_law(x, y)
            if np.isfinite(law.exponent):
                count = int((np.isfinite(x) & np.isfinite(y)).sum())
                error = number(law.error, 2)
                rows.append([name, what, over, f"{law.exponent:.4f}", error, str(count)])
    for m in cases:
        if m.scattering is not None:
            law = m.scattering.power(m.band)
            if np.isfinite(law.exponent):
                text = [f"{law.exponent:.4f}", number(law.error, 2), "1"]
                rows.append([m.case.label, "ridge width", "frequency, 0.7-1.3 f_low-pass", *text])
    header = ["group", "quantity", "power of", "exponent", "standard error", "cases"]
    return Table("Power laws", header, rows)


def tables(cases: list[Measures]) -> dict[str, Table]:
    """All tables by file name; those without a row are left out."""
    if not cases:
        raise InputError("no case given; name at least one")
    found = {
        "table1": table_1(cases),
        "table2": table_2(cases),
        "paper": Table("Numbers stated by the paper", HEADER, deviations(cases)),
        "fits": table_of_fits(cases),
        "choices": table_of_choices(cases),
        "shear": table_of_shear(cases, number),
    }
    return {name: table for name, table in found.items() if table.rows}
