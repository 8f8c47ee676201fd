"""Define a product: an HDF5 file with a schema, in a table of its columns and attributes.

The table defines the format completely: how files are written, read and refused.

>>> track = Product(
...     "granular-track",
...     columns={
...         "time": Column("time", "f", ("nt",), "s"),
...         "place": Column("sphere/position", "f", ("nt", 3), "m", optional=True),
...     },
...     attributes={"name": str},
... )
>>> import tempfile
>>> path = tempfile.mkdtemp() + "/one.track.h5"
>>> track.write(path, {"time": np.arange(3.0), "name": "first"})
>>> sorted(track.read(path).items())
[('name', 'first'), ('place', None), ('time', array([0., 1., 2.]))]
"""

from collections.abc import Callable, Container, Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, get_type_hints

import h5py
import numpy as np

from modal.formats.attributes import number_noted, read_attributes, write_attributes
from modal.formats.column import NUMBER_TYPES, Column, columns_of
from modal.formats.hdf5 import atomic_h5, complete, named, open_h5, put
from modal.formats.provenance import PACKING_DIGEST, Provenance
from modal.formats.storage import walk
from modal.tools.arrays import Array
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers, says

CREATOR = "granular-wave-modes"
"""Value of the attribute `creator` in all files."""
FORMAT_ATTRIBUTES = ("schema", "schema_version", "creator", PACKING_DIGEST)
"""Attributes of the format itself, which every product has."""


UNIT_ATTRIBUTES = ("unit", "units")
"""Names, in small letters, of attributes that state the unit of a dataset."""
PACKING_ATTRIBUTES = {"scale_factor": 1.0, "add_offset": 0.0}
"""Attributes by which other programs scale stored numbers, and their values if nothing is
scaled."""
MISSING_ATTRIBUTES = ("_FillValue", "missing_value")
"""Attributes with a number that stands for a missing one."""


