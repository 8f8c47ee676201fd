"""The report: one HTML page without references to anything outside it, and its single files."""

from __future__ import annotations

import shlex
from pathlib import Path

from analysis.case_files import EXTRA_KINDS, KINDS
from analysis.case_tables import tables
from analysis.figures import FIGURES, compose
from analysis.figures.render import save
from analysis.measures import Measures
from analysis.page import Section, figure_html, list_html, made_by, page, table_html
from analysis.table import Table
from modal.formats.hdf5 import sha256, write_text
from modal.formats.provenance import read_provenance
from modal.tools.errors import InputError

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
    paths, sections = [], []
    for name, table in tables(cases).items():
        paths += table.write(output / name)
        sections.append(Section(table.title, table_html(table)))
    absent, drawn = [], []
    for name, entry in FIGURES.items():
        try:
            picture = compose(name, cases)
        except InputError as error:
            absent.append(f"{name}: {error}")
            continue
        png, csv = save(picture, output / name)
        paths += [png, csv]
        drawn.append(figure_html(png, entry.caption))
    sections.append(Section("Figures", "".join(drawn)))
    if absent:
        items = [without_folder(text, cases) for text in absent]
        sections.append(Section("Not drawn", list_html(items)))
    sections.append(Section("Provenance", table_html(provenance_table(cases))))
    above = (
        "<p>After Otsubo, O'Sullivan, Hanley and Sim, Granular Matter 19:50 (2017). Values with ± "
        "carry their standard error; that of a threshold's frequency is half the quartile distance "
        "of its values. V_P is of a wall that pushes, V_S of one that slides. "
        "YADE is the recorded run; linear wave, the wave of its network's springs "
        "alone, without the pre-stress of the contacts; unless they name YADE, values are of the "
        "linear wave.</p>" + made_by(shown(command))
    )
    path = output / "report.html"
    title = "Waves in sphere packings: " + ", ".join(m.case.name for m in cases)
    write_text(path, page(title, above, sections))
    return [path, *paths]


def shown(command: list[str]) -> str:
    """The command without a folder of this machine: paths from here on, or their last part."""
    here = Path.cwd()
    parts = []
    for part in command:
        path = Path(part)
        if path.is_absolute():
            part = str(path.relative_to(here)) if path.is_relative_to(here) else path.name
        parts.append(part)
    return shlex.join(parts)


def without_folder(text: str, cases: list[Measures]) -> str:
    """A message without the folders of the cases' files."""
    for m in cases:
        for folder in {m.case.path(kind).parent for kind in (*KINDS, *EXTRA_KINDS)}:
            text = text.replace(f"{folder}/", "")
    return text


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
