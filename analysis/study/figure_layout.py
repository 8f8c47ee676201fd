"""The figures of a study: which panels of which cases each shows, and how, as its YAML says.

Panels of single cases were drawn when the case was measured; they lie beside its result, as the CSV
from which a figure is drawn again.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
import pandas as pd

from analysis.figures import FIGURES
from analysis.figures.groups import EDGE, SHADES, STRESS_MARKS
from analysis.figures.picture import Panel, Picture, merged, read_picture, share_limits
from analysis.frame import mean_with_error, select
from analysis.study.captions import Captions
from analysis.study.description import following
from analysis.study.fields import inside
from analysis.table import cell
from modal.tools.errors import InputError

Spec = Mapping[str, Any]
MARKERS = tuple(STRESS_MARKS.values())
WIDTH = {1: 8, 2: 10, 3: 12}
"""Inches of a figure, by its columns of panels."""
MOST = 4
"""Processes that draw: of 250 MB each, where memory counts."""


def wanted(specs: Sequence[Spec], case: pd.DataFrame) -> list[str]:
    """Figures of which a case's panels are kept; `case` is its line of the study."""
    of_cases = [spec for spec in specs if {"cases", "figure"} <= spec.keys()]
    shown = [spec for spec in of_cases if len(select(case, spec["cases"]))]
    return list(dict.fromkeys(spec["figure"] for spec in shown))


def arrange(
    specs: Sequence[Spec], cases: pd.DataFrame, panels: Path, output: Path
) -> tuple[list[tuple[Path, str]], list[str]]:
    """Write the figures; PNG and caption in the order of the specs, a line for each not drawn.

    `panels` is the folder with those of each case, CASE.FIGURE.csv.
    """
    from analysis.figures.render import save  # Matplotlib, which to measure a case does not need

    pictures, captions, absent = {}, {}, []
    words = Captions(cases)
    for spec in specs:
        caption = words(spec["caption"])
        with following(spec):
            if "plot" not in spec and spec.get("figure") not in FIGURES:
                raise InputError(
                    "unknown_word", f"{spec['name']}: its figure is none of {', '.join(FIGURES)}"
                )
            try:
                if "plot" in spec:
                    picture = _plot(spec["plot"], cases[cases["there"]])
                elif "cases" in spec:
                    picture, away = _of_cases(spec, select(cases, spec["cases"]).index, panels)
                    caption += f" Absent: {', '.join(away)}." if away else ""
                else:
                    picture = FIGURES[spec["figure"]](cases[cases["there"]])
            except InputError as error:
                if error.code.startswith("expression"):
                    raise
                absent.append(f"{spec['name']}: {error}")
                continue
        stem = inside(output, spec["name"])
        pictures[stem], captions[stem] = picture, caption
    with ProcessPoolExecutor(min(MOST, os.cpu_count() or 1)) as processes:
        pngs = [png for png, *_ in processes.map(save, pictures.values(), pictures)]
    return list(zip(pngs, captions.values(), strict=True)), absent


def _plot(spec: Spec, cases: pd.DataFrame) -> Picture:
    """Quantities `y`, a panel each, over `x`; a line for each value of `by`, mean of the others."""
    panels = []
    for text in spec["y"]:
        panel = Panel(spec["x"], text)
        for k, (value, members) in enumerate(cases.groupby(spec["by"])):
            groups = members.groupby(spec["x"])
            x = [key for key, _ in groups]
            pairs = [mean_with_error(some, text) for _, some in groups]
            mean, error = np.reshape(pairs, (-1, 2)).T
            shade = SHADES[2 * k % len(SHADES)]
            style = EDGE | {"color": shade, "mfc": shade, "marker": MARKERS[k % len(MARKERS)]}
            panel.line(x, mean, f"{spec['by']} {cell(value)}", **style | {"ls": "-"})
            panel.add("error", x, mean, error, capsize=2, color=shade)
        panels.append(panel)
    if not any(series.y.size for panel in panels for series in panel.series):
        raise InputError("input", "no case has these quantities")
    return Picture(panels, len(panels), (4.5 * len(panels), 3.6))


def _of_cases(spec: Spec, names: Sequence[str], folder: Path) -> tuple[Picture, list[str]]:
    """The panels of several cases as one picture, and the cases that have none."""
    files = {name: folder / f"{name}.{spec['figure']}.csv" for name in names}
    away = [name for name, path in files.items() if not path.is_file()]
    panels = [p for path in files.values() if path.is_file() for p in read_picture(path).panels]
    if not panels:
        raise InputError("input", f"no panels of {', '.join(away)}", remedy="measure these cases")
    columns, like = spec.get("columns", 2), spec.get("like", "")
    if spec.get("together"):
        for panel in panels:  # those without a title are told apart by what they show
            panel.title = panel.title or panel.ylabel
        panels = merged(panels)
    if like == "columns":
        for first in range(columns):
            share_limits(panels[first::columns])
    elif like:
        share_limits(panels, like)
    if len(panels) > 1:
        for letter, panel in zip(ascii_lowercase, panels, strict=False):
            if not panel.title.startswith("("):
                panel.title = f"({letter}) {panel.title}"
    columns = min(columns, len(panels))
    if columns == 2 and len(panels) == 3:  # a case is absent; no part of the grid stays blank
        columns = 3
    height = 0.3 + spec.get("height", 3.6) * -(-len(panels) // columns)
    return Picture(panels, columns, (WIDTH[columns], height)), away
