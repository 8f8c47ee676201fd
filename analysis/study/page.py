"""One HTML page without references to anything outside it, by the study's own template."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2

PLAIN = Path(__file__).with_name("plain.html.j2")
"""The template of a study that has none of its own."""


def page(template: Path, content: Mapping[str, Any]) -> str:
    """The page; a template extends the plain one, plain.html.j2, or stands alone."""
    folders = [str(template.parent), str(PLAIN.parent)]
    loader = jinja2.FileSystemLoader(folders)
    own = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    own.filters["base64"] = lambda path: base64.b64encode(path.read_bytes()).decode()
    own.filters["anchor"] = lambda title: "".join(c if c.isalnum() else "-" for c in title.lower())
    return own.get_template(template.name).render(content)
