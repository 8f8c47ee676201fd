"""The whole study: every case of a folder measured, its tables and figures written, one page.

A case that is not there is said to be missing; nothing stands in for it.
"""

from __future__ import annotations

import re
from pathlib import Path

from analysis.comparable import scatter_of_samples
from analysis.estimators.settled import why_unsettled
from analysis.measures.estimate import Estimate
from analysis.page import Section, list_html, made_by, page, table_html
from analysis.report import provenance_table, shown
from analysis.rows import Row
from analysis.status import names_in
from analysis.study.arrangement import arrange
from analysis.study.elasticity import table_of_elasticity
from analysis.study.measuring import Packing, measure_all
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
from modal.exchange.registry import read_remarked
from modal.formats.hdf5 import write_text
from modal.packing.state import contacts_per_particle, void_ratio
from modal.tools.errors import InputError

CASES = range(1, 33)


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
) -> tuple[Path, list[str]]:
    """Measure the study's cases in a folder, and write tables, figures and the page to `output`.

    Returns the page, and a line for each case that could not be measured.
    `seeds` are folders with the same cases of other seeds, `states` those with states at 1 kPa
    beside the folder's own compressions.
    """
    names = [name for name in names_in(folder) if re.fullmatch(r"case\d\d", name)]
    names = [name for name in names if _has_packing(folder, name)]
    if not names:
        raise InputError(f"{folder}: no case has a packing; run the cases first")
    packings = [Packing(folder, name) for name in names]
    packings += [
        Packing(other, name, other_seed=True)
        for other in seeds or []
        for name in names_in(other)
        if _has_packing(other, name)
    ]
    measured, failed = measure_all(packings, jobs)
    found = [one for packing, one in measured if not packing.other_seed]
    if not found:
        raise InputError(f"{folder}: no case can be read; {failed[0]}")
    rows = [one.row for one in found]
    others = [one.row for packing, one in measured if packing.other_seed]
    at_1_kpa = states_at_1_kpa([folder, *(states or [])])
    for row in rows:
        row.samples = scatter_of_samples(row, others)
        row.packings += sum(other.name == row.name for other in others)
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
    return path, failed


def _has_packing(folder: Path, name: str) -> bool:
    return any((folder / f"{name}.{kind}.h5").is_file() for kind in ("network", "sample"))
