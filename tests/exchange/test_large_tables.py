"""Numbers of large tables: pandas and numpy read the same doubles, and refuse the same rows.

numpy's reader is the oracle. Python's `float` gives the nearest double.
"""

import numpy as np
import pytest

from modal.exchange import lines, numbers
from modal.exchange.lines import Lines
from modal.exchange.row_texts import RowTexts
from modal.exchange.rows import Rows
from modal.tools.errors import InputError

SPELLINGS = [
    "1.5",
    "+1",
    "-.5",
    "1.",
    "1e5",
    "1E-5",
    "1e400",
    "1e-400",
    "-0.0",
    "nan",
    "NaN",
    "NA",
    "NULL",
    "inf",
    "-Infinity",
    "True",
    "1d5",
    "0x10",
    "1_0",
    ".",
    "e5",
    "1e",
    "--1",
    "1;5",
    "1.5abc",
    "١",
    '"1"',
    "'1'",
    "1\x002",
]
"""Words that are numbers, and words that some readers take for numbers."""


def row_texts(words: list[list[str]], separator: str = " ") -> RowTexts:
    """Return rows of words as a file has them."""
    rows = [(separator.join(row) + "\n").encode() for row in words]
    return RowTexts(b"".join(rows), np.cumsum([len(row) for row in rows]))


def bits(table: np.ndarray) -> np.ndarray:
    """Return doubles as integers, which tell -0 from 0."""
    return table.view(np.int64)


@pytest.mark.parametrize("layout", [".17g", ".16e", ".9f", ".30e", ".6g"])
@pytest.mark.parametrize("separator", [None, ",", ";", "\t"])
def test_pandas_and_numpy_read_the_nearest_doubles(layout, separator):
    """Read doubles of all sizes, also those below the normal ones, in columns of any order."""
    pytest.importorskip("pandas")
    rng = np.random.default_rng(1)
    values = rng.integers(0, 2**63, 900).view(float)
    values = np.where(np.isfinite(values), values, 0.0)
    if layout == ".9f":
        values = rng.normal(size=900)
    words = [[format(x, layout) for x in row] for row in values.reshape(-1, 3).tolist()]
    texts = row_texts(words, separator or "  ")
    columns = [2, 0, 2]
    expected = np.array([[float(row[k]) for k in columns] for row in words])
    for parse in (numbers.parse_by_pandas, numbers.parse_by_numpy):
        np.testing.assert_array_equal(bits(parse(texts, columns, separator)), bits(expected))


@pytest.mark.parametrize("word", SPELLINGS)
def test_what_pandas_reads_numpy_reads_alike(word):
    pytest.importorskip("pandas")
    for separator in (None, ","):
        texts = row_texts([["1", "2"], ["3", word], ["5", "6"]], separator or " ")
        by_pandas = numbers.parse_by_pandas(texts, [0, 1], separator)
        if by_pandas is not None:
            by_numpy = numbers.parse_by_numpy(texts, [0, 1], separator)
            np.testing.assert_array_equal(bits(by_pandas), bits(by_numpy))


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ("1 2\n3 x\n5 6\n", "not_a_number", 3),
        ("1 2\n3\n5 6\n", "short_row", 3),
        ("1 2\n\n5 6\n", "empty_line", 3),
        ("1 2\n3 inf\n5 6\n", "not_finite", 3),
        ("1 2\n3 4\n5 \0\n", "not_a_number", 4),
    ],
)
@pytest.mark.parametrize("has_pandas", [True, False])
def test_faults_are_named_with_and_without_pandas(
    tmp_path, monkeypatch, text, code, line, has_pandas
):
    monkeypatch.setattr(numbers, "MIN_ROWS_BY_PANDAS", 1)
    if not has_pandas:
        monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    path = tmp_path / "x"
    path.write_text("a b\n" + text)
    reader = Lines(path)
    next(reader)
    rows = Rows(path, ("a", "b"), reader.take_rows(), 2)
    with pytest.raises(InputError) as refused:
        rows.read("a", "b")
    assert refused.value.code == code
    assert f"line {line}" in refused.value.problem


@pytest.mark.parametrize("block", [5, 8, 64, 1 << 22])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_are_those_of_python(tmp_path, monkeypatch, block, end):
    """Compare with Python's universal line ends, whatever ends where a block ends."""
    monkeypatch.setattr(lines, "BLOCK_BYTES", block)
    text = end.join(["\ufeffone", "", "zwei\u00fc", "3 4", "ITEM: next", "five", "six"])
    path = tmp_path / "x"
    path.write_bytes(text.encode())
    with path.open(encoding="utf-8-sig") as file:
        expected = file.readlines()
    assert [line for _, line in Lines(path)] == expected
    reader = Lines(path)
    next(reader)
    rows = reader.take_rows()
    assert [*rows] == expected[1:4] == [rows[k] for k in range(3)]
    assert rows[-2:] == expected[2:4]
    assert next(reader) == (5, "ITEM: next\n")
    reader.step_back()
    assert len(reader.take_rows()) == 0
    next(reader)
    assert [*reader.take_rows(1)] == ["five\n"]
    assert [*reader.take_rows(9)] == ["six"]
    assert next(reader, None) is None


def test_an_archive_is_read_in_blocks(tmp_path):
    """Take rows of more bytes than a block, up to a count and up to the end."""
    count = lines.BLOCK_BYTES // 20
    path = tmp_path / "x"
    path.write_bytes(b"".join(b"%d 0.123456789012345678\n" % k for k in range(count)))
    assert path.stat().st_size > lines.BLOCK_BYTES
    reader = Lines(path)
    first = reader.take_rows(count - 1)
    assert len(first) == count - 1
    assert next(reader) == (count, f"{count - 1} 0.123456789012345678\n")
    assert first.data.count(b"\n") == len(first)
    np.testing.assert_array_equal(numbers.parse_columns(first, [0], None)[:, 0], range(count - 1))
