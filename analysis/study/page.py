"""One HTML page without references to anything outside it, by the study's own template."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2

from analysis.study.selection import runs
from analysis.table import number

TEMPLATES = Path(__file__).parent


def page(folder: Path, content: Mapping[str, Any]) -> str:
    """The page by the study's page.html.j2, which may extend plain.html.j2, else by that."""
    loader = jinja2.FileSystemLoader([str(folder), str(TEMPLATES)])
    own = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    own.filters["base64"] = lambda path: base64.b64encode(path.read_bytes()).decode()
    own.filters["anchor"] = lambda title: "".join(c if c.isalnum() else "-" for c in title.lower())
    own.globals |= {"runs": runs, "number": number}
    return own.select_template(["page.html.j2", "plain.html.j2"]).render(content)
