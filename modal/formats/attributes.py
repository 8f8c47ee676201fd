"""Attributes of HDF5 files: texts and numbers by name, as notes without a fixed list of names.

Programs in Fortran or C leave texts as bytes, and MATLAB a number as an array of one member. Other
kinds of attribute (references, records, lists of unequal length) are ignored.
"""

import math
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from modal.tools.arrays import Array
from modal.tools.errors import InputError

MAX_NOTE_BYTES = 1 << 20
"""Largest size of an attribute, bytes: a note is a word or a list of numbers, and larger data
should be a dataset."""
MAX_TEXTS = 1000
"""Largest number of texts in one attribute: all of them may point to one long text of a small
file."""
NUMBER_KINDS = "biufc"
"""Kinds of NumPy arrays of numbers that a note may be."""


def number_noted(notes: Mapping[str, Any], name: str) -> float | None:
    """Return the finite number with a name in the notes; None if there is none.

    Notes may have any type: a text, a list, True or a number that is not finite gives None.

    >>> number_noted({"stress": 1e5, "mu_comp": "0.1"}, "stress")
    100000.0
    """
    note = notes.get(name)
    if isinstance(note, np.ndarray) and note.size == 1:
        note = note.item()
    if isinstance(note, bool | np.bool_) or not isinstance(note, int | float | np.number):
        return None
    try:
        number = float(note)
    except (OverflowError, TypeError):  # a whole number of 400 digits, a complex number
        return None
    return number if math.isfinite(number) else None


def read_attributes(node: h5py.Group | h5py.Dataset) -> dict[str, Any]:
    """Return the attributes of a group or dataset by their names, texts as `str`.

    Attributes that are neither text, number nor list are left out. Raises InputError for an
    attribute that is too large.
    """
    notes: dict[str, Any] = {}
    for name in node.attrs:
        note = _read(node, name)
        if note is not None:
            notes[name] = note
    return notes


def _read(node: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Return one attribute; None if it is neither a text, a number nor a list of them."""
    attribute = node.attrs.get_id(name)
    if attribute.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        return None
    try:
        kind = attribute.dtype
    except TypeError:  # a kind of number that NumPy lacks
        return None
    is_text = h5py.check_string_dtype(kind) is not None
    if not (is_text or kind.kind in NUMBER_KINDS):
        return None
    count = math.prod(attribute.shape)
    if count * kind.itemsize > MAX_NOTE_BYTES or (is_text and count > MAX_TEXTS):
        raise _too_large(node, name)
    note = node.attrs[name]
    if isinstance(note, str | bytes) and len(note) > MAX_NOTE_BYTES:
        raise _too_large(node, name)
    return _to_text(note) if is_text else note


def _too_large(node: h5py.Group | h5py.Dataset, name: str) -> InputError:
    """Return the error for an attribute that is too large to be a note."""
    problem = f"attribute {name} of {node.name} is too large for a note"
    return InputError("huge_note", problem, remedy="keep it as a dataset")


def _to_text(note: Any) -> Any:
    """Return a text, or a list of texts, as `str`, from any form in which it is stored."""
    if isinstance(note, np.ndarray):
        return [_to_text(member) for member in note.ravel().tolist()]
    if isinstance(note, bytes):
        return note.decode(errors="replace")
    return str(note)


def write_attributes(node: h5py.Group, notes: Mapping[str, Any]) -> None:
    """Write notes as attributes; notes that are None are left out.

    Raises InputError for a name that is not a text, and for a note that is neither a text nor a
    number nor a list of them.
    """
    for name, note in notes.items():
        label = f"the note {name!r} of {node.name}"
        if not (isinstance(name, str) and name and _is_storable(name)):
            raise InputError("note_name", f"{label}: its name is no text", remedy="give one")
        if note is not None:
            node.attrs[name] = _to_stored(note, label)


def _to_stored(note: Any, label: str) -> Any:
    """Return a note in a form that HDF5 stores; raise InputError, with the label, else."""
    if isinstance(note, bytes):
        note = note.decode(errors="replace")
    if isinstance(note, str):
        if _is_storable(note):
            return note
        raise InputError("note", f"{label} has a NUL or half a character", remedy="mend the text")
    try:
        data: Array = np.asarray(note)
    except (TypeError, ValueError):  # rows of unequal length
        data = np.array(None)
    is_text = data.dtype.kind == "U"
    if is_text:
        # NumPy's own texts drop a NUL at their end.
        members = np.asarray(note, object).ravel().tolist()
        is_text = all(_is_storable(str(member)) for member in members)
    if not (is_text or data.dtype.kind in NUMBER_KINDS):
        problem = f"{label} is a {type(note).__name__}"
        raise InputError("note", problem, remedy="give a text, numbers or a list of them")
    if data.nbytes > MAX_NOTE_BYTES or (is_text and data.size > MAX_TEXTS):
        problem = f"{label} is too large"
        raise InputError("huge_note", problem, remedy="keep it in a file of its own")
    return data.astype(h5py.string_dtype()) if is_text else note


def _is_storable(text: str) -> bool:
    """Tell whether HDF5 can store the text: valid UTF-8 without NUL, which would end the text."""
    try:
        return "\0" not in text and len(text.encode()) <= MAX_NOTE_BYTES
    except UnicodeEncodeError:
        return False
