"""The command on all cases of a folder: study."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from analysis.cli.options import add_command, add_products
from analysis.study.whole import study
from modal.cli.options import NewFolder
from modal.cli.terminal import put
from modal.tools.errors import InputError


def add(commands: Any) -> None:
    """The command's options."""
    text = "all cases of a folder: every table and figure, targets, one page"
    whole = add_command(commands, "study", text, "study --products products -o study", _study)
    add_products(whole)
    whole.add_argument(
        "-o", "--output", type=NewFolder, default="results/study", metavar="DIR", help="to write to"
    )
    whole.add_argument("-j", "--jobs", type=int, default=1, metavar="N", help="cases at a time")
    text = "folders with the same cases of other seeds, for the scatter of samples; default: seed_*"
    whole.add_argument("--seeds", nargs="+", metavar="DIR", help=f"{text} in --products")
    text = "folders with states at 1 kPa, besides --products"
    whole.add_argument("--states", nargs="+", default=["results/samples"], metavar="DIR", help=text)


def _study(options: argparse.Namespace) -> int:
    if options.jobs < 1:
        raise InputError(f"-j {options.jobs}: at least one case at a time")
    folder, output = Path(options.products), Path(options.output)
    asked = sorted(folder.glob("seed_*")) if options.seeds is None else options.seeds
    for path in (folder, *map(Path, asked)):
        if not path.is_dir():
            raise InputError(f"{path}: no such folder; give --products DIR")
    try:
        page, failed = study(
            folder,
            output,
            ["python", "-m", "analysis", *options.argv],
            jobs=options.jobs,
            seeds=[Path(text) for text in asked],
            states=[Path(text) for text in options.states],
        )
    except OSError as error:
        raise InputError(f"{output}: cannot be written ({error}); choose another -o") from error
    put(page)
    for line in failed:
        print(f"not measured: {line}", file=sys.stderr)
    return 3 if failed else 0
