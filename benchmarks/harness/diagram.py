"""Work-precision diagrams: cost over error, one curve for each method."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from analysis.figures.render import STYLE

Row = Mapping[str, Any]
COSTS = {"seconds": "processor time (s)", "peak_mb": "peak memory (MB)", "mb": "memory (MB)"}
COLORS = ("#000000", "#0060a8", "#c05000", "#737373")
MARKERS = "os^Dxv+P*1<>"
LINES = ("-", "--", "-.", ":", "--", "-", ":", "-", ":", "-.", "-", "--")


def panels(rows: int, columns: int, *, width: float = 3.3, height: float = 2.5) -> tuple:
    """Return a figure in the style of the project, and its axes (rows, columns)."""
    with matplotlib.rc_context(fname=STYLE):
        figure = Figure(figsize=(width * columns, height * rows + 0.5), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False)
    for ax in axes.ravel():
        ax.grid(alpha=0.3)
        ax.tick_params(labelsize=8)
    return figure, axes


def curve_style(k: int) -> dict[str, Any]:
    """Return marker, line and colour of curve k; the first two differ also in grey."""
    n = k % len(MARKERS)
    style = {"color": COLORS[n % len(COLORS)], "marker": MARKERS[n], "ls": LINES[n]}
    return {**style, "ms": 5, "lw": 1.1, "mfc": "none"}


def draw_curve(ax: Axes, rows: Sequence[Row], x: str, y: str, **style: Any) -> None:
    """Draw the points of one method in the order of the rows, without those that have no number.

    An error of exactly zero has no place on a logarithmic axis: a method that has no other is
    drawn as a level across the panel.
    """
    known = [(row[x], row[y]) for row in rows if row.get(x) is not None and row.get(y)]
    points = [(error, cost) for error, cost in known if error > 0]
    if points:
        ax.plot(*zip(*points, strict=True), **style)
    elif known:
        ax.axhline(min(cost for _, cost in known), **style)


def bars(names: Sequence[str], series: Mapping[str, Sequence[Row]], column: str) -> tuple:
    """Return a figure, and its axes, with bars of a column of each series, the first on top."""
    figure, axes = panels(1, 1, width=6.5, height=0.3 * len(names) + 0.5)
    ax = axes[0, 0]
    greys = ("0.4", "0.75", "1", "0.1")
    thickness = 0.8 if len(series) < 3 else 0.8 / len(series)
    for k, (label, rows) in enumerate(series.items()):
        places = np.arange(len(names)) + (k * thickness if len(series) > 2 else 0)
        long = [row.get(column) or 0 for row in rows]
        ax.barh(places, long, thickness, color=greys[k], edgecolor="k", lw=0.6, label=label)
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    return figure, ax


def work_precision(
    rows: Sequence[Row],
    errors: Mapping[str, str],
    costs: Sequence[str] = ("seconds", "peak_mb"),
) -> Figure:
    """Draw a panel for each cost (rows) and each error (columns: its column and axis label)."""
    figure, axes = panels(len(costs), len(errors), width=max(3.0, 6.4 / len(errors)))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    for across, (error, error_label) in enumerate(errors.items()):
        for down, cost in enumerate(costs):
            ax = axes[down, across]
            for k, method in enumerate(methods):
                method_rows = [row for row in rows if row["method"] == method]
                draw_curve(ax, method_rows, error, cost, label=method, **curve_style(k))
            ax.set(xlabel=error_label, ylabel=COSTS[cost])
            use_decades(ax)
    legend_below(figure, axes[0, 0])
    return figure


MARGIN_DECADES = 0.06
"""Powers of ten beside the first and the last tick, where half of a marker has room."""


def use_decades(ax: Axes) -> None:
    """Make axes logarithmic, from just below a power of ten to just above one, with labels."""
    ax.set(xscale="log", yscale="log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_minor_formatter(NullFormatter())
    lowest, highest = ax.dataLim.get_points()
    for low, high, set_limits in zip(lowest, highest, (ax.set_xlim, ax.set_ylim), strict=True):
        if 0 < low <= high < np.inf:
            floor = np.floor(np.log10(low))
            ceiling = max(floor + 1, np.ceil(np.log10(high)))
            set_limits(10.0 ** (floor - MARGIN_DECADES), 10.0 ** (ceiling + MARGIN_DECADES))


def legend_below(figure: Figure, ax: Axes) -> None:
    """Draw one legend of all panels below them."""
    handles, labels = ax.get_legend_handles_labels()
    width = figure.get_size_inches()[0]
    widest = max((len(label) for label in labels), default=1)
    columns = max(1, min(len(labels), int(width / (0.065 * widest + 0.45))))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=8)


def exponent(rows: Sequence[Row], quantity: str) -> float | None:
    """Return the slope of log quantity over log x in the larger half of the points.

    None for fewer than two points.
    """
    points = [(row["x"], row[quantity]) for row in rows if row.get(quantity)]
    if len(points) < 2:
        return None
    x, y = np.log(points[-max(2, (len(points) + 1) // 2) :]).T
    return float(np.polyfit(x, y, 1)[0])
