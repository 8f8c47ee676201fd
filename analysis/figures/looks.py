"""Check whether a picture from a file can be drawn: looks, texts and limits of Matplotlib.

What a figure draws in this program is its own affair; a CSV may have gone through other hands.
"""

from collections.abc import Callable, Iterator
from typing import Any

import matplotlib
import numpy as np
from matplotlib.colors import is_color_like
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.mathtext import MathTextParser

from analysis.figures.picture import Panel, Picture, Series
from modal.tools.errors import InputError

OUTSIDE = "outside"
"""Place of a panel's legend beside the panel, where its entries would cover points."""
LEGENDS = {
    *("best", OUTSIDE, "center", "right", "center left", "center right"),
    *("upper left", "upper right", "upper center", "lower left", "lower right", "lower center"),
}
SCALES = ("linear", "log")
LARGEST = 1e30
"""Largest coordinate: sums of larger ones are no numbers to Matplotlib."""
WIDEST = 60.0
"""Largest side of a picture, inches: 36 million points."""
MOST_PANELS, MOST_COLUMNS = 100, 20


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _is_size(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= 100


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_colour(value: Any) -> bool:
    return isinstance(value, str) and is_color_like(value)


def _is_one_of(words: Any) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, str) and value in words


LOOKS: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("color", "mec", "mfc"), _is_colour),
    **dict.fromkeys(("lw", "ms", "mew", "capsize", "diameter"), _is_size),
    **dict.fromkeys(("vmin", "vmax", "zorder"), _is_number),
    "alpha": lambda value: _is_number(value) and 0 <= value <= 1,
    "clim": _is_pair,
    "cmap": _is_one_of(set(matplotlib.colormaps)),
    "ls": _is_one_of({*Line2D.lineStyles, "none"}),
    "marker": _is_one_of({mark for mark in MarkerStyle.markers if isinstance(mark, str)}),
}
"""Tests, by the words of a style, of whether a value is allowed."""
OF_LINES = ("color", "ls", "lw", "alpha", "zorder")
STYLES = {
    "line": (*OF_LINES, "marker", "ms", "mec", "mew", "mfc"),
    "map": ("cmap", "vmin", "vmax", "alpha", "zorder"),
    "spheres": ("cmap", "clim", "diameter", "alpha", "zorder"),
    "band": ("color", "lw", "alpha", "zorder"),
    "error": ("color", "lw", "capsize", "alpha", "zorder"),
    "vline": OF_LINES,
    "hline": OF_LINES,
}
"""Words of the style of each kind of series."""


def drawable_text(text: str) -> str:
    r"""Return a text as Matplotlib can set it: its dollars plain, where they enclose no formula.

    >>> drawable_text(r"$\chi_z$"), drawable_text(r"cost$ \of $grain")
    ('$\\chi_z$', 'cost\\$ \\of \\$grain')
    """
    try:
        MathTextParser("path").parse(text)
    except (ValueError, RecursionError):
        return text.replace("$", r"\$")
    return text


def refuse_undrawable(picture: Picture, path: object) -> None:
    """Raise InputError, which names what is wrong, for a picture that cannot be drawn."""
    for wrong, fault in _faults(picture):
        if wrong:
            raise InputError("figure", f"{path}: {fault}", remedy="draw the figure again")


Faults = Iterator[tuple[bool, str]]


def _faults(picture: Picture) -> Faults:
    """Yield, one after the other, whether something is wrong, and what."""
    count = len(picture.panels)
    yield not 0 < count <= MOST_PANELS, f"{count} panels"
    yield not 0 < picture.columns <= MOST_COLUMNS, f"columns {picture.columns}"
    shape = picture.shape or (1.0, 1.0)
    yield not all(0.5 <= side <= WIDEST for side in shape), f"shape {shape}"
    for number, panel in enumerate(picture.panels):
        for wrong, fault in _of_panel(panel):
            yield wrong, f"panel {number}: {fault}"
        for place, series in enumerate(panel.series):
            for wrong, fault in _of_series(series):
                yield wrong, f"panel {number}, series {place}: {fault}"


def _of_panel(panel: Panel) -> Faults:
    """Yield the faults of the limits, the scales and the legend of a panel."""
    for name in ("xlim", "ylim"):
        low, high = getattr(panel, name) or (1.0, 2.0)
        good = -LARGEST < low < high < LARGEST
        on_log = getattr(panel, f"{name[0]}scale") == "log"
        yield not good or (on_log and low <= 0), f"{name} {low:g} to {high:g}"
    for name in ("xscale", "yscale"):
        yield getattr(panel, name) not in SCALES, f"{name} {getattr(panel, name)}"
    yield panel.legend not in LEGENDS, f"legend {panel.legend}"
    yield not 0 < panel.legend_columns <= MOST_COLUMNS, f"legend_columns {panel.legend_columns}"


def _of_series(series: Series) -> Faults:
    """Yield the faults of the style, the lengths and the sizes of a series."""
    for word, value in series.style.items():
        known = word in STYLES[series.kind] and LOOKS[word](value)
        yield not known, f"style {word} of a {series.kind} is {value!r}"
    yield series.kind == "spheres" and "diameter" not in series.style, "spheres have no diameter"
    size = np.size(series.y) if series.z is None else np.size(series.z)
    wanted = len(series.y) * (len(series.x) if series.kind == "map" else 1)
    has_third = series.kind in ("map", "spheres", "band", "error")
    yield has_third and (series.z is None or size != wanted or size == 0), "z does not fit x and y"
    yield series.kind != "map" and len(series.x) != len(series.y), "x does not fit y"
    for name in ("x", "y", "z"):
        data = getattr(series, name)
        wrong = data is not None and (abs(data[~np.isnan(data)]) > LARGEST).any()
        yield bool(wrong), f"{name} has numbers above {LARGEST:g}"
    negative = series.kind == "error" and series.z is not None and (series.z < 0).any()
    yield bool(negative), "an error is negative"
