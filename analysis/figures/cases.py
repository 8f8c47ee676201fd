"""Draw figures that compare all cases: 6, 8, 16 to 19 of the paper, and two further ones."""

import numpy as np
import pandas as pd

from analysis.case_columns import of_one_producer
from analysis.case_result import CaseResult
from analysis.estimators.fits import power_law, straight_line
from analysis.figures import groups
from analysis.figures.groups import LOG, THIN, legend, mark, points, random_of, scatter, styles
from analysis.figures.picture import BLUE, ORANGE, Panel, Picture
from analysis.frame import numbers

COMMON_STRESS = 1e5
"""Stress, Pa, of the curves that are drawn if cases of several stresses have curves."""
GAIN = "gain: received over sent stress (-)"
FIRST_RESONANCES = 10
"""Range of the gain factor that is drawn for one case, in orders of resonances."""


def velocity_cases(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 6: V_P by first peaks against void ratio (with trend to FCC) and stress."""
    producer, name = of_one_producer(cases["record"], "v_p_first_peaks_{record}_m_per_s")
    label = f"$V_P$, first peaks, {producer} (m/s)"
    left = Panel(groups.VOID_RATIO, label, "(a)", yscale="log", legend="outside")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    legend(left, cases, frictions=False)
    for _, members in cases.groupby("stress"):
        _draw_trend(left, members, name)
    scatter(left, cases, name)
    groups.explain_groups(right, cases)
    for group, members, style in styles(cases):
        stress = members["stress"]
        law = power_law(stress, numbers(members, name))
        right.line(stress / 1e3, law.factor * stress**law.exponent, color="0.5", **THIN)
        points(right, members, style, name)
        if np.isfinite(law.exponent):
            group += f": {law}"
        right.line([np.nan], [np.nan], group, marker="o", **style)
    lowest = numbers(cases, name).min()
    if np.isfinite(lowest):
        stress = np.array([1e4, 1e7])
        sixth = 0.93 * lowest * (stress / stress[0]) ** (1 / 6)
        right.line(stress / 1e3, sixth, "b = 1/6", color="k", ls="--")
    return Picture([left, right], columns=2, shape=(13, 4.4))


def _draw_trend(panel: Panel, cases: pd.DataFrame, name: str) -> None:
    """Draw the line through a quantity of random packings against e, up to e of the crystal."""
    random = random_of(cases)
    crystal = cases[cases["kind"] == "fcc"]
    if crystal.empty or len(random) < 2:
        return
    e = numbers(random, "void_ratio")
    e_of_crystal = numbers(crystal, "void_ratio").iloc[0]
    value_of_crystal = numbers(crystal, name).iloc[0]
    line = straight_line(e, numbers(random, name))
    value, error = line.at(e_of_crystal)
    along = np.linspace(e_of_crystal, e.max(), 30)  # the line is curved on a logarithmic axis
    text = rf"line at FCC's e: {value:.0f} $\pm$ {error:.0f}; FCC {value_of_crystal:.0f} m/s"
    panel.line(along, line.slope * along + line.offset, text, color="0.4", **THIN | {"ls": "--"})
    panel.add("error", [e_of_crystal], [value], [error], color="0.4", lw=0.8, capsize=3)


def highest_frequency(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 8: highest natural frequency divided by that of FCC at the same stress."""
    crystal = cases[cases["kind"] == "fcc"]
    panel = Panel("stress (kPa)", "$f_{max}$ over that of FCC (-)", xscale="log", legend="outside")
    over = ""
    if crystal.empty:
        panel.ylabel = "$f_{max}$ (kHz)"
        panel.yscale = "log"
    else:
        frequency_by_stress = numbers(crystal.set_index("stress"), "f_max_khz")
        over = "of_crystal"
        cases = cases.assign(of_crystal=cases["stress"].map(frequency_by_stress))
    scatter(panel, cases, "f_max_khz", over=over, stated="f_max_khz", side_by_side=True)
    legend(panel, cases, stresses=False)
    return Picture([panel], shape=(8.6, 4))


def low_pass_cases(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 16: f_low-pass, 2 % of the whole map, against void ratio and stress."""
    producer, name = of_one_producer(cases["record"], "f_low_pass_2_{record}_khz")
    label = f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    left = Panel(groups.VOID_RATIO, label, "(a)", yscale="log", legend="lower left")
    right = Panel("stress (kPa)", label, "(b)", legend="outside", **LOG)
    stated = "f_low_pass_2_khz"
    scatter(left, cases, name, stated=stated)
    legend(left, cases, frictions=False)
    scatter(right, cases, name, stated=stated, side_by_side=True)
    legend(right, cases, stresses=False)
    return Picture([left, right], columns=2, shape=(12, 4.2))


def velocity_low_pass(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 17: f_low-pass, 2 %, against V_P by first peaks, with the slope of each group."""
    producer, velocity, frequency = of_one_producer(
        cases["record"], "v_p_first_peaks_{record}_m_per_s", "f_low_pass_2_{record}_khz"
    )
    xlabel = f"$V_P$, first peaks, {producer} (m/s)"
    ylabel = f"$f_{{low-pass}}$, 2 %, {producer} (kHz)"
    panel = Panel(xlabel, ylabel, legend="outside", **LOG)
    _draw_stated_slopes(panel, random_of(cases), velocity, frequency)
    groups.explain_groups(panel, cases)
    for group, members, style in styles(cases):
        law = power_law(numbers(members, velocity), numbers(members, frequency))
        if np.isfinite(law.exponent):
            group += f": slope {law.exponent:.2f}"
        if np.isfinite(law.error):
            group += rf" $\pm$ {law.error:.1g}"
        points(panel, members, style, frequency, x=velocity)
        panel.line([np.nan], [np.nan], group, marker="o", **style)
    legend(panel, cases, frictions=False)
    return Picture([panel], shape=(8.6, 4.8))


def _draw_stated_slopes(panel: Panel, random: pd.DataFrame, velocity: str, frequency: str) -> None:
    """Draw lines of the stated powers through the middle of the points, over their range."""
    log_velocity = np.log(numbers(random, velocity))
    log_frequency = np.log(numbers(random, frequency))
    known = np.isfinite(log_velocity) & np.isfinite(log_frequency)
    if not known.any():
        return
    slopes = groups.stated_ends(random, "low_pass_power_of_v_p")
    for slope, ls in zip(slopes, ("--", ":"), strict=False):
        ends = np.array([log_velocity[known].min(), log_velocity[known].max()])
        line = log_frequency[known].mean() + slope * (ends - log_velocity[known].mean())
        panel.line(np.exp(ends), np.exp(line), f"stated: {slope}", color="k", ls=ls, lw=0.9)


def wavelength_cases(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 18: lambda_low-pass / D of random packings against void ratio, 2 % and 1 %."""
    random = random_of(cases)
    width = numbers(random, "width_over_d").median()
    void_ratios = [*numbers(random, "void_ratio"), 0.6]
    span = (np.nanmin(void_ratios) - 0.01, np.nanmax(void_ratios) + 0.01)
    panels = []
    for percent, letter in (("2", "(a)"), ("1", "(b)")):
        producer, name = of_one_producer(cases["record"], f"lambda_{percent}_{{record}}_over_d")
        panel = Panel(
            groups.VOID_RATIO, rf"$\lambda_{{low-pass}}/D$, {percent} %, {producer} (-)", letter
        )
        panel.yscale = "log"
        panel.xlim = span
        panel.legend = "outside"
        ends = groups.stated_ends(cases, f"lambda_{percent}_over_d")
        if ends:
            low, high = ends
            panel.band(span, low, high, f"stated: {low:g} to {high:g}", color="0.88", zorder=0)
        panel.hline(2**0.5, r"FCC, $\sqrt{2}$", color="0.5", ls=":")
        if np.isfinite(width):
            panel.hline(width, f"width, {width:.3g} D", color="k", lw=0.8)
        scatter(panel, random, name)
        panels.append(panel)
    legend(panels[0], cases, frictions=False)
    legend(panels[1], random, stresses=False)
    return Picture(panels, columns=2, shape=(13, 4.2))


def gain_cases(cases: pd.DataFrame) -> Picture:
    """Draw Fig. 19: gain factor of FCC and of the lowest friction at all stresses."""
    groups_with_gain = styles(groups.with_curve(cases, "gain", "gain factor"))
    two_groups = [members for _, members, _ in groups_with_gain[:2]]
    upper = []
    lower = []
    letters = (("(a)", "(c)"), ("(b)", "(d)"))
    for (upper_letter, lower_letter), members in zip(letters, two_groups, strict=False):
        upper.append(_draw_gains(members["row"].to_list(), upper_letter))
        row = members["row"].iloc[min(1, len(members) - 1)]
        lower.append(_draw_gain(row, lower_letter))
    panels = upper + lower
    rows = -(-len(panels) // 2)
    return Picture(panels, columns=2, shape=(10, 0.3 + 3.1 * rows))


def _draw_gains(rows: list[CaseResult], letter: str) -> Panel:
    """Draw gain factors of a group against frequency / first resonance, each stress a decade lower.

    The curves of all stresses nearly coincide. Those of random packings end where only noise is
    received.
    """
    title = f"{letter} {rows[0].group}"
    if len(rows) > 1:
        title += ", each stress a decade lower"
    panel = Panel("frequency over $f_1$ (-)", GAIN, title, yscale="log", ylim=(1e-6, 10))
    for k, row in enumerate(rows):
        frequency, gain = row.curves["gain"]
        edge = np.inf
        if not row.crystal:
            edge = 2 * 1e3 * row.value("f_low_pass_2_linear_khz")
        above = frequency > edge
        frequency = frequency[~above]
        gain = gain[~above]
        width = row.value("gain_resolution_hz")
        text = f"{row.stress / 1e3:g} kPa, resolution {width:.0f} Hz"
        colour = ("k", "0.5")[k % 2]
        first = row.curves["first"][0]
        panel.line(frequency / first, gain / 10**k, text, color=colour, ls="-", lw=0.9)
        panel.hline(10.0**-k, color="0.6", lw=0.6)
    return panel


def _draw_gain(row: CaseResult, letter: str) -> Panel:
    """Draw the gain factor (receiver stress / source stress) without damping, and the resonances.

    Between rigid walls the stress ratio of a rod is 1 / |cos kappa L|: its maxima lie midway
    between the resonances sin kappa L = 0, not on them.
    """
    frequency, gain = row.curves["gain"]
    resonances = row.curves["resonances"][0]
    top = FIRST_RESONANCES * row.curves["first"][0][0]
    shown = frequency < top
    title = f"{letter} {row.label}"
    panel = Panel("frequency (kHz)", GAIN, title, legend="upper right")
    panel.xlim = (0, top / 1e3)
    panel.ylim = (0, 1.4 * float(gain[shown].max()))
    panel.line(frequency[shown] / 1e3, gain[shown], "gain", color="k")
    resonances = resonances[resonances < top] / 1e3
    if len(resonances):
        panel.vlines(resonances, "resonances $f_r$, both walls held", color=BLUE, ls=":", lw=1)
        middle = 0.5 * (np.append(0, resonances[:-1]) + resonances)
        panel.vlines(middle, "half way, source free of stress", color=ORANGE, ls="--", lw=0.8)
    return panel


def isostaticity(cases: pd.DataFrame) -> Picture:
    """Draw three frequencies divided by the highest against z - 4 (not in the paper)."""
    random = random_of(cases)
    contacts = numbers(random, groups.AXES[groups.BEYOND])
    highest = numbers(random, "f_max_khz")
    along = np.array([0.0, np.nanmax([0.0, *contacts])])
    panels: list[Panel] = []
    for name, title in (
        ("f_low_pass_2_linear_khz", "low-pass frequency, 2 %"),
        ("excess_peak_khz", "peak of $D(f) / f^2$"),
        ("ioffe_regel_khz", "Ioffe-Regel limit"),
    ):
        ratio = numbers(random, name) / highest
        panel = Panel(groups.BEYOND, "frequency over the highest (-)", title, legend="upper left")
        if (np.isfinite(ratio) & np.isfinite(contacts)).sum() > 2:
            line = straight_line(contacts, ratio)
            zero = groups.ISOSTATIC - line.offset / line.slope
            text = f"{line.slope:.3f} (z - {zero:.2f})"
            panel.line(along, line.slope * along + line.offset, text, color="k", lw=0.8)
        scatter(panel, random, name, over="f_max_khz")
        panels.append(panel)
    panels[2].legend = "outside"
    legend(panels[2], random)
    return Picture(panels, columns=3, shape=(13, 3.8))


def scattering(cases: pd.DataFrame) -> Picture:
    """Draw width of the ridge, mean free path and Ioffe-Regel limit (not in the paper).

    Frequencies are in units of V_P / D. All curves have the same stress, and end at the limit:
    beyond it the ridge is no longer a wave.
    """
    members = groups.with_curve(cases, "ridge", "structure factor")
    # Most cases have this stress; of several such stresses it is the nearest to the common one.
    stress = min(members["stress"].mode(), key=_decades_from_common_stress)
    axis = "frequency, $f D / V_P$ (-)"
    title = f"{stress / 1e3:g} kPa"
    width = Panel(axis, "full width of the ridge over $f$ (-)", f"(a) {title}", **LOG)
    path = Panel(axis, "mean free path / D (-)", f"(b) {title}", legend="outside", **LOG)
    limit = Panel(groups.VOID_RATIO, "Ioffe-Regel frequency (kHz)", "(c)", yscale="log")
    ratio = Panel(
        groups.ON_CONTACTS, "Ioffe-Regel over $f_{low-pass}$, 2 % (-)", "(d)", legend="outside"
    )
    width.hline(1 / np.pi, r"$l = \lambda / 2$ (Ioffe-Regel)", color="k")
    for _, group, style in styles(members):
        style |= {"marker": mark(stress), "ms": 3, "lw": 0.8, "ls": "-"}
        for row in group["row"][group["stress"] == stress]:
            frequency, relative_width, free_path = row.curves["ridge"]
            width.line(frequency, relative_width, **style)
            path.line(frequency, free_path, **style)
    scatter(limit, members, "ioffe_regel_khz")
    scatter(ratio, members, "ioffe_regel_khz", over="f_low_pass_2_linear_khz")
    legend(path, members, stresses=False)
    legend(ratio, members, frictions=False)
    return Picture([width, path, limit, ratio], columns=2, shape=(12, 7))


def _decades_from_common_stress(stress: float) -> float:
    """Return the distance of a stress, Pa, from `COMMON_STRESS` on a logarithmic axis."""
    return abs(np.log(stress / COMMON_STRESS))
