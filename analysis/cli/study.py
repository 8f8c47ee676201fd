"""The command study: its cases measured, what of them is stale, and all results on one page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from analysis.cli.options import add_command, add_products
from analysis.study.beside import table_of
from analysis.study.description import Study
from analysis.study.measuring import measure_case
from analysis.study.whole import case_of, write_study
from modal.cli.table import NewFile, NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The command's options: of the whole, then of its stages."""
    text = (
        "all results of a study: tables, figures, targets, a page, in seconds; or one of its stages"
    )
    example = "study studies/friction_width.yaml --results products/results"
    study = add_command(commands, "study", text, example, _study)
    study.add_argument("study", metavar="YAML", help="the study")
    study.add_argument("file", nargs="*", metavar="FILE", help="packing and waves to --measure")
    study.add_argument("--results", default="products/results", metavar="DIR", help="to read")
    study.add_argument(
        *("-o", "--output"),
        type=lambda text: NewFile(text) if text.endswith(".json") else NewFolder(text),
        default=NewFolder("products/study"),
        metavar="DIR",
        help="folder to write to; with --measure the file, *.json",
    )
    add_products(study)
    stage = study.add_mutually_exclusive_group()
    stage.add_argument("--measure", metavar="NAME", help="write the result of a case, of a state")
    stage.add_argument("--case", metavar="NAME", help="print the table of a case, write nothing")
    text = "measure only numbers that show a scatter"
    study.add_argument("--scatter", action="store_true", help=text)


def _study(options: argparse.Namespace) -> int:
    results, output, products = map(Path, (options.results, options.output, options.products))
    study = Study(options.study)
    if options.measure:
        if not isinstance(options.output, NewFile):
            raise InputError(f"-o {output}: a result is a file; name it *.json")
        files = list(map(Path, options.file))
        measure_case(study, options.measure, files, products, output, options.scatter)
        put(output)
        return 0
    if not results.is_dir():
        raise InputError(f"{results}: no such folder; give --results DIR")
    if options.case:
        row, frame, rules = case_of(study, results, options.case)
        table = table_of(row, frame, rules)
        put(f"{table.title}\n{table.text()}")
        put("".join(f"note: {note}\n" for note in row.notes), end="")
    else:
        command = ["python", "-m", "analysis", *options.argv]
        try:
            page, missing = write_study(study, results, output, command)
        except OSError as error:
            raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
        put(page)
        return 3 if missing else 0
    return 0
