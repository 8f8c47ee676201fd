"""Numbers of the columns of a text: by numpy, and large tables by pandas where it is installed.

Both give the double that is nearest to what is written, so that which of them reads is never seen
in a number. What pandas does not read as numbers numpy judges: it takes a few spellings more.
"""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from modal.exchange.row_texts import RowTexts
from modal.tools.arrays import Floats

MIN_ROWS_BY_PANDAS = 50_000
"""Number of rows from which pandas is asked: with fewer rows loading it takes longer than numpy."""
EXACT_BY_DEFAULT = (3, 1)
"""Version of pandas from which its default is the nearest double; before, it is an option."""


def parse_columns(texts: Sequence[str], indices: Sequence[int], separator: str | None) -> Floats:
    """Return the numbers (n, k) of k columns, given by their indices from 0.

    Raises ValueError for a text that is no number and for a row that is too short. Blank rows are
    left out.
    """
    if isinstance(texts, RowTexts) and len(texts) >= MIN_ROWS_BY_PANDAS:
        table = parse_by_pandas(texts, indices, separator)
        if table is not None:
            return table
    return parse_by_numpy(texts, indices, separator)


def parse_by_numpy(texts: Sequence[str], indices: Sequence[int], separator: str | None) -> Floats:
    """Return the numbers (n, k) as `parse_columns`."""
    source: Sequence[str] | io.TextIOWrapper = texts
    if isinstance(texts, RowTexts):  # as a file, which is read in less time than row by row
        source = io.TextIOWrapper(io.BytesIO(texts.data), "utf-8", "replace", newline="\n")
    table: Floats = np.loadtxt(source, usecols=indices, comments=None, delimiter=separator, ndmin=2)
    return table


def parse_by_pandas(
    texts: RowTexts, indices: Sequence[int], separator: str | None
) -> Floats | None:
    """Return the numbers (n, k) as `parse_columns`; None if pandas is absent or finds a fault."""
    try:
        import pandas
    except ImportError:
        return None
    if b"\0" in texts.data:  # a word ends there for pandas
        return None
    options: dict[str, Any] = {}
    if tuple(int(part) for part in pandas.__version__.split(".")[:2]) < EXACT_BY_DEFAULT:
        options["float_precision"] = "round_trip"
    try:
        table = pandas.read_csv(
            io.BytesIO(texts.data),
            sep=separator or r"\s+",
            header=None,
            usecols=sorted(set(indices)),
            dtype=float,
            engine="c",
            low_memory=False,
            na_filter=False,
            quoting=3,  # none
            skip_blank_lines=False,
            skipinitialspace=True,
            **options,
        )
    except ValueError:
        return None
    if len(table) != len(texts):
        return None
    numbers: Floats = np.ascontiguousarray(table[list(indices)].to_numpy())
    return numbers
