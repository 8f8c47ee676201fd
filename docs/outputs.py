"""Run the blocks of a page when the site is built, and show below each what it prints and draws.

A page of `PAGES` is a text that a reader can type: `console` blocks are commands, `python` blocks
share their names, both run in one folder, in the page's order. Pictures (*.png) that a block has
written follow it. `tests/test_docs.py` runs the same blocks, of all pages. Of `modal` the rooms and
the imports among them are drawn on the page of the layout.
"""

import ast
import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from graphlib import TopologicalSorter
from pathlib import Path

from docutils import nodes
from matplotlib.figure import Figure

from modal.cli.options import FALLS_SHORT_STATUS

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("tutorial", "lammps", "attenuation")
FOLDER = "_outputs"
"""Beside the pages, for their pictures."""
LINES = 45
"""Of an output, more of which are left out."""


def run_commands(text, folder):
    """Return what the commands of a console block print, their warnings too."""
    printed, environment = [], os.environ | {"PYTHONPATH": str(ROOT), "CI": "true"}
    for line in text.splitlines():
        command = line.removeprefix("$ ").replace("granular-modes", "python -m modal", 1)
        command = command.replace("python", sys.executable, 1)
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        if done.returncode not in (0, FALLS_SHORT_STATUS):
            raise RuntimeError(f"{line}: {done.stdout}")
        printed.append(done.stdout.replace(str(folder) + "/", "").strip("\n"))
    return "\n\n".join(printed)


def run_python(text, folder, names):
    """Return what a python block prints."""
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out):
        exec(compile(text, "page", "exec"), names)
    return out.getvalue()


def imports_of_rooms(package):
    """Of each room, a folder or module of a package, those that it imports, in functions too."""
    rooms = {}
    for path in sorted((ROOT / package).rglob("*.py")):
        room = path.relative_to(ROOT / package).parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in getattr(node, "names", ()) if hasattr(alias, "name")]
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{name}" for name in names]
            used = {name.split(".")[1] for name in names if name.startswith(f"{package}.")}
            rooms[room] = rooms.get(room, set()) | used
    return {room: used & {*rooms} - {room} for room, used in rooms.items()}


def draw_rooms(picture):
    """Rooms of `modal`, each above those that it imports; dark where no other room is between."""
    rooms, boxes, level = imports_of_rooms("modal"), {}, 0
    names = {"__init__": "modal", "__main__": "python -m modal"}
    figure = Figure(figsize=(7.5, 5.5))
    ax = figure.add_axes((0, 0, 1, 0.94))
    order = TopologicalSorter(rooms)
    order.prepare()
    while ready := sorted(order.get_ready()):
        for k, room in enumerate(ready):
            place, look = (k - (len(ready) - 1) / 2, level), {"boxstyle": "round", "fc": "white"}
            text = names.get(room, room)
            boxes[room] = ax.text(*place, text, ha="center", va="center", bbox=look, zorder=3)
        order.done(*ready)
        level += 1
    for room, used in rooms.items():
        for below in used:
            dark = not any(below in rooms[other] for other in used)
            style = {"arrowstyle": "->", "color": "0.2" if dark else "0.8"}
            style["connectionstyle"] = f"arc3,rad={0 if dark else 0.12}"
            style |= {
                "patchA": boxes[room].get_bbox_patch(),
                "patchB": boxes[below].get_bbox_patch(),
            }
            places = (boxes[one].get_position() for one in (below, room))
            ax.annotate("", *places, arrowprops=style, zorder=1 + dark)
    title = f"{len(rooms)} rooms, {sum(map(len, rooms.values()))} arrows"
    ax.set(xlim=(-2, 2), ylim=(-0.4, level - 0.6), title=title)
    ax.set_axis_off()
    figure.savefig(picture, dpi=100)


def show_rooms(app, doctree):
    """Put the picture of the rooms below the paragraph that speaks of its arrows."""
    if app.env.docname == "layout":
        (told,) = (p for p in doctree.findall(nodes.paragraph) if "arrows" in p.astext())
        (Path(app.srcdir) / FOLDER).mkdir(exist_ok=True)
        draw_rooms(Path(app.srcdir) / FOLDER / "rooms.png")
        image = nodes.image(uri=f"/{FOLDER}/rooms.png", alt="rooms of modal and their imports")
        told.parent.insert(told.parent.index(told) + 1, image)


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
    app.connect("doctree-read", show_rooms, priority=400)
    return {"parallel_read_safe": False}
