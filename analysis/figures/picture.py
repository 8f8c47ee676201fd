"""A figure as data: panels of series, written to one CSV from which alone it is drawn again.

The CSV begins with lines `# {...}`, JSON: one for the picture, one for each panel and each series
(labels, units in the axis labels, line styles). Then come the numbers, a row a point: panel,
series, x, y, z. Of a map the x stand in its head, and a row is a row of the map: y, and all its z
with blanks between. Numbers are rounded before anything is drawn, so the file holds all that the
picture shows, and drawing it again gives the same picture.
"""

import csv
import io
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from itertools import repeat
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from analysis.typed_json import MismatchError, by_name, fields_of, parsed, read_text
from modal.formats.whole_file import write_text
from modal.tools.errors import InputError

BLUE, ORANGE = "#0060a8", "#c05000"
"""Beside black and greys; the three are told apart without colours, too."""
COLUMNS = ("panel", "series", "x", "y", "z")
"""Of the CSV."""
KINDS = ("line", "map", "spheres", "band", "error", "vline", "hline")
DIGITS, SHADES = 5, 3
"""Significant digits of coordinates and of a map's values."""


@dataclass
class Series:
    """One curve, point set, map or band of a panel.

    kind: `line` (points joined or not, by `style`); `map`, z (ny, nx) over x (nx,) and y (ny,);
    `spheres`, discs at x, y coloured by z; `band` between y and z; `error` bars of z about y;
    `vline`, `hline`, at each x or y. `style` goes to Matplotlib as it is.
    """

    kind: str
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray | None = None
    label: str = ""
    style: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"kind {self.kind!r} is none of {KINDS}")
        self.x, self.y = (_rounded(values) for values in (self.x, self.y))
        if self.z is not None:
            self.z = _rounded(self.z, SHADES if self.kind == "map" else DIGITS)
        if self.kind == "map":
            self.z = self.z.reshape(len(self.y), len(self.x))


@dataclass
class Panel:
    """Axes: labels with units, limits and scales, and what is drawn in them."""

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

    def add(self, kind: str, x, y, z=None, label: str = "", **style) -> None:
        """Append a series."""
        self.series.append(Series(kind, x, y, z, label, style))

    def line(self, x, y, label: str = "", **style) -> None:
        """Append a curve; `marker` and `ls="none"` for points."""
        self.add("line", x, y, None, label, **style)

    def line_on_map(self, x, y, label: str = "", lw: float = 1.5, **style) -> None:
        """Append a curve with white beneath it: on a map it is told from any shade, in grey too."""
        self.line(x, y, color="w", lw=lw + 2)
        self.line(x, y, label, lw=lw, **style)

    def hline(self, y, label: str = "", **style) -> None:
        """Append a line across at y."""
        self.add("hline", [0], [y], None, label, **style)

    def vlines(self, x, label: str = "", **style) -> None:
        """Append upright lines at x (n,)."""
        self.add("vline", x, np.zeros(np.shape(x)), None, label, **style)

    def band(self, x, low, high, label: str = "", **style) -> None:
        """Append what lies between low and high, which may be numbers, over x (n,)."""
        ends = np.broadcast_to(low, np.shape(x)), np.broadcast_to(high, np.shape(x))
        self.add("band", x, *ends, label, **style)


@dataclass
class Picture:
    """Panels, row by row in `columns` columns; `shape` is width and height in inches."""

    panels: list[Panel]
    columns: int = 1
    shape: tuple[float, float] | None = None

    @property
    def shown(self) -> bool:
        """Whether there is a point of any case: neither straight lines nor a legend alone."""
        series = [one for panel in self.panels for one in panel.series]
        return any(
            np.isfinite(one.x).any() and np.isfinite(one.y).any()
            for one in series
            if one.kind not in ("vline", "hline")
        )


def columns_for(count: int) -> int:
    """Columns that leave no part of a grid of panels blank: 1, 2, 3, 2 x 2, then three a row."""
    return count if count < 4 else 2 if count % 2 == 0 and count < 6 else 3


def merged(panels: list[Panel]) -> list[Panel]:
    """Panels of one title become one, with the series of all; limits cover all of theirs."""
    alike: dict[str, list[Panel]] = {}
    for panel in panels:
        alike.setdefault(panel.title, []).append(panel)
    return [
        replace(share_limits(same)[0], series=[one for panel in same for one in panel.series])
        for same in alike.values()
    ]


def share_limits(panels: list[Panel], axes: str = "xy") -> list[Panel]:
    """Give panels one common range along the axes named."""
    for name in (f"{axis}lim" for axis in axes):
        limits = [getattr(p, name) for p in panels if getattr(p, name) is not None]
        for panel in panels if limits else []:
            setattr(panel, name, (min(low for low, _ in limits), max(high for _, high in limits)))
    return panels


