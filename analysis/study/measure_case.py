"""Measure one case of a study: write its result, and the panels of the figures that show it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from analysis.case import Case
from analysis.case_measurement import add_quantities, empty_result, measure_result
from analysis.case_result import CaseResult
from analysis.crystal import compare
from analysis.figures import compose
from analysis.figures.picture import write_picture
from analysis.measurement import measure
from analysis.packing_data import PackingData
from analysis.quantities.passband import passband
from analysis.quantities.records import LOW_PASS
from analysis.quantities.spectrum import standing, standing_waves
from analysis.result_file import write_result
from analysis.study.description import Study
from analysis.study.figure_layout import figures_of_case
from analysis.study.rules import Rules
from analysis.table import number
from analysis.value import Value
from modal.formats.provenance import read_provenance
from modal.formats.whole_file import sha256
from modal.tools.errors import InputError

MAX_RESONANCES = 10
"""Number of rows of the table of resonances; higher resonances overlap in most packings."""
QUANTITIES_OF_STATE = ("void_ratio", "coordination")
"""Quantities of a state during a compression that is not a case of the study."""
QUANTITIES_OF_OTHER_SEEDS = (
    *("particles", "length_over_d", "void_ratio", "coordination", "f_max"),
    *("v_p_first_peaks_yade", "v_p_first_peaks_linear"),
    *(name for key, names in LOW_PASS.items() if key.count("_") == 1 for name in names),
)
"""Quantities of a packing from another seed: those of Table 1, whose scatter is shown."""


def measure_case(
    study: Study, name: str, files: Sequence[Path], folder: Path, output: Path, scatter: bool
) -> None:
    """Measure a case of a study, or another state of a compression, and write its result.

    Parameters
    ----------
    study : Study
        The study.
    name : str
        A case, or a state called WALK_STRESSPa.
    files : sequence of Path
        The packing and its waves, for a case whose quantities the study names; the sample of a
        state; for other cases empty.
    folder : Path
        Folder that holds all products of a case for which no files are given.
    output : Path
        File of the result, *.json. Panels of figures are written beside it.
    scatter : bool
        Measure only the numbers whose scatter over seeds is shown, for a packing of another seed,
        and leave out errors along every column of particles.

    Raises
    ------
    InputError
        If the study has no such case, or if a file is missing or wrong.
    """
    quantities = study.settings["measure"]
    is_state = name.endswith("Pa") and len(files) == 1
    if not is_state and name not in study.rows:
        raise InputError("unknown_case", f"{name}: no case of {study.path}")
    files_by_name = None
    if is_state or quantities:
        files_by_name = {files[0].name.split(".")[-2]: files[0]}
    case = Case(name, folder, files_by_name)
    case.check()
    m = PackingData.of(case, every_particle=not scatter)
    row = empty_result(m)
    if is_state:
        row.state = True
        add_quantities(row, m, QUANTITIES_OF_STATE)
    elif quantities:
        _add_quantities(row, files, quantities)
    elif scatter:
        add_quantities(row, m, QUANTITIES_OF_OTHER_SEEDS)
    else:
        m.stated = Rules(study.cases, study.stated()).stated_intervals(name)
        row = measure_result(m)
        _add_tables(row, m)
        _write_panels(study, row, m, output)
        row.notes = [note.replace(f"{folder}/", "") for note in row.notes]
    if not (is_state or scatter):
        row.provenance = _read_provenances(case)
    write_result(output, row)


def _write_panels(study: Study, row: CaseResult, m: PackingData, output: Path) -> None:
    """Write the panels of the figures that show a case; note those that cannot be drawn."""
    line_of_case = study.cases.loc[[row.name]]
    for figure in figures_of_case(study.part("figures"), line_of_case):
        try:
            write_picture(output.with_suffix(f".{figure}.csv"), compose(figure, [m]))
        except InputError as error:
            row.notes.append(f"figure {figure}: {error}")


def _add_quantities(row: CaseResult, files: Sequence[Path], quantities: Sequence[str]) -> None:
    """Add quantities by their names in the registry, of a packing and its waves."""
    row.paper_columns = False
    for quantity, value in measure(*files, quantities=quantities).items():
        if value.at is None:
            row.values[quantity] = value
        else:
            row.curves[quantity] = (
                np.asarray(value.at),
                np.asarray(value.value),
                np.asarray(value.error),
            )
        row.notes += [f"{quantity}: {caveat}" for caveat in value.caveats]


def _add_tables(row: CaseResult, m: PackingData) -> None:
    """Add the tables of a single case: resonances, choices of the threshold's rule, a theory."""
    resonances = _tabulate_resonances(m)
    if resonances:
        row.tables["resonances"] = resonances
    choices = [[text, _describe_edge(edge)] for text, edge in passband(m).choices()]
    row.tables["choices"] = [["f_low-pass, kHz", "f_low-pass"], *choices]
    if m.crystal:
        row.tables["comparison"] = compare(m)


def _tabulate_resonances(m: PackingData) -> list[list[str]]:
    """Return header and lines of the lowest resonances; empty without any."""
    frequency, wavenumber = standing_waves(m)
    modes = standing(m)
    if not len(frequency):
        return []
    columns = {
        "r": [str(order) for order in range(1, MAX_RESONANCES + 1)],
        "f_r, kHz": [number(value) for value in frequency / 1e3],
        "kappa_r, rad/m": [number(value) for value in wavenumber],
    }
    if not m.crystal:
        shares = () if modes is None else modes.share
        columns["share of the mode"] = [f"{share:.2f}" for share in shares]
    padded = [_pad(cells) for cells in columns.values()]
    return [list(columns), *map(list, zip(*padded, strict=True))]


def _pad(cells: list[str]) -> list[str]:
    """Return exactly `MAX_RESONANCES` cells: the given ones, followed by empty ones."""
    return (cells + [""] * MAX_RESONANCES)[:MAX_RESONANCES]


def _describe_edge(edge: Value) -> str:
    """Return a threshold's frequency in kHz, or the reason why there is none.

    A frequency that is not on a plateau is marked.
    """
    text = number(1e-3 * edge.value, 1e-3 * edge.error)
    if not text:
        return "".join(f"none: {caveat}" for caveat in edge.caveats)
    if not edge.plateau:
        text += ", no plateau"
    return text


def _read_provenances(case: Case) -> list[list[str]]:
    """Return a line for each file of a case: its name, digest, command and sources."""
    lines = []
    for path in map(case.path, case.there):
        provenance = read_provenance(path)
        sources = ", ".join(map(str, provenance.sources))
        command = provenance.command or "of unknown origin"
        lines.append([path.name, sha256(path)[:16], command, sources])
    return lines
