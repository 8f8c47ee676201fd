"""A YADE run or a non-linear wave against the linear one, the difference split by cause."""

from pathlib import Path

from analysis.agreement import OTHER_RUNS, Agreement, report
from modal.cli.options import Option, Options, output, say, typed
from modal.cli.terminal import put
from modal.exchange.registry import read
from modal.formats.provenance import packing_of, require_same_packing
from modal.formats.whole_file import write_text
from modal.waves.signals import read_signals

EXAMPLE = "agreement case02.network.h5 case02.signals.h5 -o agreement.md"
OPTIONS = [
    Option("network", "NETWORK", "*.network.h5 or *.sample.h5 of the run", kind=str),
    Option("signals", "SIGNALS", "*.signals.h5 of the run", kind=str),
    *(Option(typed(name), "FILE", what, kind=str) for name, what in OTHER_RUNS.items()),
    output("write the table, *.md", (".md",)),
]


def run(options: Options) -> None:
    """Print the table, and write it where --output says."""
    network, first = read(options.network), read_signals(options.signals)
    paths = {name: path for name in OTHER_RUNS if (path := getattr(options, name))}
    packing = packing_of(options.network)
    for path in (options.signals, *paths.values()):
        if note := require_same_packing(path, packing):
            say(f"note: {note}")
    others = {name: read_signals(path) for name, path in paths.items()}
    found = report(Agreement(network, first), **others)
    put(found.markdown(), end="")
    if options.output:
        write_text(options.output, found.markdown())
        found.write_csv(Path(options.output).with_suffix(".csv"))
