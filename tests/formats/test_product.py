"""One table for each format: what is written is read, what the table does not know is refused."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from modal.formats.product import Column, Product
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
    said = TABLE.read(file)
    assert said.pop("twist") is None
    for name, value in VALUES.items():
        np.testing.assert_array_equal(said.pop(name), value)
    assert not said
    assert TABLE.read(file, leave=["answer"])["answer"] is None
    with h5py.File(file, "a") as raw:
        assert raw.attrs["schema_version"] == 1
        del raw.attrs["direction"]
    assert TABLE.read(file)["direction"] == "z"


def test_a_column_of_a_later_version_says_so(file):
    TABLE.write(file, VALUES | {"twist": np.ones(2)})
    with h5py.File(file) as raw:
        assert raw.attrs["schema_version"] == 2
    with pytest.raises(InputError, match="schema_version is 2, this program reads 1;"):
        Product(TABLE.schema, TABLE.columns).read(file)


@pytest.mark.parametrize(
    ("dataset", "data", "said"),
    [
        ("time", [0.0, np.nan, 2.0], "time is not finite"),
        ("time", [0.0, np.inf, 2.0], "time is not finite in row 1"),
        ("time", "noon", "time is no array of numbers; write"),
        ("time", [1j, 2, 3], "time is no array of numbers"),
        ("time", [[0.0], [1.0], [2.0]], r"time has shape .3, 1., expected .'nt',."),
        ("time", None, "dataset time is missing"),
        ("spheres/index", [1.5, 2.0], "spheres/index is no array of whole numbers"),
        ("spheres/index", [1, 2, 3], r"spheres/answer has shape .3, 2, 2., expected .3, 3, 2."),
        ("spheres/twist", [1.0], "spheres/twist has shape"),
        ("bonds/cohesion", [1.0, 1.0], "bonds/cohesion is unknown .* may change the answer"),
        ("height", None, "height.*incomplete, make it again"),
    ],
)
def test_what_does_not_fit_the_table_is_refused(file, dataset, data, said):
    with h5py.File(file, "a") as raw:
        raw.attrs["schema_version"] = 2
        where = raw.attrs if dataset == "height" else raw
        where.pop(dataset, None)
        if data is not None:
            raw[dataset] = data
    with pytest.raises(InputError, match=said) as caught:
        TABLE.read(file)
    assert "\n" not in str(caught.value) and "a.h5" in str(caught.value)
