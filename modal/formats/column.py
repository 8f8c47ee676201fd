"""Define a column of a file: kind, shape and unit of its numbers, and which numbers it takes."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any, Literal, NamedTuple, get_type_hints

import h5py
import numpy as np

from modal.formats.storage import refuse_hidden
from modal.tools.arrays import Array
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers

Kind = Literal["f", "i", "b", "c"]
"""Kind of the numbers of a column: floating-point (f), integer (i), boolean (b), complex (c)."""


class NumberType(NamedTuple):
    """The types in which a kind of number is read and written.

    accepted: kinds of NumPy arrays that are read. description: words for messages. in_memory,
    in_file: NumPy types of the numbers in memory and in a file.
    """

    accepted: str
    description: str
    in_memory: type
    in_file: type


NUMBER_TYPES: Mapping[str, NumberType] = {
    "f": NumberType("fiu", "numbers", np.float64, np.float64),
    "i": NumberType("iu", "whole numbers", np.int64, np.int32),
    "b": NumberType("biu", "yes or no", np.bool_, np.bool_),
    "c": NumberType("fiu", "numbers", np.float64, np.complex128),
}
"""Number types by the kind of a column. Complex numbers are stored as (..., 2), real and imaginary
part."""
MIN_INTEGER_BYTES = 4
"""Bytes of an integer that is kept in memory as in the file: six times a number of contacts must
fit."""


class Column(NamedTuple):
    """A dataset of a format.

    dataset: path of the dataset in the file. kind: kind of the numbers. shape: lengths; a length
    with a name is the same in all columns of a file. unit: SI unit. optional: whether a file may
    lack it. finite: whether all numbers must be finite. since: lowest version of a file that has
    the column; a program of an earlier version refuses such a file.
    """

    dataset: str
    kind: Kind
    shape: tuple[int | str, ...]
    unit: str
    optional: bool = False
    finite: bool = True
    since: int = 1

    def check(self, name: str, data: Any, lengths: dict[int | str, int]) -> None:
        """Raise InputError if an array or a dataset has another kind or shape than this column.

        `lengths` are the lengths with a name that are known so far; new ones are added. No numbers
        are read, so that a dataset may declare any size.
        """
        number_type = NUMBER_TYPES[self.kind]
        if data.dtype.kind not in number_type.accepted:
            problem = f"{name} is no array of {number_type.description}"
            raise InputError("wrong_kind", problem, remedy="write it as documented")
        if isinstance(data, h5py.Dataset):
            refuse_hidden(data, name)
        shape: tuple[int | str, ...] = self.shape
        if self.kind == "c":
            shape = (*shape, 2)
        expected = tuple(lengths.get(length, length) for length in shape)
        if not _shape_fits(data.shape, expected):
            problem = f"{name} has shape {data.shape}, expected {expected}"
            raise InputError("wrong_shape", problem, remedy="mend it")
        lengths.update(zip(shape, data.shape, strict=True))

    def array(
        self, name: str, data: Any, lengths: dict[int | str, int], indices: Any = ()
    ) -> Array:
        """Return a dataset, or an array-like object, as an array of this column.

        `indices` select the part that is read. Lengths with a name must agree with `lengths`; new
        names are added there. Integers of 4 bytes keep their width in memory. Raises InputError if
        the data do not fit the column.
        """
        is_stored = isinstance(data, h5py.Dataset)
        if not is_stored:
            data = _to_array(plain_numbers(data, name, self.unit))
        self.check(name, data, lengths)
        numbers: Array = data[indices]
        if self.kind == "i":
            numbers = _to_integers(name, numbers, keep_width=not is_stored)
        else:
            if self.kind == "b":
                _refuse_other_than_yes_or_no(name, numbers)
            numbers = numbers.astype(NUMBER_TYPES[self.kind].in_memory, copy=False)
        if self.kind == "c":
            numbers = numbers[..., 0] + 1j * numbers[..., 1]
        if self.finite and not np.isfinite(numbers).all():
            row = int(np.argwhere(~np.isfinite(numbers))[0, 0])
            problem = f"{name} is not finite in row {row}"
            raise InputError("not_finite", problem, remedy="make it again")
        return numbers


def _shape_fits(shape: tuple[int, ...], expected: tuple[int | str, ...]) -> bool:
    """Tell whether a shape is as expected.

    An expected length that is a name stands for any length.
    """
    if len(shape) != len(expected):
        return False
    return all(
        isinstance(wanted, str) or wanted == length
        for wanted, length in zip(expected, shape, strict=True)
    )


def _to_array(data: Any) -> Array:
    """Return data as an array; data other than numbers give an array that every column refuses."""
    try:
        return np.asarray(data)
    except (TypeError, ValueError):  # rows of different lengths, or members that are no numbers
        return np.array(None)


def stored(
    folder: str,
    kind: Kind,
    *shape: int | str,
    name: str = "",
    unit: str = "1",
    optional: bool = False,
    finite: bool = True,
    since: int = 1,
) -> Column:
    """Return a column in a `folder` of the file, with the name of its field or this `name`.

    The folder "" is the file's root.

    The other arguments are those of `Column`.
    """
    return Column(f"{folder}/{name}".lstrip("/"), kind, shape, unit, optional, finite, since)


def columns_of(table: type) -> dict[str, Column]:
    """Return the columns of the fields of a class that are `stored`, by the names of the fields.

    A field with a default is optional.
    """
    hints = get_type_hints(table, include_extras=True)
    columns = {}
    for each in fields(table):
        has_default = each.default is not MISSING or each.default_factory is not MISSING
        for column in getattr(hints[each.name], "__metadata__", ()):
            folder, _, name = column.dataset.rpartition("/")
            dataset = f"{folder}/{name or each.name}".lstrip("/")
            columns[each.name] = column._replace(dataset=dataset, optional=has_default)
    return columns


def _to_integers(name: str, data: Array, *, keep_width: bool) -> Array:
    """Return signed integers of 8 bytes, which the computations need.

    With `keep_width` integers of 4 bytes or more, in the byte order of the machine, are returned
    unchanged.
    """
    is_native = data.dtype.itemsize >= MIN_INTEGER_BYTES and data.dtype.isnative
    if keep_width and data.dtype.kind == "i" and is_native:
        return data
    if data.dtype.kind == "u" and data.max(initial=0) > np.iinfo(np.int64).max:
        row = int(np.argmax(data.reshape(len(data), -1).max(axis=1)))
        raise InputError(
            "whole_number_too_large",
            f"{name} is {data[row]} in row {row}, more than 8 bytes with a sign hold (a negative "
            "number without its sign?)",
            remedy="write it with a sign",
        )
    return data.astype(np.int64, copy=False)


def _refuse_other_than_yes_or_no(name: str, data: Array) -> None:
    """Raise InputError for a number that is neither 0 nor 1, the numbers for no and yes."""
    is_other = (data != 0) & (data != 1)
    if is_other.any():
        problem = f"{name} is {data[is_other][0]}, neither 0 nor 1"
        raise InputError("not_yes_or_no", problem, remedy="write 1 for yes and 0 for no")
