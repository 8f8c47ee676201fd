"""Make all results of a study: tables, figures, targets and a page; or run one stage."""

import textwrap
from pathlib import Path

from analysis.study.case_table import WIDTH, case_text
from analysis.study.description import Study
from analysis.study.measure_case import measure_case
from analysis.study.report import write_study
from modal.cli.options import Group, NewFile, NewFolder, Option, Options, flag, output_folder
from modal.cli.terminal import put
from modal.tools.errors import InputError

EXAMPLE = "study studies/friction_width.yaml --results products/results"


def _new(text: str) -> NewFile | NewFolder:
    return NewFile(text) if text.endswith(".json") else NewFolder(text)


TO = "folder to write to; with --measure the file, *.json"
OPTIONS = [
    Option("study", "YAML", "the study", kind=str),
    Option("file", "FILE", "packing and waves to --measure", kind=str, more={"nargs": "*"}),
    Option("--results", "DIR", "to read", "products/results", str),
    output_folder(TO, "products/study")._replace(kind=_new),
    Option("--products", "DIR", "folder to read", "products", str),
    Group(
        "",
        [
            Option("--measure", "NAME", "write the result of a case, of a state", kind=str),
            Option("--case", "NAME", "print the table of a case, write nothing", kind=str),
        ],
    ),
    flag("--scatter", "measure only numbers that show a scatter"),
]


def run(options: Options) -> int:
    """Run one stage of a study, or all; return 3 if the page lacks cases."""
    results, folder, products = map(Path, (options.results, options.output, options.products))
    study = Study(options.study)
    if options.file and not options.measure:
        raise InputError(
            "file_not_read", "FILE is for --measure NAME", remedy="leave it out: --results are read"
        )
    if options.measure:
        if not isinstance(options.output, NewFile):
            raise InputError(
                "output_name", f"-o {folder}: a result is a file", remedy="name it *.json"
            )
        files = list(map(Path, options.file))
        measure_case(study, options.measure, files, products, folder, options.scatter)
        put(folder)
        return 0
    if not results.is_dir():
        raise InputError("no_folder", f"{results}: no such folder", remedy="give --results DIR")
    if options.case:
        text, notes = case_text(study, results, options.case)
        put(text)
        for note in notes:
            put(textwrap.fill(f"note: {note}", WIDTH, subsequent_indent="      "))
        return 0
    page, missing = write_study(study, results, folder, ["python", "-m", "analysis", *options.argv])
    put(page)
    return 3 if missing else 0
