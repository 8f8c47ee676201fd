"""Run the blocks of a page when the site is built, and show below each what it prints and draws.

A page of `PAGES` is a text that a reader can type: `console` blocks are commands, `python` blocks
share their names, both run in one folder, in the page's order. Pictures (*.png) that a block has
written follow it. `tests/test_docs.py` runs the same blocks, of all pages.
"""

import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from docutils import nodes

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("tutorial", "lammps", "attenuation")
FOLDER = "_outputs"
"""Beside the pages, for their pictures."""
LINES = 45
"""Of an output, more of which are left out."""


def run_commands(text, folder):
    """What the commands of a console block print, their warnings too."""
    printed, environment = [], os.environ | {"PYTHONPATH": str(ROOT), "CI": "true"}
    for line in text.splitlines():
        command = line.removeprefix("$ ").replace("granular-modes", "python -m modal", 1)
        command = command.replace("python", sys.executable, 1)
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"{line}: {done.stdout}")
        printed.append(done.stdout.replace(str(folder) + "/", "").strip("\n"))
    return "\n\n".join(printed)


def run_python(text, folder, names):
    """What a python block prints."""
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        exec(compile(text, "page", "exec"), names)
    return out.getvalue()


def show(app, doctree):
    """Put outputs and pictures below the blocks of a page that is to show them."""
    page = app.env.docname
    if page not in PAGES or app.tags.has("quick"):
        return
    pictures = Path(app.srcdir) / FOLDER / page
    pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder, names, seen = Path(name), {}, set()
        shutil.copytree(ROOT / "examples/packings", folder, dirs_exist_ok=True)
        for block in list(doctree.findall(nodes.literal_block)):
            kind, text = block.get("language"), block.astext()
            if kind not in ("console", "python"):
                continue
            out = (
                run_commands(text, folder) if kind == "console" else run_python(text, folder, names)
            )
            below = []
            if lines := out.strip("\n").splitlines():
                shown = "\n".join([*lines[:LINES], "..."] if len(lines) > LINES else lines)
                below.append(nodes.literal_block(shown, shown, language="text", classes=["output"]))
            for picture in sorted(set(folder.rglob("*.png")) - seen):
                seen.add(picture)
                shutil.copy(picture, pictures)
                uri = f"/{FOLDER}/{page}/{picture.name}"
                below.append(nodes.image(uri=uri, alt="picture that the block above draws"))
            at = block.parent.index(block) + 1
            block.parent.insert(at, below)


def setup(app):
    """Before Sphinx collects a page's pictures."""
    app.connect("doctree-read", show, priority=400)
    return {"parallel_read_safe": False}
