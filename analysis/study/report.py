"""The whole study from the results of its cases: tables, figures, targets, one page.

A case that is not there is said to be missing; nothing stands in for it.
"""

import base64
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.frame import frame_of, runs
from analysis.rows import read_results
from analysis.study.description import Study
from analysis.study.fields import inside
from analysis.study.figure_layout import arrange
from analysis.study.page import page
from analysis.study.tables import tables, whole
from analysis.study.targets import Answer, Rules, answers, second_verdicts, targets
from analysis.table import Table
from modal.formats.whole_file import write_text
from modal.tools.errors import InputError

OF_EVERY_STUDY = "table1", "targets", "second_verdicts", "absent", "study"
SPLIT = "split_"
"""Names of files that every study has, and how others of them begin."""


def write_study(study: Study, results: Path, output: Path, command: list[str]) -> tuple[Path, int]:
    """Write tables, figures and the page of a study to `output`; the page, and missing cases.

    `results` is a folder of results with the panels of their figures, and of the tables that
    `python -m analysis agreement` has made of a case; absent.csv says why cases have none.
    """
    rows = read_results(results)
    frame = frame_of(rows, study.cases)
    if not frame["there"].any():
        raise InputError(
            "input", f"{results}: no result of {study.path}", remedy="run its cases first"
        )
    specs, drawn = study.part("tables"), study.part("figures")
    _refuse_same_files([*specs, *drawn])
    rules, found = Rules(frame, study.stated()), answers(study, frame)
    goals = targets(found)
    shown = [_absent(results / "absent.csv", frame), second_verdicts(found)]
    shown += tables(specs, rules)
    for path in sorted(results.glob("*.agreement.csv")):
        case = path.name.split(".")[0]
        title = f"YADE against the linear wave by cause, {case}"
        if case in frame.index:
            shown.append(Table(title, *_read(path), f"{SPLIT}{case}"))
    shown = [table for table in shown if table.rows]
    of_pages = {"targets", "second_verdicts", *(s["name"] for s in specs if s.get("page"))}
    for table in (each for each in (whole(frame), goals, *shown) if each.rows):
        table.write_csv(inside(output, f"{table.name}.csv"))
        if table.name in of_pages:
            write_text(inside(output, f"{table.name}.md"), table.markdown())
    for line, index in rules.lines:
        name = line["quantity"]
        frame.loc[index, [f"{name}_stated", f"{name}_stated_to"]] = line[["low", "high"]].to_list()
    figures, absent = arrange(drawn, frame, results, output)
    header = ["file", "SHA-256, first 16 digits", "command", "made from"]
    provenance = Table("Provenance", header, [line for row in rows for line in row.provenance])
    content = {
        "settings": {name: study.settings[name] for name in ("name", "title", "headlines")},
        "command": _shown(command),
        "cases": _plain(frame[frame["there"]]),
        "counts": _counts(frame, found),
        "targets": asdict(goals),
        "tables": list(map(asdict, shown)),
        "figures": [_figure(png, caption) for png, caption in figures],
        "absent": absent,
        "notes": sorted({f"{row.name}: {note}" for row in rows for note in row.notes}),
        "provenance": asdict(provenance),
    }
    path = output / "study.html"
    write_text(path, page(study.folder, content))
    return path, int((~frame["there"]).sum())


def _refuse_same_files(specs: Sequence[Mapping[str, Any]]) -> None:
    """InputError where two tables or figures would have one file, or one of every study."""
    taken = set(OF_EVERY_STUDY)
    for name in (spec["name"] for spec in specs):
        if name.lower() in taken or name.lower().startswith(SPLIT):
            raise InputError("same_name", f"{name}: another file is called so", remedy="rename it")
        taken.add(name.lower())


def _plain(cases: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """The numbers and texts of each case that are known, by name."""
    return {
        str(name): {
            column: value
            for column, value in case.items()
            if isinstance(value, str | int | float | np.number) and value == value
        }
        for name, case in cases.iterrows()
    }


def _counts(frame: pd.DataFrame, found: list[Answer]) -> dict[str, Any]:
    """How many cases and targets there are, and which of them lack what."""
    there, away = frame[frame["there"]], frame[~frame["there"]]
    several = there[there["packings"] > 1]
    absent = there["absent"].str.split().explode().dropna()
    lacking = {kind: absent.index[absent == kind] for kind in sorted(absent.unique())}
    still_open = [spec["id"] for spec, finding, _ in found if not finding.met]
    return {
        "there": len(there),
        "all": len(frame),
        "yade": int((there["record"] == "yade").sum()),
        "away": runs(away["case"]),
        "absent": [(kind, runs(there["case"][names])) for kind, names in lacking.items()],
        "samples": int(there["packings"].max()),
        "sampled": runs(several["case"]),
        "unsettled": ", ".join(there.index[there["unsettled"] != ""]),
        "targets": len(found),
        "met": len(found) - len(still_open),
        "open": ", ".join(still_open),
    }


def _figure(png: Path, caption: str) -> dict[str, str]:
    """A figure as the page has it within itself."""
    return {
        "name": png.stem,
        "caption": caption,
        "png": base64.b64encode(png.read_bytes()).decode(),
    }


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
        raise InputError("input", f"{path}: no table ({error})", remedy="make it again") from None
    return list(found.columns), found.to_numpy().tolist()


def _shown(command: list[str]) -> str:
    """The command without a folder of this machine: paths from here on, or their last part."""
    from_here = [part.removeprefix(f"{Path.cwd()}/") for part in command]
    return shlex.join(Path(part).name if Path(part).is_absolute() else part for part in from_here)
