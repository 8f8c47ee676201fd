"""Command line of analysis: from products to tables, figures and one report."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

from analysis.agreement import OTHER_RUNS, Agreement, report
from analysis.belonging import cases_of, cases_of_files
from analysis.case import Case, case_name
from analysis.case_tables import tables
from analysis.crystal import compare, comparison_table, stress_rows
from analysis.estimators.power_law import power_law
from analysis.estimators.trial import trial
from analysis.figures import FIGURES, draw
from analysis.figures.picture import read_picture
from analysis.figures.preparation import ladder_pictures
from analysis.figures.render import save
from analysis.measures import Measures
from analysis.packings.convergence import limits_table, rows_of, settings_table, twins_table
from analysis.packings.coordination import table as coordination_table
from analysis.packings.elastic import table as elastic_table
from analysis.packings.samples import table
from analysis.packings.seeds import KEPT, Seeds
from analysis.packings.state import measured
from analysis.prepare import KINDS, prepare
from analysis.quality import picture_of, quality_of, table_of
from analysis.report import report as write_report
from analysis.status import stale_files, status_table
from analysis.study.whole import study
from analysis.watch import watch_page
from modal.cli.options import Parser
from modal.cli.terminal import put
from modal.formats.hdf5 import InputError, write_text
from modal.formats.provenance import packing_of, require_same_packing
from modal.packing.network_file import read_network
from modal.stiffness.damping import ContactDamping
from modal.waves.signals import read_signals

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
EXAMPLES = {
    "report": "report 2 -o pages",
    "compare": "compare 2 -o pages",
    "figure": "figure dispersion 2 -o pages",
    "prepare": "prepare 2 --kind response",
    "status": "status --products products",
    "study": "study --products products -o study",
    "elastic": "elastic mine.sample.h5",
    "coordination": "coordination mine.sample.h5",
    "quality": "quality mine.network.h5 mine.modes.h5 --damping 0.01 0.01 -o quality",
    "samples": "samples mine.sample.h5 rested.sample.h5",
    "packing": "packing rested.sample.h5",
    "convergence": "convergence products/convergence -o tables",
    "estimators": "estimators -o estimators.md",
    "agreement": "agreement case02.network.h5 case02.signals.h5 -o agreement.md",
    "watch": "watch mine.signals.h5 mine.network.h5 -o wave.html",
}
"""What the help of each command ends in."""
CASE = "a case of --products by name, as 2; or files: a NETWORK and what was made from it"


def _parser() -> argparse.ArgumentParser:
    about = "Compare theory, modes and YADE; COMMAND --help has options and an example."
    parser = Parser(prog="python -m analysis", description=about)
    commands = parser.add_subparsers(
        dest="command", required=True, parser_class=Parser, metavar="COMMAND", title="commands"
    )

    def command(name: str, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.add_argument("--products", default="products", metavar="DIR", help="folder to read")
        return sub

    reported = command("report", "one HTML page: tables, figures, deviations, provenance")
    compared = command("compare", "print and write the comparison table, draw the figures")
    compared.add_argument("--no-figures", action="store_true", help="only the table")
    figure = command("figure", "draw one figure of the cases, or again from its own CSV")
    figure.add_argument("name", metavar="NAME", help="a CSV file, or " + ", ".join(FIGURES))
    for sub, count in ((reported, "+"), (compared, "+"), (figure, "*")):
        sub.add_argument("case", nargs=count, metavar="CASE", help=CASE)
        sub.add_argument("-o", "--output", default="products", metavar="DIR", help="to write to")
    text = "what a report needs beside the run's products: gain, density of states, ridge"
    prepared = command("prepare", text)
    prepared.add_argument("case", nargs="+", metavar="CASE", help=CASE)
    prepared.add_argument("--kind", nargs="+", choices=KINDS, default=KINDS, help="only these")
    status = command("status", "which cases have which products, and which are stale and why")
    status.add_argument("--cases", default="cases", metavar="DIR", help="tables of the cases")
    status.add_argument("--stale", nargs="+", metavar="CASE", help="names of stale files alone")
    whole = command("study", "all cases of a folder: every table and figure, targets, one page")
    whole.add_argument("-o", "--output", default="results/study", metavar="DIR", help="to write to")
    whole.add_argument("-j", "--jobs", type=int, default=1, metavar="N", help="cases at a time")
    text = "folders with the same cases of other seeds, for the scatter of samples; default: seed_*"
    whole.add_argument("--seeds", nargs="+", metavar="DIR", help=f"{text} in --products")
    text = "folders with states at 1 kPa, besides --products"
    whole.add_argument("--states", nargs="+", default=["results/samples"], metavar="DIR", help=text)
    text = "elastic moduli of packings, V_P and V_S by moduli, modes and the linear wave"
    elastic = commands.add_parser("elastic", help=text, description=text)
    text = "moduli in units of the contacts' stiffness, beside coordination and indeterminacy"
    coordination = commands.add_parser("coordination", help=text, description=text)
    for sub in (elastic, coordination):
        sub.add_argument("packing", nargs="+", metavar="FILE", help="network or sample")
        sub.add_argument("-o", "--output", metavar="FILE", help="write the table, *.md")
    text = "quality factor over frequency of viscous contacts: table and figure"
    quality = commands.add_parser("quality", help=text, description=text)
    quality.add_argument("file", nargs="+", metavar="FILE", help="packings, and modes of them")
    quality.add_argument("--damping", nargs=2, type=float, metavar=("N", "T"), required=True)
    quality.add_argument(
        "--near", nargs="+", type=float, default=[], metavar="HZ",
        help="complex modes near these, of packings without a file of modes",
    )  # fmt: skip
    quality.add_argument("-o", "--output", required=True, metavar="STEM", help="*.md, *.png, *.csv")
    text = "table of compact samples: density, contacts, stresses, balance"
    samples = commands.add_parser("samples", help=text, description=text)
    samples.add_argument("sample", nargs="+", metavar="FILE", help="*.sample.h5")
    samples.add_argument("-o", "--output", metavar="FILE", help="write the table, *.md")
    text = "numbers of one packing that its preparation decides, as JSON"
    state = commands.add_parser("packing", help=text, description=text)
    state.add_argument("sample", metavar="FILE", help="*.sample.h5, at rest")
    state.add_argument("-o", "--output", metavar="FILE", help="write them, *.json")
    text = (
        "what the settings of a compression change, from packings of several seeds; those that "
        "stand in DIR/seeds.csv already count as well"
    )
    converged = commands.add_parser("convergence", help=text, description=text)
    converged.add_argument("folder", help="of workflow/convergence.smk")
    converged.add_argument("--table", default="cases/convergence.table", metavar="FILE")
    converged.add_argument("-o", "--output", required=True, metavar="DIR", help="to write to")
    text = "bias and scatter of every estimator on signals of known answer"
    tried = commands.add_parser("estimators", help=text, description=text)
    tried.add_argument("-o", "--output", metavar="FILE", help="write the tables, *.md")
    text = "a YADE run against the linear wave of its network, the difference split by cause"
    agree = commands.add_parser("agreement", help=text, description=text)
    agree.add_argument("network", help="*.network.h5 of the run")
    agree.add_argument("signals", help="*.signals.h5 of the YADE run")
    for name, what in OTHER_RUNS.items():
        agree.add_argument(f"--{name.replace('_', '-')}", metavar="FILE", help=what)
    agree.add_argument("--first", type=int, metavar="N", help="up to the chain's N-th particle")
    agree.add_argument("-o", "--output", metavar="FILE", help="write the tables, *.md")
    text = "a wave or modes in three dimensions: one HTML page that opens without a network"
    watched = commands.add_parser("watch", help=text, description=text)
    watched.add_argument("product", metavar="FILE", help="*.signals.h5 or *.modes.h5")
    watched.add_argument("packing", nargs="?", help="what it was made from; the one beside it")
    watched.add_argument("--frames", type=int, metavar="N", help="times of a wave; 100 or more")
    watched.add_argument("--modes", type=int, nargs="+", metavar="K", help="which, from 1; all")
    watched.add_argument("-o", "--output", required=True, metavar="FILE", help="*.html")
    for name, sub in commands.choices.items():
        sub.example = EXAMPLES[name]
    return parser


def _compare(cases: list[Case], output: Path, figures: bool) -> None:
    for case in cases:
        put(f"\n{case.name}  stress {case.network.study.get('stress', float('nan')):g} Pa")
        paths = _crystal(case, output) if case.is_crystal else _random(case, output)
        for kind in ("modes", "translations.modes", "signals"):
            if not case.has(kind):
                put(f"note: {case.path(kind)} is absent; what needs it is left empty")
        if figures:
            paths += _figures(COMPARED, [Measures(case)], output, f"{case.name}.")
        put("\n".join(str(path) for path in paths))
    crystals = [case for case in cases if case.is_crystal and np.isfinite(case.stress)]
    if len(crystals) > 1:
        columns = stress_rows(crystals)
        for name in ("theory", "modal", "yade"):
            law = power_law(columns["stress_Pa"], columns[f"velocity_{name}_m_per_s"])
            if np.isfinite(law.exponent):
                put(f"exponent of V_P against stress, {name}: {law.exponent:.5f} (paper: 1/6)")
        if figures:
            measured = [Measures(case) for case in crystals]
            paths = _figures(("stress_dependence",), measured, output, "")
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


def _figure(name: str, cases: list[Measures], output: Path) -> None:
    if name.endswith(".csv"):
        if cases:
            raise InputError("a figure's CSV holds its cases already; leave CASE out")
        paths = save(read_picture(name), output / Path(name).stem)
    elif cases:
        paths = draw(name, cases, output / ".".join([*(m.case.name for m in cases), name]))
    else:
        raise InputError("no case given; name at least one, or the CSV file of a figure")
    put("\n".join(str(path) for path in paths))


def _report(cases: list[Measures], output: Path, argv: list[str]) -> None:
    for table_ in tables(cases).values():
        put(f"{table_.title}\n{table_.text()}\n")
    put(write_report(cases, output, ["python", "-m", "analysis", *argv])[0])


def _study(arguments: argparse.Namespace, argv: list[str]) -> None:
    if arguments.jobs < 1:
        raise InputError(f"-j {arguments.jobs}: at least one case at a time")
    folder, output = Path(arguments.products), Path(arguments.output)
    asked = sorted(folder.glob("seed_*")) if arguments.seeds is None else arguments.seeds
    for path in (folder, *map(Path, asked)):
        if not path.is_dir():
            raise InputError(f"{path}: no such folder; give --products DIR")
    try:
        page = study(
            folder,
            output,
            ["python", "-m", "analysis", *argv],
            jobs=arguments.jobs,
            seeds=[Path(text) for text in asked],
            states=[Path(text) for text in arguments.states],
        )
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    put(page)


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
    packing = packing_of(arguments.network)
    for path in (arguments.signals, *filter(None, paths.values())):
        if note := require_same_packing(path, packing):
            print(f"note: {note}", file=sys.stderr)
    found = report(Agreement(network, run, within), **others)
    _show("\n".join(table_.markdown() for table_ in found), arguments.output)
    if arguments.output:
        found[0].write_csv(Path(arguments.output).with_suffix(".csv"))


def _quality(arguments: argparse.Namespace) -> None:
    damping, output = ContactDamping(*arguments.damping), Path(arguments.output)
    cases = cases_of_files(arguments.file)
    found = {case.name: quality_of(case, damping, arguments.near) for case in cases}
    _show(table_of(found).markdown(), f"{output}.md")
    save(picture_of(found, damping), output)


def _convergence(arguments: argparse.Namespace) -> None:
    seeds, output = Seeds(arguments.table), Path(arguments.output)
    seeds.add_kept(output)
    seeds.add_folder(arguments.folder)
    rows = rows_of(seeds)
    if not rows:
        raise InputError(
            f"{arguments.folder}: no packing of {arguments.table} is there; run "
            "workflow/convergence.smk"
        )
    output.mkdir(parents=True, exist_ok=True)
    tables = {"settings": settings_table, "limits": limits_table, "twins": twins_table}
    found = {output / name: of(rows) for name, of in tables.items()}
    paths = [path for stem, table_ in found.items() if table_.rows for path in table_.write(stem)]
    paths.append(seeds.kept().write_csv(output / KEPT))
    for name, picture in ladder_pictures(rows).items():
        paths += save(picture, output / name)
    put("\n".join(str(path) for path in paths))


def _show(text: str, output: str | None) -> None:
    put(text, end="")
    if output:
        write_text(output, text)


def main(argv: list[str] | None = None) -> int:
    """Run one command; exit status 0, or 2 with one line on stderr for a user's mistake."""
    try:
        arguments = _parser().parse_args(argv)
        if arguments.command == "status":
            folder = Path(arguments.products)
            if not folder.is_dir():
                raise InputError(f"{folder}: no such folder; give --products DIR")
            tables_ = Path(arguments.cases)
            if arguments.stale:
                names = [case_name(text) for text in arguments.stale]
                put("".join(f"{path}\n" for path in stale_files(folder, tables_, names)), end="")
            else:
                put(status_table(folder, tables_))
            return 0
        if arguments.command == "agreement":
            _agreement(arguments)
            return 0
        if arguments.command == "study":
            _study(arguments, argv or sys.argv[1:])
            return 0
        if arguments.command == "estimators":
            _show("\n".join(f"{t.title}:\n\n{t.markdown()}" for t in trial()), arguments.output)
            return 0
        if arguments.command == "watch":
            asked = (arguments.packing, arguments.frames, arguments.modes)
            for note in watch_page(arguments.product, arguments.output, *asked):
                print(f"note: {note}", file=sys.stderr)
            put(arguments.output)
            return 0
        if arguments.command == "packing":
            _show(json.dumps(measured(arguments.sample)) + "\n", arguments.output)
            return 0
        if arguments.command == "convergence":
            _convergence(arguments)
            return 0
        if arguments.command in ("elastic", "coordination"):
            of = elastic_table if arguments.command == "elastic" else coordination_table
            _show(of(arguments.packing).markdown(), arguments.output)
            return 0
        if arguments.command == "quality":
            _quality(arguments)
            return 0
        if arguments.command == "samples":
            _show(table(arguments.sample), arguments.output)
            return 0
        cases = cases_of(arguments.case, arguments.products)
        if arguments.command == "prepare":
            for case in cases:
                put("".join(f"{path}\n" for path in prepare(case, arguments.kind)), end="")
            return 0
        for case in cases:
            case.check()
        output = Path(arguments.output)
        try:
            output.mkdir(parents=True, exist_ok=True)
            if arguments.command == "compare":
                _compare(cases, output, not arguments.no_figures)
            elif arguments.command == "report":
                _report([Measures(case) for case in cases], output, argv or sys.argv[1:])
            else:
                _figure(arguments.name, [Measures(case) for case in cases], output)
        except OSError as error:
            raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
        put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
