"""Attributes of HDF5 files: texts and numbers by name, and notes that nobody has fixed.

A program that writes Fortran or C leaves texts as bytes, and MATLAB a number as an array of one;
other kinds of attribute (references, records, lists of unequal length) are no notes, and are left
alone.
"""

import math
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np

from modal.tools.arrays import Array
from modal.tools.errors import InputError

MAX_NOTE_BYTES = 1 << 20
"""Of one attribute: a note is a word or a list of numbers; what is larger is a dataset."""
MAX_TEXTS = 1000
"""In one attribute: all of them may point to the one long text of a small file."""
NUMBERS = "biufc"
"""Kinds of NumPy array that a note may be."""


def number_noted(notes: Mapping[str, Any], name: str) -> float | None:
    """Return the finite number that the notes give under a name; None where they give none.

    A text, a list, True or a number that is not finite is no number, as free notes may be anything.

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
    """Return what the attributes of a group or dataset say, texts as `str`, by their names.

    Those of kinds that are no notes are left out; InputError for one that is too large.
    """
    found = dict[str, Any]()
    for name in node.attrs:
        note = _read(node, name)
        if note is not None:
            found[name] = note
    return found


def _read(node: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Return one attribute; None where it is of a kind that is no note."""
    attribute = node.attrs.get_id(name)
    if attribute.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        return None
    try:
        kind = attribute.dtype
    except TypeError:  # a kind of number that NumPy lacks
        return None
    texts = h5py.check_string_dtype(kind) is not None
    if not (texts or kind.kind in NUMBERS):
        return None
    count = math.prod(attribute.shape)
    huge = count * kind.itemsize > MAX_NOTE_BYTES or (texts and count > MAX_TEXTS)
    note = None if huge else node.attrs[name]
    if huge or (isinstance(note, str | bytes) and len(note) > MAX_NOTE_BYTES):
        raise InputError(
            "huge_note",
            f"attribute {name} of {node.name} is too large for a note",
            remedy="keep it as a dataset",
        )
    return _texts(note) if texts else note


def _texts(note: Any) -> Any:
    """Return a text, or a list of them, as `str`, whatever it is stored as."""
    if isinstance(note, np.ndarray):
        return [_texts(each) for each in note.ravel().tolist()]
    return note.decode(errors="replace") if isinstance(note, bytes) else str(note)


def write_attributes(node: h5py.Group, notes: Mapping[str, Any]) -> None:
    """Write notes as attributes; None, which says nothing, is left out.

    InputError for a name that is no text, and for a note that is none of texts, numbers and lists
    of them.
    """
    for name, note in notes.items():
        what = f"the note {name!r} of {node.name}"
        if not (isinstance(name, str) and name and _storable(name)):
            raise InputError("note_name", f"{what}: its name is no text", remedy="give one")
        if note is not None:
            node.attrs[name] = _as_stored(note, what)


def _as_stored(note: Any, what: str) -> Any:
    """Return a note as HDF5 takes it; InputError where it cannot."""
    if isinstance(note, bytes):
        note = note.decode(errors="replace")
    if isinstance(note, str):
        if _storable(note):
            return note
        raise InputError("note", f"{what} has a NUL or half a character", remedy="mend the text")
    try:
        data: Array = np.asarray(note)
    except (TypeError, ValueError):  # rows of unequal length
        data = np.array(None)
    # NumPy's own texts drop a NUL at their end.
    members = np.asarray(note, object).ravel().tolist() if data.dtype.kind == "U" else []
    texts = data.dtype.kind == "U" and all(_storable(str(each)) for each in members)
    if not (texts or data.dtype.kind in NUMBERS):
        kind = type(note).__name__
        raise InputError(
            "note", f"{what} is a {kind}", remedy="give a text, numbers or a list of them"
        )
    if data.nbytes > MAX_NOTE_BYTES or (texts and data.size > MAX_TEXTS):
        raise InputError("huge_note", f"{what} is too large", remedy="keep it in a file of its own")
    return data.astype(h5py.string_dtype()) if texts else note


def _storable(text: str) -> bool:
    """Return whether HDF5 can store the text: as UTF-8, which ends at the first NUL."""
    try:
        return "\0" not in text and len(text.encode()) <= MAX_NOTE_BYTES
    except UnicodeEncodeError:
        return False