@dataclass(frozen=True)
class Product:
    """A file format: its columns and attributes, and functions to write and read files.

    Attributes
    ----------
    schema : str
        Name of the format.
    columns : mapping
        Columns by the names of their values.
    attributes : mapping
        Functions that convert the attributes of a file, by the names of their values.
    defaults : mapping
        Values of the attributes that a file may lack.
    groups : tuple of str
        Groups of free attributes; each is a dictionary, empty if the file lacks it.
    others : str
        Name of the dictionary of all further attributes of the file; empty for none.
    versions : tuple of int
        Versions that are read.
    since : mapping
        Attributes that need a version: they are written only if they differ from their default, and
        the file then has at least that version.
    """

    schema: str
    columns: Mapping[str, Column]
    attributes: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    defaults: Mapping[str, Any] = field(default_factory=dict)
    groups: tuple[str, ...] = ()
    others: str = ""
    versions: tuple[int, ...] = (1,)
    since: Mapping[str, int] = field(default_factory=dict)

    def write(
        self, path: str | Path, values: Mapping[str, Any], made: Provenance | None = None
    ) -> None:
        """Write the complete file, or leave the previous one; optional columns may be absent.

        `made` is the provenance.
        """
        columns = {}
        for name, column in self.columns.items():
            if not (column.optional and values.get(name) is None):
                columns[name] = column
        omitted = {name for name in self.since if values.get(name) == self.defaults[name]}
        with atomic_h5(path) as file:
            if made:
                made.write(file)
            if self.others:
                write_attributes(file, values[self.others])
            version = self._version(columns, omitted)
            file.attrs.update(schema=self.schema, schema_version=version, creator=CREATOR)
            for name, convert in self.attributes.items():
                may_be_absent = name not in values and name in self.defaults
                if name not in omitted and not may_be_absent:
                    write_attributes(file, {name: convert(values[name])})
            for name, column in columns.items():
                _write_column(file, column, name, values[name])
            for group in self.groups:
                write_attributes(file.require_group(group), values[group])

    def _version(self, columns: Mapping[str, Column], omitted: set[str]) -> int:
        """Return the version of a file with these columns, without the omitted attributes."""
        versions = [1, *(column.since for column in columns.values())]
        versions += [since for name, since in self.since.items() if name not in omitted]
        return max(versions)

    def read(
        self, path: str | Path, leave: Container[str] = (), parts: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return all values by name; absent columns are None.

        Columns in `leave` are not read, and are None. `parts` maps columns to the indices of the
        elements to be read. Raises InputError for any fault of the file.
        """
        with open_h5(path) as file:
            with named(path):
                self._refuse_other_file(file)
                self._refuse_units_of_folders(file)
                values: dict[str, Any] = dict.fromkeys(self.columns)
                values |= self._read_columns(file, leave, parts or {})
                attributes = read_attributes(file)
                for group in self.groups:
                    # `file.get` would take a damaged group for an absent one.
                    values[group] = read_attributes(file[group]) if group in file else {}
            with complete(path):
                for name, convert in self.attributes.items():
                    if name in attributes or name not in self.defaults:
                        values[name] = convert(attributes[name])
                    else:
                        values[name] = self.defaults[name]
        if self.others:
            known = (*FORMAT_ATTRIBUTES, *self.attributes)
            values[self.others] = {
                name: value for name, value in attributes.items() if name not in known
            }
        return values

    def _read_columns(
        self, file: h5py.File, leave: Container[str], parts: Mapping[str, Any]
    ) -> dict[str, Array]:
        """Return the columns that are to be read and that the file has, by name."""
        columns = {}
        for name, column in self.columns.items():
            is_absent = column.optional and column.dataset not in file
            if name not in leave and not is_absent:
                columns[name] = column
        lengths: dict[int | str, int] = {}
        for column in columns.values():  # before memory is taken for the sizes that they declare
            column.check(column.dataset, _find_dataset(file, column), lengths)
        values = {}
        for name, column in columns.items():
            values[name] = _read_column(file, column, lengths, parts.get(name, ()))
        return values

    def _refuse_units_of_folders(self, file: h5py.File) -> None:
        """Raise InputError if the file or a folder of columns says that numbers are not SI."""
        folders = {column.dataset.rpartition("/")[0] for column in self.columns.values()}
        for folder in {"", *(folders & {*file})}:
            _refuse_units(read_attributes(file[folder or "/"]), folder or "the file", "1")

    def _refuse_other_file(self, file: h5py.File) -> None:
        """Raise InputError for another schema or version, and for unknown columns.

        An unknown column, written by a later version of the program, may change the answer. Files
        of version 1 have no such columns.
        """
        attributes = read_attributes(file)
        schema = attributes.get("schema")
        if not (isinstance(schema, str) and schema == self.schema):
            problem = f"schema is {schema!r}, expected {self.schema!r}"
            raise InputError("schema", problem, remedy="wrong file?")
        version = number_noted(attributes, "schema_version")
        if version not in self.versions:
            raise InputError(
                "schema_version",
                f"schema_version is {attributes.get('schema_version')}, this program reads "
                f"{' and '.join(map(str, self.versions))}",
                remedy="convert the file or update the program",
            )
        if version == 1:
            return
        known = {column.dataset for column in self.columns.values()}
        for name, node in walk(file):
            if name not in known and not isinstance(node, h5py.Group):
                problem = f"{name} is unknown to this program and may change the answer"
                remedy = "update the program, or leave it out"
                raise InputError("unknown_column", problem, remedy=remedy)


def product_of(
    schema: str,
    table: type,
    columns: Mapping[str, Column] = MappingProxyType({}),
    attributes: Mapping[str, Callable[[Any], Any]] = MappingProxyType({}),
    *,
    groups: tuple[str, ...] = (),
    others: str = "",
    versions: tuple[int, ...] = (1,),
) -> Product:
    """Return the file format of a dataclass.

    Its columns are the stored fields of the class and further `columns`; its attributes are the
    texts and floating-point numbers of the class and further `attributes`. Attributes that a file
    lacks have the default of their field. The other arguments are those of `Product`.
    """
    kinds = get_type_hints(table)
    plain_fields = [each for each in fields(table) if kinds[each.name] in (str, float)]
    all_attributes = {each.name: kinds[each.name] for each in plain_fields} | dict(attributes)
    defaults = {}
    for each in plain_fields:
        if each.default is not MISSING:
            defaults[each.name] = each.default
    all_columns = columns_of(table) | dict(columns)
    return Product(schema, all_columns, all_attributes, defaults, groups, others, versions)


def _find_dataset(file: h5py.File, column: Column) -> h5py.Dataset:
    """Return the dataset of a column; raise InputError if it is missing, or not in SI units."""
    node = file.get(column.dataset)
    if not isinstance(node, h5py.Dataset):
        problem = f"dataset {column.dataset} is missing"
        raise InputError("missing_dataset", problem, remedy="write it as documented")
    _refuse_units(read_attributes(node), column.dataset, column.unit)
    return node


def _read_column(
    file: h5py.File, column: Column, lengths: dict[int | str, int], indices: Any
) -> Array:
    """Return the numbers of a column, or a part; refuse values that mark a missing number."""
    name = column.dataset
    dataset = _find_dataset(file, column)
    attributes = read_attributes(dataset)
    data = column.array(name, dataset, lengths, indices)
    for attribute in MISSING_ATTRIBUTES:
        number = number_noted(attributes, attribute)
        if number is not None and (data == number).any():
            problem = f"{name} has the number {number:g}, which stands for none by its {attribute}"
            remedy = "give a number there, or leave the column out"
            raise InputError("masked", problem, remedy=remedy)
    return data


def _write_column(file: h5py.File, column: Column, name: str, value: Any) -> None:
    """Write the numbers of a column."""
    numbers = plain_numbers(value, name, column.unit)
    data: Array = np.asarray(numbers).astype(NUMBER_TYPES[column.kind].in_file, copy=False)
    if column.kind == "c":
        data = np.stack([data.real, data.imag], axis=-1)
    put(file, column.dataset, data, column.unit)


def _refuse_units(attributes: Mapping[str, Any], name: str, unit: str) -> None:
    """Raise InputError if the attributes of a dataset say that its numbers are not in SI units."""
    for attribute, value in attributes.items():
        if attribute.lower() not in UNIT_ATTRIBUTES:
            continue
        text = _to_text(value)
        if not says(text, unit):
            raise InputError(
                "unit",
                f"{name} is in {text!r}",
                "all numbers are SI",
                f"convert them to m, kg, s, here {unit}, and say so or nothing",
            )
    for attribute, neutral in PACKING_ATTRIBUTES.items():
        if attribute in attributes and number_noted(attributes, attribute) != neutral:
            problem = f"{name} is packed by its {attribute}"
            raise InputError("unit", problem, remedy="write the numbers themselves")


def _to_text(value: Any) -> str:
    """Return the value of an attribute as a text; for a list of one member, return that member."""
    if isinstance(value, list | np.ndarray) and len(value) == 1:
        value = value[0]
    return str(value)
