"""The command convergence: what the settings of a preparation change."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from analysis.cli.options import add_command
from analysis.packings.convergence import limits_table, rows_of, settings_table, twins_table
from analysis.packings.seeds import KEPT, Seeds
from modal.cli.options import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The command's options."""
    text = (
        "what the settings of a compression change, from packings of several seeds; those that "
        "stand in DIR/seeds.csv already count as well"
    )
    example = "convergence products/convergence -o tables"
    converged = add_command(commands, "convergence", text, example, _convergence)
    converged.add_argument("folder", help="of workflow/convergence.smk")
    converged.add_argument(
        "--table", default="studies/convergence/convergence.table", metavar="FILE"
    )
    converged.add_argument(
        "-o", "--output", type=NewFolder, required=True, metavar="DIR", help="to write to"
    )


def _convergence(options: argparse.Namespace) -> None:
    from analysis.figures.preparation import ladder_pictures
    from analysis.figures.render import save

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
