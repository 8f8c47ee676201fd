"""Write the whole study from the results of its cases: tables, figures, targets, one page.

A case without a result is listed as missing, and is not replaced.
"""

import base64
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from analysis.case_result import CaseResult
from analysis.frame import frame_of, runs
from analysis.result_file import read_results
from analysis.study.description import Study
from analysis.study.fields import file_inside
from analysis.study.figure_layout import DrawnFigure, draw_figures
from analysis.study.page import page
from analysis.study.rules import Rules
from analysis.study.tables import make_tables, tabulate_all_numbers
from analysis.study.targets import (
    Answer,
    answer_targets,
    tabulate_second_verdicts,
    tabulate_targets,
)
from analysis.table import Table
from modal.formats.whole_file import write_text
from modal.tools.errors import InputError

FILES_OF_EVERY_STUDY = ("table1", "targets", "second_verdicts", "absent", "study")
"""Names of files that every study has; the study's own tables and figures must have other names."""
SPLIT_PREFIX = "split_"
"""Beginning of the names of tables that compare YADE with the linear wave of one case."""
PROVENANCE_HEADER = ["file", "SHA-256, first 16 digits", "command", "made from"]


class WrittenStudy(NamedTuple):
    """The page of a study, and how many of its cases have no result."""

    page: Path
    missing_cases: int


def write_study(study: Study, results: Path, output: Path, command: list[str]) -> WrittenStudy:
    """Write tables, figures and the page of a study to the folder `output`.

    Parameters
    ----------
    study : Study
        The study.
    results : Path
        Folder of results with the panels of their figures, and of the tables that `python -m
        analysis agreement` has made of cases. The file absent.csv in it says why cases have no
        result.
    output : Path
        Folder to write to.
    command : list of str
        Command that the page shows as its origin.

    Raises
    ------
    InputError
        If no case has a result, or if an entry of the study cannot be followed.
    """
    rows = read_results(results)
    frame = frame_of(rows, study.cases)
    if not frame["there"].any():
        raise InputError(
            "no_results", f"{results}: no result of {study.path}", remedy="run its cases first"
        )
    table_specs = study.part("tables")
    figure_specs = study.part("figures")
    _refuse_same_files([*table_specs, *figure_specs])
    rules = Rules(frame, study.stated())
    answers = answer_targets(study, frame)
    targets = tabulate_targets(answers)
    tables = [
        _tabulate_absent(results / "absent.csv", frame),
        tabulate_second_verdicts(answers),
        *make_tables(table_specs, rules),
        *_read_agreements(results, frame),
    ]
    tables = [table for table in tables if table.rows]
    names_on_pages = {"targets", "second_verdicts"}
    names_on_pages |= {spec["name"] for spec in table_specs if spec.get("page")}
    _write_tables([tabulate_all_numbers(frame), targets, *tables], names_on_pages, output)
    _add_stated_columns(frame, rules)
    figures, not_drawn = draw_figures(figure_specs, frame, results, output)
    provenance = Table(
        "Provenance", PROVENANCE_HEADER, [line for row in rows for line in row.provenance]
    )
    content = {
        "settings": {name: study.settings[name] for name in ("name", "title", "headlines")},
        "command": _shorten_paths(command),
        "cases": _known_values(frame[frame["there"]]),
        "counts": _count(frame, answers),
        "targets": asdict(_with_unbroken_errors(targets)),
        "tables": [asdict(_with_unbroken_errors(table)) for table in tables],
        "figures": list(map(_embed, figures)),
        "absent": not_drawn,
        "notes": _collect_notes(rows, frame),
        "provenance": asdict(provenance),
    }
    path = output / "study.html"
    write_text(path, page(study.folder, content))
    return WrittenStudy(path, int((~frame["there"]).sum()))


def _refuse_same_files(specs: Sequence[Mapping[str, Any]]) -> None:
    """Raise InputError if two tables or figures have the same file, or that of a standard table."""
    taken = set(FILES_OF_EVERY_STUDY)
    for spec in specs:
        name = spec["name"].lower()
        if name in taken or name.startswith(SPLIT_PREFIX):
            raise InputError(
                "same_name", f"{spec['name']}: another file has this name", remedy="rename it"
            )
        taken.add(name)


def _read_agreements(results: Path, frame: pd.DataFrame) -> list[Table]:
    """Return the tables of a folder that compare YADE's wave of a case with the linear one."""
    tables = []
    for path in sorted(results.glob("*.agreement.csv")):
        case = path.name.split(".")[0]
        if case in frame.index:
            title = f"YADE against the linear wave by cause, {case}"
            header, rows = _read_table(path)
            tables.append(Table(title, header, rows, f"{SPLIT_PREFIX}{case}"))
    return tables


