"""Hold a figure as data: panels of series, written to a CSV from which it can be redrawn.

The CSV begins with lines `# {...}`, JSON: one for the picture, one for each panel and each series
(labels, units in the axis labels, line styles). Then come the numbers, a row for each point: panel,
series, x, y, z. The x of a map are in the line of its series; each of its rows has y, and all z of
this y separated by blanks. Numbers are rounded before drawing, so that the file contains everything
that the picture shows, and redrawing gives the same picture.
"""

import csv
import io
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import repeat
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, get_args, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from analysis.typed_json import MismatchError, by_name, fields_of, parsed, read_text
from modal.formats.whole_file import write_text
from modal.tools.arrays import Floats
from modal.tools.errors import InputError

BLUE = "#0060a8"
ORANGE = "#c05000"
"""Colours beside black and greys; in a print without colours their greys differ, too."""
COLUMNS = ("panel", "series", "x", "y", "z")
"""Columns of the CSV."""
SeriesKind = Literal["line", "map", "spheres", "band", "error", "vline", "hline"]
COORDINATE_DIGITS = 5
"""Significant digits of coordinates, more than a print shows."""
SHADE_DIGITS = 3
"""Significant digits of a map's values, which a palette of 256 colours shows."""


@dataclass
class Series:
    """One curve, point set, map or band of a panel.

    Attributes
    ----------
    kind : SeriesKind
        `line`: points, joined or not, by `style`. `map`: z (ny, nx) over x (nx,) and y (ny,).
        `spheres`: discs at x and y, coloured by z. `band`: between y and z. `error`: bars of length
        z about y. `vline`, `hline`: a line across the panel at each x or y.
    x, y : ndarray (n,)
        In the units of the labels of the panel's axes.
    z : ndarray (n,) or (ny, nx), or None
        Third coordinate, if the kind has one.
    label : str
        Entry of the legend; none if empty.
    style : dict
        Keywords of Matplotlib.
    """

    kind: SeriesKind
    x: Floats
    y: Floats
    z: Floats | None = None
    label: str = ""
    style: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Round the numbers; ValueError for an unknown kind, and for a map of another shape."""
        kinds = get_args(SeriesKind)
        if self.kind not in kinds:
            raise ValueError(f"kind {self.kind!r} is none of {kinds}")
        self.x = _rounded(self.x)
        self.y = _rounded(self.y)
        if self.kind == "map":
            if self.z is None:
                raise ValueError("a map has no values")
            self.z = _rounded(self.z, SHADE_DIGITS).reshape(len(self.y), len(self.x))
        elif self.z is not None:
            self.z = _rounded(self.z)


LINE_WIDTH_ON_MAP = 1.5
"""Points."""


class Style(TypedDict, total=False):
    """Matplotlib's style keywords that a series may have (`analysis.figures.looks`)."""

    color: str
    mec: str
    mfc: str
    lw: float
    ms: float
    mew: float
    capsize: float
    diameter: float
    vmin: float
    vmax: float
    zorder: float
    alpha: float
    clim: Sequence[float]
    cmap: str
    ls: str | tuple[float, tuple[float, float]]
    marker: str


@dataclass
class Panel:
    """Axes of a figure: labels with units, limits and scales, and the series drawn in them."""

    xlabel: str
    ylabel: str
    title: str = ""
    xlim: tuple[float, float] | None = None
    ylim: tuple[float, float] | None = None
    xscale: str = "linear"
    yscale: str = "linear"
    colour_label: str = ""
    legend: str = "best"
    legend_columns: int = 1
    equal: bool = False
    series: list[Series] = field(default_factory=list)

    def add(
        self,
        kind: SeriesKind,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike | None = None,
        label: str = "",
        **style: Unpack[Style],
    ) -> None:
        """Append a series."""
        third = None
        if z is not None:
            third = np.asarray(z)
        self.series.append(Series(kind, np.asarray(x), np.asarray(y), third, label, dict(style)))

    def line(self, x: ArrayLike, y: ArrayLike, label: str = "", **style: Unpack[Style]) -> None:
        """Append a curve; give `marker` and `ls="none"` for points."""
        self.add("line", x, y, None, label, **style)

    def line_on_map(
        self, x: ArrayLike, y: ArrayLike, label: str = "", **style: Unpack[Style]
    ) -> None:
        """Append a curve with a white one beneath, visible on any shade of a map."""
        style.setdefault("lw", LINE_WIDTH_ON_MAP)
        self.line(x, y, color="w", lw=style["lw"] + 2)
        self.line(x, y, label, **style)

    def hline(self, y: float, label: str = "", **style: Unpack[Style]) -> None:
        """Append a line across the panel at y."""
        self.add("hline", [0], [y], None, label, **style)

    def vlines(self, x: ArrayLike, label: str = "", **style: Unpack[Style]) -> None:
        """Append vertical lines at x (n,)."""
        self.add("vline", x, np.zeros(np.shape(x)), None, label, **style)

    def band(
        self, x: ArrayLike, low: ArrayLike, high: ArrayLike, label: str = "", **style: Unpack[Style]
    ) -> None:
        """Append the band between low and high, arrays (n,) or numbers, over x (n,)."""
        lower = np.broadcast_to(low, np.shape(x))
        upper = np.broadcast_to(high, np.shape(x))
        self.add("band", x, lower, upper, label, **style)


