"""Check whether Matplotlib can draw a figure from a file: styles, texts, limits, lengths.

Figures that this program has just made need no check, but a CSV file may have been edited.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.colors import is_color_like
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.mathtext import MathTextParser

from analysis.figures.picture import Panel, Picture, Series, SeriesKind
from modal.tools.errors import InputError

OUTSIDE = "outside"
"""Place of a legend beside its panel, for entries that would cover points."""
LEGENDS = {
    "best",
    OUTSIDE,
    "center",
    "right",
    "center left",
    "center right",
    "upper left",
    "upper right",
    "upper center",
    "lower left",
    "lower right",
    "lower center",
}
"""Places of a legend: those of Matplotlib, and `OUTSIDE`."""
SCALES = ("linear", "log")
MAX_COORDINATE = 1e30
"""Largest coordinate: sums of larger ones overflow in Matplotlib."""
MIN_SIDE_IN_INCHES = 0.5
MAX_SIDE_IN_INCHES = 60.0
"""Largest side of a picture: a square of this side has 36 million pixels."""
MAX_PANELS = 100
MAX_COLUMNS = 20
"""Largest number of columns of panels, and of entries of a legend."""
MAX_SIZE_IN_POINTS = 100
"""Largest width of a line and size of a marker."""
StyleCheck = Callable[[Any], bool]
"""Function that tells whether the value of a word of a style is allowed."""


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < MAX_COORDINATE


def _is_size(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= MAX_SIZE_IN_POINTS


def _is_opacity(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= 1


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_colour(value: Any) -> bool:
    return isinstance(value, str) and is_color_like(value)


def _check_words(words: Collection[str]) -> StyleCheck:
    """Return a function that tests whether a value is one of these words."""

    def is_one_of_them(value: Any) -> bool:
        return isinstance(value, str) and value in words

    return is_one_of_them


MARKERS = {marker for marker in MarkerStyle.markers if isinstance(marker, str)}
STYLE_CHECKS: Final[Mapping[str, StyleCheck]] = {
    "color": _is_colour,
    "mec": _is_colour,
    "mfc": _is_colour,
    "lw": _is_size,
    "ms": _is_size,
    "mew": _is_size,
    "capsize": _is_size,
    "diameter": _is_size,
    "vmin": _is_number,
    "vmax": _is_number,
    "zorder": _is_number,
    "alpha": _is_opacity,
    "clim": _is_pair,
    "cmap": _check_words(set(matplotlib.colormaps)),
    "ls": _check_words({*Line2D.lineStyles, "none"}),
    "marker": _check_words(MARKERS),
}
"""Checks of the values of a style, by the words of the style."""
LINE_STYLES = ("color", "ls", "lw", "alpha", "zorder")
STYLES: Final[Mapping[SeriesKind, tuple[str, ...]]] = {
    "line": (*LINE_STYLES, "marker", "ms", "mec", "mew", "mfc"),
    "map": ("cmap", "vmin", "vmax", "alpha", "zorder"),
    "spheres": ("cmap", "clim", "diameter", "alpha", "zorder"),
    "band": ("color", "lw", "alpha", "zorder"),
    "error": ("color", "lw", "capsize", "alpha", "zorder"),
    "vline": LINE_STYLES,
    "hline": LINE_STYLES,
}
"""Words of the style of each kind of series."""


def drawable_text(text: str) -> str:
    r"""Return a text that Matplotlib can draw: escape dollars that do not enclose a formula.

    >>> drawable_text(r"$\chi_z$"), drawable_text(r"cost$ \of $grain")
    ('$\\chi_z$', 'cost\\$ \\of \\$grain')
    """
    try:
        MathTextParser("path").parse(text)
    except (ValueError, RecursionError):
        return text.replace("$", r"\$")
    return text


def refuse_undrawable(picture: Picture, path: object) -> None:
    """Raise InputError, which names the fault, for a picture that cannot be drawn."""
    for fault in _find_faults(picture):
        raise InputError("figure", f"{path}: {fault}", remedy="draw the figure again")


def _find_faults(picture: Picture) -> Iterator[str]:
    """Yield the faults of a picture. Later checks assume that earlier ones have passed."""
    count = len(picture.panels)
    if not 0 < count <= MAX_PANELS:
        yield f"{count} panels"
    if not 0 < picture.columns <= MAX_COLUMNS:
        yield f"columns {picture.columns}"
    for side in picture.shape or ():
        if not MIN_SIDE_IN_INCHES <= side <= MAX_SIDE_IN_INCHES:
            yield f"shape {picture.shape}"
    for panel_number, panel in enumerate(picture.panels):
        for fault in _find_faults_of_panel(panel):
            yield f"panel {panel_number}: {fault}"
        for series_number, series in enumerate(panel.series):
            for fault in _find_faults_of_series(series):
                yield f"panel {panel_number}, series {series_number}: {fault}"


def _find_faults_of_panel(panel: Panel) -> Iterator[str]:
    """Yield the faults of the limits, the scales and the legend of a panel."""
    axes = (("x", panel.xlim, panel.xscale), ("y", panel.ylim, panel.yscale))
    for name, limits, scale in axes:
        if limits is None:
            continue
        low, high = limits
        in_order = -MAX_COORDINATE < low < high < MAX_COORDINATE
        if not in_order or (scale == "log" and low <= 0):
            yield f"{name}lim {low:g} to {high:g}"
    for name, _, scale in axes:
        if scale not in SCALES:
            yield f"{name}scale {scale}"
    if panel.legend not in LEGENDS:
        yield f"legend {panel.legend}"
    if not 0 < panel.legend_columns <= MAX_COLUMNS:
        yield f"legend_columns {panel.legend_columns}"


def _find_faults_of_series(series: Series) -> Iterator[str]:
    """Yield the faults of the style, the lengths and the numbers of a series."""
    for word, value in series.style.items():
        if word not in STYLES[series.kind] or not STYLE_CHECKS[word](value):
            yield f"style {word} of a {series.kind} is {value!r}"
    if series.kind == "spheres" and "diameter" not in series.style:
        yield "spheres have no diameter"
    if series.kind in ("map", "spheres", "band", "error"):
        size = len(series.y)
        if series.kind == "map":
            size *= len(series.x)
        if series.z is None or size == 0 or np.size(series.z) != size:
            yield "z does not fit x and y"
    if series.kind != "map" and len(series.x) != len(series.y):
        yield "x does not fit y"
    for name, coordinates in (("x", series.x), ("y", series.y), ("z", series.z)):
        if coordinates is None:
            continue
        known = coordinates[~np.isnan(coordinates)]
        if (abs(known) > MAX_COORDINATE).any():
            yield f"{name} has numbers above {MAX_COORDINATE:g}"
    if series.kind == "error" and series.z is not None and (series.z < 0).any():
        yield "an error is negative"