def _write_tables(tables: Sequence[Table], names_on_pages: set[str], output: Path) -> None:
    """Write tables that have rows as CSV; those in `names_on_pages` also as Markdown."""
    for table in tables:
        if not table.rows:
            continue
        table.write_csv(file_inside(output, f"{table.name}.csv"))
        if table.name in names_on_pages:
            write_text(file_inside(output, f"{table.name}.md"), table.markdown())


def _add_stated_columns(frame: pd.DataFrame, rules: Rules) -> None:
    """Add, for each stated quantity, columns with the ends of its interval."""
    for row, names in rules.statements:
        quantity = row["quantity"]
        columns = [f"{quantity}_stated", f"{quantity}_stated_to"]
        frame.loc[names, columns] = row[["low", "high"]].to_list()


def _known_values(cases: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return the known numbers and texts of each case, by name."""
    values = {}
    for name, case in cases.iterrows():
        plain = {key: value for key, value in case.items() if _is_plain(value)}
        # NaN is the only value that differs from itself.
        values[str(name)] = {key: value for key, value in plain.items() if value == value}
    return values


def _is_plain(value: Any) -> bool:
    """Tell whether a page can show a value: a text or a number."""
    return isinstance(value, str | int | float | np.number)


def _count(frame: pd.DataFrame, answers: Sequence[Answer]) -> dict[str, Any]:
    """Return the numbers of cases and targets, and the missing results of cases."""
    present = frame[frame["there"]]
    missing = frame[~frame["there"]]
    sampled = present[present["packings"] > 1]
    # One line for each kind of file that a case lacks.
    lacking = present["absent"].str.split().explode().dropna()
    cases_by_kind = []
    for kind in sorted(lacking.unique()):
        names = lacking.index[lacking == kind]
        cases_by_kind.append((kind, runs(present["case"][names])))
    unmet = [answer.spec["id"] for answer in answers if not answer.finding.met]
    return {
        "there": len(present),
        "all": len(frame),
        "yade": int((present["record"] == "yade").sum()),
        "away": runs(missing["case"]),
        "absent": cases_by_kind,
        "samples": int(present["packings"].max()),
        "sampled": runs(sampled["case"]),
        "unsettled": ", ".join(present.index[present["unsettled"] != ""]),
        "targets": len(answers),
        "met": len(answers) - len(unmet),
        "open": ", ".join(unmet),
    }


def _embed(figure: DrawnFigure) -> dict[str, str]:
    """Return a figure with its image as text, so that the page contains the image."""
    return {
        "name": figure.name,
        "alt": figure.alt,
        "caption": figure.caption,
        "png": base64.b64encode(figure.png.read_bytes()).decode(),
    }


def _with_unbroken_errors(table: Table) -> Table:
    """Return a table whose numbers stay in one line with their errors."""
    rows = [[cell.replace(" ± ", "\u00a0±\u00a0") for cell in row] for row in table.rows]
    return replace(table, rows=rows)


def _collect_notes(rows: Iterable[CaseResult], frame: pd.DataFrame) -> list[str]:
    """Return each note once, with the number of packings that have it, and which these are."""
    names_by_note: dict[str, set[str]] = {}
    for row in rows:
        for note in row.notes:
            names_by_note.setdefault(note, set()).add(row.name)
    lines = []
    for note, names in sorted(names_by_note.items()):
        cases = frame.index.intersection(sorted(names))
        texts = []
        if len(cases):
            texts.append(f"case {runs(frame['case'][cases])}")
        texts += sorted(names.difference(cases))
        count = "1 packing" if len(names) == 1 else f"{len(names)} packings"
        lines.append(f"{note} ({count}: {', '.join(texts)})")
    return lines


def _tabulate_absent(path: Path, frame: pd.DataFrame) -> Table:
    """Return the cases that could not be made and still have no result, with the reasons."""
    header = ["case", "why"]
    rows: list[list[str]] = []
    if path.is_file():
        header, rows = _read_table(path)
    missing = set(frame.index[~frame["there"]])
    rows = [row for row in rows if row[0] in missing]
    return Table("Cases that could not be made", header, rows, "absent")


def _read_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return header and cells of a table that was written before; InputError if invalid."""
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except ValueError as error:
        raise InputError(
            "no_table", f"{path}: no table ({error})", remedy="make it again"
        ) from None
    return list(table.columns), table.to_numpy().tolist()


def _shorten_paths(command: list[str]) -> str:
    """Return a command as text, without folders of this machine.

    Paths below the working folder are relative to it; of other paths only the last part remains.
    """
    words = []
    for word in command:
        relative = word.removeprefix(f"{Path.cwd()}/")
        if Path(relative).is_absolute():
            relative = Path(relative).name
        words.append(relative)
    return shlex.join(words)
