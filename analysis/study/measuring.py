"""One case measured: its result, and beside it the panels of those figures that show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from analysis.case import Case
from analysis.crystal import compare
from analysis.estimators.low_pass import Edge
from analysis.estimators.settled import why_unsettled
from analysis.figures import compose
from analysis.figures.picture import write_picture
from analysis.measurement import measure
from analysis.measuring import Measuring
from analysis.quantities.passband import passband
from analysis.quantities.records import LOW_PASS
from analysis.quantities.spectrum import standing, standing_waves
from analysis.rows import Row, row_of
from analysis.study.results import write_result
from analysis.table import number
from analysis.value import estimate
from modal.exchange.registry import read_packing, read_remarked
from modal.formats.hdf5 import sha256
from modal.formats.provenance import read_provenance
from modal.packing.state import contacts_per_particle, void_ratio
from modal.tools.errors import InputError

RESONANCES = 10
"""Rows of the table of resonances."""
SCATTERING = (
    *("particles", "length_over_d", "void_ratio", "coordination", "f_max"),
    *("v_p_first_peaks_yade", "v_p_first_peaks_linear"),
    *(name for key, names in LOW_PASS.items() if key.count("_") == 1 for name in names),
)
"""Quantities of another seed's packing: Table 1's."""


def of_case(
    name: str,
    folder: Path,
    output: Path,
    figures: Sequence[str] = (),
    stated: Mapping[str, tuple[float, float]] | None = None,
) -> Row:
    """Measure a case of a folder; write its result, and its panels of `figures` beside it.

    `stated` are lower and upper ends of numbers that figures show beside its own.
    """
    case = Case(name, folder)
    case.check()
    m = Measuring.of(case)
    m.stated = dict(stated or {})
    row = row_of(m)
    _add_tables(row, m)
    row.provenance = _provenance(case)
    for figure in figures:
        try:
            write_picture(output.with_suffix(f".{figure}.csv"), compose(figure, [m]))
        except InputError as error:
            row.notes.append(f"figure {figure}: {error}")
    row.notes = [note.replace(f"{folder}/", "") for note in row.notes]
    write_result(output, row)
    return row


def of_seed(name: str, folder: Path, output: Path) -> Row:
    """Of a case's packing of another seed, the numbers whose scatter is shown.

    These are Table 1's and what sets packings apart. Errors are not among them: along every column
    of a packing f_low-pass and V_P are had for the study's own packings alone.
    """
    case = Case(name, folder)
    case.check()
    m = Measuring(read_packing(case.packing_path), None, None, case)
    m.linear = m.linear_wave(particles=False)
    row = Row.of(m)
    row.add(m, SCATTERING)
    write_result(output, row)
    return row


def of_quantities(name: str, files: Sequence[Path], output: Path, quantities: Sequence[str]) -> Row:
    """Of any packing, quantities by their name in the registry; files are it and its waves."""
    packing, *records = files
    case = Case(name, packing.parent, {packing.name.split(".")[-2]: packing})
    found = measure(packing, *records, quantities=quantities)
    row = Row.of(Measuring.of(case))
    for quantity, value in found.items():
        if value.at is None:
            row.values[quantity] = estimate(float(value.value), float(value.error))
        else:
            row.curves[quantity] = tuple(map(np.asarray, (value.at, value.value, value.error)))
        row.notes += [f"{quantity}: {caveat}" for caveat in value.caveats]
    row.provenance = _provenance(case)
    write_result(output, row)
    return row


def of_state(name: str, sample: Path, output: Path) -> Row:
    """Of a state that is no case: density, contacts, and whether it has settled."""
    network = read_remarked(sample, lambda note: None)
    study = network.study
    stress, mu = float(study["stress"]), float(study.get("mu_comp", 0.0))
    why = why_unsettled(network, stress)
    row = Row(None, name, f"random, {stress / 1e3:g} kPa", False, stress, mu, "", why, state=True)
    row.values["void_ratio"] = estimate(void_ratio(network))
    row.values["coordination_number"] = estimate(float(contacts_per_particle(network).mean()))
    write_result(output, row)
    return row


def _add_tables(row: Row, m: Measuring) -> None:
    """Tables of a case by itself: resonances, choices of the threshold's rule, a theory."""
    (f, kappa), bearers, lines = standing_waves(m), standing(m), []
    if len(f):
        share = [] if bearers is None else [f"{v:.2f}" for v in bearers.share]
        columns = [[number(v) for v in f / 1e3], [number(v) for v in kappa]]
        columns += [] if m.crystal else [share]
        head = ["r", "f_r, kHz", "kappa_r, rad/m", "share of the mode"][: 1 + len(columns)]
        lines = [[(c[r : r + 1] or [""])[0] for c in columns] for r in range(RESONANCES)]
        row.tables["resonances"] = [head, *([str(r + 1), *line] for r, line in enumerate(lines))]
    choices = [[text, _chosen(edge)] for text, edge in passband(m).choices()]
    row.tables["choices"] = [["f_low-pass, kHz", "f_low-pass"], *choices]
    if m.crystal:
        row.tables["comparison"] = compare(m)


def _chosen(edge: Edge) -> str:
    """A threshold's frequency in kHz, marked where it stands on no plateau; else why none."""
    text = number(1e-3 * edge.value, 1e-3 * edge.error)
    if not text:
        return f"none: {edge.why}" if edge.why else ""
    return text if edge.flat else f"{text}, no plateau"


def _provenance(case: Case) -> list[list[str]]:
    """Every file that was read, its digest, its command and its sources as far as it says."""
    lines = []
    for path in map(case.path, case.there):
        made = read_provenance(path)
        sources = ", ".join(map(str, made.sources))
        how = made.command or "of unknown origin"
        lines.append([path.name, sha256(path)[:16], how, sources])
    return lines
