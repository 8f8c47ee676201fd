"""The whole study from the results of its cases: tables, figures, targets, one page.

A case that is not there is said to be missing; nothing stands in for it.
"""

import base64
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from analysis.frame import frame_of, runs
from analysis.rows import read_results
from analysis.study.arrangement import arrange
from analysis.study.description import Study
from analysis.study.tables import tables, whole
from analysis.study.targets import Rules, answers, second_verdicts, targets
from analysis.table import Table, number
from modal.formats.whole_file import write_text
from modal.tools.errors import InputError


def write_study(study: Study, results: Path, output: Path, command: list[str]) -> tuple[Path, int]:
    """Write tables, figures and the page of a study to `output`; the page, and missing cases.

    `results` is a folder of results with the panels of their figures, and of the tables that
    `python -m analysis agreement` has made of a case; absent.csv says why cases have none.
    """
    rows = read_results(results)
    frame = frame_of(rows, study.cases)
    if not frame["there"].any():
        raise InputError(f"{results}: no result of {study.path}; run its cases first")
    rules, found = Rules(frame, study.stated()), answers(study, frame)
    specs, goals = study.part("tables"), targets(found)
    shown = [_absent(results / "absent.csv", frame), second_verdicts(found)]
    shown += tables(specs, rules)
    for path in sorted(results.glob("*.agreement.csv")):
        case = path.name.split(".")[0]
        title = f"YADE against the linear wave by cause, {case}"
        shown.append(Table(title, *_read(path), f"split_{case}"))
    shown = [table for table in shown if table.rows]
    of_pages = {"targets", "second_verdicts", *(s["name"] for s in specs if s.get("page"))}
    for table in (each for each in (whole(frame), goals, *shown) if each.rows):
        table.write_csv(output / f"{table.name}.csv")
        if table.name in of_pages:
            write_text(output / f"{table.name}.md", table.markdown())
    for line, index in rules.lines:
        name = line["quantity"]
        frame.loc[index, [f"{name}_stated", f"{name}_stated_to"]] = line[["low", "high"]].to_list()
    figures, absent = arrange(study.part("figures"), frame, results, output)
    header = ["file", "SHA-256, first 16 digits", "command", "made from"]
    provenance = [line for row in rows for line in row.provenance]
    content = {
        "settings": study.settings,
        "command": _shown(command),
        "frame": frame,
        "answers": found,
        "targets": goals,
        "tables": shown,
        "figures": figures,
        "absent": absent,
        "notes": sorted({f"{row.name}: {note}" for row in rows for note in row.notes}),
        "provenance": Table("Provenance", header, provenance),
    }
    path = output / "study.html"
    write_text(path, page(study.folder, content))
    return path, int((~frame["there"]).sum())


TEMPLATES = Path(__file__).parent


def page(folder: Path, content: Mapping[str, Any]) -> str:
    """The page by the study's page.html.j2, which may extend plain.html.j2, else by that.

    It refers to nothing outside it.
    """
    loader = jinja2.FileSystemLoader([str(folder), str(TEMPLATES)])
    own = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    own.filters["base64"] = lambda path: base64.b64encode(path.read_bytes()).decode()
    own.filters["anchor"] = lambda title: "".join(c if c.isalnum() else "-" for c in title.lower())
    own.globals |= {"runs": runs, "number": number}
    return own.select_template(["page.html.j2", "plain.html.j2"]).render(content)


def _absent(path: Path, frame: pd.DataFrame) -> Table:
    """The cases that could not be made, and why, as far as they still have no result."""
    header, rows = _read(path) if path.is_file() else (["case", "why"], [])
    away = set(frame.index[~frame["there"]])
    rows = [row for row in rows if row[0] in away]
    return Table("Cases that could not be made", header, rows, "absent")


def _read(path: Path) -> tuple[list[str], list[list[str]]]:
    """Header and cells of a table that was written before."""
    try:
        found = pd.read_csv(path, dtype=str, keep_default_na=False)
    except ValueError as error:
        raise InputError(f"{path}: no table ({error}); make it again") from None
    return list(found.columns), found.to_numpy().tolist()


def _shown(command: list[str]) -> str:
    """The command without a folder of this machine: paths from here on, or their last part."""
    from_here = [part.removeprefix(f"{Path.cwd()}/") for part in command]
    return shlex.join(Path(part).name if Path(part).is_absolute() else part for part in from_here)
