"""The commands of a study: result, of one case, and study, of all results."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from analysis.cli.options import add_command
from analysis.study.arrangement import wanted
from analysis.study.beside import table_of
from analysis.study.description import Study
from analysis.study.measuring import of_case, of_quantities, of_seed, of_state
from analysis.study.targets import Rules
from analysis.study.whole import case_of, write_study
from modal.cli.options import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The commands' options."""
    text = "one case of a study measured: its result, a JSON file, for `study`"
    example = "result mine --study studies/friction_width.yaml -o mine.json"
    result = add_command(commands, "result", text, example, _result)
    result.add_argument("case", metavar="CASE", help="its name in the study, or of a state")
    result.add_argument("file", nargs="*", metavar="FILE", help="its packing and waves, or a state")
    result.add_argument("--products", default="products", metavar="DIR", help="folder to read")
    kind = result.add_mutually_exclusive_group()
    kind.add_argument("--state", action="store_true", help="FILE is a state that is no case")
    kind.add_argument("--scatter", action="store_true", help="only numbers that show a scatter")
    result.add_argument("-o", "--output", required=True, metavar="FILE", help="*.json")
    text = "all results of a study: tables, figures, targets, one page; in seconds"
    example = "study studies/friction_width.yaml --results products/results"
    whole = add_command(commands, "study", text, example, _study)
    whole.add_argument("study", metavar="YAML", help="the study")
    whole.add_argument("--results", default="products/results", metavar="DIR", help="to read")
    whole.add_argument("--case", metavar="NAME", help="print the table of one case, write nothing")
    whole.add_argument(
        "-o", "--output", type=NewFolder, default="products/study", metavar="DIR", help="write to"
    )
    result.add_argument("--study", required=True, metavar="YAML", help="the study")


def _result(options: argparse.Namespace) -> int:
    study, output = Study(options.study), Path(options.output)
    output.parent.mkdir(parents=True, exist_ok=True)
    files = [Path(text) for text in options.file]
    if options.state:
        of_state(options.case, files[0], output)
        return 0
    if options.case not in study.rows:
        raise InputError(f"{options.case}: no case of {options.study}")
    if options.scatter:
        of_seed(options.case, Path(options.products), output)
    elif quantities := study.settings["measure"]:
        of_quantities(options.case, files, output, quantities)
    else:
        specs = study.settings["figures"] or study.part("figures")
        figures = wanted(specs, study.cases.loc[[options.case]])
        stated = Rules(study.cases, study.stated()).stated_of(options.case)
        of_case(options.case, Path(options.products), output, figures, stated)
    put(output)
    return 0


def _study(options: argparse.Namespace) -> int:
    study, results, output = Study(options.study), Path(options.results), Path(options.output)
    if not results.is_dir():
        raise InputError(f"{results}: no such folder; give --results DIR")
    if options.case:
        row, frame, rules = case_of(study, results, options.case)
        table = table_of(row, frame, rules)
        put(f"{table.title}\n{table.text()}")
        put("".join(f"note: {note}\n" for note in row.notes), end="")
        return 0
    try:
        page, missing = write_study(
            study, results, output, ["python", "-m", "analysis", *options.argv]
        )
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    put(page)
    return 3 if missing else 0
