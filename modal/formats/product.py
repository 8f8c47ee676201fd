"""A product: an HDF5 file of one schema, told by one table of its columns and attributes.

The table is all that a format needs: files are written, read and refused by it alone.

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
from typing import Any, NamedTuple, get_type_hints

import h5py
import numpy as np

from modal.formats.attributes import number_noted, read_attributes, write_attributes
from modal.formats.hdf5 import atomic_h5, complete, named, open_h5, put
from modal.formats.provenance import OF_PACKING, Provenance
from modal.formats.storage import refuse_hidden, walk
from modal.tools.arrays import Array
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers, says

CREATOR = "granular-wave-modes"
OF_THE_FORMAT = ("schema", "schema_version", "creator", OF_PACKING)
"""Attributes that each product has, and that are none of its own."""
KINDS = {
    "f": ("fiu", "numbers", np.float64),
    "i": ("iu", "whole numbers", np.int64),
    "b": ("biu", "yes or no", np.bool_),
    "c": ("fiu", "numbers", np.float64),
}
"""Of each kind of column: the kinds of array that are taken, its name, and what it is made. Complex
numbers are stored as (..., 2), real and imaginary part."""
STORED = {"f": np.float64, "i": np.int32, "b": np.bool_, "c": np.complex128}
OF_UNITS = ("unit", "units")
"""Names of attributes, in small letters, that say the unit of a dataset."""
OF_PACKED = {"scale_factor": 1.0, "add_offset": 0.0}
"""Attributes by which other programs pack numbers, and what these are where nothing is packed."""
OF_MISSING = ("_FillValue", "missing_value")
"""Attributes that name a number which stands for none."""


class Column(NamedTuple):
    """A dataset: its place in the file, kind of number, lengths, unit.

    A length with a name is the same in all columns of the file. Of a file that has the column,
    `since` is the lowest version: a program that would miss it refuses the file. What may be
    infinite or no number is not `finite`.
    """

    dataset: str
    kind: str
    shape: tuple[int | str, ...]
    unit: str
    optional: bool = False
    finite: bool = True
    since: int = 1

    def check(self, name: str, given: Any, lengths: dict[int | str, int]) -> None:
        """InputError where an array or a dataset has another kind or shape than this column.

        Nothing of a dataset is read, whatever it says of itself.
        """
        taken, words, _ = KINDS[self.kind]
        if given.dtype.kind not in taken:
            raise InputError(
                "wrong_kind", f"{name} is no array of {words}", remedy="write it as documented"
            )
        if isinstance(given, h5py.Dataset):
            refuse_hidden(given, name)
        shape = self.shape if self.kind != "c" else (*self.shape, 2)
        wanted = tuple(lengths.get(n, n) for n in shape)
        pairs = zip(wanted, given.shape, strict=False)
        if given.ndim != len(wanted) or any(w != n for w, n in pairs if not isinstance(w, str)):
            problem = f"{name} has shape {given.shape}, expected {wanted}"
            raise InputError("wrong_shape", problem, remedy="mend it")
        lengths.update(zip(shape, given.shape, strict=True))

    def array(self, name: str, given: Any, lengths: dict[int | str, int], of: Any = ()) -> Array:
        """What is `given`, a dataset or like an array, as an array of this column; or InputError.

        `of` has the indices of the part that is taken. Lengths with a name are those in `lengths`,
        or new there. In memory whole numbers may keep 4 bytes: six times a number fits.
        """
        stored = isinstance(given, h5py.Dataset)
        if not stored:
            given = _as_array(plain_numbers(given, name, self.unit))
        self.check(name, given, lengths)
        data: Array = given[of]
        if self.kind == "i":
            data = _whole_numbers(name, data, keep=not stored)
        else:
            data = data.astype(KINDS[self.kind][2], copy=False)
        if self.kind == "c":
            data = data[..., 0] + 1j * data[..., 1]
        if self.finite and not np.isfinite(data).all():
            row = int(np.argwhere(~np.isfinite(data))[0, 0])
            raise InputError(
                "not_finite", f"{name} is not finite in row {row}", remedy="make it again"
            )
        return data


def _as_array(given: Any) -> Array:
    """What is given as an array; of no kind that a column has, where it is none."""
    try:
        return np.asarray(given)
    except (TypeError, ValueError):  # rows of different lengths, or members that are no numbers
        return np.array(None)


@dataclass(frozen=True)
class Product:
    """One format: columns and attributes by the names of their values.

    `attributes` convert what a file says; `defaults` are those that a file may lack. `groups` are
    of free attributes, each a dictionary, empty where absent; `others` is the name of the
    dictionary of all further attributes of the file, empty for none. An attribute with a version
    `since` is written where it is not its default, and such a file is of that version.
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
        """Write the file whole, or leave what was there; optional columns may be None or absent."""
        there = {
            name: column
            for name, column in self.columns.items()
            if not (column.optional and values.get(name) is None)
        }
        usual = [name for name in self.since if values.get(name) == self.defaults[name]]
        said = [since for name, since in self.since.items() if name not in usual]
        version = max([1, *said, *(column.since for column in there.values())])
        with atomic_h5(path) as file:
            if made:
                made.write(file)
            if self.others:
                write_attributes(file, values[self.others])
            file.attrs.update(schema=self.schema, schema_version=version, creator=CREATOR)
            for name, convert in self.attributes.items():
                if name not in usual and (name in values or name not in self.defaults):
                    write_attributes(file, {name: convert(values[name])})
            for name, column in there.items():
                given = plain_numbers(values[name], name, column.unit)
                data: Array = np.asarray(given).astype(STORED[column.kind], copy=False)
                if column.kind == "c":
                    data = np.stack([data.real, data.imag], axis=-1)
                put(file, column.dataset, data, column.unit)
            for group in self.groups:
                write_attributes(file.require_group(group), values[group])

    def read(
        self, path: str | Path, leave: Container[str] = (), parts: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """All values by name, absent columns None; InputError in one line for anything wrong.

        Columns to `leave` are not read, and are None. Of those in `parts` their indices are read.
        """
        with open_h5(path) as file:
            values: dict[str, Any] = {}
            lengths: dict[int | str, int] = {}
            with named(path):
                self._refuse_others(file)
                folders = {column.dataset.rpartition("/")[0] for column in self.columns.values()}
                for folder in {"", *(folders & {*file})}:
                    _refuse_units(read_attributes(file[folder or "/"]), folder or "the file", "1")
                values |= dict.fromkeys(self.columns)
                there = {
                    name: column
                    for name, column in self.columns.items()
                    if name not in leave and not (column.optional and column.dataset not in file)
                }
                for column in there.values():  # before memory is taken for what they say
                    column.check(column.dataset, _dataset(file, column), lengths)
                for name, column in there.items():
                    values[name] = _numbers(file, column, lengths, (parts or {}).get(name, ()))
                said = read_attributes(file)
                # `file.get` would take a damaged group for an absent one.
                for group in self.groups:
                    values[group] = read_attributes(file[group]) if group in file else {}
            with complete(path):
                for name, convert in self.attributes.items():
                    if name in said or name not in self.defaults:
                        values[name] = convert(said[name])
                    else:
                        values[name] = self.defaults[name]
            if self.others:
                own = (*OF_THE_FORMAT, *self.attributes)
                values[self.others] = {name: note for name, note in said.items() if name not in own}
        return values

    def _refuse_others(self, file: h5py.File) -> None:
        """InputError for a file of another schema or version, and for columns that are not known.

        A column of a later program may change the answer; in version 1 there is none.
        """
        said = read_attributes(file)
        schema, version = (said.get(name) for name in OF_THE_FORMAT[:2])
        if not (isinstance(schema, str) and schema == self.schema):
            problem = f"schema is {schema!r}, expected {self.schema!r}"
            raise InputError("schema", problem, remedy="wrong file?")
        number = number_noted(said, "schema_version")
        if number not in self.versions:
            reads = f"this program reads {' and '.join(map(str, self.versions))}"
            raise InputError(
                "schema_version",
                f"schema_version is {version}, {reads}",
                remedy="convert the file or update the program",
            )
        if number == 1:
            return
        known = {column.dataset for column in self.columns.values()}
        for name, node in walk(file):
            if name not in known and not isinstance(node, h5py.Group):
                raise InputError(
                    "unknown_column",
                    f"{name} is unknown to this program and may change the answer",
                    remedy=("update the program, or leave it out"),
                )


def stored(folder: str, kind: str, *shape: int | str, name: str = "", **more: Any) -> Column:
    """A column in a folder, "" for none, named as its field or by `name`; `more` of `Column`."""
    return Column(f"{folder}/{name}".lstrip("/"), kind, shape, **{"unit": "1"} | more)


def columns_of(table: type) -> dict[str, Column]:
    """The columns that the fields of a class are `stored` as; those with a default are optional."""
    hints, found = get_type_hints(table, include_extras=True), {}
    for one in fields(table):
        for column in getattr(hints[one.name], "__metadata__", ()):
            folder, _, name = column.dataset.rpartition("/")
            dataset = f"{folder}/{name or one.name}".lstrip("/")
            optional = not one.default is one.default_factory is MISSING
            found[one.name] = column._replace(dataset=dataset, optional=optional)
    return found


def product_of(
    schema: str,
    table: type,
    columns: Mapping[str, Column] = MappingProxyType({}),
    attributes: Mapping[str, Callable[[Any], Any]] = MappingProxyType({}),
    **more: Any,
) -> Product:
    """The format of a class: its columns, its texts and numbers as attributes, and further ones.

    `more` as of `Product`. Attributes that a file lacks have the default of their field.
    """
    kinds = get_type_hints(table)
    plain = [one for one in fields(table) if kinds[one.name] in (str, float)]
    every = {one.name: kinds[one.name] for one in plain} | dict(attributes)
    defaults = {one.name: one.default for one in plain if one.default is not MISSING}
    return Product(schema, columns_of(table) | dict(columns), every, defaults, **more)


def _whole_numbers(name: str, given: Array, keep: bool) -> Array:
    """Return whole numbers with the sign and the width that computing needs, 8 bytes.

    Those of 4 bytes or more in the machine's own order may `keep` their width.
    """
    if keep and given.dtype.kind == "i" and given.dtype.itemsize >= 4 and given.dtype.isnative:
        return given
    if given.dtype.kind == "u" and given.max(initial=0) > np.iinfo(np.int64).max:
        row = int(np.argmax(given.reshape(len(given), -1).max(axis=1)))
        raise InputError(
            "whole_number_too_large",
            f"{name} is {given[row]} in row {row}, more than 8 bytes with a sign hold (a negative "
            "number without its sign?)",
            remedy="write it with a sign",
        )
    return given.astype(np.int64, copy=False)


def _dataset(file: h5py.File, column: Column) -> h5py.Dataset:
    """The dataset of a column, unless it is missing or says that it is not SI."""
    node = file.get(column.dataset)
    if not isinstance(node, h5py.Dataset):
        problem = f"dataset {column.dataset} is missing"
        raise InputError("missing_dataset", problem, remedy="write it as documented")
    _refuse_units(read_attributes(node), column.dataset, column.unit)
    return node


def _numbers(file: h5py.File, column: Column, lengths: dict[int | str, int], of: Any) -> Array:
    """The numbers of a column, or a part `of` them; InputError where one stands for none."""
    name, node = column.dataset, _dataset(file, column)
    notes = read_attributes(node)
    data = column.array(name, node, lengths, of)
    for missing in OF_MISSING:
        number = number_noted(notes, missing)
        if number is not None and (data == number).any():
            raise InputError(
                "masked",
                f"{name} has the number {number:g}, which stands for none by its {missing}",
                remedy=("give a number there, or leave the column out"),
            )
    return data


def _refuse_units(notes: Mapping[str, Any], name: str, unit: str) -> None:
    """InputError where the attributes of a dataset say that its numbers are no plain SI."""
    for attribute, said in notes.items():
        if attribute.lower() in OF_UNITS and not says(_text_of(said), unit):
            raise InputError(
                "unit",
                f"{name} is in {_text_of(said)!r}",
                remedy=(
                    "all numbers are SI: convert them to m, kg, s, "
                    f"here {unit}, and say so or nothing"
                ),
            )
    for attribute, usual in OF_PACKED.items():
        if attribute in notes and number_noted(notes, attribute) != usual:
            raise InputError(
                "unit",
                f"{name} is packed by its {attribute}",
                remedy="write the numbers themselves",
            )


def _text_of(said: Any) -> str:
    """What an attribute says, also as a list of one text."""
    return str(said[0] if isinstance(said, list | np.ndarray) and len(said) == 1 else said)