def write_picture(path: Path, picture: Picture) -> None:
    """Write the CSV."""
    heads: list[dict] = [{"picture": {"columns": picture.columns, "shape": picture.shape}}]
    rows: list[tuple] = [COLUMNS]
    for p, panel in enumerate(picture.panels):
        heads.append({"panel": asdict(replace(panel, series=[]))})
        for s, series in enumerate(panel.series):
            facts = {"kind": series.kind, "label": series.label, "style": series.style}
            heads.append({"series": facts})
            z = series.z
            x: Iterable[str] = map(_text, series.x)
            third: Iterable[str] = repeat("") if z is None else map(_text, z)
            if series.kind == "map":
                facts["x"], x = list(series.x), repeat("")
                third = (" ".join(_text(value, SHADES) for value in row) for row in z)
            rows += zip(repeat(p), repeat(s), x, map(_text, series.y), third, strict=False)
    file = io.StringIO()
    file.writelines(f"# {json.dumps(head)}\n" for head in heads)
    csv.writer(file, lineterminator="\n").writerows(rows)
    write_text(path, file.getvalue())


def read_picture(path: str | Path) -> Picture:
    """The picture that a CSV holds; InputError if it is not one."""
    lines = read_text(path).splitlines()
    try:
        heads = [parsed(line[2:]) for line in lines if line.startswith("# ")]
        points = _points(line for line in lines if not line.startswith("# "))
        return _picture(heads, points)
    except (ValueError, csv.Error) as error:
        problem = f"{path}: not the CSV of a figure"
        raise InputError("figure", problem, str(error), "draw it again") from error


Points = dict[tuple[int, int], list[list[str]]]
"""Rows x, y, z of each series, by the numbers of its panel and its own."""


def _points(lines: Iterable[str]) -> Points:
    """What stands below the heads."""
    points: Points = {}
    for number, row in enumerate(csv.reader(lines)):
        if number == 0:
            continue
        if len(row) != len(COLUMNS):
            raise MismatchError(f"row {number} has {len(row)} cells, not {len(COLUMNS)}")
        points.setdefault((int(row[0]), int(row[1])), []).append(row[2:])
    return points


def _picture(heads: list[Any], points: Points) -> Picture:
    """The picture of these heads."""
    first = _head(heads[0], "picture") if heads else None
    if first is None:
        raise MismatchError("its first line has no picture")
    picture = Picture([], **fields_of(first, _kinds(Picture, "panels"), set(), "picture"))
    for head in heads[1:]:
        panel = _head(head, "panel")
        if panel is not None:
            said = panel if not panel.get("series") else {}
            said = {name: value for name, value in said.items() if name != "series"}
            kinds = _kinds(Panel, "series")
            picture.panels.append(Panel(**fields_of(said, kinds, {"xlabel", "ylabel"}, "panel")))
            continue
        series = _head(head, "series")
        if series is None or not picture.panels:
            raise MismatchError("a line is of no picture, panel or series")
        place = len(picture.panels) - 1, len(picture.panels[-1].series)
        picture.panels[-1].series.append(_series(series, points.pop(place, [])))
    if points:
        raise MismatchError(f"points of series {min(points)}, which has no head")
    return picture


def _head(head: Any, name: str) -> dict[str, Any] | None:
    """What a head says of a picture, a panel or a series; None where it is of another."""
    if not isinstance(head, dict) or [*head] != [name]:
        return None
    return by_name(head[name], Any, name)


def _kinds(owner: type, *left: str) -> dict[str, Any]:
    """Kinds of the fields of a class, but for those that are `left`."""
    return {name: kind for name, kind in get_type_hints(owner).items() if name not in left}


def _series(said: dict[str, Any], rows: list[list[str]]) -> Series:
    """A series of its head and its points."""
    kinds = {"kind": str, "label": str, "style": dict[str, Any], "x": list[float]}
    facts = fields_of(said, kinds, {"kind"}, "series")
    x = [float(row[0]) for row in rows if row[0]]
    y = [float(row[1]) for row in rows]
    z = [[float(value) for value in row[2].split()] for row in rows if row[2]]
    return Series(**{"x": np.array(x), "y": np.array(y), "z": np.array(z) if z else None} | facts)


def _rounded(values: np.ndarray, digits: int = DIGITS) -> np.ndarray:
    return np.array([float(_text(value, digits)) for value in np.ravel(values)])


def _text(value: float, digits: int = DIGITS) -> str:
    return f"{value:.{digits}g}"
