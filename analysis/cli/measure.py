"""Velocities, low-pass frequency, moduli ... of any packing, with errors and caveats."""

from pathlib import Path

from analysis.measurement import Measurement, measure_files
from analysis.quantities import QUANTITIES, QUICK
from analysis.quantities.amplitude import AMPLITUDE
from analysis.table import Table
from modal.cli.options import Group, NewFolder, Option, Options, flag, output, say
from modal.cli.terminal import json_text, put
from modal.formats.whole_file import write_text

EXAMPLE = "measure mine.network.h5 --quick"
OF_PRODUCERS = "_yade", "_linear", "_over_d"
EPILOG = "\n".join(
    [
        f"{q.name}: {q.definition} ({q.unit}){', on request' * q.on_request}"
        for q in QUANTITIES.values()
        if not q.name.endswith(OF_PRODUCERS)
    ]
    + ["..._yade, ..._linear: numbers of one record, in analysis/quantities/records.py"]
)
NAMES, OF_PULSES = "names below, or those that end in _yade, _linear", ", ".join(AMPLITUDE)
OPTIONS = [
    Option("files", "FILE ...", "packings, and waves recorded in them", kind=str),
    Group(
        "",
        [
            flag("--quick", f"only {', '.join(QUICK)}"),
            Option("--quantities", "NAME ...", NAMES, kind=tuple(QUANTITIES)),
        ],
    ),
    flag("--json", "print JSON"),
    Option("--amplitudes", "A ...", f"of pulses through a sample, m: {OF_PULSES}", ()),
    Option("--keep", "DIR", "folder that keeps costly spectra", kind=NewFolder),
    output("what --json prints, *.json; or a table, *.md", (".json", ".md")),
]


def _table(found: dict[str, Measurement]) -> str:
    """All packings side by side, one line a quantity, as Markdown."""
    stems = [Path(name).name.split(".h5")[0] for name in found]
    first = next(iter(found.values()))
    rows = [[name, *(one[name].text() for one in found.values())] for name in first]
    return Table("Quantities", ["quantity", *stems], rows).markdown()


def run(options: Options) -> int:
    """Measure; 3 where a file, or a quantity asked for by name or as quick, could not be.

    And where nothing could.
    """
    names = QUICK if options.quick else options.quantities
    how = {"quantities": names, "keep": options.keep, "amplitudes": options.amplitudes}
    measured = measure_files(options.files, say, **how)
    found = measured.found
    text = json_text(measured.as_json())
    if options.output:
        as_json = options.output.endswith(".json")
        write_text(options.output, text + "\n" if as_json else _table(found))
    if options.json:
        put(text)
    else:
        parts = dict(found)
        if measured.mean is not None and not measured.differences:
            parts["mean"] = measured.mean
        put("\n\n".join(f"{path}\n{each}" for path, each in parts.items()))
    for path, error in measured.refused.items():
        say(f"{path} could not be measured: {error}")
    if measured.differences:
        say(f"no mean: the packings differ in {'; '.join(map(str, measured.differences))}")
    missing = {name for each in found.values() for name in names or () if not each[name].known}
    for name in sorted(missing):
        say(f"{name} could not be measured of every packing; its caveat says why")
    nothing = not any(each.known for each in found.values())
    return 3 if missing or measured.refused or nothing else 0
