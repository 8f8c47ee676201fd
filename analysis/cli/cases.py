"""Commands on the cases of a folder: figure, prepare, status."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from analysis.belonging import cases_of
from analysis.case import Case
from analysis.case_files import case_name
from analysis.cli.options import CASE, add_command, add_products
from analysis.figures import FIGURES, draw
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.measures import Measures
from analysis.prepare import KINDS, prepare
from analysis.status import Settings, stale_files, status_table
from modal.cli.options import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The commands' options."""
    text = "draw one figure of the cases, or again from its own CSV"
    figure = add_command(commands, "figure", text, "figure dispersion 2 -o pages", _figure)
    figure.add_argument("name", metavar="NAME", help="a CSV file, or " + ", ".join(FIGURES))
    add_products(figure)
    figure.add_argument("case", nargs="*", metavar="CASE", help=CASE)
    figure.add_argument(
        "-o", "--output", type=NewFolder, default="products", metavar="DIR", help="to write to"
    )
    text = "what a report needs beside the run's products: gain, density of states, ridge"
    example = "prepare 2 --kind response"
    prepared = add_command(commands, "prepare", text, example, _prepare)
    add_products(prepared)
    prepared.add_argument("case", nargs="+", metavar="CASE", help=CASE)
    prepared.add_argument("--kind", nargs="+", choices=KINDS, default=KINDS, help="only these")
    text = "which cases have which products, and which are stale and why"
    status = add_command(commands, "status", text, "status --products products", _status)
    add_products(status)
    status.add_argument("--study", metavar="YAML", help="the study, for the cases' settings")
    status.add_argument("--stale", nargs="+", metavar="CASE", help="names of stale files alone")


def _on_cases(options: argparse.Namespace, work: Callable[[list[Case], Path], None]) -> None:
    """Do work that writes into --output, then print what the cases' reader should know."""
    cases = cases_of(options.case, options.products)
    for case in cases:
        case.check()
    output = Path(options.output)
    try:
        output.mkdir(parents=True, exist_ok=True)
        work(cases, output)
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")


def _list(paths: list[Path]) -> None:
    put("\n".join(str(path) for path in paths))


def _figure(options: argparse.Namespace) -> None:
    name: str = options.name

    def work(cases: list[Case], output: Path) -> None:
        if name.endswith(".csv"):
            if cases:
                raise InputError("a figure's CSV holds its cases already; leave CASE out")
            _list(save(read_picture(name), output / Path(name).stem))
        elif cases:
            stem = output / ".".join([*(case.name for case in cases), name])
            _list(draw(name, [Measures(case) for case in cases], stem))
        else:
            raise InputError("no case given; name at least one, or the CSV file of a figure")

    _on_cases(options, work)


def _prepare(options: argparse.Namespace) -> None:
    for case in cases_of(options.case, options.products):
        put("".join(f"{path}\n" for path in prepare(case, options.kind)), end="")


def _status(options: argparse.Namespace) -> None:
    folder = Path(options.products)
    settings: Settings = {}
    if options.study:
        from analysis.study.description import Study  # which needs pandas and YAML

        settings = Study(options.study).rows
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give --products DIR")
    if options.stale:
        names = [case_name(text) for text in options.stale]
        put("".join(f"{path}\n" for path in stale_files(folder, settings, names)), end="")
    else:
        put(status_table(folder, settings))
