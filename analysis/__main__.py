"""Command line of analysis: compare, status, figure, samples, agreement."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NoReturn

import numpy as np

from analysis.agreement import OTHER_RUNS, Agreement, report
from analysis.compare import as_text, compare, write_table
from analysis.figures import CROSS_CASE, FIGURES, draw
from analysis.figures.crystal import power_law, stress_rows
from analysis.products import Products, find
from analysis.samples import table
from analysis.status import status_table
from modal.network import read_network
from modal.signals import read_signals
from modal.storage import InputError


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{self.prog}: {message}; see {self.prog} --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="python -m analysis", description="Compare theory, modes and YADE")
    commands = parser.add_subparsers(dest="command", required=True, parser_class=_Parser)

    def command(name: str, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.add_argument("--products", default="products", metavar="DIR", help="folder to read")
        return sub

    compared = command("compare", "print and write the comparison table, draw the figures")
    compared.add_argument("case", nargs="+", metavar="CASE", help="1 ... 4")
    compared.add_argument("--no-figures", action="store_true", help="only the table")
    figure = command("figure", "draw one figure")
    figure.add_argument("name", metavar="NAME", help=", ".join(sorted((*FIGURES, *CROSS_CASE))))
    figure.add_argument("case", nargs="+", metavar="CASE", help="1 ... 4")
    for sub in (compared, figure):
        sub.add_argument("-o", "--output", default="products", metavar="DIR", help="to write to")
    command("status", "which cases have which products")
    text = "table of compact samples: density, contacts, stresses, balance"
    samples = commands.add_parser("samples", help=text, description=text)
    samples.add_argument("sample", nargs="+", metavar="FILE", help="*.sample.h5")
    samples.add_argument("-o", "--output", metavar="FILE", help="write the table, *.md")
    text = "a DEM run against the linear wave of its network, the difference split by cause"
    agree = commands.add_parser("agreement", help=text, description=text)
    agree.add_argument("network", help="*.network.h5 of the run")
    agree.add_argument("signals", help="*.signals.h5 of the DEM run")
    for name, what in OTHER_RUNS.items():
        agree.add_argument(f"--{name.replace('_', '-')}", metavar="FILE", help=what)
    agree.add_argument("--first", type=int, metavar="N", help="up to the chain's N-th particle")
    agree.add_argument("-o", "--output", metavar="FILE", help="write the tables, *.md")
    return parser


def _compare(cases: list[Products], output: Path, figures: bool) -> None:
    for case in cases:
        rows = compare(case)
        print(f"\n{case.name}  stress {case.network.study.get('stress', float('nan')):g} Pa")
        print(as_text(rows))
        for kind in ("modes", "translations.modes", "signals"):
            if not case.has(kind):
                print(f"note: {case.path(kind)} is absent; what needs it is left empty")
        paths = write_table(rows, output / f"{case.name}.comparison")
        if figures:
            for name in FIGURES:
                paths += draw(name, [case], output, missing_ok=True)
        print("\n".join(str(path) for path in paths))
    if len(cases) > 1:
        columns = stress_rows(cases)
        for name in ("theory", "modal", "yade"):
            exponent = power_law(columns["stress_Pa"], columns[f"velocity_{name}_m_per_s"])
            if np.isfinite(exponent):
                print(f"exponent of V_P against stress, {name}: {exponent:.5f} (paper: 1/6)")
    if figures and len(cases) > 1:
        for name in CROSS_CASE:
            print("\n".join(str(path) for path in draw(name, cases, output, missing_ok=True)))


def _agreement(arguments: argparse.Namespace) -> None:
    network, run = read_network(arguments.network), read_signals(arguments.signals)
    within = np.inf
    if arguments.first is not None:
        if not 1 <= arguments.first <= len(run.chain_position):
            raise InputError(f"--first {arguments.first}: the chain has {len(run.chain_position)}")
        z = np.sort(run.chain_position)[arguments.first - 1]
        within = (z - network.wall_position[0]) * (1 + 1e-9)
    paths = {name: getattr(arguments, name) for name in OTHER_RUNS}
    others = {name: read_signals(path) for name, path in paths.items() if path}
    _show(report(Agreement(network, run, within), **others), arguments.output)


def _show(text: str, output: str | None) -> None:
    print(text, end="")
    if output:
        Path(output).write_text(text)


def main(argv: list[str] | None = None) -> int:
    """Run one command; exit status 0, or 2 with one line on stderr for a user's mistake."""
    try:
        arguments = _parser().parse_args(argv)
        if arguments.command == "status":
            folder = Path(arguments.products)
            if not folder.is_dir():
                raise InputError(f"{folder}: no such folder; give --products DIR")
            print(status_table(folder))
            return 0
        if arguments.command == "agreement":
            _agreement(arguments)
            return 0
        if arguments.command == "samples":
            _show(table(arguments.sample), arguments.output)
            return 0
        cases = [find(text, arguments.products) for text in arguments.case]
        output = Path(arguments.output)
        try:
            output.mkdir(parents=True, exist_ok=True)
            if arguments.command == "compare":
                _compare(cases, output, not arguments.no_figures)
            else:
                print("\n".join(str(p) for p in draw(arguments.name, cases, output)))
        except OSError as error:
            raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
