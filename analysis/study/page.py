"""One HTML page without references to anything outside it, by the study's own template."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2

PLAIN = Path(__file__).with_name("plain.html.j2")
"""The template of a study that has none of its own."""


def figure_html(png: Path, caption: str) -> str:
    """A picture with its caption, and the name of the CSV that it is drawn again from."""
    data, text = base64.b64encode(png.read_bytes()).decode(), html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text} <code>{png.stem}.csv</code></figcaption></figure>"
    )


def page(template: Path, content: Mapping[str, Any]) -> str:
    """The page; a template extends the plain one, plain.html.j2, or stands alone."""
    folders = [str(template.parent), str(PLAIN.parent)]
    loader = jinja2.FileSystemLoader(folders)
    own = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    own.filters["anchor"] = lambda title: "".join(c if c.isalnum() else "-" for c in title.lower())
    return own.get_template(template.name).render(content)
