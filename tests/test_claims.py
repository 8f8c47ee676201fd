"""Numbers in the sentences of documents against the committed files that they come from."""

from pathlib import Path

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


def read_number(file: str, rows: str, column: str) -> float:
    """Return the number of a column, or of an expression of columns, in some rows of a file."""
    table = pd.read_csv(ROOT / "results" / file).query(rows, engine="python")
    value = table.eval(column, engine="python")
    if isinstance(value, pd.Series):
        (value,) = value
    return float(value)


def join_words(text: str) -> str:
    """Return a text with one space between its words, wherever its lines end."""
    return " ".join(text.split())


@pytest.mark.parametrize(("page", "claim"), CLAIMS)
def test_sentence_has_the_numbers_of_its_files(page, claim):
    """Fill the places of a sentence with numbers of files: the document has this sentence."""
    sources = dict(claim)
    text = sources.pop("text")
    numbers = {name: read_number(*source) for name, source in sources.items()}
    assert text.format(**numbers) in join_words((ROOT / f"docs/{page}.md").read_text())
