"""Draw a picture's data into Matplotlib's Axes, and write PNG, CSV and PDF files."""

import io
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
COLOURS = 256
"""Colours of the palette of a PNG."""


def draw_panel(ax: Axes, panel: Panel) -> None:
    """Draw one panel into given Axes."""
    ax.set_xscale(panel.xscale)
    ax.set_yscale(panel.yscale)
    for series in panel.series:
        _draw_series(ax, series, panel.colour_label)
    limits = {name: getattr(panel, name) for name in ("xlim", "ylim") if getattr(panel, name)}
    labels = {name: drawable_text(getattr(panel, name)) for name in ("xlabel", "ylabel")}
    ax.set(**labels, **limits)
    ax.set_title(drawable_text(panel.title), loc="left")
    if panel.equal:
        ax.set_aspect("equal")
    if any(series.kind in ("map", "spheres") for series in panel.series):
        ax.grid(False)
    if any(series.label for series in panel.series):
        place: dict[str, Any] = {"loc": panel.legend}
        if panel.legend == OUTSIDE:
            place = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0), "borderaxespad": 0.0}
        ax.legend(ncols=panel.legend_columns, **place)
    for axis, scale in ((ax.xaxis, panel.xscale), (ax.yaxis, panel.yscale)):
        if scale == "log":
            low, high = axis.get_data_interval()
            if 0 < high <= (1 + 1e-9) * low:  # a single number has no range of its own
                along = {"updatex": axis is ax.xaxis, "updatey": axis is ax.yaxis}
                ax.update_datalim([(low / 2, low / 2), (2 * high, 2 * high)], **along)
            _plain_numbers(axis)
        else:
            few = panel.equal and axis is ax.yaxis
            axis.set_major_locator(MaxNLocator(2 if few else 6, steps=[1, 2, 2.5, 5, 10]))


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
    """Draw one series; `colour_label` stands beside the bar of its colours, if it has one."""
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
    elif series.kind in ("vline", "hline"):
        draw = ax.axvline if series.kind == "vline" else ax.axhline
        for k, place in enumerate(x if series.kind == "vline" else y):
            draw(place, label=label if k == 0 else None, **style)
    elif series.kind == "map":
        assert z is not None
        mesh = ax.pcolormesh(x, y, z, rasterized=True, **style)
        ax.figure.colorbar(mesh, ax=ax, label=colour_label)
    else:
        size = np.full(len(x), style.pop("diameter"))
        discs = EllipseCollection(
            size, size, 0 * size, offsets=np.column_stack([x, y]), units="xy",
            transOffset=ax.transData, lw=0.2, edgecolor="k", **style,
        )  # fmt: skip
        discs.set_array(z)
        ax.add_collection(discs)
        ax.autoscale_view()
        ax.figure.colorbar(discs, ax=ax, label=colour_label, ticks=MaxNLocator(4, integer=True))


def to_figure(picture: Picture) -> Figure:
    """Return the whole figure; call inside `rc_context(fname=STYLE)`."""
    columns = min(picture.columns, len(picture.panels))
    rows = -(-len(picture.panels) // columns)
    width, height = matplotlib.rcParams["figure.figsize"]
    shape = picture.shape or (width * (1 if columns == 1 else 1.55), max(height, 2.3 * rows + 0.6))
    figure = Figure(figsize=shape)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, panel in zip(axes, picture.panels, strict=False):
        draw_panel(ax, panel)
    for ax in axes[len(picture.panels) :]:
        ax.remove()
    return figure


def write_png(figure: Figure, path: Path) -> None:
    """Save a figure in a palette of `COLOURS`, which takes a third of the size."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    data = io.BytesIO()
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(data, "png", optimize=True)
    write_whole(path, data.getvalue())


def save(picture: Picture, stem: Path) -> list[Path]:
    """Write stem.png, stem.csv and stem.pdf (in vectors), and return their paths."""
    png, table, vectors = (stem.with_name(stem.name + end) for end in (".png", ".csv", ".pdf"))
    write_picture(table, picture)
    with matplotlib.rc_context(fname=STYLE):
        figure = to_figure(picture)
        write_png(figure, png)
        data = io.BytesIO()
        figure.set_layout_engine("none")  # the layout is that of the PNG
        FigureCanvasPdf(figure).print_pdf(data, metadata={"CreationDate": None})
        write_whole(vectors, data.getvalue())
    return [png, table, vectors]
