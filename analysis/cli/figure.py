"""The command figure: one figure of some cases."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from analysis.belonging import cases_of
from analysis.cli.options import CASE, add_command, add_products
from analysis.figures import FIGURES, draw
from analysis.figures.picture import read_picture
from analysis.figures.render import save
from analysis.measuring import Measuring
from modal.cli.table import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The command's options."""
    text = "draw one figure of the cases, or again from its own CSV"
    figure = add_command(commands, "figure", text, "figure dispersion 2 -o pages", _figure)
    figure.add_argument("name", metavar="NAME", help="a CSV file, or " + ", ".join(FIGURES))
    add_products(figure)
    figure.add_argument("case", nargs="*", metavar="CASE", help=CASE)
    figure.add_argument(
        "-o", "--output", type=NewFolder, default="products", metavar="DIR", help="to write to"
    )


def _figure(options: argparse.Namespace) -> None:
    """Draw into --output, then print what the cases' reader should know."""
    name, again = options.name, options.name.endswith(".csv")
    cases, output = cases_of(options.case, options.products), Path(options.output)
    for case in cases:
        case.check()
    if again and cases:
        raise InputError("a figure's CSV holds its cases already; leave CASE out")
    if not again and not cases:
        raise InputError("no case given; name at least one, or the CSV file of a figure")
    try:
        output.mkdir(parents=True, exist_ok=True)
        if again:
            paths = save(read_picture(name), output / Path(name).stem)
        else:
            stem = output / ".".join([*(case.name for case in cases), name])
            paths = draw(name, [Measuring.of(case) for case in cases], stem)
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    put("\n".join(map(str, paths)))
    put("".join(f"note: {note}\n" for case in cases for note in case.notes), end="")
