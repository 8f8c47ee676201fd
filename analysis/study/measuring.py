"""Every packing of the study measured, one after the other or side by side in own processes.

A case is let go of once it is measured: what stays are its row and the panels of those figures that
show it, of a packing of another seed the row alone.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from analysis.case import Case
from analysis.case_tables import choices_of, table_2
from analysis.figures import compose
from analysis.figures.picture import Panel
from analysis.measures import Measures
from analysis.report import provenance_table, without_folder
from analysis.rows import Row, row_of
from analysis.study.arrangement import wanted
from analysis.study.elasticity import add_elasticity
from analysis.study.other_seeds import row_of_seed
from analysis.table import Table
from modal.cli.terminal import put
from modal.tools.errors import InputError

SECOND_TABLE = 2, 6, 10, 14, 18, 22, 26, 30
"""Cases of Table 2: all that are under 100 kPa."""

THREADS = "OMP_NUM_THREADS"
"""How many threads a process takes: heeded by BLAS and by the loops of `modal.tools.loops`."""


@dataclass(frozen=True)
class Packing:
    """A case in a folder: the study's own, or the same case of another seed."""

    folder: Path
    name: str
    other_seed: bool = False

    @property
    def size(self) -> int:
        """Bytes of its products, by which to guess how long it takes."""
        return sum(path.stat().st_size for path in self.folder.glob(f"{self.name}.*.h5"))


@dataclass
class Measured:
    """What stays of a case: its row, panels by figure, Table 2, choices, provenance."""

    row: Row
    panels: dict[str, list[Panel]] = field(default_factory=dict)
    second: Table | None = None
    choices: list[list[str]] = field(default_factory=list)
    provenance: list[list[str]] = field(default_factory=list)


def measure(packing: Packing) -> Measured:
    """Measure one packing; of the study's own also draw the panels of the figures that show it."""
    if packing.other_seed:
        return Measured(row_of_seed(packing.name, packing.folder))
    case = Case(packing.name, packing.folder)
    case.check()
    m = Measures(case)
    found = Measured(row_of(m))
    add_elasticity(found.row, m)
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
    packings: Sequence[Packing], jobs: int
) -> tuple[list[tuple[Packing, Measured]], list[str]]:
    """Each packing with what was measured of it, and one line for each that was not.

    Where several are measured at once the long ones come first: no core waits for another's.
    """
    found: list[tuple[Packing, Measured]] = []
    failed: list[str] = []
    with _side_by_side(packings, jobs) as results:
        for packing, result in zip(packings, results, strict=True):
            seed = f" of {packing.folder.name}" if packing.other_seed else ""
            try:
                found.append((packing, result()))
                put(f"{packing.name}{seed}: measured")
            except Exception as error:  # one case must not cost the others
                kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
                failed.append(f"{packing.name}{seed}: {kind}{error}")
    return found, failed


@contextmanager
def _side_by_side(packings: Sequence[Packing], jobs: int) -> Iterator[list[Callable[[], Measured]]]:
    """Calls that wait for what is measured of each packing."""
    if jobs == 1 or len(packings) == 1:
        yield [partial(measure, packing) for packing in packings]
        return
    order = sorted(packings, key=lambda packing: (packing.other_seed, -packing.size))
    with _shared_cores(jobs), ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {packing: pool.submit(measure, packing) for packing in order}
        yield [waiting[packing].result for packing in packings]


@contextmanager
def _shared_cores(jobs: int) -> Iterator[None]:
    """Processes that are started in here share the cores: as many threads each, unless told so."""
    told = os.environ.get(THREADS)
    if told is None:
        os.environ[THREADS] = str(max(1, len(os.sched_getaffinity(0)) // jobs))
    try:
        yield
    finally:
        if told is None:
            del os.environ[THREADS]
