"""The list of mutants that compute the same names lines that are there."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_listed_line_stands_in_its_module():
    rows = tomllib.loads((ROOT / "tests/mutation/equivalent.toml").read_text())["mutant"]
    gone = [
        (row["path"], row["before"])
        for row in rows
        if row["before"] not in " ".join((ROOT / row["path"]).read_text().split())
    ]
    assert rows and not gone
