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

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from modal.formats.hdf5 import complete, get, open_h5, put
from modal.formats.provenance import Provenance, new_product
from modal.tools.arrays import Array
from modal.tools.errors import InputError

CREATOR = "granular-wave-modes"
OF_THE_FORMAT = ("schema", "schema_version", "creator")
"""Attributes that each product has, and that are none of its own."""
STORED = {"f": np.float64, "i": np.int32, "b": np.bool_, "c": np.complex128}
"""Kinds of numbers; complex ones are stored as (..., 2), real and imaginary part."""


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
        with new_product(path, self.schema, version, made) as file:
            file.attrs["creator"] = CREATOR
            file.attrs.update(values[self.others] if self.others else {})
            for name, convert in self.attributes.items():
                if name not in usual and (name in values or name not in self.defaults):
                    file.attrs[name] = convert(values[name])
            for name, column in there.items():
                data: Array = np.asarray(values[name]).astype(STORED[column.kind], copy=False)
                if column.kind == "c":
                    data = np.stack([data.real, data.imag], axis=-1)
                put(file, column.dataset, data, column.unit)
            for group in self.groups:
                file.require_group(group).attrs.update(values[group])

    def read(
        self,
        path: str | Path,
        leave: Container[str] = (),
        parts: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """All values by name, absent columns None; InputError in one line for anything wrong.

        Columns to `leave` are not read, and are None. Of those in `parts` their indices are read.
        """
        with open_h5(path, self.schema, self.versions) as file:
            self._refuse_unknown(file)
            values: dict[str, Any] = {}
            lengths: dict[int | str, int] = {}
            for name, column in self.columns.items():
                absent = column.optional and column.dataset not in file
                left = absent or name in leave
                values[name] = (
                    None if left else _column(file, column, lengths, (parts or {}).get(name, ()))
                )
            with complete(path):
                for name, convert in self.attributes.items():
                    if name in file.attrs or name not in self.defaults:
                        values[name] = convert(file.attrs[name])
                    else:
                        values[name] = self.defaults[name]
                # `file.get` would take a damaged group for an absent one.
                for group in self.groups:
                    values[group] = dict(file[group].attrs) if group in file else {}
            if self.others:
                own = (*OF_THE_FORMAT, *self.attributes)
                further = {name: said for name, said in file.attrs.items() if name not in own}
                values[self.others] = further
        return values

    def _refuse_unknown(self, file: h5py.File) -> None:
        """A column of a later program may change the answer; in version 1 there is none."""
        if file.attrs["schema_version"] == 1:
            return
        known = {column.dataset for column in self.columns.values()}
        for folder in {name.rpartition("/")[0] for name in known}:
            for name in sorted(file.get(folder, ()) if folder else file):
                full = f"{folder}/{name}" if folder else name
                if full not in known and isinstance(file[full], h5py.Dataset):
                    raise InputError(
                        f"{file.filename}: {full} is unknown to this program and may change the "
                        "answer; update the program, or leave it out"
                    )


def _column(file: h5py.File, column: Column, lengths: dict[int | str, int], of: Any) -> Array:
    """A column as numbers, or a part `of` it; its named lengths are those in `lengths`, or new."""
    shape = tuple(n if isinstance(n, int) else lengths.get(n) for n in column.shape)
    if column.kind == "c":
        parts = get(file, column.dataset, "f", (*shape, 2))
        data: Array = parts[..., 0] + 1j * parts[..., 1]
    else:
        data = get(file, column.dataset, column.kind, shape, of=of)
    lengths.update(zip(column.shape, file[column.dataset].shape, strict=False))
    if column.finite and not np.isfinite(data).all():
        raise InputError(f"{file.filename}: {column.dataset} is not finite; make it again")
    return data
