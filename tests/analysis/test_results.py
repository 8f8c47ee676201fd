"""Write and read results of cases: values in SI units, as columns, and files of version 1."""

import json

import numpy as np
import pytest
from places import ROOT

from analysis.case_columns import OF_RECORD, paper_column
from analysis.case_result import CaseResult
from analysis.caveats import Caveat
from analysis.result_file import read_result, write_result
from analysis.value import Value
from modal.tools.errors import InputError

COMMITTED = ROOT / "results/study/cases/case06.json"
"""A result whose values are by column, in the units of the paper's tables."""
FREQUENCY = Value(
    189_300.0,
    "Hz",
    {"fit": 300.0, "length": 400.0},
    (Caveat("no_plateau", {"change": 0.2}),),
    plateau=False,
)


@pytest.fixture
def row():
    """Return a case with an exact number, a frequency, and a number that is not known."""
    row = CaseResult(6, "case06", "random", False, 1e5, 0.1, "linear", "")
    row.values["void_ratio"] = Value(0.544, "1")
    row.values["f_max"] = FREQUENCY
    row.values["bulk_modulus"] = Value(np.nan, "Pa", {"fit": np.nan}, (Caveat("absent"),))
    return row


@pytest.fixture
def written(row, tmp_path):
    """Return the file of that case."""
    write_result(tmp_path / "case06.json", row)
    return tmp_path / "case06.json"


def test_a_result_has_the_values_of_measure(row, written):
    """Read unit, parts of the error, caveats and plateau from the file, all in SI units."""
    values = json.loads(written.read_text())["values"]
    assert values == {name: value.as_json() for name, value in row.values.items()}


def test_values_are_read_as_they_were_written(written):
    again = read_result(written).values["f_max"]
    assert (again.value, again.unit, again.parts) == (189_300.0, "Hz", FREQUENCY.parts)
    assert again.error == FREQUENCY.error == 500.0
    assert (again.codes, again.plateau) == (["no_plateau"], False)
    assert [str(caveat) for caveat in again.caveats] == [str(each) for each in FREQUENCY.caveats]


def test_columns_have_the_units_of_the_tables(written):
    """Give an exact number no error in a table, and NaN for what is not known."""
    columns = read_result(written).columns
    assert columns["f_max_khz"] == (189.3, 0.5, 0.4)
    assert columns["void_ratio"].value == 0.544
    assert np.isnan(columns["void_ratio"].error)
    assert np.isnan(columns["bulk_modulus_mpa"].value)


def test_columns_of_a_study_by_quantities_are_in_si_units(row):
    row.paper_columns = False
    assert row.columns["f_max"] == (189_300.0, 500.0, 400.0)
    assert row.columns["void_ratio"].error == 0


def test_a_result_by_column_keeps_all_digits():
    """Convert values to SI units and back to columns with all digits of the file."""
    cells = json.loads(COMMITTED.read_text())["values"]
    row = read_result(COMMITTED)
    columns = row.columns
    assert list(columns) == list(cells)
    for name, cell in cells.items():
        for kind in ("value", "error"):
            number = np.nan if cell[kind] is None else cell[kind]
            assert getattr(columns[name], kind) == pytest.approx(number, rel=0, abs=0, nan_ok=True)
    assert row.values["f_max"].unit == "Hz"
    assert row.values["f_max"].value == pytest.approx(1e3 * cells["f_max_khz"]["value"])


def test_a_result_by_column_is_written_with_units(tmp_path):
    write_result(tmp_path / "again.json", read_result(COMMITTED))
    again = read_result(tmp_path / "again.json")
    assert all(value.unit for value in again.values.values())
    before = read_result(COMMITTED).columns
    for name, cell in again.columns.items():
        assert cell == pytest.approx(before[name], rel=1e-11, nan_ok=True)


def test_columns_of_the_record_are_those_of_its_quantities():
    """Compare the columns of both tables of copies."""
    units = {"v": "m/s", "f": "Hz", "l": "1"}
    row = read_result(COMMITTED)
    copies = [name for name in row.values if "_of_record" in name]
    columns = [paper_column(name, units[name[0]])[0] for name in copies]
    assert columns == [column for column in row.columns if column in OF_RECORD]
    assert len(columns) == len(OF_RECORD)


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param({"unit": "furlong"}, id="unit"),
        pytest.param({"parts": {"mystery": 1.0}}, id="part"),
        pytest.param({"codes": ["absent", "absent"]}, id="codes"),
        pytest.param({"value": "many"}, id="value"),
    ],
)
def test_a_damaged_value_is_refused(written, wrong):
    contents = json.loads(written.read_text())
    contents["values"]["f_max"] |= wrong
    written.write_text(json.dumps(contents))
    with pytest.raises(InputError) as refused:
        read_result(written)
    assert refused.value.code == "result"
    assert "values.f_max" in refused.value.reason


@pytest.mark.parametrize("first", [[], [500.0, 600.0]])
def test_the_first_resonance_is_one_frequency(tmp_path, first):
    """Return one number, by which figures divide the gain's frequencies."""
    contents = json.loads((ROOT / "results/study/cases/case02.json").read_text())
    contents["curves"]["first"] = [first]
    path = tmp_path / "case02.json"
    path.write_text(json.dumps(contents))
    with pytest.raises(InputError) as refused:
        read_result(path)
    assert refused.value.code == "result"
    assert "curves.first" in refused.value.reason
