"""A table with a row for each packing of a study, made row by row and resumed."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd


def complete_table(
    path: Path, name: str, values: Sequence[float], seeds: Sequence[int], make: Callable[..., Any]
) -> None:
    """Write the rows that a table lacks, each as soon as `make(value, seed)` has made it.

    `name` is the column of `values`; the seeds are in the column `seed`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = []
    if path.exists():
        rows = pd.read_csv(path).to_dict("records")
    present = {(row[name], row["seed"]) for row in rows}
    for seed in seeds:
        for value in values:
            if (value, seed) not in present:
                rows.append(make(value, seed))
                pd.DataFrame(rows).to_csv(path, index=False, float_format="%.7g")
