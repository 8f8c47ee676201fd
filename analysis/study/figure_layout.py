"""Arrange the figures of a study from panels of its cases, as the study describes.

Panels of single cases were drawn when the case was measured. They are next to its result as CSV
files, from which a figure is drawn again.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from string import ascii_lowercase
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from analysis.figures import FIGURES
from analysis.figures.groups import EDGE, SHADES, STRESS_MARKS
from analysis.figures.picture import (
    Panel,
    Picture,
    describe_picture,
    merged,
    read_picture,
    share_limits,
)
from analysis.frame import mean_with_error, select
from analysis.study.captions import Captions
from analysis.study.description import following
from analysis.study.fields import file_below_here, file_inside
from analysis.table import cell
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
"""Description of a figure, as the file of figures has it."""
MARKERS = tuple(STRESS_MARKS.values())
WIDTH_IN_INCHES = {1: 8, 2: 10, 3: 12}
"""Width of a figure, by its number of columns of panels."""
MAX_PROCESSES = 4
"""Largest number of processes that draw at once. Each takes 250 MB, so that memory is the limit,
not the number of cores."""


class DrawnFigure(NamedTuple):
    """The PNG of a figure, its name and caption, and a text for who cannot see it."""

    png: Path
    name: str
    caption: str
    alt: str


def figures_of_case(specs: Sequence[Spec], case: pd.DataFrame) -> list[str]:
    """Return the names of the figures that show panels of a case, given as a frame of one line."""
    names = []
    for spec in specs:
        if "cases" in spec and "figure" in spec and len(select(case, spec["cases"])):
            names.append(spec["figure"])
    return list(dict.fromkeys(names))


def draw_figures(
    specs: Sequence[Spec], cases: pd.DataFrame, panels: Path, output: Path
) -> tuple[list[DrawnFigure], list[str]]:
    """Write the figures of a study to the folder `output`.

    Returns the figures in the order of the specs, and a line for each that is not drawn or lacks
    the panels of cases. `panels` is the folder with the panels of each case, CASE.FIGURE.csv.
    Raises InputError if a spec is wrong, but not if cases lack data.
    """
    from analysis.figures.render import save  # Matplotlib, which measuring a case does not need

    captions = Captions(cases)
    pictures: dict[Path, Picture] = {}
    figures = []
    absent = []
    for spec in specs:
        caption = captions(spec["caption"])
        if "picture" in spec:
            with following(spec):
                path = file_below_here(spec["picture"])
            if path.suffix == ".png" and path.is_file():
                figures.append(DrawnFigure(path, spec["name"], caption, spec.get("alt", caption)))
            else:
                absent.append(f"{spec['name']}: no picture {path}")
            continue
        with following(spec):
            _refuse_unknown_figure(spec)
            try:
                picture, cases_without = _compose(spec, cases, panels)
            except InputError as error:
                if error.code.startswith("expression"):
                    raise
                absent.append(f"{spec['name']}: {error}")
                continue
        if cases_without:
            absent.append(f"{spec['name']}: without {', '.join(cases_without)}")
        stem = file_inside(output, spec["name"])
        pictures[stem] = picture
        alt = spec.get("alt", describe_picture(picture))
        png = stem.with_name(f"{stem.name}.png")
        figures.append(DrawnFigure(png, spec["name"], caption, alt))
    with ProcessPoolExecutor(min(MAX_PROCESSES, os.cpu_count() or 1)) as processes:
        for _ in processes.map(save, pictures.values(), pictures):
            pass  # raises what failed in a process
    return figures, absent


def _refuse_unknown_figure(spec: Spec) -> None:
    """Raise InputError unless a spec plots quantities or names one of the figures."""
    if "plot" not in spec and spec.get("figure") not in FIGURES:
        raise InputError(
            "unknown_word", f"{spec['name']}: its figure is none of {', '.join(FIGURES)}"
        )


def _compose(spec: Spec, cases: pd.DataFrame, panels: Path) -> tuple[Picture, list[str]]:
    """Return the picture of a figure, and the names of selected cases that it does not show."""
    if "plot" in spec:
        return plot_quantities(spec["plot"], cases[cases["there"]]), []
    if "cases" in spec:
        return _combine_cases(spec, select(cases, spec["cases"]).index, panels)
    return FIGURES[spec["figure"]](cases[cases["there"]]), []


def plot_quantities(spec: Spec, cases: pd.DataFrame) -> Picture:
    """Plot each quantity of `y` against `x` in a panel, with a line for each value of `by`.

    A point is the mean of the cases with the same x and the same value of `by`.
    """
    panels = []
    for quantity in spec["y"]:
        panel = Panel(spec["x"], quantity)
        for k, (value, members) in enumerate(cases.groupby(spec["by"])):
            groups = members.groupby(spec["x"])
            x = [key for key, _ in groups]
            means_and_errors = [mean_with_error(group, quantity) for _, group in groups]
            mean, error = np.reshape(means_and_errors, (-1, 2)).T
            shade = SHADES[2 * k % len(SHADES)]
            style = EDGE | {
                "color": shade,
                "mfc": shade,
                "marker": MARKERS[k % len(MARKERS)],
                "ls": "-",
            }
            panel.line(x, mean, f"{spec['by']} {cell(value)}", **style)
            panel.add("error", x, mean, error, capsize=2, color=shade)
        panels.append(panel)
    if not any(series.y.size for panel in panels for series in panel.series):
        raise InputError("nothing_to_draw", "no case has these quantities")
    return Picture(panels, len(panels), (4.5 * len(panels), 3.6))


def _combine_cases(spec: Spec, names: Sequence[str], folder: Path) -> tuple[Picture, list[str]]:
    """Return the panels of several cases as one picture, and the cases that have no panels."""
    panels: list[Panel] = []
    absent = []
    for name in names:
        path = folder / f"{name}.{spec['figure']}.csv"
        if path.is_file():
            panels += read_picture(path).panels
        else:
            absent.append(name)
    if not panels:
        raise InputError(
            "nothing_to_draw", f"no panels of {', '.join(absent)}", remedy="measure these cases"
        )
    if spec.get("together"):
        for panel in panels:  # panels without a title are distinguished by what they show
            panel.title = panel.title or panel.ylabel
        panels = merged(panels)
    columns = spec.get("columns", 2)
    shared_axes = spec.get("like", "")
    if shared_axes == "columns":
        for first in range(columns):
            share_limits(panels[first::columns])
    elif shared_axes:
        share_limits(panels, shared_axes)
    _add_letters(panels)
    columns = min(columns, len(panels))
    if columns == 2 and len(panels) == 3:  # a case is absent; no part of the grid stays blank
        columns = 3
    rows = -(-len(panels) // columns)
    height = 0.3 + spec.get("height", 3.6) * rows
    return Picture(panels, columns, (WIDTH_IN_INCHES[columns], height)), absent


def _add_letters(panels: Sequence[Panel]) -> None:
    """Put (a), (b), ... before the titles of several panels that have no letter yet."""
    if len(panels) < 2:
        return
    for letter, panel in zip(ascii_lowercase, panels, strict=False):
        if not panel.title.startswith("("):
            panel.title = f"({letter}) {panel.title}"
