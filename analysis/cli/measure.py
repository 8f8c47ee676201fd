"""Velocities, low-pass frequency, moduli ... of any packing, with errors and caveats."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from analysis.measurement import MeasuredFiles, Measurement, measure_files
from analysis.quantities import QUANTITIES, QUICK
from analysis.quantities.amplitude import AMPLITUDE
from analysis.quantities.registry import Quantity
from analysis.table import Table
from modal.cli.options import Group, NewFolder, Option, Options, flag, output, say
from modal.cli.terminal import json_text, put
from modal.formats.whole_file import write_text

EXAMPLE = "measure mine.network.h5 --quick"
ENDINGS_LEFT_OUT_OF_HELP = "_yade", "_linear", "_over_d"
"""Endings of names that the help leaves out: the quantities of one record, or in units of D."""


def _help_line(quantity: Quantity) -> str:
    """Return name, definition and unit of a quantity for the help."""
    line = f"{quantity.name}: {quantity.definition} ({quantity.unit})"
    if quantity.on_request:
        line += ", on request"
    return line


_listed = [each for each in QUANTITIES.values() if not each.name.endswith(ENDINGS_LEFT_OUT_OF_HELP)]
EPILOG = "\n".join(
    [
        *map(_help_line, _listed),
        "..._yade, ..._linear: numbers of one record, in analysis/quantities/records.py",
    ]
)
NAMES = "names below, or those that end in _yade, _linear"
AMPLITUDES_HELP = f"of pulses through a sample, m: {', '.join(AMPLITUDE)}"
EXPLAIN_HELP = "how these come about, or why they are not known: windows, fits, limits, errors"
OPTIONS = [
    Option("files", "FILE ...", "packings, and waves recorded in them", kind=str),
    Group(
        "",
        [
            flag("--quick", f"only {', '.join(QUICK)}"),
            Option("--quantities", "NAME ...", NAMES, kind=tuple(QUANTITIES)),
            Option("--explain", "NAME ...", EXPLAIN_HELP, kind=tuple(QUANTITIES)),
        ],
    ),
    flag("--json", "print JSON"),
    Option("--amplitudes", "A ...", AMPLITUDES_HELP, ()),
    Option("--keep", "DIR", "folder that keeps costly spectra", kind=NewFolder),
    output("what --json prints, *.json; or a table, *.md", (".json", ".md")),
]


def run(options: Options) -> int:
    """Measure the packings and print; return 3 if a file or a requested quantity fails.

    The status is 3 also if nothing at all is known.
    """
    names = options.quantities or options.explain
    if options.quick:
        names = QUICK
    measured = measure_files(
        options.files, say, quantities=names, keep=options.keep, amplitudes=options.amplitudes
    )
    text = json_text(_as_json(measured, explained=bool(options.explain)))
    if options.output and options.output.endswith(".json"):
        write_text(options.output, text + "\n")
    elif options.output:
        write_text(options.output, _table(measured.found))
    if options.json:
        put(text)
    elif options.explain:
        blocks = [f"{name}\n{_explain(each)}" for name, each in _with_mean(measured).items()]
        put("\n\n".join(blocks))
    else:
        put(_text(measured))
    for path, error in measured.refused.items():
        say(f"{path} could not be measured: {error}")
    if measured.differences:
        say(f"no mean: the packings differ in {'; '.join(map(str, measured.differences))}")
    return _status(measured, names or ())


def _as_json(measured: MeasuredFiles, explained: bool) -> dict[str, Any]:
    """Return all values, or the explanation of each by file, for JSON."""
    if not explained:
        return measured.as_json()
    by_file = {}
    for path, measurement in _with_mean(measured).items():
        by_file[path] = {name: value.explain().as_json() for name, value in measurement.items()}
    return by_file


def _with_mean(measured: MeasuredFiles) -> dict[str, Measurement]:
    """Return the measurement of each file by its path, and `mean` if there is one."""
    if measured.mean is None or measured.differences:
        return measured.found
    return measured.found | {"mean": measured.mean}


def _explain(measurement: Measurement) -> str:
    """Return the explanation of each quantity of a packing."""
    texts = []
    for name, value in measurement.items():
        texts.append(f"{name}: {QUANTITIES[name].definition}\n{value.explain()}")
    return "\n".join(texts)


def _text(measured: MeasuredFiles) -> str:
    """Return the quantities of each packing, and their mean if there is one."""
    return "\n\n".join(f"{name}\n{each}" for name, each in _with_mean(measured).items())


def _table(measurements: Mapping[str, Measurement]) -> str:
    """Return all packings side by side, one line for each quantity, as Markdown."""
    stems = [Path(path).name.split(".h5")[0] for path in measurements]
    rows = []
    for name in next(iter(measurements.values())):
        rows.append([name, *(each[name].text() for each in measurements.values())])
    return Table("Quantities", ["quantity", *stems], rows).markdown()


def _status(measured: MeasuredFiles, requested: tuple[str, ...]) -> int:
    """Return the exit status, and say which of the requested quantities are not known."""
    measurements = measured.found.values()
    missing = set()
    for name in requested:
        if not all(each[name].known for each in measurements):
            missing.add(name)
    for name in sorted(missing):
        say(f"{name} could not be measured of every packing; its caveat says why")
    if missing or measured.refused or not any(each.known for each in measurements):
        return 3
    return 0
