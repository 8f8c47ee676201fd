"""The glossary of `docs/index.md`: each word stands there once, is used, and is told only there."""

import re

from places import ROOT
from test_docs import users_pages


def glossary_words():
    """Return the words of the glossary, each name of a row by itself."""
    index = (ROOT / "docs/index.md").read_text()
    table = index.partition("| word | meaning |")[2].partition("```")[0]
    rows = re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE)[1:]
    return [word for row in rows for word in row.split(", ")]


def test_words_stand_once_and_are_used_by_a_page():
    words = glossary_words()
    assert len(words) > 30
    assert len(set(words)) == len(words)
    pages = [page.read_text() for page in users_pages() if page.name != "index.md"]
    text = " ".join(" ".join(pages).split()).lower()
    unused = [word for word in words if word.lower() not in text]
    assert unused == []


def test_words_are_defined_nowhere_else():
    """Look for "the *rough wall*", or "near field means"."""
    for page in users_pages():
        text = " ".join(page.read_text().split())
        for word in glossary_words():
            name = re.escape(word)
            pattern = rf"\b(?:a|an|the) \*{name}\*|\b{name} (?:means|denotes)\b"
            assert not re.search(pattern, text, re.IGNORECASE), (page.name, word)