@dataclass
class Picture:
    """Panels, row by row in `columns` columns; `shape` is width and height in inches."""

    panels: list[Panel]
    columns: int = 1
    shape: tuple[float, float] | None = None

    @property
    def shown(self) -> bool:
        """Whether any case has a point; straight lines and a legend do not count."""
        for panel in self.panels:
            for series in panel.series:
                straight = series.kind in ("vline", "hline")
                if not straight and np.isfinite(series.x).any() and np.isfinite(series.y).any():
                    return True
        return False


def columns_for(count: int) -> int:
    """Return the number of columns of a grid of `count` panels without blank places.

    1, 2, 3, 2 x 2, then three in a row.
    """
    if count == 4:
        return 2
    return min(count, 3)


def merged(panels: list[Panel]) -> list[Panel]:
    """Join panels with the same title into one panel with all series and the widest limits."""
    panels_by_title: dict[str, list[Panel]] = {}
    for panel in panels:
        panels_by_title.setdefault(panel.title, []).append(panel)
    joined = []
    for members in panels_by_title.values():
        first = share_limits(members)[0]
        series = [each for panel in members for each in panel.series]
        joined.append(replace(first, series=series))
    return joined


def share_limits(panels: list[Panel], axes: str = "xy") -> list[Panel]:
    """Give panels a common range along the named axes, and return them."""
    for axis in axes:
        name = f"{axis}lim"
        limits = [getattr(panel, name) for panel in panels if getattr(panel, name) is not None]
        if not limits:
            continue
        low = min(low for low, _ in limits)
        high = max(high for _, high in limits)
        for panel in panels:
            setattr(panel, name, (low, high))
    return panels


def describe_picture(picture: Picture) -> str:
    """Return what the axes of the panels show, for who cannot see the picture.

    >>> describe_picture(Picture([Panel("time (ms)", "$u_z$ (nm)")] * 2))
    '2 panels: u_z (nm) against time (ms)'
    """
    counts: dict[str, int] = {}
    for panel in picture.panels:
        axes = f"{panel.ylabel} against {panel.xlabel}"
        if panel.colour_label:
            axes = f"{panel.colour_label} in colours over {panel.xlabel} and {panel.ylabel}"
        text = plain_text(axes)
        counts[text] = counts.get(text, 0) + 1
    texts = []
    for text, count in counts.items():
        panels = "1 panel" if count == 1 else f"{count} panels"
        texts.append(f"{panels}: {text}")
    return "; ".join(texts)


def plain_text(text: str) -> str:
    r"""Return a text with its formulas as plain words.

    >>> plain_text(r"$\chi_z$ (-)"), plain_text("$f_{max}$ over that of FCC")
    ('chi_z (-)', 'f_max over that of FCC')
    """
    parts = text.split("$")
    for k in range(1, len(parts), 2):
        parts[k] = re.sub(r"[{}\\]|\\,", "", parts[k])
    return "".join(parts)


def write_picture(path: Path, picture: Picture) -> None:
    """Write the CSV."""
    heads: list[dict[str, Any]] = [
        {"picture": {"columns": picture.columns, "shape": picture.shape}}
    ]
    rows: list[tuple[Any, ...]] = [COLUMNS]
    for panel_number, panel in enumerate(picture.panels):
        heads.append({"panel": asdict(replace(panel, series=[]))})
        for series_number, series in enumerate(panel.series):
            head = {"kind": series.kind, "label": series.label, "style": series.style}
            if series.kind == "map":
                head["x"] = list(series.x)
            heads.append({"series": head})
            rows += [(panel_number, series_number, *texts) for texts in _texts_of_points(series)]
    file = io.StringIO()
    file.writelines(f"# {json.dumps(head)}\n" for head in heads)
    csv.writer(file, lineterminator="\n").writerows(rows)
    write_text(path, file.getvalue())


