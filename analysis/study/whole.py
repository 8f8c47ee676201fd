"""The whole study from the results of its cases: tables, figures, targets, one page.

A case that is not there is said to be missing; nothing stands in for it.
"""

from __future__ import annotations

import shlex
from pathlib import Path

import pandas as pd

from analysis.rows import Row
from analysis.study.arrangement import arrange
from analysis.study.description import Study
from analysis.study.page import PLAIN, page
from analysis.study.results import frame_of, read_results
from analysis.study.selection import runs
from analysis.study.tables import tables, whole
from analysis.study.targets import Answer, Rules, answers, second_verdicts, targets, targets_seen
from analysis.table import Table, number, read_csv
from analysis.value import Value, estimate
from modal.formats.hdf5 import write_text
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
    output.mkdir(parents=True, exist_ok=True)
    wanted = study.settings["tables"] or study.part("tables")
    pages = {spec["name"] for spec in wanted if spec.get("page")}
    shown = [_absent(results / "absent.csv", frame), second_verdicts(found)]
    shown += tables(wanted, frame, rules, rows)
    shown, pages = [table for table in shown if table.rows], {*pages, "second_verdicts"}
    for path in sorted(results.glob("*.agreement.csv")):
        case = path.name.split(".")[0]
        shown.append(read_csv(path, f"YADE against the linear wave by cause, {case}"))
        shown[-1].name = f"split_{case}"
    for table in (whole(frame, rows), targets(found), *shown):
        if table.rows and table.name:
            table.write_csv(output / f"{table.name}.csv")
    for row in rows:
        row.values |= _of_state(frame, row)
        row.stated = rules.stated_of(row.name) if row.name in frame.index else {}
    specs = study.settings["figures"] or study.part("figures")
    figures, absent = arrange(specs, frame, rows, results, output)
    template = study.folder / "page.html.j2"
    away = frame[~frame["there"]]
    content = {
        "title": study.settings["title"] or study.settings["name"],
        "command": _shown(command),
        "summary": _summary(frame, found),
        "targets": targets_seen(found),
        "tables": shown,
        "figures": figures,
        "absent": absent,
        "notes": sorted({f"{row.name}: {note}" for row in rows for note in row.notes}),
        "provenance": Table(
            "Provenance",
            ["file", "SHA-256, first 16 digits", "command", "made from"],
            [line for row in rows for line in row.provenance],
        ),
        "frame": frame,
        "headlines": study.settings["headlines"],
        "number": number,
    }
    path = output / "study.html"
    write_text(path, page(template if template.is_file() else PLAIN, content))
    for table in (targets_seen(found), *shown):
        if table.rows and table.name in {"targets", *pages}:
            write_text(output / f"{table.name}.md", table.markdown())
    return path, len(away)


def _of_state(frame: pd.DataFrame, row: Row) -> dict[str, Value]:
    """By which void ratio figures order packings: that of the state before the cases."""
    if "void_ratio_of_state" not in frame or row.name not in frame.index:
        return {}
    return {"void_ratio_of_state": estimate(float(frame["void_ratio_of_state"][row.name]))}


def _absent(path: Path, frame: pd.DataFrame) -> Table:
    """The cases that could not be made, and why, as far as they still have no result."""
    title = "Cases that could not be made"
    table = read_csv(path, title) if path.is_file() else Table(title, ["case", "why"], [])
    away = set(frame.index[~frame["there"]])
    return Table(title, table.header, [row for row in table.rows if row[0] in away], "absent")


def _summary(frame: pd.DataFrame, found: list[Answer]) -> list[str]:
    """How many cases and targets, and what is missing."""
    there, away = frame[frame["there"]], frame[~frame["there"]]
    runs_ = int((there["record"] == "yade").sum())
    lines = [f"{len(there)} of {len(frame)} cases are there, {runs_} of them with a YADE run."]
    if len(away):
        lines.append(f"No result of case {runs(away['case'])}.")
    for kind in sorted({kind for kinds in there["absent"] for kind in kinds.split()}):
        cases = there[[kind in kinds.split() for kinds in there["absent"]]]["case"]
        lines.append(f"Absent: {kind} of case {runs(cases)}; what needs it is empty.")
    several = there[there["packings"] > 1]
    if len(several):
        most = int(several["packings"].max())
        lines.append(f"Scatter of {most} samples at most: of case {runs(several['case'])}.")
    else:
        lines.append("One sample a case: no error of the sample is known.")
    if len(unsettled := there[there["unsettled"] != ""]):
        lines.append(f"Not settled: {', '.join(unsettled.index)}.")
    if found:
        open_ = [answer.id for answer in found if not answer.finding.met]
        lines.append(f"{len(found) - len(open_)} of {len(found)} targets are met.")
        if open_:
            lines.append(f"Not met: {', '.join(open_)}; the column why says why.")
    return lines


def _shown(command: list[str]) -> str:
    """The command without a folder of this machine: paths from here on, or their last part."""
    here, parts = Path.cwd(), []
    for part in command:
        path = Path(part)
        if path.is_absolute():
            part = str(path.relative_to(here)) if path.is_relative_to(here) else path.name
        parts.append(part)
    return shlex.join(parts)


def case_of(study: Study, results: Path, name: str) -> tuple[Row, pd.DataFrame, Rules]:
    """One case's result, with what its table needs; InputError where it is not there."""
    rows = read_results(results)
    frame = frame_of(rows, study.cases)
    found = next((row for row in rows if row.name == name), None)
    if found is None:
        raise InputError(f"{results}: no result of {name}; run it first")
    return found, frame, Rules(frame, study.stated())
