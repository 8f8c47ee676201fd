"""Draw a picture's data into Matplotlib's Axes, and write PNG, CSV and PDF files."""

import io
import math
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter
from PIL import Image

from analysis.figures.looks import OUTSIDE, drawable_text
from analysis.figures.picture import Panel, Picture, Series, write_picture
from modal.formats.whole_file import write_whole

STYLE = Path(__file__).with_name("paper.mplstyle")
"""Matplotlib's settings of all figures."""
PALETTE_COLOURS = 256
"""Number of colours of the palette of a PNG."""
ROW_HEIGHT = 2.3
"""Height of a row of panels, inches, in a figure without a shape of its own."""
LEGEND_HEIGHT = 0.6
"""Height for labels below the last row and above the first one, inches."""
WIDTH_RATIO = 1.55
"""Width of a figure of several columns divided by that of a figure of one column."""
TICK_STEPS = [1, 2, 2.5, 5, 10]
"""Allowed distances of ticks, apart from a power of ten."""
MAX_TICKS = 6
MAX_TICKS_OF_NARROW_AXIS = 2
"""Largest number of ticks across a drawn packing, which is narrow."""


def draw_panel(ax: Axes, panel: Panel) -> None:
    """Draw one panel into given Axes."""
    ax.set_xscale(panel.xscale)
    ax.set_yscale(panel.yscale)
    for series in panel.series:
        _draw_series(ax, series, panel.colour_label)
    if panel.xlim:
        ax.set_xlim(panel.xlim)
    if panel.ylim:
        ax.set_ylim(panel.ylim)
    ax.set_xlabel(drawable_text(panel.xlabel))
    ax.set_ylabel(drawable_text(panel.ylabel))
    ax.set_title(drawable_text(panel.title), loc="left")
    if panel.equal:
        ax.set_aspect("equal")
    if any(series.kind in ("map", "spheres") for series in panel.series):
        ax.grid(False)
    if any(series.label for series in panel.series):
        _draw_legend(ax, panel)
    for axis, scale in ((ax.xaxis, panel.xscale), (ax.yaxis, panel.yscale)):
        if scale == "log":
            _widen_range_of_single_number(ax, axis)
            _plain_numbers(axis)
        else:
            ticks = MAX_TICKS
            if panel.equal and axis is ax.yaxis:
                ticks = MAX_TICKS_OF_NARROW_AXIS
            axis.set_major_locator(MaxNLocator(ticks, steps=TICK_STEPS))


def _draw_legend(ax: Axes, panel: Panel) -> None:
    """Draw the legend of a panel, inside the axes or beside them."""
    place: dict[str, Any] = {"loc": panel.legend}
    if panel.legend == OUTSIDE:
        place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
    ax.legend(ncols=panel.legend_columns, **place)


def _widen_range_of_single_number(ax: Axes, axis: Axis) -> None:
    """Widen a logarithmic axis to half and twice a number if it shows no other number."""
    low, high = axis.get_data_interval()
    if 0 < high <= (1 + 1e-9) * low:
        corners = [(low / 2, low / 2), (2 * high, 2 * high)]
        ax.update_datalim(corners, updatex=axis is ax.xaxis, updatey=axis is ax.yaxis)


def _plain_numbers(axis: Axis) -> None:
    """Write plain numbers beside a logarithmic axis that spans few powers of ten."""
    low, high = sorted(axis.get_view_interval())
    if high > 300 * low:
        return
    if high < 4 * low:
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    else:
        axis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7) if high < 12 * low else (1, 2, 5)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def _draw_series(ax: Axes, series: Series, colour_label: str) -> None:
    """Draw one series; `colour_label` is the label of its colour bar."""
    x = series.x
    y = series.y
    z = series.z
    style = dict(series.style)
    label = drawable_text(series.label) or None
    colour_label = drawable_text(colour_label)
    if series.kind == "line":
        ax.plot(x, y, label=label, **style)
    elif series.kind == "band":
        assert z is not None
        ax.fill_between(x, y, z, label=label, **style)
    elif series.kind == "error":
        ax.errorbar(x, y, yerr=z, fmt="none", **style)
    elif series.kind == "vline":
        for line_number, x_of_line in enumerate(x):
            ax.axvline(x_of_line, label=None if line_number else label, **style)
    elif series.kind == "hline":
        for line_number, y_of_line in enumerate(y):
            ax.axhline(y_of_line, label=None if line_number else label, **style)
    elif series.kind == "map":
        assert z is not None
        mesh = ax.pcolormesh(x, y, z, rasterized=True, **style)
        ax.figure.colorbar(mesh, ax=ax, label=colour_label)
    else:
        _draw_spheres(ax, series, colour_label)


def _draw_spheres(ax: Axes, series: Series, colour_label: str) -> None:
    """Draw spheres as discs of one diameter, in units of the axes, coloured by z."""
    style = dict(series.style)
    diameter = np.full(len(series.x), style.pop("diameter"))
    no_angle = np.zeros_like(diameter)
    discs = EllipseCollection(
        diameter,
        diameter,
        no_angle,
        offsets=np.column_stack([series.x, series.y]),
        units="xy",
        transOffset=ax.transData,
        lw=0.2,
        edgecolor="k",
        **style,
    )
    discs.set_array(series.z)
    ax.add_collection(discs)
    ax.autoscale_view()
    ticks = MaxNLocator(4, integer=True)
    ax.figure.colorbar(discs, ax=ax, label=colour_label, ticks=ticks)


def to_figure(picture: Picture) -> Figure:
    """Return the whole figure; call inside `rc_context(fname=STYLE)`."""
    columns = min(picture.columns, len(picture.panels))
    rows = math.ceil(len(picture.panels) / columns)
    shape = picture.shape
    if not shape:
        width, height = matplotlib.rcParams["figure.figsize"]
        if columns > 1:
            width *= WIDTH_RATIO
        shape = (width, max(height, ROW_HEIGHT * rows + LEGEND_HEIGHT))
    figure = Figure(figsize=shape)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, panel in zip(axes, picture.panels, strict=False):
        draw_panel(ax, panel)
    for ax in axes[len(picture.panels) :]:
        ax.remove()
    return figure


def write_png(figure: Figure, path: Path) -> None:
    """Save a figure with `PALETTE_COLOURS` colours, which takes a third of the size."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image = image.quantize(PALETTE_COLOURS, dither=Image.Dither.NONE)
    data = io.BytesIO()
    image.save(data, "png", optimize=True)
    write_whole(path, data.getvalue())


def save(picture: Picture, stem: Path) -> list[Path]:
    """Write stem.png, stem.csv and stem.pdf (vector graphics), and return their paths."""
    png = stem.with_name(stem.name + ".png")
    table = stem.with_name(stem.name + ".csv")
    pdf = stem.with_name(stem.name + ".pdf")
    write_picture(table, picture)
    with matplotlib.rc_context(fname=STYLE):
        figure = to_figure(picture)
        write_png(figure, png)
        # The layout of the PNG stays as it is.
        figure.set_layout_engine("none")
        data = io.BytesIO()
        FigureCanvasPdf(figure).print_pdf(data, metadata={"CreationDate": None})
        write_whole(pdf, data.getvalue())
    return [png, table, pdf]
