"""One HTML page without references to anything outside it: tables, figures, contents."""

from __future__ import annotations

import base64
import html
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy
import scipy

from analysis.table import Table

CSS = (
    "body{font:15px/1.45 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#111}"
    "table{border-collapse:collapse;font-size:13px}td,th{border:1px solid #999;padding:2px 6px}"
    "td{text-align:right}td:first-child,th{text-align:left}img{max-width:100%}"
    ".wide{overflow-x:auto}figure{margin:1.5em 0}code{font-size:12px}"
    ".words td{text-align:left}"
)


@dataclass(frozen=True)
class Section:
    """A heading and the HTML below it."""

    title: str
    body: str

    @property
    def anchor(self) -> str:
        """What the contents point to."""
        return "".join(c if c.isalnum() else "-" for c in self.title.lower()).strip("-")


def table_html(table: Table, *, words: bool = False) -> str:
    """A table; `words` sets all cells to the left."""
    head = "".join(f"<th>{html.escape(cell)}" for cell in table.header)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}" for cell in row) for row in table.rows
    )
    kind = "wide words" if words else "wide"
    return f'<div class="{kind}"><table><tr>{head}{rows}</table></div>'


def figure_html(png: Path, caption: str) -> str:
    """A picture with its caption, and the name of the CSV that it is drawn again from."""
    data = base64.b64encode(png.read_bytes()).decode()
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text} <code>{png.stem}.csv</code></figcaption></figure>"
    )


def list_html(items: list[str]) -> str:
    """A list of lines of text."""
    return "<ul>" + "".join(f"<li>{html.escape(item)}</li>" for item in items) + "</ul>"


def made_by(command: str) -> str:
    """A line that says what made the page, with which versions."""
    return (
        f"<p>Made by <code>{html.escape(command)}</code> with numpy {numpy.__version__}, scipy "
        f"{scipy.__version__}, matplotlib {matplotlib.__version__}.</p>"
    )


def page(title: str, above: str, sections: list[Section], *, contents: bool = False) -> str:
    """The page: title, what stands above all sections, contents where asked for, the sections."""
    head = html.escape(title)
    text = f"<!doctype html><html lang=en><meta charset=utf-8><title>{head}</title>"
    text += f"<style>{CSS}</style><h1>{head}</h1>{above}"
    if contents:
        links = (f'<li><a href="#{s.anchor}">{html.escape(s.title)}</a></li>' for s in sections)
        text += f"<h2>Contents</h2><ol>{''.join(links)}</ol>"
    for section in sections:
        text += f'<h2 id="{section.anchor}">{html.escape(section.title)}</h2>{section.body}'
    return text
