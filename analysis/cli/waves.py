"""Commands on recorded waves: agreement, watch."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from analysis.agreement import OTHER_RUNS, Agreement, report
from analysis.cli.options import add_command
from analysis.watch import watch_page
from modal.cli.table import add_options, output
from modal.cli.terminal import put
from modal.exchange.registry import read_packing
from modal.formats.hdf5 import write_text
from modal.formats.provenance import packing_of, require_same_packing
from modal.tools.errors import InputError
from modal.waves.signals import read_signals


def add(commands: Any) -> None:
    """The commands' options."""
    text = "a YADE run or a non-linear wave against the linear one, the difference split by cause"
    example = "agreement case02.network.h5 case02.signals.h5 -o agreement.md"
    agree = add_command(commands, "agreement", text, example, _agreement)
    agree.add_argument("network", help="*.network.h5 or *.sample.h5 of the run")
    agree.add_argument("signals", help="*.signals.h5 of the run")
    for name, what in OTHER_RUNS.items():
        agree.add_argument(f"--{name.replace('_', '-')}", metavar="FILE", help=what)
    agree.add_argument("--first", type=int, metavar="N", help="up to the chain's N-th particle")
    add_options(agree, [output("write the tables, *.md")])
    text = "a wave or modes in three dimensions: one HTML page that opens without a network"
    example = "watch mine.signals.h5 mine.network.h5 -o wave.html"
    watched = add_command(commands, "watch", text, example, _watch)
    watched.add_argument("product", metavar="FILE", help="*.signals.h5 or *.modes.h5")
    watched.add_argument("packing", nargs="?", help="what it was made from; the one beside it")
    watched.add_argument("--frames", type=int, metavar="N", help="times of a wave; 100 or more")
    watched.add_argument("--modes", type=int, nargs="+", metavar="K", help="which, from 1; all")
    add_options(watched, [output("*.html", required=True)])


def _agreement(options: argparse.Namespace) -> None:
    if options.output and options.output.endswith(".csv"):
        raise InputError(f"-o {options.output}: the tables are text, a *.csv is put beside; *.md")
    network, run = read_packing(options.network), read_signals(options.signals)
    within = np.inf
    if options.first is not None:
        if not 1 <= options.first <= len(run.chain_position):
            raise InputError(f"--first {options.first}: the chain has {len(run.chain_position)}")
        z = np.sort(run.chain_position)[options.first - 1]
        within = (z - network.wall_position[0]) * (1 + 1e-9)
    paths = {name: getattr(options, name) for name in OTHER_RUNS}
    others = {name: read_signals(path) for name, path in paths.items() if path}
    packing = packing_of(options.network)
    for path in (options.signals, *filter(None, paths.values())):
        if note := require_same_packing(path, packing):
            print(f"note: {note}", file=sys.stderr)
    found = report(Agreement(network, run, within), **others)
    text = "\n".join(table.markdown() for table in found)
    put(text, end="")
    if options.output:
        write_text(options.output, text)
        found[0].write_csv(Path(options.output).with_suffix(".csv"))


def _watch(options: argparse.Namespace) -> None:
    asked = (options.packing, options.frames, options.modes)
    for note in watch_page(options.product, options.output, *asked):
        print(f"note: {note}", file=sys.stderr)
    put(options.output)
