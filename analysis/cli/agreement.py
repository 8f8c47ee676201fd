"""Compare a YADE run or a non-linear wave with the linear one: the difference split by cause."""

from pathlib import Path

from analysis.agreement import OTHER_RUNS, Agreement, report
from modal.cli.options import Option, Options, output, say, typed
from modal.cli.terminal import put
from modal.exchange.registry import read
from modal.formats.provenance import Source, packing_of, require_same_packing
from modal.formats.whole_file import write_text
from modal.waves.signals import read_signals

EXAMPLE = "agreement case02.network.h5 case02.signals.h5 -o agreement.md"
OPTIONS = [
    Option("network", "NETWORK", "*.network.h5 or *.sample.h5 of the run", kind=str),
    Option("signals", "SIGNALS", "*.signals.h5 of the run", kind=str),
    *(Option(typed(name), "FILE", text, kind=str) for name, text in OTHER_RUNS.items()),
    output("write the table, *.md", (".md",)),
]


def run(options: Options) -> None:
    """Print the table, and write it into the file of --output, beside it as CSV."""
    network = read(options.network)
    run_of_case = read_signals(options.signals)
    packing = packing_of(options.network)
    _note_unknown_packing(options.signals, packing)
    other_runs = {}
    for name in OTHER_RUNS:
        path = getattr(options, name)
        if path:
            _note_unknown_packing(path, packing)
            other_runs[name] = read_signals(path)
    table = report(Agreement(network, run_of_case), **other_runs)
    put(table.markdown(), end="")
    if options.output:
        write_text(options.output, table.markdown())
        table.write_csv(Path(options.output).with_suffix(".csv"))


def _note_unknown_packing(path: str, packing: tuple[Source, ...]) -> None:
    """Print a note if a run does not name its packing; InputError if this is another packing."""
    note = require_same_packing(path, packing)
    if note:
        say(f"note: {note}")
