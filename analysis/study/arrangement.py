"""The figures of the study in the paper's arrangement: which cases each shows, and how."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import ascii_lowercase

from analysis.figures import beyond, cases
from analysis.figures.picture import Panel, Picture, merged, share_limits
from analysis.figures.render import save
from analysis.page import figure_html
from analysis.rows import Row
from modal.tools.errors import InputError


@dataclass(frozen=True)
class Shown:
    """A figure of the study that is put together from the panels of single cases.

    `name` there, the `figure` that draws the panels, the cases that the paper shows in it, columns,
    height of a row of panels in inches, the axes that all panels share (`columns`: both, those of a
    column), and whether panels of one title are laid over each other.
    """

    name: str
    figure: str
    caption: str
    cases: tuple[int, ...]
    columns: int = 2
    height: float = 3.6
    like: str = ""
    together: bool = False


NINE = 2, 3, 4, 6, 7, 8, 30, 31, 32
AT_100_KPA = 2, 6, 22, 30
OF_CASES = (
    Shown("fig01_samples", "samples", "Figure 1: samples", (2, 22), 1, 1.3, "x"),
    Shown("fig03_signals", "signals", "Figure 3: motion", (2, 6, 30), 3, 2.3, "columns"),
    Shown("fig04_stress", "signals_stress", "Figure 4: motion at 50 D", NINE, 1, 2.4, "xy", True),
    Shown("fig05_space_time", "space_time", "Figure 5: motion over distance and time", (2, 6)),
    Shown("fig07_modes", "natural_frequencies", "Figure 7: modes", (2, 6, 30), 2, 4.0, "", True),
    Shown("fig09_chi_z", "chi_z", "Figure 9: chi_z of the modes", (2, 6, 30), 2, 3.4, "y"),
    Shown("fig10_shapes", "mode_shapes", "Figure 10: shapes of P resonances", (2, 6), 3, 1.6),
    Shown("fig11_velocities", "velocity_frequency", "Figure 11: velocities over frequency", (2, 6)),
    Shown("fig12_spectra", "spectrum_distance", "Figure 12: spectra, 100 kPa", AT_100_KPA),
    Shown("fig13_spectra", "spectrum_distance", "Figure 13: spectra, 1 and 10 MPa", (7, 8)),
    Shown("fig14_dispersion", "dispersion", "Figure 14: dispersion, 100 kPa", AT_100_KPA),
    Shown("fig15_dispersion", "dispersion", "Figure 15: dispersion, 1 and 10 MPa", (7, 8)),
    Shown("beyond_ridges", "structure", "Beyond the paper: ridge of the modes", (6, 30)),
    Shown("beyond_distance", "low_pass_chains", "Beyond: f_low-pass over distance", (2, 6, 30), 3),
)  # fmt: skip
OF_ROWS: tuple[tuple[str, Callable[[list[Row]], Picture], str], ...] = (
    ("fig06_velocity", cases.velocity_cases, "Figure 6: V_P over void ratio and stress"),
    ("fig08_highest", cases.highest_frequency, "Figure 8: highest natural frequency"),
    ("fig16_low_pass", cases.low_pass_cases, "Figure 16: low-pass frequency"),
    ("fig17_velocity_low_pass", cases.velocity_low_pass, "Figure 17: low-pass frequency over V_P"),
    ("fig18_wavelength", cases.wavelength_cases, "Figure 18: low-pass wavelength"),
    ("fig19_gain", cases.gain_cases, "Figure 19: gain factor"),
    ("beyond_gain", beyond.gain_orders, "Beyond the paper: the gain's maxima, (r - 1/2) f_1"),
    ("beyond_scattering", beyond.scattering, "Beyond the paper: scattering, without a threshold"),
    ("beyond_density", beyond.density_excess, "Beyond the paper: D(f) / f^2 over Z"),
    ("beyond_rules", beyond.low_pass_rules, "Beyond the paper: f_low-pass by each rule"),
)
PULSES = 1, 3
"""Cases of the two pulses of Fig. 2, 100 and 200 kHz."""


def wanted(number: int | None) -> list[str]:
    """Figures of which a case's panels are kept."""
    names = [shown.figure for shown in OF_CASES if number in shown.cases]
    return list(dict.fromkeys(names + (["source"] if number in PULSES else [])))


def arrange(
    panels: Mapping[int, Mapping[str, list[Panel]]], rows: list[Row], output: Path
) -> tuple[list[str], list[str]]:
    """Write the figures; their HTML in the paper's order, and a line for each that is not drawn.

    `panels` are those of each case by figure.
    """
    drawn: dict[str, str] = {}
    absent = []

    def keep(name: str, picture: Picture, caption: str) -> None:
        drawn[name] = figure_html(save(picture, output / name)[0], caption)

    for shown in OF_CASES:
        there = [n for n in shown.cases if shown.figure in panels.get(n, {})]
        away = ", ".join(str(n) for n in shown.cases if n not in there)
        if not there:
            absent.append(f"{shown.caption}: no such product of case {away}")
            continue
        caption = shown.caption + (f" (not of case {away}: absent)" if away else "")
        keep(shown.name, _together(shown, [panels[n][shown.figure] for n in there]), caption)
    sources = [p for n in PULSES for p in panels.get(n, {}).get("source", [])]
    if sources:
        for panel in sources:
            panel.title = panel.ylabel
        picture = Picture(merged(sources), 2)
        for letter, panel in zip(ascii_lowercase, picture.panels, strict=False):
            panel.title = f"({letter})"
        keep("fig02_source", picture, "Figure 2: motion of the source wall, and its spectrum")
    for name, draw, caption in OF_ROWS:
        try:
            keep(name, draw(rows), caption)
        except InputError as error:
            absent.append(f"{caption}: {error}")
    order = sorted(drawn, key=lambda name: (not name.startswith("fig"), name))
    return [drawn[name] for name in order], absent


def _together(shown: Shown, found: list[list[Panel]]) -> Picture:
    panels = [panel for part in found for panel in part]
    if shown.together:
        panels = merged(panels)
    if shown.like == "columns":
        for first in range(shown.columns):
            share_limits(panels[first :: shown.columns])
    elif shown.like:
        share_limits(panels, shown.like)
    if len(panels) > 1:
        for letter, panel in zip(ascii_lowercase, panels, strict=False):
            if not panel.title.startswith("("):
                panel.title = f"({letter}) {panel.title}"
    columns = min(shown.columns, len(panels))
    if columns == 2 and len(panels) == 3:  # a case is absent; no part of the grid stays blank
        columns = 3
    width = {1: 8, 2: 10, 3: 12}[columns]
    return Picture(panels, columns, (width, 0.3 + shown.height * -(-len(panels) // columns)))