def _texts_of_points(series: Series) -> Iterator[tuple[str, str, str]]:
    """Yield x, y and z of each point, and of each row of a map, as text for the CSV."""
    x: Iterable[str] = map(_text, series.x)
    y = map(_text, series.y)
    z: Iterable[str] = repeat("")
    if series.kind == "map":
        x = repeat("")
    if series.z is not None:
        z = map(_text_of_row if series.kind == "map" else _text, series.z)
    yield from zip(x, y, z, strict=False)


def _text_of_row(shades: Floats) -> str:
    """Return a row of a map (nx,) as text."""
    return " ".join(_text(shade, SHADE_DIGITS) for shade in shades)


def read_picture(path: str | Path) -> Picture:
    """Return the picture that a CSV holds; InputError if it is not the CSV of a figure."""
    lines = read_text(path).splitlines()
    try:
        heads = [parsed(line[2:]) for line in lines if line.startswith("# ")]
        points = _read_points(line for line in lines if not line.startswith("# "))
        return _picture_of_heads(heads, points)
    except (ValueError, csv.Error) as error:
        problem = f"{path}: not the CSV of a figure"
        raise InputError("figure", problem, str(error), "draw it again") from error


Points = dict[tuple[int, int], list[list[str]]]
"""Rows x, y, z of each series, by the number of its panel and its number in the panel."""


def _read_points(lines: Iterable[str]) -> Points:
    """Return the points after the heads; `MismatchError` if a row has too few or many cells."""
    points: Points = {}
    for number, row in enumerate(csv.reader(lines)):
        if number == 0:
            continue
        if len(row) != len(COLUMNS):
            raise MismatchError(f"row {number} has {len(row)} cells, not {len(COLUMNS)}")
        points.setdefault((int(row[0]), int(row[1])), []).append(row[2:])
    return points


def _picture_of_heads(heads: list[Any], points: Points) -> Picture:
    """Return the picture with these heads and points; `MismatchError` if they do not fit."""
    first = _head(heads[0], "picture") if heads else None
    if first is None:
        raise MismatchError("its first line has no picture")
    fields = fields_of(first, _kinds_of_fields(Picture, but="panels"), set(), "picture")
    picture = Picture([], **fields)
    for head in heads[1:]:
        panel = _head(head, "panel")
        if panel is not None:
            picture.panels.append(_panel_of_head(panel))
            continue
        series = _head(head, "series")
        if series is None or not picture.panels:
            raise MismatchError("a line is of no picture, panel or series")
        members = picture.panels[-1].series
        rows = points.pop((len(picture.panels) - 1, len(members)), [])
        members.append(_series_of_head(series, rows))
    if points:
        raise MismatchError(f"points of series {min(points)}, which has no head")
    return picture


def _head(head: Any, name: str) -> dict[str, Any] | None:
    """Return the fields of the head of a picture, panel or series `name`; None for another head."""
    if not isinstance(head, dict) or list(head) != [name]:
        return None
    return by_name(head[name], Any, name)


def _kinds_of_fields(owner: type, but: str) -> dict[str, Any]:
    """Return the kinds of the fields of a class, without one of them."""
    return {name: kind for name, kind in get_type_hints(owner).items() if name != but}


def _panel_of_head(head: dict[str, Any]) -> Panel:
    """Return a panel without its series, which have their own heads."""
    if not head.get("series"):
        head = {name: value for name, value in head.items() if name != "series"}
    kinds = _kinds_of_fields(Panel, but="series")
    return Panel(**fields_of(head, kinds, {"xlabel", "ylabel"}, "panel"))


def _series_of_head(head: dict[str, Any], rows: list[list[str]]) -> Series:
    """Return a series from its head and the rows of its points."""
    kinds = {"kind": str, "label": str, "style": dict[str, Any], "x": list[float]}
    fields = fields_of(head, kinds, {"kind"}, "series")
    # The x of a map stand in its head.
    fields.setdefault("x", np.array([float(x) for x, _, _ in rows if x]))
    y = np.array([float(y) for _, y, _ in rows])
    shades = [[float(word) for word in z.split()] for _, _, z in rows if z]
    z = None
    if shades:
        z = np.array(shades)
    return Series(y=y, z=z, **fields)


def _rounded(values: ArrayLike, digits: int = COORDINATE_DIGITS) -> Floats:
    """Return numbers (n,) rounded to `digits` significant digits."""
    return np.array([float(_text(value, digits)) for value in np.ravel(values)])


def _text(value: float, digits: int = COORDINATE_DIGITS) -> str:
    """Return a number as text with `digits` significant digits."""
    return f"{value:.{digits}g}"
