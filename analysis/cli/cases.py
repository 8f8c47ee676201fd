"""Commands on the cases of a folder: compare, report, figure, prepare, status."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from analysis.belonging import cases_of
from analysis.case import Case
from analysis.case_files import case_name
from analysis.case_tables import tables
from analysis.cli.options import CASE, add_command, add_products
from analysis.crystal import compare, comparison_table, stress_rows
from analysis.estimators.power_law import power_law
from analysis.figures import FIGURES, draw
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.measures import Measures
from analysis.prepare import KINDS, prepare
from analysis.report import report as write_report
from analysis.status import stale_files, status_table
from modal.cli.options import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError

COMPARED = (
    "signals",
    "space_time",
    "spectrum_distance",
    "dispersion",
    "gain",
    "natural_frequencies",
    "chi_z",
    "mode_shapes",
)
"""Figures of `compare`, one of each for every case."""


def add(commands: Any) -> None:
    """The commands' options."""
    text = "one HTML page: tables, figures, deviations, provenance"
    report = add_command(commands, "report", text, "report 2 -o pages", _report)
    text = "print and write the comparison table, draw the figures"
    compared = add_command(commands, "compare", text, "compare 2 -o pages", _compare)
    compared.add_argument("--no-figures", action="store_true", help="only the table")
    text = "draw one figure of the cases, or again from its own CSV"
    figure = add_command(commands, "figure", text, "figure dispersion 2 -o pages", _figure)
    figure.add_argument("name", metavar="NAME", help="a CSV file, or " + ", ".join(FIGURES))
    for command, count in ((report, "+"), (compared, "+"), (figure, "*")):
        add_products(command)
        command.add_argument("case", nargs=count, metavar="CASE", help=CASE)
        command.add_argument(
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
    status.add_argument("--cases", default="cases", metavar="DIR", help="tables of the cases")
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


def _compare(options: argparse.Namespace) -> None:
    _on_cases(options, lambda cases, output: _compared(cases, output, not options.no_figures))


def _compared(cases: list[Case], output: Path, figures: bool) -> None:
    for case in cases:
        put(f"\n{case.name}  stress {case.network.study.get('stress', float('nan')):g} Pa")
        paths = _crystal(case, output) if case.is_crystal else _random(case, output)
        for kind in ("modes", "translations.modes", "signals"):
            if not case.has(kind):
                put(f"note: {case.path(kind)} is absent; what needs it is left empty")
        if figures:
            paths += _figures(COMPARED, [Measures(case)], output, f"{case.name}.")
        _list(paths)
    crystals = [case for case in cases if case.is_crystal and np.isfinite(case.stress)]
    if len(crystals) > 1:
        columns = stress_rows(crystals)
        for name in ("theory", "modal", "yade"):
            law = power_law(columns["stress_Pa"], columns[f"velocity_{name}_m_per_s"])
            if np.isfinite(law.exponent):
                put(f"exponent of V_P against stress, {name}: {law.exponent:.5f} (paper: 1/6)")
        if figures:
            measured = [Measures(case) for case in crystals]
            _list(_figures(("stress_dependence",), measured, output, ""))


def _list(paths: list[Path]) -> None:
    put("\n".join(str(path) for path in paths))


def _crystal(case: Case, output: Path) -> list[Path]:
    """Theory, modes, linear wave and YADE side by side."""
    found = comparison_table(compare(case))
    put(found.text())
    return found.write(output / f"{case.name}.comparison")


def _random(case: Case, output: Path) -> list[Path]:
    """A random packing has no theory: its own row of Table 1, and the paper's numbers."""
    found = tables([Measures(case)])
    paths = []
    for name in ("table1", "paper"):
        if name in found:
            put(f"{found[name].title}\n{found[name].text()}")
            paths += found[name].write(output / f"{case.name}.{name}")
    return paths


def _figures(
    names: tuple[str, ...], cases: list[Measures], output: Path, prefix: str
) -> list[Path]:
    """Draw what the products allow."""
    paths = []
    for name in names:
        try:
            paths += draw(name, cases, output / f"{prefix}{name}")
        except InputError as error:
            put(f"note: no figure {name}: {error}")
    return paths


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


def _report(options: argparse.Namespace) -> None:
    def work(cases: list[Case], output: Path) -> None:
        measured = [Measures(case) for case in cases]
        for table in tables(measured).values():
            put(f"{table.title}\n{table.text()}\n")
        put(write_report(measured, output, ["python", "-m", "analysis", *options.argv])[0])

    _on_cases(options, work)


def _prepare(options: argparse.Namespace) -> None:
    for case in cases_of(options.case, options.products):
        put("".join(f"{path}\n" for path in prepare(case, options.kind)), end="")


def _status(options: argparse.Namespace) -> None:
    folder, tables_of_cases = Path(options.products), Path(options.cases)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give --products DIR")
    if options.stale:
        names = [case_name(text) for text in options.stale]
        put("".join(f"{path}\n" for path in stale_files(folder, tables_of_cases, names)), end="")
    else:
        put(status_table(folder, tables_of_cases))
