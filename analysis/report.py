"""The report: one HTML page without references to anything outside it, and its single files."""

from __future__ import annotations

import base64
import html
import io
import shlex
from pathlib import Path

import matplotlib
import numpy
import scipy

from analysis.case import EXTRA_KINDS, KINDS
from analysis.figures import FIGURES, compose
from analysis.figures.picture import write_picture
from analysis.figures.render import save_png
from analysis.measures import Measures
from analysis.study import tables
from analysis.table import Table
from modal.formats.hdf5 import InputError, sha256
from modal.formats.provenance import read_provenance

CSS = (
    "body{font:15px/1.45 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#111}"
    "table{border-collapse:collapse;font-size:13px}td,th{border:1px solid #999;padding:2px 6px}"
    "td{text-align:right}td:first-child,th{text-align:left}img{max-width:100%}"
    ".wide{overflow-x:auto}figure{margin:1.5em 0}code{font-size:12px}"
)

ABSENT = {
    "signals": "no record of a YADE run; linear wave instead",
    "modes": "no chi_z, no mode shapes; python -m modal modes makes them",
    "band.modes": "no chi_z at higher frequencies; python -m modal modes --between makes them",
    "structure": "no dispersion of the modes; python -m analysis prepare makes it",
    "density": "no density of states; python -m analysis prepare makes it",
    "response": "gain made for this page; python -m analysis prepare keeps it",
}
FOR_RANDOM = ("band.modes", "structure", "density")
"""What a crystal does not need: its modes are all known."""


def report(cases: list[Measures], output: Path, command: list[str]) -> list[Path]:
    """Write report.html, and every table and figure as files of their own; returns the paths."""
    paths, body = [], []
    for name, table in tables(cases).items():
        paths += table.write(output / name)
        body.append(f"<h2>{html.escape(table.title)}</h2>{_table(table)}")
    absent = []
    body.append("<h2>Figures</h2>")
    for name, entry in FIGURES.items():
        try:
            drawn = compose(name, cases)
        except InputError as error:
            absent.append(f"{name}: {error}")
            continue
        stem = output / name
        write_picture(stem.with_name(f"{name}.csv"), drawn)
        png = save_png(drawn, stem.with_name(f"{name}.png"))
        paths += [png, stem.with_name(f"{name}.csv")]
        body.append(_figure(png, entry.caption))
    if absent:
        items = "".join(f"<li>{html.escape(_without_folder(text, cases))}</li>" for text in absent)
        body.append(f"<h2>Not drawn</h2><ul>{items}</ul>")
    provenance = provenance_table(cases)
    body.append(f"<h2>Provenance</h2>{_table(provenance)}")
    page = output / "report.html"
    title = html.escape("Waves in sphere packings: " + ", ".join(m.case.name for m in cases))
    text = io.StringIO()
    text.write(f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title>")
    text.write(f"<style>{CSS}</style><h1>{title}</h1>")
    text.write(
        "<p>After Otsubo, O'Sullivan, Hanley and Sim, Granular Matter 19:50 (2017). Values with ± "
        "carry their standard error; a plateau's is half the quartile distance of its values. "
        "YADE is the recorded run; linear wave, the wave of its network's springs alone, without "
        "the pre-stress of the contacts; unless they name YADE, values are of the linear wave.</p>"
        f"<p>Made by <code>{html.escape(_shown(command))}</code> with numpy "
        f"{numpy.__version__}, scipy {scipy.__version__}, matplotlib {matplotlib.__version__}.</p>"
    )
    text.write("".join(body))
    page.write_text(text.getvalue())
    return [page, *paths]


def _shown(command: list[str]) -> str:
    """The command without a folder of this machine: paths from here on, or their last part."""
    here = Path.cwd()
    parts = []
    for part in command:
        path = Path(part)
        if path.is_absolute():
            part = str(path.relative_to(here)) if path.is_relative_to(here) else path.name
        parts.append(part)
    return shlex.join(parts)


def _without_folder(text: str, cases: list[Measures]) -> str:
    for m in cases:
        for folder in {m.case.path(kind).parent for kind in (*KINDS, *EXTRA_KINDS)}:
            text = text.replace(f"{folder}/", "")
    return text


def _table(table: Table) -> str:
    head = "".join(f"<th>{html.escape(cell)}" for cell in table.header)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in row) for row in table.rows
    )
    return f"<div class=wide><table><tr>{head}{rows}</table></div>"


def _figure(png: Path, caption: str) -> str:
    data = base64.b64encode(png.read_bytes()).decode()
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text} <code>{png.stem}.csv</code></figcaption></figure>"
    )


def provenance_table(cases: list[Measures]) -> Table:
    """Every file that was read, its digest, its command and its sources as far as it says."""
    rows = []
    for m in cases:
        for kind in (*KINDS, *EXTRA_KINDS):
            path = m.case.path(kind)
            if m.case.has(kind):
                made = read_provenance(path)
                how = made.command or "of unknown origin"
                sources = ", ".join(map(str, made.sources))
                rows.append([path.name, sha256(path)[:16], how, sources])
            elif kind in ABSENT and not (m.case.is_crystal and kind in FOR_RANDOM):
                rows.append([path.name, "absent", ABSENT[kind], ""])
    header = ["file", "SHA-256, first 16 digits", "command, or what its absence means", "made from"]
    return Table("Provenance", header, rows)
