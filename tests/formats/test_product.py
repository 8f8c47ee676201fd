"""One table for each format: what is written is read, what the table does not know is refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from refusals import refusal

from modal.formats import hdf5
from modal.formats.column import Column
from modal.formats.product import Product
from modal.tools.errors import InputError

TABLE = Product(
    "granular-trial",
    {
        "time": Column("time", "f", ("nt",), "s"),
        "index": Column("spheres/index", "i", ("n",), "1"),
        "answer": Column("spheres/answer", "c", ("nt", "n"), "m/N", optional=True),
        "twist": Column("spheres/twist", "f", ("n",), "N m", optional=True, since=2),
    },
    {"height": float, "direction": str},
    defaults={"direction": "z"},
    groups=("study",),
    others="further",
    versions=(1, 2),
)
VALUES = {
    "time": np.arange(3.0),
    "index": np.array([4, 2]),
    "answer": np.arange(6).reshape(3, 2) * (1 + 2j),
    "height": 0.5,
    "direction": "x",
    "study": {"seed": 3},
    "further": {"solver": "banded"},
}


@pytest.fixture
def file(tmp_path):
    TABLE.write(tmp_path / "a.h5", VALUES)
    return tmp_path / "a.h5"


def test_what_is_written_is_read(file):
    values = TABLE.read(file)
    assert values.pop("twist") is None
    assert values.keys() == VALUES.keys()
    for name, value in VALUES.items():
        np.testing.assert_array_equal(values[name], value)


def test_columns_and_attributes_may_be_left_out(file):
    assert TABLE.read(file, leave=["answer"])["answer"] is None
    with h5py.File(file, "a") as raw:
        assert raw.attrs["schema_version"] == 1
        del raw.attrs["direction"]
    assert TABLE.read(file)["direction"] == "z"


def test_a_column_of_a_later_version_says_so(file):
    TABLE.write(file, VALUES | {"twist": np.ones(2)})
    with h5py.File(file) as raw:
        assert raw.attrs["schema_version"] == 2
    with refusal("schema_version"):
        Product(TABLE.schema, TABLE.columns).read(file)


@pytest.mark.parametrize(
    ("dataset", "data", "code", "names"),
    [
        ("time", [0.0, np.nan, 2.0], "not_finite", ["time", "row 1"]),
        ("time", [0.0, np.inf, 2.0], "not_finite", ["time", "row 1"]),
        ("time", "noon", "wrong_kind", ["time"]),
        ("time", [1j, 2, 3], "wrong_kind", ["time"]),
        ("time", [[0.0], [1.0], [2.0]], "wrong_shape", ["time", "(3, 1)", "('nt',)"]),
        ("time", None, "missing_dataset", ["time"]),
        ("spheres/index", [1.5, 2.0], "wrong_kind", ["spheres/index"]),
        ("spheres/index", [1, 2, 3], "wrong_shape", ["spheres/answer", "(3, 2, 2)", "(3, 3, 2)"]),
        ("spheres/twist", [1.0], "wrong_shape", ["spheres/twist"]),
        ("bonds/cohesion", [1.0, 1.0], "unknown_column", ["bonds/cohesion"]),
        ("height", None, "incomplete", ["height"]),
    ],
)
def test_file_that_does_not_fit_the_table_is_refused(file, dataset, data, code, names):
    with h5py.File(file, "a") as raw:
        raw.attrs["schema_version"] = 2
        node = raw.attrs if dataset == "height" else raw
        node.pop(dataset, None)
        if data is not None:
            raw[dataset] = data
    with pytest.raises(InputError) as refused:
        TABLE.read(file)
    assert refused.value.code == code
    line = str(refused.value)
    assert "\n" not in line
    for name in ("a.h5", *names):
        assert name in line


def test_memory_of_a_file_that_cannot_be_written_is_given_back(tmp_path, monkeypatch):
    lent = []

    def write_to_a_full_disk(path, data):
        lent.append(data)
        raise OSError("no space left")

    monkeypatch.setattr(hdf5, "write_whole", write_to_a_full_disk)
    with pytest.raises(OSError), hdf5.atomic_h5(tmp_path / "a.network.h5"):
        pass
    with pytest.raises(ValueError):  # of a memoryview that was released
        len(lent[0])
