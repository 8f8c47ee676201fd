"""Commands on packings: samples, packing, convergence, elastic, coordination, quality."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from analysis.belonging import cases_of_files
from analysis.cli.options import add_command, show
from analysis.figures.preparation import ladder_pictures
from analysis.figures.render import save
from analysis.packings.convergence import limits_table, rows_of, settings_table, twins_table
from analysis.packings.coordination import table as coordination_table
from analysis.packings.elastic import table as elastic_table
from analysis.packings.samples import table as samples_table
from analysis.packings.seeds import KEPT, Seeds
from analysis.packings.state import measured
from analysis.quality import picture_of, quality_of, table_of
from analysis.table import Table
from modal.cli.options import NewFolder, add_output, json_text
from modal.cli.terminal import put
from modal.system.damping import ContactDamping
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The commands' options."""
    text = "table of compact samples: density, contacts, stresses, balance"
    example = "samples mine.sample.h5 rested.sample.h5"
    samples = add_command(commands, "samples", text, example, _samples)
    samples.add_argument("sample", nargs="+", metavar="FILE", help="*.sample.h5")
    text = "numbers of one packing that its preparation decides, as JSON"
    state = add_command(commands, "packing", text, "packing rested.sample.h5", _packing)
    state.add_argument("sample", metavar="FILE", help="*.sample.h5, at rest")
    add_output(state, "write them, *.json")
    text = (
        "what the settings of a compression change, from packings of several seeds; those that "
        "stand in DIR/seeds.csv already count as well"
    )
    example = "convergence products/convergence -o tables"
    converged = add_command(commands, "convergence", text, example, _convergence)
    converged.add_argument("folder", help="of workflow/convergence.smk")
    converged.add_argument("--table", default="cases/convergence.table", metavar="FILE")
    converged.add_argument(
        "-o", "--output", type=NewFolder, required=True, metavar="DIR", help="to write to"
    )
    text = "elastic moduli of packings, V_P and V_S by moduli, modes and the linear wave"
    run = _table_of_packings(elastic_table)
    elastic = add_command(commands, "elastic", text, "elastic mine.sample.h5", run)
    text = "moduli in units of the contacts' stiffness, beside coordination and indeterminacy"
    run = _table_of_packings(coordination_table)
    coordination = add_command(commands, "coordination", text, "coordination mine.sample.h5", run)
    for command in (elastic, coordination):
        command.add_argument("packing", nargs="+", metavar="FILE", help="network or sample")
    for command in (samples, elastic, coordination):
        add_output(command, "write the table, *.md")
    text = "quality factor over frequency of viscous contacts: table and figure"
    example = "quality mine.network.h5 mine.modes.h5 --damping 0.01 0.01 -o quality"
    quality = add_command(commands, "quality", text, example, _quality)
    quality.add_argument("file", nargs="+", metavar="FILE", help="packings, and modes of them")
    quality.add_argument("--damping", nargs=2, type=float, metavar=("N", "T"), required=True)
    quality.add_argument(
        "--near", nargs="+", type=float, default=[], metavar="HZ",
        help="complex modes near these, of packings without a file of modes",
    )  # fmt: skip
    quality.add_argument("-o", "--output", required=True, metavar="STEM", help="*.md, *.png, *.csv")


def _samples(options: argparse.Namespace) -> None:
    show(samples_table(options.sample), options.output)


def _packing(options: argparse.Namespace) -> None:
    show(json_text(measured(options.sample)) + "\n", options.output)


def _table_of_packings(table: Callable[[list[str]], Table]) -> Callable[[argparse.Namespace], None]:
    """A command that shows one table of all packings."""
    return lambda options: show(table(options.packing).markdown(), options.output)


def _convergence(options: argparse.Namespace) -> None:
    seeds, output = Seeds(options.table), Path(options.output)
    seeds.add_kept(output)
    seeds.add_folder(options.folder)
    rows = rows_of(seeds)
    if not rows:
        raise InputError(
            f"{options.folder}: no packing of {options.table} is there; run "
            "workflow/convergence.smk"
        )
    output.mkdir(parents=True, exist_ok=True)
    tables = {"settings": settings_table, "limits": limits_table, "twins": twins_table}
    found = {output / name: of(rows) for name, of in tables.items()}
    paths = [path for stem, table in found.items() if table.rows for path in table.write(stem)]
    paths.append(seeds.kept().write_csv(output / KEPT))
    for name, picture in ladder_pictures(rows).items():
        paths += save(picture, output / name)
    put("\n".join(str(path) for path in paths))


def _quality(options: argparse.Namespace) -> None:
    damping, output = ContactDamping(*options.damping), Path(options.output)
    cases = cases_of_files(options.file)
    found = {case.name: quality_of(case, damping, options.near) for case in cases}
    show(table_of(found).markdown(), f"{output}.md")
    save(picture_of(found, damping), output)
