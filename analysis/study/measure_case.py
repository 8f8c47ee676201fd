"""One case measured: its result, and beside it the panels of those figures that show it."""

from collections.abc import Sequence
from itertools import islice, zip_longest
from pathlib import Path

import numpy as np

from analysis.case import Case
from analysis.crystal import compare
from analysis.figures import compose
from analysis.figures.picture import write_picture
from analysis.measurement import measure
from analysis.packing_data import PackingData
from analysis.quantities.passband import passband
from analysis.quantities.records import LOW_PASS
from analysis.quantities.spectrum import standing, standing_waves
from analysis.rows import CaseResult, row_of, write_result
from analysis.study.description import Study
from analysis.study.figure_layout import wanted
from analysis.study.targets import Rules
from analysis.table import number
from analysis.value import Value
from modal.formats.provenance import read_provenance
from modal.formats.whole_file import sha256
from modal.tools.errors import InputError

RESONANCES = 10
"""Rows of the table of resonances."""
OF_STATE = "void_ratio", "coordination"
"""Quantities of a state that is no case."""
SCATTERING = (
    *("particles", "length_over_d", "void_ratio", "coordination", "f_max"),
    *("v_p_first_peaks_yade", "v_p_first_peaks_linear"),
    *(name for key, names in LOW_PASS.items() if key.count("_") == 1 for name in names),
)
"""Quantities of another seed's packing: Table 1's."""


def measure_case(
    study: Study, name: str, files: Sequence[Path], folder: Path, output: Path, scatter: bool
) -> None:
    """Measure a case of a study, or a state, WALK_STRESSPa, that is none; write its result.

    Of a case with quantities of its own `files` are the packing and its waves, of a state its
    sample; else all is in `folder`, and the panels of figures are written beside the result.
    `scatter`: of another seed's packing only the numbers are measured whose scatter is shown,
    without errors along every column.
    """
    state, quantities = name.endswith("Pa") and len(files) == 1, study.settings["measure"]
    if not state and name not in study.rows:
        raise InputError("input", f"{name}: no case of {study.path}")
    of_files = {files[0].name.split(".")[-2]: files[0]} if state or quantities else None
    case = Case(name, folder, of_files)
    case.check()
    m = PackingData.of(case, every_particle=not scatter)
    row = CaseResult.of(m)
    if state:
        row.state = True
        row.add(m, OF_STATE)
    elif quantities:
        _add_quantities(row, files, quantities)
    elif scatter:
        row.add(m, SCATTERING)
    else:
        m.stated = Rules(study.cases, study.stated()).stated_of(name)
        row = row_of(m)
        _add_tables(row, m)
        for figure in wanted(study.part("figures"), study.cases.loc[[name]]):
            try:
                write_picture(output.with_suffix(f".{figure}.csv"), compose(figure, [m]))
            except InputError as error:
                row.notes.append(f"figure {figure}: {error}")
        row.notes = [note.replace(f"{folder}/", "") for note in row.notes]
    if not (state or scatter):
        row.provenance = _provenance(case)
    write_result(output, row)


def _add_quantities(row: CaseResult, files: Sequence[Path], quantities: Sequence[str]) -> None:
    """Quantities by their name in the registry, of a packing and its waves."""
    row.paper_columns = False
    for quantity, value in measure(*files, quantities=quantities).items():
        if value.at is None:
            row.values[quantity] = value
        else:
            row.curves[quantity] = tuple(map(np.asarray, (value.at, value.value, value.error)))
        row.notes += [f"{quantity}: {caveat}" for caveat in value.caveats]


def _add_tables(row: CaseResult, m: PackingData) -> None:
    """Tables of a case by itself: resonances, choices of the threshold's rule, a theory."""
    (f, kappa), bearers = standing_waves(m), standing(m)
    if len(f):
        columns = {"f_r, kHz": map(number, f / 1e3), "kappa_r, rad/m": map(number, kappa)}
        if not m.crystal:
            share = () if bearers is None else bearers.share
            columns["share of the mode"] = map("{:.2f}".format, share)
        numbers = map(str, range(1, RESONANCES + 1))
        lines = zip_longest(numbers, *columns.values(), fillvalue="")
        row.tables["resonances"] = [["r", *columns], *map(list, islice(lines, RESONANCES))]
    choices = [[text, _chosen(edge)] for text, edge in passband(m).choices()]
    row.tables["choices"] = [["f_low-pass, kHz", "f_low-pass"], *choices]
    if m.crystal:
        row.tables["comparison"] = compare(m)


def _chosen(edge: Value) -> str:
    """A threshold's frequency in kHz, marked where it stands on no plateau; else why none."""
    text = number(1e-3 * edge.value, 1e-3 * edge.error)
    if not text:
        return "".join(f"none: {why}" for why in edge.caveats)
    return text if edge.plateau else f"{text}, no plateau"


def _provenance(case: Case) -> list[list[str]]:
    """Every file that was read, its digest, its command and its sources as far as it says."""
    lines = []
    for path in map(case.path, case.there):
        made = read_provenance(path)
        sources = ", ".join(map(str, made.sources))
        how = made.command or "of unknown origin"
        lines.append([path.name, sha256(path)[:16], how, sources])
    return lines
