"""Numbers in the sentences of documents against the committed files that they come from."""

import functools
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
CLAIMS = [
    pytest.param(page.stem, claim, id=f"{page.stem}-{number}")
    for page in sorted((ROOT / "tests/claims").glob("*.yaml"))
    for number, claim in enumerate(yaml.safe_load(page.read_text()))
]
"""Name of the document and claim: a text with places for numbers, and the source of each."""


def split_row(line: str) -> list[str]:
    """Return the cells of a row of a Markdown table."""
    return [cell.strip() for cell in line.strip("|").split("|")]


@functools.cache
def read_table(path: Path) -> pd.DataFrame:
    """Return the table of a CSV or Markdown file; other cells than numbers are texts."""
    if path.suffix == ".csv":
        return pd.read_csv(path)
    lines = [line for line in path.read_text().splitlines() if line.startswith("|")]
    header, _, *rows = [split_row(line) for line in lines]
    table = pd.DataFrame(rows, columns=header)
    for column in header:
        with suppress(ValueError):
            table[column] = pd.to_numeric(table[column])
    return table


def read_number(file: str, rows: str, column: str) -> float:
    """Return the number of a column, or of an expression of columns, in some rows of a file.

    Of a text this is its first word: the number of "548.5 m/s". Expressions may call numpy: @np.
    """
    table = read_table(ROOT / "results" / file).query(rows, engine="python")
    if column in table:
        value = table[column]
    else:
        value = table.eval(column, engine="python", local_dict={"np": np})
    if isinstance(value, pd.Series):
        (value,) = value
    return float(str(value).split()[0])


def document(page: str) -> Path:
    """Return the file of a page of documents, or of one beside them (README)."""
    path = ROOT / f"docs/{page}.md"
    if path.exists():
        return path
    return ROOT / f"{page}.md"


def join_words(text: str) -> str:
    """Return a text with one space between its words, wherever its lines end."""
    return " ".join(text.split())


@pytest.mark.parametrize(("page", "claim"), CLAIMS)
def test_sentence_has_the_numbers_of_its_files(page, claim):
    """Fill the places of a sentence with numbers of files: the document has this sentence."""
    sources = dict(claim)
    text = sources.pop("text")
    numbers = {name: read_number(*source) for name, source in sources.items()}
    assert text.format(**numbers) in join_words(document(page).read_text())
