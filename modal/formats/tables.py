"""Return results as tables of pandas and xarray, which are imported only when needed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import fields
from html import escape
from types import ModuleType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from modal.formats.column import columns_of
from modal.tools.arrays import Array
from modal.tools.errors import UnavailableError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

PACKAGES = {"vtkmodules": "vtk"}
"""Names of packages by the names of their modules, where these differ."""
MAX_HTML_ROWS = 20
"""Largest number of rows that a notebook shows of a table."""


def load_optional(name: str, purpose: str) -> ModuleType:
    """Return an optional module; raise UnavailableError, with the way to install it, if absent.

    >>> load_optional("no_such_package", "tables")
    Traceback (most recent call last):
        ...
    modal.tools.errors.UnavailableError: tables need no_such_package; pip install no_such_package
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        module = name.partition(".")[0]
        package = PACKAGES.get(module, module)
        raise UnavailableError(
            "not_installed", f"{purpose} need {package}", remedy=f"pip install {package}"
        ) from error


def html_table(header: list[str], rows: list[list[str]], more: int = 0) -> str:
    """Return a table in HTML; `more` is the number of rows that are left out.

    >>> html_table(["f, Hz"], [["<1"]])
    '<table><tr><th>f, Hz</th></tr><tr><td>&lt;1</td></tr></table>'
    """
    lines = ["".join(f"<th>{escape(name)}</th>" for name in header)]
    lines += ["".join(f"<td>{escape(text)}</td>" for text in row) for row in rows]
    if more > 0:
        lines.append(f'<td colspan="{len(header)}">{more} more</td>')
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


class Tabular:
    """A dataclass with stored columns, which can be converted to tables of pandas and xarray.

    `DIMENSIONS` names the lengths of the columns, `ROWS` the dimension of the rows of a table, and
    `INDEX` the column that is its index; if empty, rows are counted from 1.
    """

    DIMENSIONS: ClassVar[Mapping[int | str, str]] = {}
    ROWS: ClassVar[str] = ""
    INDEX: ClassVar[str] = ""

    def to_pandas(self) -> pd.DataFrame:
        """Return the columns with one number per row as a pandas DataFrame, units in `attrs`."""
        pandas = load_optional("pandas", "tables")
        columns = {}
        units = {}
        for name, (dimensions, data, unit) in self._labelled().items():
            if dimensions == (self.ROWS,):
                columns[name] = data
                units[name] = unit
        if self.INDEX:
            index = pandas.Index(columns.pop(self.INDEX), name=self.INDEX)
        else:
            count = len(next(iter(columns.values())))
            index = pandas.RangeIndex(1, count + 1, name=self.ROWS)
        frame: pd.DataFrame = pandas.DataFrame(columns, index=index)
        frame.attrs["units"] = units
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Return all columns as an xarray Dataset; the unit of each is in its `attrs`."""
        xarray = load_optional("xarray", "labelled arrays")
        variables = {}
        coordinates = {}
        for name, (dimensions, data, unit) in self._labelled().items():
            variable = (dimensions, data, {"units": unit})
            if name == self.INDEX:
                coordinates[self.ROWS] = variable
            else:
                variables[name] = variable
        dataset: xr.Dataset = xarray.Dataset(variables, coordinates)
        return dataset

    def _labelled(self) -> dict[str, tuple[tuple[str, ...], Array, str]]:
        """Return, for each column that is present, names of dimensions, numbers and unit."""
        labelled = {}
        columns = columns_of(type(self))
        for field in fields(self):  # type: ignore[arg-type]
            column = columns.get(field.name)
            value = getattr(self, field.name)
            if column is None or value is None or np.size(value) == 0:
                continue
            names: list[str] = []
            for length in column.shape:
                name = self.DIMENSIONS.get(length, str(length))
                same = sum(other.partition(" ")[0] == name for other in names)
                names.append(f"{name} {same + 1}" if same else name)
            labelled[field.name] = (tuple(names), np.asarray(value), column.unit)
        return labelled
