"""Hold the measured values of a case.

A `CaseResult` holds values with their errors, and curves, but not the contents of the case's files:
therefore a whole study fits into memory, and its cases can be measured in parallel.
`analysis.result_file` writes and reads results as files. Tables and figures of several cases are
made from these files alone, so that a clone of the project makes them in seconds, without any
product.

Values are those of `measure`, in SI units. Tables and studies see them as columns, whose names and
units are those of the paper's tables (`CaseResult.columns`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from analysis.case_columns import (
    OF_RECORD,
    PRODUCER_NAMES,
    Cell,
    cell_of_value,
    of_one_producer,
    paper_column,
)
from analysis.value import Value


@dataclass
class CaseResult:
    """The measured values of one case.

    Attributes
    ----------
    number : int or None
        Number of the case in the study; None for another packing.
    name, label : str
        Name of its files, and short name for legends.
    crystal : bool
    stress : float, Pa
    mu_comp : float
        Friction of the compression.
    record : str
        "yade", or "linear" if there is no recorded run.
    unsettled : str
        Why the packing does not count as being at rest; empty for a packing at rest.
    values : dict of str to Value
        Values in SI units by quantity. A value without unit has the unit of its column, which is
        then its name.
    samples : dict of str to float
        Standard deviation over packings of other seeds, by column and in its unit.
    packings : int
        Number of these packings, this one included.
    flat : dict of str to bool
        Whether the frequency of a threshold is on a plateau, by threshold.
    curves : dict of str to tuple of ndarray (n,)
        Arrays by name, in SI units; of a quantity over frequency: frequencies, values, errors.
    texts : dict of str to str
    absent : list of str
        Kinds of files that do not exist.
    notes : list of str
    state : bool
        Whether it is a state during a compression, not a case.
    tables : dict of str to list of lines
        Cells of text by the name of a table.
    provenance : list of lines
        A line for each file that was read.
    paper_columns : bool
        Whether columns have the names and units of the paper's tables; otherwise each has the name
        and the SI unit of its quantity.
    """

    number: int | None
    name: str
    label: str
    crystal: bool
    stress: float
    mu_comp: float
    record: str
    unsettled: str
    values: dict[str, Value] = field(default_factory=dict)
    samples: dict[str, float] = field(default_factory=dict)
    packings: int = 1
    flat: dict[str, bool] = field(default_factory=dict)
    curves: dict[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    absent: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    state: bool = False
    tables: dict[str, list[list[str]]] = field(default_factory=dict)
    provenance: list[list[str]] = field(default_factory=list)
    paper_columns: bool = True

    @property
    def columns(self) -> dict[str, Cell]:
        """Return the numbers by their column, in the column's unit."""
        cells = {}
        for name, value in self.values.items():
            column, factor = self.column_of(name, value.unit)
            cells[column] = cell_of_value(value, factor, self.paper_columns)
        return cells

    def column_of(self, quantity: str, unit: str) -> tuple[str, float]:
        """Return the column of a quantity, and the factor of its numbers."""
        if not unit or not self.paper_columns:
            return quantity, 1.0
        return paper_column(quantity, unit)

    def value(self, column: str) -> float:
        """Return the number in a column; NaN if it is not known."""
        cells = self.columns
        if column not in cells:
            return np.nan
        return cells[column].value

    def spread(self, column: str) -> float:
        """Return the error of a number, or its scatter over packings if that is larger.

        The scatter contains the error. NaN if neither is known.
        """
        cell = self.columns.get(column, Cell(np.nan))
        return float(np.fmax(cell.error, self.scatter(column)))

    def scatter(self, column: str) -> float:
        """Return the standard deviation of a column over packings; NaN if it is not known.

        What is read from a record of YADE or from the linear wave scatters like the quantity of the
        case that is read by the same rule: packings of other seeds may have one of both records.
        """
        for name, of_record in OF_RECORD.items():
            is_same_rule = column in (of_record.format(record=record) for record in PRODUCER_NAMES)
            if is_same_rule and column not in self.samples:
                return self.samples.get(name, np.nan)
        return self.samples.get(column, np.nan)

    @property
    def group(self) -> str:
        """Return the group whose cases figures join by lines: FCC, or a friction coefficient."""
        if self.crystal:
            return "FCC"
        return f"random, friction {self.mu_comp:g} during compression"


def scatter_of_samples(packings: Sequence[CaseResult]) -> dict[str, float]:
    """Compute the standard deviation of each column of the first packing over all packings.

    The packings are those of one case, of different seeds. All quantities of records are those of
    the same program. Empty for a single packing.
    """
    producers = [packing.record for packing in packings]
    columns = [packing.columns for packing in packings]
    scatter = {}
    for name in columns[0]:
        _, column = of_one_producer(producers, OF_RECORD.get(name, name))
        numbers = [cells[column].value if column in cells else np.nan for cells in columns]
        deviation = pd.Series(numbers).std()
        if np.isfinite(deviation):
            scatter[name] = float(deviation)
    return scatter
