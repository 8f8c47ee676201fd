"""The whole study: every case of a folder measured, its tables and figures written, one page.

Cases are measured one after the other, or side by side in processes of their own, and let go of:
what stays are their rows and the panels of those figures that show them. A case that is not there
is said to be missing; nothing stands in for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from analysis.case import Case
from analysis.case_tables import choices_of, table_2
from analysis.comparable import scatter_of_samples
from analysis.figures import compose
from analysis.figures.picture import Panel
from analysis.measures import Measures
from analysis.measures.estimate import Estimate
from analysis.packings.settled import why_unsettled
from analysis.page import Section, list_html, made_by, page, table_html
from analysis.report import provenance_table, shown, without_folder
from analysis.rows import Row, row_of
from analysis.status import names_in
from analysis.study.arrangement import arrange, wanted
from analysis.study.elasticity import add_elasticity, table_of_elasticity
from analysis.study.statements import statements
from analysis.study.summary import summary
from analysis.study.tables import (
    table_1,
    table_1_seen,
    table_2_of,
    table_of_choices,
    table_of_density,
    table_of_energy,
    table_of_highest,
    table_of_scattering,
)
from analysis.study.targets import answers, targets, targets_seen
from analysis.study.velocity_rules import table_of_biases, table_of_laws, velocities
from analysis.table import Table, read_csv
from modal.cli.terminal import put
from modal.formats.hdf5 import InputError, write_text
from modal.packing.plausibility import read_remarked
from modal.packing.state import contacts_per_particle, void_ratio

CASES = range(1, 33)
SECOND_TABLE = 2, 6, 10, 14, 18, 22, 26, 30
"""Cases of Table 2: all that are under 100 kPa."""


@dataclass
class Measured:
    """What stays of a case: its row, panels by figure, Table 2, choices, provenance."""

    row: Row
    panels: dict[str, list[Panel]] = field(default_factory=dict)
    second: Table | None = None
    choices: list[list[str]] = field(default_factory=list)
    provenance: list[list[str]] = field(default_factory=list)


def measure(folder: Path, name: str, *, rows_alone: bool = False) -> Measured:
    """Measure one case and, unless `rows_alone`, draw the panels of the figures that show it."""
    case = Case(name, folder)
    case.check()
    m = Measures(case)
    found = Measured(row_of(m))
    add_elasticity(found.row, m)
    if rows_alone:
        return found
    for figure in wanted(found.row.number):
        try:
            found.panels[figure] = compose(figure, [m]).panels
        except InputError as error:
            found.row.notes.append(f"figure {figure}: {error}")
    if found.row.number in SECOND_TABLE:
        found.second = table_2([m])
        found.choices = choices_of(m)
    found.provenance = [list(row) for row in provenance_table([m]).rows]
    found.row.notes = [without_folder(note, [m]) for note in found.row.notes]
    return found


def measure_all(
    folder: Path, names: list[str], jobs: int, *, rows_alone: bool = False
) -> tuple[list[Measured], list[str]]:
    """All cases in their order, and one line for each that cannot be read."""
    found: list[Measured] = []
    failed: list[str] = []
    one = partial(measure, folder, rows_alone=rows_alone)
    if jobs > 1 and len(names) > 1:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            waiting = [pool.submit(one, name) for name in names]
            results: list[Callable[[], Measured]] = [future.result for future in waiting]
            return _collect(names, results, found, failed)
    return _collect(names, [partial(one, name) for name in names], found, failed)


def _collect(
    names: list[str],
    results: list[Callable[[], Measured]],
    found: list[Measured],
    failed: list[str],
) -> tuple[list[Measured], list[str]]:
    for name, result in zip(names, results, strict=True):
        try:
            found.append(result())
            put(f"{name}: measured")
        except InputError as error:
            failed.append(f"{name}: {error}")
    return found, failed


def states_at_1_kpa(folders: list[Path]) -> dict[float, Row]:
    """Void ratio and coordination number of the packings under 1 kPa, by their friction."""
    found: dict[float, Row] = {}
    patterns = "compression_mu*/1000Pa.sample.h5", "compression_mu*/*_1kPa.sample.h5"
    for folder in folders:
        for pattern in (*patterns, "mu*_1kPa.sample.h5"):
            for path in sorted(folder.glob(pattern)):
                match = re.search(r"mu([0-9.]+)", str(path.relative_to(folder)))
                if match is None or float(match[1].rstrip(".")) in found:
                    continue
                mu = float(match[1].rstrip("."))
                network = read_remarked(path, lambda note: None)
                row = Row(
                    None, path.name, path.name, False, 1e3, mu, "", why_unsettled(network, 1e3)
                )
                row.values["void_ratio"] = Estimate(void_ratio(network))
                z = float(contacts_per_particle(network).mean())
                row.values["coordination_number"] = Estimate(z)
                found[mu] = row
    return found


def splits(folder: Path) -> dict[str, Table]:
    """What the differences between YADE and the linear wave come from, of cases that were split."""
    found = {}
    for path in sorted(folder.glob("case??.agreement.csv")):
        name = path.name.split(".")[0]
        title = f"YADE against the linear wave by cause, {name}"
        found[f"split_{name}"] = read_csv(path, title)
    return found


def study(
    folder: Path,
    output: Path,
    command: list[str],
    *,
    jobs: int = 1,
    seeds: list[Path] | None = None,
    states: list[Path] | None = None,
) -> Path:
    """Measure the study's cases in a folder, and write tables, figures and the page to `output`.

    `seeds` are folders with the same cases of other seeds, `states` those with states at 1 kPa
    beside the folder's own compressions.
    """
    names = [name for name in names_in(folder) if re.fullmatch(r"case\d\d", name)]
    names = [name for name in names if _has_packing(folder, name)]
    if not names:
        raise InputError(f"{folder}: no case has a packing; run the cases first")
    found, failed = measure_all(folder, names, jobs)
    if not found:
        raise InputError(f"{folder}: no case can be read; {failed[0]}")
    rows = [one.row for one in found]
    others: list[Row] = []
    for other in seeds or []:
        twins = [name for name in names_in(other) if _has_packing(other, name)]
        more, lost = measure_all(other, twins, jobs, rows_alone=True)
        others += [one.row for one in more]
        failed += lost
    at_1_kpa = states_at_1_kpa([folder, *(states or [])])
    for row in rows:
        row.samples = scatter_of_samples(row, others)
        row.packings += sum(other.number == row.number for other in others)
        if not row.crystal and row.mu_comp in at_1_kpa:
            row.values["void_ratio_at_1_kpa"] = at_1_kpa[row.mu_comp].values["void_ratio"]
            row.texts["unsettled_at_1_kpa"] = at_1_kpa[row.mu_comp].unsettled
    output.mkdir(parents=True, exist_ok=True)
    table_1(rows).write_csv(output / "table1.csv")
    found_of_targets = answers(rows, at_1_kpa)
    targets(found_of_targets).write_csv(output / "targets.csv")
    for name, seen in (
        ("table1", table_1_seen(rows)),
        ("targets", targets_seen(found_of_targets)),
    ):
        write_text(output / f"{name}.md", seen.markdown())
    tables = {
        "table2": table_2_of([x.second for x in found if x.second is not None]),
        "velocities": velocities(rows),
        "biases": table_of_biases(),
        "laws": table_of_laws(rows, at_1_kpa),
        "statements": statements(rows),
        "highest": table_of_highest(rows),
        "density": table_of_density(rows),
        "energy": table_of_energy(rows),
        "scattering": table_of_scattering(rows),
        "elasticity": table_of_elasticity(rows),
        "choices": table_of_choices({x.row.label: x.choices for x in found if x.choices}),
        **splits(folder),
    }
    for name, table in tables.items():
        if table.rows:
            table.write_csv(output / f"{name}.csv")
    panels = {one.row.number: one.panels for one in found if one.row.number is not None}
    figures, absent = arrange(panels, rows, output)
    missing = [n for n in CASES if n not in {row.number for row in rows}]
    failed = [text.replace(f"{folder}/", "") for text in failed]
    sections = [
        Section("Summary", summary(rows, found_of_targets, missing, failed)),
        Section("Targets", table_html(targets_seen(found_of_targets), words=True)),
        Section("Table 1", table_html(table_1_seen(rows))),
        *(Section(table.title, table_html(table)) for table in tables.values() if table.rows),
        Section("Figures", "".join(figures)),
    ]
    if absent:
        sections.append(Section("Not drawn", list_html(absent)))
    notes = sorted({f"{row.name}: {note}" for row in rows for note in row.notes})
    if notes:
        sections.append(Section("Notes", list_html(notes)))
    made = Table("", provenance_table([]).header, [row for one in found for row in one.provenance])
    details = f"<details><summary>{len(made.rows)} files</summary>{table_html(made)}</details>"
    sections.append(Section("Provenance", details))
    above = (
        "<p>After Otsubo, O'Sullivan, Hanley and Sim, Granular Matter 19:50 (2017). Each number's "
        "file names its columns; ± is the error of the estimator and of the choice of the chain, "
        "in figures and targets the scatter of samples where that is known and larger. "
        "YADE is the recorded run; linear, the wave of its network's springs.</p>"
        + made_by(shown(command))
    )
    path = output / "study.html"
    text = page("Waves in sphere packings: the study", above, sections, contents=True)
    write_text(path, text)
    return path


def _has_packing(folder: Path, name: str) -> bool:
    return any((folder / f"{name}.{kind}.h5").is_file() for kind in ("network", "sample"))
